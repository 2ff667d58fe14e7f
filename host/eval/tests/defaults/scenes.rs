//! The scenes of the table, how each is measured, and what judges it.

use nirspi::example::Example;
use nirspi::scene::SceneSource;
use nirspi_eval::completion::Scene;
use nirspi_recon::reconstruct::{Method, MethodSettings};
use nirspi_recon::{Image, Measurements, Rows, Side, fwht, metrics};
use std::fmt;
use std::io::Write as _;
use std::path::{Path, PathBuf};

const SIDE: usize = 32;
/// Edge of the drawings, of which a pixel of the image is the mean of 8 x 8.
const DRAWN_PX: usize = 256;

/// What a figure is.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// Peak signal to noise, in dB.
    Psnr,
    Correlation,
}

impl Unit {
    /// The most that another method may be better than the default.
    pub fn most_lost(self) -> f64 {
        match self {
            Self::Psnr => 1.0,
            Self::Correlation => 0.01,
        }
    }

    /// The difference that other processors' rounding, and the two digits of the table, may make.
    pub fn rounding(self) -> f64 {
        match self {
            Self::Psnr => 0.2,
            Self::Correlation => 0.002,
        }
    }

    pub fn written(self, figure: f64) -> String {
        match self {
            Self::Psnr => format!("{figure:.1}"),
            Self::Correlation => format!("{figure:.3}"),
        }
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Psnr => "PSNR",
            Self::Correlation => "correlation",
        })
    }
}

/// Scenes whose figures have one mean.
pub struct Kind {
    pub name: String,
    pub unit: Unit,
    pub scenes: Vec<Measured>,
}

impl Kind {
    fn new(name: &str, unit: Unit, scenes: Vec<Measured>) -> Self {
        Self { name: name.to_owned(), unit, scenes }
    }

    /// Whether this share leaves something to judge by.
    pub fn judges(&self, share: f64) -> bool {
        share < 1.0 || !matches!(self.scenes[0].judge, Judge::LeftOut(_))
    }
}

/// All patterns of one scene.
pub struct Measured {
    pub measured: Measurements,
    pub judge: Judge,
}

/// What an image is compared with.
pub enum Judge {
    /// The scene's pixels, 1 is white.
    Truth(Vec<f32>),
    /// The image of all patterns of another exposure.
    OtherExposure(Image),
    /// All readings, of which those count that the methods were not given.
    LeftOut(Measurements),
}

impl Judge {
    /// The figure of an image from `given`.
    pub fn figure(&self, image: &Image, given: &Measurements) -> f64 {
        let n = image.side().pixels();
        match self {
            Self::Truth(truth) => metrics::psnr(truth, image.pixels(), n, n, 1.0).unwrap(),
            Self::OtherExposure(other) => {
                metrics::correlation(other.pixels(), image.pixels(), n, n).unwrap()
            }
            Self::LeftOut(all) => left_out_psnr(all, image, given),
        }
    }
}

/// PSNR in dB that the image would have if the given rows had no error.
fn left_out_psnr(all: &Measurements, image: &Image, given: &Measurements) -> f64 {
    let area = image.side().area() as f64;
    let mut predicted: Vec<f64> = image.pixels().iter().map(|&v| v.into()).collect();
    fwht(&mut predicted).unwrap();
    let readings = all.rows().iter().zip(all.values());
    let missed = readings.filter(|(row, _)| !given.rows().contains(row));
    let squares: f64 = missed.map(|(&row, value)| (value - predicted[row as usize]).powi(2)).sum();
    let full = full_image(all);
    let least = full.pixels().iter().copied().fold(f32::MAX, f32::min);
    let most = full.pixels().iter().copied().fold(f32::MIN, f32::max);
    // Parseval: the squares of all rows are `area` times those of the pixels.
    20.0 * (f64::from(most - least) * area).log10() - 10.0 * squares.log10()
}

fn full_image(all: &Measurements) -> Image {
    let transform = Method::HADAMARD.prepare(&MethodSettings::default()).unwrap();
    transform.reconstruct(all).unwrap().image
}

/// Every kind; those that need data of others are left out, with a line, where this machine has none.
pub fn all() -> Vec<Kind> {
    let mut kinds = vec![
        sources("letters", &["letter:R", "letter:a", "letter:8"]),
        sources("words", &["word:STOP", "word:IR", "word:Nacht"]),
        Kind::new("leaf", Unit::Psnr, vec![drawing(leaf)]),
        Kind::new("star", Unit::Psnr, vec![drawing(star)]),
        Kind::new("hills", Unit::Psnr, vec![drawing(hills)]),
        Kind::new("points", Unit::Psnr, vec![drawing(points)]),
        Kind::new("drawn wing, virtual camera", Unit::Correlation, vec![drawn_wing()]),
        Kind::new("no light", Unit::Psnr, (0..3).map(no_light).collect()),
    ];
    match std::env::var_os("NIRSPI_DATA").map(PathBuf::from).filter(|data| data.is_dir()) {
        Some(data) => kinds.extend(of_others(&data)),
        // Past libtest, which keeps what a passing test prints to itself.
        None => {
            let _ = writeln!(
                std::io::stderr(),
                "skipped: no data (NIRSPI_DATA): recordings and natural scenes"
            );
        }
    }
    kinds
}

fn of_others(data: &Path) -> Vec<Kind> {
    let natural = |noise| natural(data, noise);
    vec![
        Kind::new("natural scenes", Unit::Psnr, natural(NOISE)),
        Kind::new("natural scenes, 5 % noise", Unit::Psnr, natural(0.05)),
        Kind::new("photon counts", Unit::Correlation, photon_counts(data)),
        Kind::new("car", Unit::Psnr, car(data)),
        Kind::new("insect's wing", Unit::Psnr, insect_wing(data)),
    ]
}

/// A scene of known pixels, with white noise that the measurement states, as a camera's does. 1 is white.
fn simulated(pixels: Vec<f32>, noise: f64, seed: u64) -> Measured {
    let side = Side::new(SIDE as u64).unwrap();
    let scene = Scene { name: String::new(), side, pixels };
    let measured = scene.measured(noise, seed).unwrap();
    let measured = measured.with_noise(noise * SIDE as f64).unwrap();
    Measured { measured, judge: Judge::Truth(scene.pixels) }
}

const NOISE: f64 = 0.01;

/// The means of squares of a drawing.
fn shrunk(drawn: &[f32]) -> Vec<f32> {
    let step = DRAWN_PX / SIDE;
    let mean = |p: usize| {
        let (top, left) = (p / SIDE * step, p % SIDE * step);
        let rows = (top..top + step).flat_map(|y| &drawn[y * DRAWN_PX + left..][..step]);
        rows.sum::<f32>() / (step * step) as f32
    };
    (0..SIDE * SIDE).map(mean).collect()
}

fn sources(name: &str, words: &[&str]) -> Kind {
    let scene = |(seed, word): (usize, &&str)| {
        let map = word.parse::<SceneSource>().unwrap().load(DRAWN_PX).unwrap();
        simulated(shrunk(&map.reflectance), NOISE, seed as u64)
    };
    Kind::new(name, Unit::Psnr, words.iter().enumerate().map(scene).collect())
}

/// A drawing by its brightness at `x` and `y` from -1 to 1.
fn drawing(of: fn(f64, f64) -> f64) -> Measured {
    let at = |p: usize| 2.0 * p as f64 / (DRAWN_PX - 1) as f64 - 1.0;
    let drawn = (0..DRAWN_PX * DRAWN_PX).map(|p| of(at(p % DRAWN_PX), at(p / DRAWN_PX)) as f32);
    simulated(shrunk(&drawn.collect::<Vec<_>>()), NOISE, 1)
}

/// A leaf with veins, as in the notebook of orders.
fn leaf(x: f64, y: f64) -> f64 {
    let (along, across) = ((x - y) / 1.7, (x + y) / 1.5);
    let clipped = along.clamp(-1.0, 1.0);
    let width = 0.6 * (std::f64::consts::FRAC_PI_2 * clipped).cos() * (1.0 - 0.4 * along);
    let vein = across.abs() < 0.04 || (3.5 * (along - 0.8 * across.abs())).rem_euclid(1.0) < 0.22;
    match across.abs() < width - 0.01 {
        true if vein => 0.9,
        true => 0.45,
        false => 0.05,
    }
}

/// Nine bright spokes.
fn star(x: f64, y: f64) -> f64 {
    if x.hypot(y) < 0.9 && (9.0 * y.atan2(x)).sin() > 0.0 { 0.9 } else { 0.1 }
}

/// Nine bright points of one or two pixels on black.
fn points(x: f64, y: f64) -> f64 {
    const POINTS: [(f64, f64); 9] = [
        (-0.81, -0.70),
        (-0.42, 0.13),
        (-0.10, -0.35),
        (0.05, 0.62),
        (0.21, -0.88),
        (0.47, 0.33),
        (0.58, -0.21),
        (0.83, 0.79),
        (-0.66, 0.71),
    ];
    let lit = POINTS.into_iter().any(|(a, b)| (x - a).hypot(y - b) < 0.045);
    if lit { 0.9 } else { 0.0 }
}

/// Smooth hills without an edge.
fn hills(x: f64, y: f64) -> f64 {
    const HILLS: [(f64, f64, f64); 6] = [
        (-0.6, -0.5, 0.3),
        (0.2, -0.7, 0.12),
        (0.6, -0.1, 0.2),
        (-0.2, 0.1, 0.08),
        (-0.7, 0.6, 0.15),
        (0.4, 0.6, 0.25),
    ];
    let hill =
        |(a, b, s): (f64, f64, f64)| (-((x - a).powi(2) + (y - b).powi(2)) / (2.0 * s * s)).exp();
    0.1 + 0.8 * HILLS.into_iter().map(hill).sum::<f64>().min(1.0)
}

/// The example of the program, judged by a second simulated exposure.
fn drawn_wing() -> Measured {
    let other = full_image(&Example::Wing.measure(2).unwrap());
    let measured = Example::Wing.measure(1).unwrap();
    Measured { measured, judge: Judge::OtherExposure(other) }
}

/// Noise alone.
fn no_light(seed: u64) -> Measured {
    simulated(vec![0.0; SIDE * SIDE], 0.05, seed)
}

fn array<T: npyz::Deserialize>(file: &Path, name: &str) -> Vec<T> {
    let open = std::fs::File::open(file).unwrap();
    let mut archive = zip::ZipArchive::new(std::io::BufReader::new(open)).unwrap();
    let member = archive.by_name(&format!("{name}.npy")).unwrap();
    npyz::NpyFile::new(member).unwrap().into_vec().unwrap()
}

/// The middle of natural scenes. Training has every scene but those whose number ends in 4.
fn natural(data: &Path, noise: f64) -> Vec<Measured> {
    let file = data.join("natural/bsds_train.npz");
    let open = std::fs::File::open(&file).unwrap();
    let mut archive = zip::ZipArchive::new(std::io::BufReader::new(open)).unwrap();
    let member = npyz::NpyFile::new(archive.by_name("x.npy").unwrap()).unwrap();
    let (height, width) = (member.shape()[1] as usize, member.shape()[2] as usize);
    let levels: Vec<u8> = member.into_vec().unwrap();
    let side = Side::new(SIDE as u64).unwrap();
    let unseen = levels.chunks_exact(height * width).enumerate().filter(|(k, _)| k % 10 == 4);
    let measured = |(k, levels): (usize, &[u8])| {
        let scene = Scene::centre_of("natural", levels, height, side);
        simulated(scene.pixels, noise, k as u64)
    };
    unseen.step_by(3).take(6).map(measured).collect()
}

/// Two exposures of one scene, each judged by the other.
fn photon_counts(data: &Path) -> Vec<Measured> {
    let rows = Rows::natural(Side::new(SIDE as u64).unwrap());
    let [short, long] = ["photon_40ms.npy", "photon_80ms.npy"].map(|name| {
        let bytes = std::fs::read(data.join("spi").join(name)).unwrap();
        let counts: Vec<f64> = npyz::NpyFile::new(&bytes[..]).unwrap().into_vec().unwrap();
        Measurements::from_pairs(&rows, &counts).unwrap().measurements
    });
    let (by_long, by_short) = (full_image(&long), full_image(&short));
    vec![
        Measured { measured: short, judge: Judge::OtherExposure(by_long) },
        Measured { measured: long, judge: Judge::OtherExposure(by_short) },
    ]
}

/// Differences of four of the 33 sizes of the detector.
fn car(data: &Path) -> Vec<Measured> {
    let file = data.join("spi/scheidt_car.npz");
    let rows = Rows::new(Side::new(SIDE as u64).unwrap(), array::<i32>(&file, "h_row")).unwrap();
    let d: Vec<f64> = array::<i32>(&file, "d").into_iter().map(f64::from).collect();
    let of_size = |d: &[f64]| {
        let measured = Measurements::from_differential(&rows, d).unwrap();
        Measured { judge: Judge::LeftOut(measured.clone()), measured }
    };
    d.chunks_exact(SIDE * SIDE).step_by(10).map(of_size).collect()
}

/// 64 x 64 pixels.
fn insect_wing(data: &Path) -> Vec<Measured> {
    let file = data.join("spi/opar_ala1.npz");
    let rows = Rows::new(Side::new(64).unwrap(), array::<i32>(&file, "h_row")).unwrap();
    let y: Vec<f64> = array::<f32>(&file, "y").into_iter().map(f64::from).collect();
    let measured = Measurements::from_pairs(&rows, &y).unwrap().measurements;
    vec![Measured { judge: Judge::LeftOut(measured.clone()), measured }]
}
