//! Wiener deconvolution: the linear estimate of least mean squared error (Wiener, 1949).
//!
//! With the blur's transfer h, noise power n and the scene's power s, each wave of the DCT-II is
//! multiplied by h / (h^2 + n / s). The scene's power is that of natural images, c / f^2 (Field, J.
//! Opt. Soc. Am. A 4, 1987), with c such that scene and noise together have the power of the image.
//! The mean is kept.

use super::Blur;
use crate::cosine::Cosine;

/// The sharpened image, not clamped.
#[must_use]
pub fn deblur(image: &[f32], blur: &Blur, noise: f32) -> Vec<f32> {
    let (height, width) = blur.size();
    let cosine = Cosine::new(height, width);
    let values: Vec<f64> = image.iter().map(|&pixel| f64::from(pixel)).collect();
    let mut waves = cosine.forward(&values);

    let (h_down, h_across) = blur.transfer();
    // Squared frequency of each wave, in cycles per pixel.
    let frequency_2 = |k: usize, l: usize| {
        (k as f64 / (2 * height) as f64).powi(2) + (l as f64 / (2 * width) as f64).powi(2)
    };
    let noise_power = f64::from(noise).powi(2);
    let index = |k: usize, l: usize| k * width + l;
    let changing = || (0..height).flat_map(|k| (0..width).map(move |l| (k, l))).skip(1);
    let found: f64 = changing().map(|(k, l)| waves[index(k, l)].powi(2) - noise_power).sum();
    let expected: f64 =
        changing().map(|(k, l)| (h_down[k] * h_across[l]).powi(2) / frequency_2(k, l)).sum();
    let scale = (found / expected).max(0.0);
    for (k, l) in changing() {
        let h = h_down[k] * h_across[l];
        let scene = scale / frequency_2(k, l);
        waves[index(k, l)] *= h * scene / (h * h * scene + noise_power);
    }
    cosine.inverse(&waves).into_iter().map(|v| v as f32).collect()
}
