//! Shared test support: scenes, simulated readings, real data.

use crate::{Image, Measurements, Rows, Shape, Side, fwht};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::io::Read as _;
use std::path::PathBuf;

pub(crate) fn side(n: u64) -> Side {
    Side::new(n).unwrap()
}

/// The scene of this kind: 0 random, 1 blobs and an edge, 2 a letter-like figure, 3 a point, 4
/// flat.
pub(crate) fn scene(side: Side, kind: u8) -> Vec<f64> {
    let n = side.pixels();
    let mut random = Pcg64::seed_from_u64(7);
    (0..side.area())
        .map(|p| {
            let (r, c) = ((p / n) as f64 / n as f64, (p % n) as f64 / n as f64);
            match kind {
                0 => random.random::<f64>(),
                1 => {
                    let blob = (-((r - 0.3).powi(2) + (c - 0.6).powi(2)) / 0.02).exp();
                    0.1 + blob + if c + 0.5 * r < 0.45 { 0.4 } else { 0.0 }
                }
                2 => {
                    let stem = (0.2..0.8).contains(&r) && (0.3..0.42).contains(&c);
                    let bar = (0.2..0.32).contains(&r) && (0.3..0.75).contains(&c);
                    0.05 + if stem || bar { 0.9 } else { 0.0 }
                }
                3 => f64::from(p == side.area() / 3),
                _ => 0.5,
            }
        })
        .collect()
}

/// The letter-like figure, moved by whole pixels.
pub(crate) fn figure(side: Side, down: i64, right: i64) -> Vec<f64> {
    let n = side.pixels() as i64;
    let image = scene(side, 2);
    let at = |r: i64, c: i64| image[(r.clamp(0, n - 1) * n + c.clamp(0, n - 1)) as usize];
    (0..n * n).map(|p| at(p / n - down, p % n - right)).collect()
}

/// Measurements of a scene by some rows, each with normal noise of this deviation.
pub(crate) fn noisy(rows: &Rows, scene: &[f64], sigma: f64, seed: u64) -> Measurements {
    let mut d = scene.to_vec();
    fwht(&mut d).unwrap();
    let mut random = Pcg64::seed_from_u64(seed);
    let values: Vec<f64> =
        rows.iter().map(|&row| d[row as usize] + sigma * normal(&mut random)).collect();
    Measurements::from_differential(rows, &values).unwrap()
}

/// Readings of a perfect detector: pattern, complement, pattern, ...
pub(crate) fn readings(side: Side, rows: &[u32], scene: &[f64]) -> Vec<f64> {
    let total: f64 = scene.iter().sum();
    let mut d = scene.to_vec();
    assert_eq!(d.len(), side.area());
    fwht(&mut d).unwrap();
    rows.iter()
        .flat_map(|&r| [(total + d[r as usize]) / 2.0, (total - d[r as usize]) / 2.0])
        .collect()
}

/// All of a scene's measurements, in natural order.
pub(crate) fn measured(side: Side, scene: &[f64]) -> Measurements {
    let mut d = scene.to_vec();
    fwht(&mut d).unwrap();
    Measurements::from_differential(&Rows::natural(side), &d).unwrap()
}

#[derive(Debug, Clone, Copy)]
pub(crate) enum Noise {
    /// Normal noise, in units of the brightest reading.
    Normal { sigma: f64, seed: u64 },
    /// Photon noise, with this many photons in the brightest reading.
    Poisson { photons: f64, seed: u64 },
}

impl Noise {
    /// Reading `index` with this mean, with its noise.
    pub(crate) fn of(self, mean: f64, index: u64) -> f64 {
        match self {
            Self::Normal { sigma, seed } => mean + sigma * normal(&mut stream(seed, index)),
            Self::Poisson { photons, seed } => {
                let mut random = stream(seed, index);
                let (mut product, mut count) = (1.0, -1.0);
                let limit = (-photons * mean).exp();
                while product >= limit {
                    product *= random.random::<f64>();
                    count += 1.0;
                }
                count
            }
        }
    }
}

fn stream(seed: u64, index: u64) -> Pcg64 {
    Pcg64::new(u128::from(seed) << 64 | u128::from(index), 1)
}

/// A random number of the standard normal distribution (Box and Muller).
pub(crate) fn normal(random: &mut Pcg64) -> f64 {
    let (u, v): (f64, f64) = (1.0 - random.random::<f64>(), random.random());
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

pub(crate) fn correlation_of(a: &Image<impl Shape>, b: &Image<impl Shape>) -> f64 {
    let size = a.size();
    assert_eq!(b.size(), size);
    crate::metrics::correlation(a.pixels(), b.pixels(), size.width(), size.height()).unwrap()
}

/// An open `.npz` file.
pub(crate) type Npz = zip::ZipArchive<std::io::BufReader<std::fs::File>>;

/// A file of real measurements, or `None`, with a printed message, if this machine has no data.
pub(crate) fn real_data(name: &str) -> Option<Npz> {
    let folder = std::env::var_os("NIRSPI_DATA").map(PathBuf::from);
    let file = folder.map(|folder| std::fs::File::open(folder.join("spi").join(name)));
    let Some(Ok(file)) = file else {
        // Prints past the test harness's capture, so that a skipped test is visible.
        use std::io::Write;
        let _ = writeln!(std::io::stderr(), "skipped: no data (spi/{name} in NIRSPI_DATA)");
        return None;
    };
    Some(Npz::new(std::io::BufReader::new(file)).unwrap())
}

/// One array of such a file, row-major.
pub(crate) fn array<T: Number>(archive: &mut Npz, name: &str) -> Vec<T> {
    let mut bytes = Vec::new();
    archive.by_name(&format!("{name}.npy")).unwrap().read_to_end(&mut bytes).unwrap();
    numbers(&bytes)
}

/// A number of eight bytes or fewer, as NumPy writes it.
pub(crate) trait Number {
    /// Its NumPy type.
    const TYPE: &str;
    /// From its bytes, of which there are as many as the type says.
    fn from_bytes(bytes: &[u8]) -> Self;
}

macro_rules! number {
    ($($of:ty, $name:literal;)*) => {$(
        impl Number for $of {
            const TYPE: &str = $name;
            fn from_bytes(bytes: &[u8]) -> Self {
                Self::from_le_bytes(bytes.try_into().unwrap())
            }
        }
    )*};
}

number! { f32, "<f4"; f64, "<f8"; i32, "<i4"; }

/// The numbers of a NumPy file, version 1 of the format, row-major. The readers of nirspi-files
/// stand on this crate.
pub(crate) fn numbers<T: Number>(npy: &[u8]) -> Vec<T> {
    let start = 10 + usize::from(u16::from_le_bytes([npy[8], npy[9]]));
    let header = str::from_utf8(&npy[10..start]).unwrap();
    assert!(header.contains(&format!("'descr': '{}', 'fortran_order': False", T::TYPE)));
    npy[start..].chunks_exact(size_of::<T>()).map(T::from_bytes).collect()
}
