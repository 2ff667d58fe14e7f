//! How well each reconstruction method completes known scenes: PSNR and SSIM of the image from a
//! part of the patterns against the scene itself, over many scenes.
//!
//! Readings are computed from the scenes (`d = H x`), with white noise of a given share of white;
//! [`sampling`](crate::sampling) compares methods on the readings of an instrument instead.

use crate::error::{EvalError, Result};
use nirspi_recon::reconstruct::{Method, Reconstruct};
use nirspi_recon::{Image, Measurements, Order, Rows, Side, fwht, metrics};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;
use rayon::prelude::*;
use serde::Serialize;

/// A scene, square, in `[0, 1]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// The scene's name in reports.
    pub name: String,
    /// The side in pixels.
    pub side: Side,
    /// Row-major pixels, `side * side`.
    pub pixels: Vec<f32>,
}

impl Scene {
    /// The middle of a larger image of `height` rows, 8 bit.
    #[must_use]
    pub fn centre_of(name: &str, levels: &[u8], height: usize, side: Side) -> Self {
        let (n, width) = (side.pixels(), levels.len() / height);
        let (top, left) = ((height - n) / 2, (width - n) / 2);
        let at = |p: usize| levels[(top + p / n) * width + left + p % n];
        let pixels = (0..side.area()).map(|p| f32::from(at(p)) / 255.0).collect();
        Self { name: name.to_owned(), side, pixels }
    }

    /// The measurements of all patterns, with white noise of standard deviation `noise` (1 is
    /// white) in each orthonormal coefficient `d / n`: the noise that the image of all patterns
    /// would have in each pixel.
    ///
    /// # Errors
    /// [`EvalError::Library`] if the scene does not have `side * side` pixels.
    pub fn measured(&self, noise: f64, seed: u64) -> Result<Measurements> {
        let n = self.side.pixels() as f64;
        let mut random = Pcg64::seed_from_u64(seed);
        let mut d: Vec<f64> = self.pixels.iter().map(|&v| v.into()).collect();
        fwht(&mut d)?;
        for value in &mut d {
            *value += noise * n * random.sample::<f64, _>(StandardNormal);
        }
        Ok(Measurements::from_differential(&Rows::natural(self.side), &d)?)
    }
}

/// What is measured of each scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// The order of the patterns, of which the first are used.
    pub order: Order,
    /// The share of the patterns.
    pub share: f64,
    /// Noise, as [`Scene::measured`] adds it.
    pub noise: f64,
}

/// One method on one part of the patterns.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// The method's word on the command line.
    pub method: &'static str,
    /// The order of the patterns.
    pub order: String,
    /// The share of the patterns.
    pub share: f64,
    /// Noise, 1 is white.
    pub noise: f64,
    /// Mean PSNR against the scene, in dB; the peak is white.
    pub psnr_db: f64,
    /// Mean SSIM against the scene.
    pub ssim: f64,
    /// PSNR of each scene.
    pub each_db: Vec<f64>,
}

impl Row {
    /// Whether the method knows nothing but the measurements and a formula.
    #[must_use]
    pub fn is_classical(&self) -> bool {
        ![Method::PRIOR, Method::AUTO].map(Method::argument).contains(&self.method)
    }
}

/// Every method by its word, ready; `pseudo-inverse` is left out, because it is `hadamard`.
///
/// # Errors
/// [`EvalError::Library`] if a method cannot be prepared.
pub fn methods() -> Result<Vec<(&'static str, Box<dyn Reconstruct>)>> {
    let settings = nirspi_nets::prior::settings();
    let all = Method::ALL.iter().filter(|method| method.argument() != "pseudo-inverse");
    all.map(|method| {
        let ready = method.prepare(&settings)?;
        Ok((method.argument(), ready))
    })
    .collect()
}

/// The image of one scene by one method. `seed` draws the noise.
///
/// # Errors
/// [`EvalError::Library`] if the method fails or an order does not fit.
pub fn image(scene: &Scene, part: &Part, method: &dyn Reconstruct, seed: u64) -> Result<Image> {
    let all = scene.measured(part.noise, seed)?;
    let some = all.take(Some(&part.order), part.share)?;
    Ok(method.reconstruct(&some)?.image)
}

/// PSNR in dB and SSIM of an image against the scene.
///
/// # Errors
/// [`EvalError::Library`] if the sides differ.
pub fn quality(scene: &Scene, image: &Image) -> Result<(f64, f64)> {
    let n = scene.side.pixels();
    let (truth, found) = (&scene.pixels, image.pixels());
    let psnr_db = metrics::psnr(truth, found, n, n, 1.0)?;
    let ssim = metrics::ssim(truth, found, n, n, 1.0)?;
    Ok((psnr_db, ssim))
}

/// Every method on every part, over all scenes. Scene `k` has the noise of seed `k`. `done` is
/// called after each part.
///
/// # Errors
/// [`EvalError`] if there is no scene, or a method fails.
pub fn compare(
    scenes: &[Scene],
    parts: &[Part],
    methods: &[(&'static str, Box<dyn Reconstruct>)],
    mut done: impl FnMut(),
) -> Result<Vec<Row>> {
    if scenes.is_empty() {
        return Err(EvalError::Content("no scene, expected at least one".to_owned()));
    }
    let mut rows = Vec::new();
    for part in parts {
        for (word, method) in methods {
            let figures: Vec<(f64, f64)> = scenes
                .par_iter()
                .enumerate()
                .map(|(k, scene)| quality(scene, &image(scene, part, &**method, k as u64)?))
                .collect::<Result<_>>()?;
            let mean = |of: fn(&(f64, f64)) -> f64| {
                figures.iter().map(of).sum::<f64>() / figures.len() as f64
            };
            rows.push(Row {
                method: word,
                order: part.order.to_string(),
                share: part.share,
                noise: part.noise,
                psnr_db: mean(|figure| figure.0),
                ssim: mean(|figure| figure.1),
                each_db: figures.iter().map(|figure| figure.0).collect(),
            });
        }
        done();
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene() -> Scene {
        let levels: Vec<u8> = (0..40 * 60).map(|p| if p % 60 > 31 { 200 } else { 50 }).collect();
        Scene::centre_of("edge", &levels, 40, Side::INSTRUMENT)
    }

    #[test]
    fn the_centre_is_the_centre_and_noise_is_that_of_a_pixel() {
        let scene = scene();
        assert_eq!((scene.pixels[17], scene.pixels[18]), (50.0 / 255.0, 200.0 / 255.0));
        let part = Part { order: Order::ZigZag, share: 1.0, noise: 0.02 };
        let zero_filling = Method::ALL[0].prepare(&nirspi_nets::prior::settings()).unwrap();
        let image = image(&scene, &part, &*zero_filling, 1).unwrap();
        let (psnr_db, _) = quality(&scene, &image).unwrap();
        // The mean of 1024 squares is known to 4 %, 0.19 dB.
        assert!((psnr_db - 20.0 * 50.0_f64.log10()).abs() < 0.5, "{psnr_db}");
    }

    #[test]
    fn every_method_has_a_row_for_every_part_and_no_scene_is_refused() {
        let part = |share| Part { order: Order::ZigZag, share, noise: 0.0 };
        let methods = methods().unwrap();
        let mut calls = 0;
        let parts = [part(0.2), part(0.4)];
        let rows = compare(&[scene()], &parts, &methods, || calls += 1).unwrap();
        assert_eq!((rows.len(), calls), (2 * methods.len(), 2));
        assert_eq!(rows.iter().filter(|row| !row.is_classical()).count(), 4);
        assert!(rows.iter().all(|row| row.each_db.len() == 1 && row.psnr_db > 20.0));
        let error = compare(&[], &parts, &methods, || ()).unwrap_err().to_string();
        assert_eq!(error, "no scene, expected at least one");
    }
}
