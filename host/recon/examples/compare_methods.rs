//! Compares every built-in method that needs no network on the same measurement: peak signal-to-noise ratio of the image
//! from part of the patterns, against the scene.
//!
//! `cargo run --release -p nirspi-recon --example compare_methods`

use nirspi_recon::reconstruct::{Method, MethodSettings, Reconstruct};
use nirspi_recon::{Image, Measurements, Order, Rows, Side, fwht, metrics};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let methods: Vec<Box<dyn Reconstruct>> = Method::ALL
        .iter()
        .filter(|method| !method.needs_network())
        .map(|method| method.prepare(&MethodSettings::default()))
        .collect::<Result<_, _>>()?;
    let scene = letter(Side::INSTRUMENT);
    let all = measured(&scene)?;
    println!("| method | {} |", SHARES.map(|share| format!("{:.0} %", 100.0 * share)).join(" | "));
    println!("|---|{}", "---|".repeat(SHARES.len()));
    for method in &methods {
        print!("| {} |", method.name());
        for share in SHARES {
            let part = all.take(Some(&Order::ZigZag), share)?;
            let image = method.reconstruct(&part)?.image;
            let n = scene.side().pixels();
            print!(" {:.2} dB |", metrics::psnr(scene.pixels(), image.pixels(), n, n, 1.0)?);
        }
        println!();
    }
    Ok(())
}

/// Shares of the patterns to compare.
const SHARES: [f64; 4] = [0.1, 0.2, 0.3, 0.5];

/// A bright `L` on a dark ground.
fn letter(side: Side) -> Image {
    let n = side.pixels();
    let stem =
        |r: usize, c: usize| (n / 6..5 * n / 6).contains(&r) && (n / 4..3 * n / 8).contains(&c);
    let foot = |r: usize, c: usize| {
        (17 * n / 24..5 * n / 6).contains(&r) && (n / 4..3 * n / 4).contains(&c)
    };
    let lit = |p: usize| stem(p / n, p % n) || foot(p / n, p % n);
    Image::new(side, (0..side.area()).map(|p| if lit(p) { 0.9 } else { 0.05 }).collect())
}

/// The measurement of an instrument: every pattern minus its complement, in natural order, with a
/// little noise that is the same in every run.
fn measured(scene: &Image) -> Result<Measurements, Box<dyn Error>> {
    let mut d: Vec<f64> = scene.pixels().iter().map(|&v| v.into()).collect();
    fwht(&mut d)?;
    let mut state = 1_u32;
    for value in &mut d {
        // A linear congruential generator: noise between -1 and 1, where the brightest measurement is about 200.
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *value += f64::from(state) / f64::from(u32::MAX) * 2.0 - 1.0;
    }
    Ok(Measurements::from_differential(&Rows::natural(scene.side()), &d)?)
}
