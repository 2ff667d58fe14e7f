//! A method of your own beside the built-in ones: implement [`Reconstruct`], and every comparison
//! accepts the method.
//!
//! `cargo run --release -p nirspi-recon --example own_method`

use nirspi_recon::reconstruct::{
    Method, MethodSettings, Reconstruct, ReconstructError, Reconstruction, Report, hadamard,
};
use nirspi_recon::{Image, Measurements, Order, Rows, Side, fwht, metrics};
use std::error::Error;

/// Finds the nearest image that agrees with the measurements and is nowhere negative, by
/// projections onto the two sets in turn.
struct Projections {
    rounds: usize,
}

impl Reconstruct for Projections {
    fn name(&self) -> &str {
        "alternating projections"
    }

    fn reconstruct(&self, measurements: &Measurements) -> Result<Reconstruction, ReconstructError> {
        if self.rounds == 0 {
            return Err(ReconstructError::Failed("0 rounds, expected at least 1".to_owned()));
        }
        let side = measurements.side();
        let mut pixels: Vec<f64> =
            hadamard(measurements).pixels().iter().map(|&v| v.into()).collect();
        for _ in 0..self.rounds {
            pixels.iter_mut().for_each(|pixel| *pixel = pixel.max(0.0));
            transform(&mut pixels)?;
            for (&row, &value) in measurements.rows().iter().zip(measurements.values()) {
                pixels[row as usize] = value;
            }
            transform(&mut pixels)?;
            pixels.iter_mut().for_each(|pixel| *pixel /= side.area() as f64);
        }
        let image = Image::new(side, pixels.iter().map(|&v| v as f32).collect());
        Ok(Reconstruction { image, report: Report::new(self.name()) })
    }
}

fn transform(pixels: &mut [f64]) -> Result<(), ReconstructError> {
    fwht(pixels).map_err(|error| ReconstructError::Failed(error.to_string()))
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut methods: Vec<Box<dyn Reconstruct>> = vec![Box::new(Projections { rounds: 50 })];
    for method in Method::ALL.iter().filter(|method| !method.needs_network()) {
        methods.push(method.prepare(&MethodSettings::default())?);
    }
    let (scene, part) = points(Side::INSTRUMENT)?;
    for (name, psnr_db) in compare(&methods, &scene, &part)? {
        println!("{psnr_db:6.2} dB  {name}");
    }
    Ok(())
}

/// The error of each method's image of a measurement, against the scene.
fn compare(
    methods: &[Box<dyn Reconstruct>],
    scene: &Image,
    part: &Measurements,
) -> Result<Vec<(String, f64)>, Box<dyn Error>> {
    let n = scene.side().pixels();
    let mut found = Vec::new();
    for method in methods {
        let image = method.reconstruct(part)?.image;
        let psnr_db = metrics::psnr(scene.pixels(), image.pixels(), n, n, 1.0)?;
        found.push((method.name().to_owned(), psnr_db));
    }
    Ok(found)
}

/// Bright points in the dark, and their measurements by 40 % of the patterns in random order.
fn points(side: Side) -> Result<(Image, Measurements), Box<dyn Error>> {
    let mut pixels = vec![0.0_f32; side.area()];
    for k in 0..24 {
        pixels[(k * 389 + 57) % side.area()] = 0.4 + 0.025 * k as f32;
    }
    let mut d: Vec<f64> = pixels.iter().map(|&v| v.into()).collect();
    fwht(&mut d)?;
    let all = Measurements::from_differential(&Rows::natural(side), &d)?;
    Ok((Image::new(side, pixels), all.take(Some(&Order::Random(1)), 0.4)?))
}
