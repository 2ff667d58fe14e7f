//! Wiener deconvolution: the linear estimate of least mean squared error (Wiener, 1949).
//!
//! With the blur's transfer h, noise power n and the scene's power s, each wave of the DCT-II is multiplied by
//! h / (h^2 + n / s). For s stands the law of natural images, c / f^2 (Field, J. Opt. Soc. Am. A 4, 1987), with c such
//! that scene and noise together have the power that is found. The law: the mean is kept.

use super::Blur;
use std::f64::consts::PI;

/// The sharpened image, not clamped.
#[must_use]
pub fn deblur(image: &[f32], blur: &Blur, noise: f32) -> Vec<f32> {
    let (height, width) = blur.size();
    let (down, across) = (Cosines::new(height), Cosines::new(width));
    let values: Vec<f64> = image.iter().map(|&pixel| f64::from(pixel)).collect();
    let mut waves = transform(&values, &down, &across, Cosines::analyse);

    let (h_down, h_across) = blur.transfer();
    // Cycles per pixel, squared, of each wave.
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
    transform(&waves, &down, &across, Cosines::synthesise).into_iter().map(|v| v as f32).collect()
}

/// The orthonormal DCT-II of lines of one length, as a matrix: at 64 pixels it is as fast as it need be.
struct Cosines {
    length: usize,
    /// Row k is wave k.
    waves: Vec<f64>,
}

impl Cosines {
    fn new(length: usize) -> Self {
        let n = length as f64;
        let wave = |k: usize, i: usize| {
            let norm = if k == 0 { 1.0 / n } else { 2.0 / n };
            norm.sqrt() * (PI * (i as f64 + 0.5) * k as f64 / n).cos()
        };
        let waves = (0..length).flat_map(|k| (0..length).map(move |i| wave(k, i))).collect();
        Self { length, waves }
    }

    fn analyse(&self, line: &[f64]) -> Vec<f64> {
        self.waves
            .chunks_exact(self.length)
            .map(|wave| wave.iter().zip(line).map(|(w, v)| w * v).sum())
            .collect()
    }

    fn synthesise(&self, coefficients: &[f64]) -> Vec<f64> {
        let mut line = vec![0.0; self.length];
        for (wave, c) in self.waves.chunks_exact(self.length).zip(coefficients) {
            line.iter_mut().zip(wave).for_each(|(value, w)| *value += c * w);
        }
        line
    }
}

/// Rows, then columns.
fn transform(
    values: &[f64],
    down: &Cosines,
    across: &Cosines,
    of: fn(&Cosines, &[f64]) -> Vec<f64>,
) -> Vec<f64> {
    let (height, width) = (down.length, across.length);
    let rows: Vec<f64> = values.chunks_exact(width).flat_map(|row| of(across, row)).collect();
    let mut result = vec![0.0; rows.len()];
    for c in 0..width {
        let column: Vec<f64> = (0..height).map(|r| rows[r * width + c]).collect();
        for (r, value) in of(down, &column).into_iter().enumerate() {
            result[r * width + c] = value;
        }
    }
    result
}
