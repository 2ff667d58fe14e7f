//! Scores of an image against the scene that a simulation knows.
//!
//! # Invariant
//! The scene's own brightness serves scores alone. [`score`] fits the image to the scene and gives
//! numbers; it gives no fitted image, so no picture or file can hold one.

use nirspi_recon::Image;
use nirspi_recon::metrics::{self, MetricError};
use serde::Serialize;
use std::fmt;

/// How well an image shows a scene in `[0, 1]`.
///
/// A scene of one value (a white sheet, a covered lens) has no PSNR: a fit of gain and offset makes
/// every image of such a scene right. The image has its noise instead.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quality {
    /// Peak signal-to-noise ratio after the fit, data range 1. `None` if [`Self::no_psnr`] says why.
    pub psnr_db: Option<f64>,
    /// The PSNR less that of a blank picture, which has the scene's mean in every pixel.
    pub over_blank_db: Option<f64>,
    /// Structural similarity after the fit, Gaussian window of 11 px; `None` for a flat scene.
    pub ssim: Option<f64>,
    /// Pearson's correlation of the image itself, which needs no fit; `None` for a flat image and
    /// a flat scene.
    pub correlation: Option<f64>,
    /// The fit to the scene, which the scores use; `None` for a flat scene.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fit: Option<Fit>,
    /// Whether the image is darker where the scene is brighter. An inverted image is wrong, not
    /// dim, so it is scored as a blank image.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub inverted: bool,
    /// The image's noise, if the scene is flat.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise: Option<Noise>,
    /// Why there is no PSNR.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_psnr: Option<&'static str>,
}

/// An image of a flat scene, in the image's own units, without any fit: the middle of the image,
/// half as wide and half as high, where defocus mixes in nothing from outside the scene.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Noise {
    /// The mean of the pixels.
    pub mean: f64,
    /// The standard deviation of the pixels.
    pub std: f64,
    /// The mean divided by the standard deviation; `None` for a black scene, and for an image of
    /// one value.
    pub snr: Option<f64>,
    /// The scene's value.
    pub scene: f64,
}

/// The gain and offset of least squares that scale an image to a reference.
///
/// # Invariant
/// The gain is never negative: a fit must not turn a wrong picture into a right one
/// (`tests::an_inverted_image_is_scored_as_blank`).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Fit {
    /// Gain, 0 or more.
    pub gain: f64,
    /// The offset, added after the gain.
    pub offset: f64,
    /// Whether the image is darker where the reference is brighter. The gain is then 0.
    #[serde(skip)]
    pub inverted: bool,
}

impl Fit {
    /// Fits pixels to a reference with the same number of pixels.
    #[must_use]
    pub fn of(image: &[f32], reference: &[f32]) -> Self {
        let (mx, my) = (mean(image), mean(reference));
        let (mut xx, mut xy) = (0.0, 0.0);
        for (&x, &y) in image.iter().zip(reference) {
            let x = f64::from(x) - mx;
            xx += x * x;
            xy += x * (f64::from(y) - my);
        }
        let inverted = xy < 0.0;
        let gain = if xx > 0.0 && !inverted { xy / xx } else { 0.0 };
        Self { gain, offset: my - gain * mx, inverted }
    }

    /// A pixel on the reference's scale.
    #[must_use]
    pub fn apply(&self, pixel: f32) -> f32 {
        (f64::from(pixel) * self.gain + self.offset) as f32
    }
}

fn mean(values: &[f32]) -> f64 {
    values.iter().map(|&value| f64::from(value)).sum::<f64>() / values.len() as f64
}

/// The standard deviation of values about `mean`.
fn deviation(values: &[f32], mean: f64) -> f64 {
    let square = |&value: &f32| (f64::from(value) - mean).powi(2);
    (values.iter().map(square).sum::<f64>() / values.len() as f64).sqrt()
}

/// The middle of a square image, half as wide and half as high.
fn middle(pixels: &[f32], side: usize) -> Vec<f32> {
    let inside = side / 4..side - side / 4;
    inside.clone().flat_map(|row| &pixels[row * side..][inside.clone()]).copied().collect()
}

/// Why a flat scene has no PSNR.
const FLAT: &str = "the scene is flat: a fit of gain and offset would make every image of it right";
/// Why an image without any error has no PSNR.
const EQUAL: &str = "the image equals the scene: its PSNR has no bound";

/// Scores `image` against `scene` of the same size, in `[0, 1]`. PSNR and SSIM are of the image
/// after the gain and offset of least squares, clamped to `[0, 1]`. Of a scene with a spot brighter than white, both are
/// scored as a picture shows them, white at most; the image is then in shares of white.
///
/// # Errors
/// [`MetricError`] if the sizes differ, or a value is NaN or infinite.
pub fn score(image: &Image, scene: &[f32]) -> Result<Quality, MetricError> {
    if scene.iter().any(|&value| value > 1.0 && value.is_finite()) {
        let shown =
            |values: &[f32]| values.iter().map(|&v| if v > 1.0 { 1.0 } else { v }).collect();
        let scene: Vec<f32> = shown(scene);
        return score(&Image::new(image.side(), shown(image.pixels())), &scene);
    }
    let (side, pixels) = (image.side().pixels(), image.pixels());
    let correlation = match metrics::correlation(scene, pixels, side, side) {
        Err(MetricError::Flat { .. }) => None,
        other => Some(other?),
    };
    if let Some(&level) = scene.first()
        && scene.iter().all(|&value| value == level)
    {
        let middle = middle(pixels, side);
        let mean = mean(&middle);
        let std = deviation(&middle, mean);
        let snr = (std > 0.0 && level > 0.0).then(|| mean / std);
        return Ok(Quality {
            psnr_db: None,
            over_blank_db: None,
            ssim: None,
            correlation,
            fit: None,
            inverted: false,
            noise: Some(Noise { mean, std, snr, scene: level.into() }),
            no_psnr: Some(FLAT),
        });
    }
    let fit = Fit::of(pixels, scene);
    let fitted: Vec<f32> = pixels.iter().map(|&pixel| fit.apply(pixel).clamp(0.0, 1.0)).collect();
    let psnr_db = metrics::psnr(scene, &fitted, side, side, 1.0)?;
    let psnr_db = psnr_db.is_finite().then_some(psnr_db);
    let blank_db = -20.0 * deviation(scene, mean(scene)).log10();
    Ok(Quality {
        psnr_db,
        over_blank_db: psnr_db.map(|psnr_db| psnr_db - blank_db),
        ssim: Some(metrics::ssim(scene, &fitted, side, side, 1.0)?),
        correlation,
        fit: Some(fit),
        inverted: fit.inverted,
        noise: None,
        no_psnr: if psnr_db.is_none() { Some(EQUAL) } else { None },
    })
}

impl Quality {
    /// The PSNR of a blank picture of the same scene.
    #[must_use]
    pub fn blank_db(&self) -> Option<f64> {
        self.psnr_db.zip(self.over_blank_db).map(|(psnr_db, over)| psnr_db - over)
    }

    /// The scores in two short lines, for a caption.
    #[must_use]
    pub fn short(&self) -> Vec<String> {
        match (self.noise, self.psnr_db, self.over_blank_db, self.ssim) {
            (Some(noise), ..) => vec![
                format!("noise {:.3}, {}", noise.std, noise.snr_words()),
                format!("mean {:.3}, scene {:.3}", noise.mean, noise.scene),
            ],
            (None, Some(psnr_db), Some(over), Some(ssim)) => vec![
                format!("PSNR {psnr_db:.1} dB  SSIM {ssim:.2}"),
                format!("{over:+.1} dB over blank"),
            ],
            _ => vec![self.no_psnr.unwrap_or_default().to_owned()],
        }
    }
}

impl Noise {
    fn snr_words(&self) -> String {
        self.snr.map_or_else(|| "no SNR".to_owned(), |snr| format!("SNR {snr:.1}"))
    }
}

/// The scores in one line, with the fit beside them. Noise is a share of white: the image must be
/// one.
impl fmt::Display for Quality {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(noise) = &self.noise {
            let Noise { mean, std, scene, .. } = noise;
            let snr = noise.snr_words();
            return write!(f, "noise {std:.4} of white, {snr}, mean {mean:.4} (scene {scene:.4})");
        }
        let (Some(psnr_db), Some(over), Some(ssim), Some(fit)) =
            (self.psnr_db, self.over_blank_db, self.ssim, self.fit)
        else {
            return f.write_str(self.no_psnr.unwrap_or_default());
        };
        let Fit { gain, offset, .. } = fit;
        write!(f, "PSNR {psnr_db:.2} dB ({over:+.2} over blank), SSIM {ssim:.3}")?;
        write!(f, "; fit: gain {gain:.3}, offset {offset:+.3}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_recon::Side;

    fn half() -> Vec<f32> {
        (0..256).map(|at| if at % 16 < 8 { 0.2 } else { 0.9 }).collect()
    }

    fn image(pixels: Vec<f32>) -> Image {
        Image::new(Side::new(16).unwrap(), pixels)
    }

    #[test]
    fn gain_and_offset_do_not_matter_and_stand_beside_the_scores() {
        let seen = image(half().iter().map(|v| 700.0 * v - 40.0).collect());
        let found = score(&seen, &half()).unwrap();
        assert!(found.psnr_db.is_none_or(|psnr_db| psnr_db > 90.0) && !found.inverted);
        let fit = found.fit.unwrap();
        assert!((fit.gain - 1.0 / 700.0).abs() < 1e-6 && (fit.offset - 4.0 / 70.0).abs() < 1e-4);
    }

    #[test]
    fn an_inverted_image_is_scored_as_blank() {
        let inverted = image(half().iter().map(|v| -700.0 * v).collect());
        let inverted = score(&inverted, &half()).unwrap();
        let blank = score(&image(vec![0.0; 256]), &half()).unwrap();
        assert!(inverted.inverted && !blank.inverted);
        assert_eq!(inverted.psnr_db, blank.psnr_db);
        assert!(inverted.correlation.unwrap() < -0.99);
        // 0.35 about the mean: 9.12 dB, and a blank picture is no better than a blank one.
        assert!((blank.psnr_db.unwrap() - 9.119).abs() < 0.01, "{blank:?}");
        assert!(blank.over_blank_db.unwrap().abs() < 1e-3, "{blank:?}");
    }

    #[test]
    fn a_flat_scene_has_a_noise_and_no_psnr() {
        for level in [0.0_f32, 0.4, 0.9] {
            let noisy = (0..256).map(|at| level + if at % 2 == 0 { 0.03 } else { -0.03 });
            let found = score(&image(noisy.collect()), &[level; 256]).unwrap();
            let noise = found.noise.unwrap();
            assert!(
                (noise.std - 0.03).abs() < 1e-6 && (noise.mean - f64::from(level)).abs() < 1e-6
            );
            let snr = (level > 0.0).then(|| (f64::from(level) / 0.03 * 10.0).round() / 10.0);
            assert_eq!(noise.snr.map(|snr| (snr * 10.0).round() / 10.0), snr);
            assert_eq!((found.psnr_db, found.ssim, found.over_blank_db), (None, None, None));
            assert!(found.no_psnr.unwrap().contains("flat"), "{found:?}");
            let words = format!("{found} {}", found.short().join(" "));
            assert!(words.contains("noise 0.0300 of white") && !words.contains("inf"), "{words}");
        }
        let same = score(&image(vec![0.9; 256]), &[0.9; 256]).unwrap();
        assert_eq!(same.noise.unwrap().snr, None);
    }

    #[test]
    fn an_image_without_error_has_no_infinite_psnr() {
        let halves: Vec<f32> = (0..256).map(|at| if at % 16 < 8 { 0.25 } else { 0.75 }).collect();
        let found = score(&image(halves.clone()), &halves).unwrap();
        assert_eq!(found.psnr_db, None, "{found:?}");
        assert!(found.no_psnr.unwrap().contains("equals"), "{found:?}");
    }
}
