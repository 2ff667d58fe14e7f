//! Studies partial sampling: images of part of a sweep by zero filling, by Algorithm 1 as printed,
//! and by the default settings. Prints the three tables of the documentation of
//! `nirspi_recon::reconstruct`.
//!
//! `cargo run --release -p nirspi-recon --example sampling_study -- path/to/data`
//!
//! The folder must have `spi/opar_ala1.npz`, `spi/scheidt_car.npz`, `chars74k/*_train.npz` and
//! `scenes/*.png`. Numbers are Pearson correlations with the image of the full sweep.

use nirspi_recon::reconstruct::{OmpSettings, hadamard, omp};
use nirspi_recon::{Basis, Image, Measurements, NamedOrder, Order, Rows, Side, metrics};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

struct Scene {
    name: &'static str,
    all: Measurements,
}

fn main() -> Result<()> {
    let given = std::env::args_os().nth(1).or_else(|| std::env::var_os("NIRSPI_DATA"));
    let data = PathBuf::from(given.ok_or("which folder of data? docs/data.md says what is in it")?);
    let scenes = [
        wing(&data)?,
        car(&data, 0)?,
        letter(&data, 64)?,
        letter(&data, 32)?,
        picture(&data, "page_photo.png", "page", 64)?,
        picture(&data, "sign_no_parking.png", "sign", 128)?,
        picture(&data, "siemens_star_chart.png", "star", 64)?,
    ];
    println!("| scene | rows | zero filling | DCT as printed, k = 100 | DCT | Haar |");
    println!("|---|---|---|---|---|---|");
    for scene in &scenes {
        for (order, share) in [
            (Order::ZigZag, 0.05),
            (Order::ZigZag, 0.3),
            (Order::CakeCutting, 0.1),
            (Order::CakeCutting, 0.3),
            (Order::Random(1), 0.3),
        ] {
            completion(scene, &order, share)?;
        }
    }
    println!();
    print!("| scene |");
    let orders = Order::NAMED;
    orders.iter().for_each(|named| print!(" {} |", named.name));
    println!("\n|---|{}", "---|".repeat(orders.len()));
    for share in [0.05, 0.1, 0.2, 0.3] {
        let mut sums = vec![(0.0, 0.0); orders.len()];
        for scene in &scenes {
            print!("| {} {:.0} % |", scene.name, 100.0 * share);
            for (NamedOrder { order, .. }, sums) in orders.iter().zip(&mut sums) {
                let part = scene.all.take(Some(order), share)?;
                let full = hadamard(&scene.all);
                let found = omp(&part, &OmpSettings::default())?;
                let zero = correlation(&hadamard(&part), &full)?;
                let found = correlation(&found.image, &full)?;
                print!(" {zero:.3}, {found:.3} |");
                (sums.0, sums.1) = (sums.0 + zero, sums.1 + found);
            }
            println!();
        }
        print!("| *mean {:.0} %* |", 100.0 * share);
        let count = scenes.len() as f64;
        sums.iter()
            .for_each(|(zero, found)| print!(" {:.3}, {:.3} |", zero / count, found / count));
        println!();
    }
    gains(&data)
}

/// Number of letters of a set to compare, evenly spaced in the set.
const LETTERS: usize = 24;
const LETTERS_APART: usize = 71;

/// Gain of the default settings over zero filling on many letters: mean and worst.
fn gains(data: &Path) -> Result<()> {
    println!(
        "\n| {LETTERS} letters, 32 x 32 | rows | DCT mean, worst | Haar mean, worst |\n|---|---|---|---|"
    );
    for set in ["fnt", "hnd", "img"] {
        let x: Vec<u8> = array(&data.join(format!("chars74k/{set}_train.npz")), "x")?;
        let letters: Vec<Scene> = x
            .chunks_exact(64 * 64)
            .step_by(LETTERS_APART)
            .take(LETTERS)
            .map(|letter| simulated("", 32, 64, letter))
            .collect::<Result<_>>()?;
        for (order, share) in [
            (Order::ZigZag, 0.05),
            (Order::ZigZag, 0.3),
            (Order::CakeCutting, 0.1),
            (Order::Random(5), 0.3),
        ] {
            print!("| {set} | {:.0} % {order} |", 100.0 * share);
            for basis in [Basis::Dct, Basis::Haar] {
                let (mut sum, mut worst) = (0.0, f64::INFINITY);
                for Scene { all, .. } in &letters {
                    let (part, full) = (all.take(Some(&order), share)?, hadamard(all));
                    let found = omp(&part, &OmpSettings { basis, ..OmpSettings::default() })?;
                    let zero = correlation(&hadamard(&part), &full)?;
                    let gain = correlation(&found.image, &full)? - zero;
                    (sum, worst) = (sum + gain, f64::min(worst, gain));
                }
                print!(" {:+.3}, {worst:+.3} |", sum / LETTERS as f64);
            }
            println!();
        }
    }
    Ok(())
}

fn completion(scene: &Scene, order: &Order, share: f64) -> Result<()> {
    let part = scene.all.take(Some(order), share)?;
    let full = hadamard(&scene.all);
    print!(
        "| {} | {:.0} % {order} | {:.3} |",
        scene.name,
        100.0 * share,
        correlation(&hadamard(&part), &full)?
    );
    let printed = omp(&part, &OmpSettings::as_printed(Basis::Dct, 100))?;
    print!(" {:.3} |", correlation(&printed.image, &full)?);
    for basis in [Basis::Dct, Basis::Haar] {
        let start = Instant::now();
        let found = omp(&part, &OmpSettings { basis, ..OmpSettings::default() })?;
        let milliseconds = 1e3 * start.elapsed().as_secs_f64();
        let correlation = correlation(&found.image, &full)?;
        print!(
            " {correlation:.3} (k = {}, trust {:.2}, {milliseconds:.0} ms) |",
            found.sparsity, found.trust
        );
    }
    println!();
    Ok(())
}

fn correlation(a: &Image, b: &Image) -> Result<f64> {
    let n = a.side().pixels();
    Ok(metrics::correlation(a.pixels(), b.pixels(), n, n)?)
}

fn array<T: npyz::Deserialize>(path: &Path, name: &str) -> Result<Vec<T>> {
    let file = std::io::BufReader::new(std::fs::File::open(path)?);
    let mut archive = zip::ZipArchive::new(file)?;
    Ok(npyz::NpyFile::new(archive.by_name(&format!("{name}.npy"))?)?.into_vec()?)
}

fn wing(data: &Path) -> Result<Scene> {
    let path = data.join("spi/opar_ala1.npz");
    let rows = Rows::new(Side::new(64)?, array::<i32>(&path, "h_row")?)?;
    let y: Vec<f64> = array::<f32>(&path, "y")?.into_iter().map(f64::from).collect();
    Ok(Scene { name: "wing (real, 64)", all: Measurements::from_pairs(&rows, &y)?.measurements })
}

fn car(data: &Path, detector: usize) -> Result<Scene> {
    let path = data.join("spi/scheidt_car.npz");
    let rows = Rows::new(Side::new(32)?, array::<i32>(&path, "h_row")?)?;
    let d: Vec<f64> = array::<i32>(&path, "d")?.into_iter().map(f64::from).collect();
    let d = d.chunks_exact(rows.len()).nth(detector).ok_or("no such detector")?;
    Ok(Scene { name: "car (real, 32)", all: Measurements::from_differential(&rows, d)? })
}

fn letter(data: &Path, side: usize) -> Result<Scene> {
    let x: Vec<u8> = array(&data.join("chars74k/fnt_train.npz"), "x")?;
    let letter = x.chunks_exact(64 * 64).nth(1000).ok_or("no letter")?;
    let name = if side == 64 { "letter (64)" } else { "letter (32)" };
    simulated(name, side, 64, letter)
}

fn picture(data: &Path, file: &str, name: &'static str, side: usize) -> Result<Scene> {
    let picture = image::open(data.join("scenes").join(file))?.into_luma8();
    simulated(name, side, picture.width() as usize, picture.as_raw())
}

/// A scene of `side`, averaged down from a square picture, and its noiseless measurements.
fn simulated(name: &'static str, side: usize, width: usize, pixels: &[u8]) -> Result<Scene> {
    let block = width / side;
    let mut image = vec![0.0; side * side];
    for (p, &value) in pixels.iter().enumerate() {
        let (r, c) = (p / width / block, p % width / block);
        image[r * side + c] += f64::from(value) / (255 * block * block) as f64;
    }
    nirspi_recon::fwht(&mut image)?;
    let rows = Rows::natural(Side::new(side as u64)?);
    Ok(Scene { name, all: Measurements::from_differential(&rows, &image)? })
}
