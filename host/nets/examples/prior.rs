//! The learned prior on one simulated measurement, beside Tikhonov's method: error and time.
//!
//! `cargo run --release -p nirspi-nets --example prior`

use nirspi_recon::reconstruct::Method;
use nirspi_recon::{Measurements, Order, Rows, Side};
use std::time::Instant;

const SIDE: usize = 64;
const IMAGES: usize = 20;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Rings on a slope, and a dark bar.
    let scene: Vec<f64> = (0..SIDE * SIDE)
        .map(|p| {
            let (r, c) = ((p / SIDE) as f64, (p % SIDE) as f64);
            let rings = (0.02 * ((r - 24.0).powi(2) + (c - 36.0).powi(2))).sin();
            if (r - c).abs() < 4.0 { 0.1 } else { 0.5 + 0.3 * rings + 0.003 * r }
        })
        .collect();
    let mut d = scene.clone();
    nirspi_recon::fwht(&mut d)?;
    let all = Measurements::from_differential(&Rows::natural(Side::new(SIDE as u64)?), &d)?;
    let part = all.take(Some(&Order::ZigZag), 0.3)?;
    let settings = nirspi_nets::prior::settings();
    for method in [Method::TIKHONOV, Method::PRIOR] {
        let ready = method.prepare(&settings)?;
        let made = ready.reconstruct(&part)?;
        let start = Instant::now();
        for _ in 0..IMAGES {
            ready.reconstruct(&part)?;
        }
        let ms = 1e3 * start.elapsed().as_secs_f64() / IMAGES as f64;
        let error =
            made.image.pixels().iter().zip(&scene).map(|(a, b)| (f64::from(*a) - b).powi(2));
        let rms = (error.sum::<f64>() / scene.len() as f64).sqrt();
        println!("{}: rms error {rms:.4}, {ms:.1} ms an image", made.report);
    }
    Ok(())
}
