//! The learned stages on an image of a virtual camera, whose true scene is known, and the quality of
//! each stage.

use super::VirtualOptics;
use nirspi::imaging::{
    Enhance, EnhanceError, ImageContext, KnownReadings, Quality, Warning, White, score, warnings,
};
use nirspi::stage_times::StageTimes;
use nirspi_nets::interval::{Intervals, NoIntervals, share_of_prior};
use nirspi_nets::reading::{Reader, Reading};
use nirspi_nets::{
    DepthError, DepthMaps, Device, Images, UpscaleError, Weights, WeightsError, deblur, upscale_2x,
};
use nirspi_optics::SIDE;
use nirspi_recon::metrics::MetricError;
use nirspi_recon::{Image, Rows, Side, SideError};
use serde::Serialize;
use thiserror::Error;

/// The scene as taken by a perfect camera of 64 x 64 pixels, and the results of the stages.
///
/// Images are 64 x 64 pixels, as shares of the white sheet. No image was fitted to the truth.
#[derive(Debug)]
pub struct Stages {
    /// The scene.
    pub truth: Vec<f32>,
    /// Lanczos interpolation, without learning and without a clamp.
    pub upscaled: Vec<f32>,
    /// The image fused with depth.
    pub fused: Vec<f32>,
    /// The deblurred image.
    pub deblurred: Vec<f32>,
    /// Half-width of the 95 % interval of each pixel of the deblurred image; white is 1. `None` where
    /// the calibration does not reach ([`StagesReport::no_interval`]).
    pub half_width: Option<Vec<f32>>,
    /// Qualities and estimates.
    pub report: StagesReport,
}

/// Why the stages gave no image.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StagesError {
    /// The depth sensor cannot be simulated.
    #[error(transparent)]
    Sensor(#[from] nirspi_optics::DepthError),
    /// The depth map does not fit the image.
    #[error(transparent)]
    Depth(#[from] DepthError),
    /// The built-in calibration of the intervals cannot be used.
    #[error(transparent)]
    Intervals(#[from] NoIntervals),
    /// The built-in weights cannot be used.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// The networks failed.
    #[error(transparent)]
    Enhance(#[from] EnhanceError),
    /// The image cannot be enlarged.
    #[error(transparent)]
    Upscale(#[from] UpscaleError),
    /// The output has no valid size.
    #[error(transparent)]
    Side(#[from] SideError),
    /// The images cannot be compared.
    #[error(transparent)]
    Metric(#[from] MetricError),
}

/// Quality of each 64 x 64 stage, and the estimates of the networks.
#[derive(Debug, Serialize)]
pub struct StagesReport {
    /// Lanczos interpolation, without learning.
    pub upscaled: Quality,
    /// FSRCNN with depth.
    pub fused: Quality,
    /// The diffusion bridge.
    pub deblurred: Quality,
    /// Steps of the bridge.
    pub steps: u32,
    /// Removed blur in pixels of the 64 x 64 grid: the larger of estimate and lens.
    pub sigma_px: f32,
    /// Blur estimated from the image.
    pub estimated_sigma_px: f32,
    /// Blur computed from lens and depth map, if there is a depth map.
    pub defocus_px: Option<f32>,
    /// Estimated noise of a reading; full scale is 1.
    pub noise: f32,
    /// Distance of the readings from the readings of the result, divided by their noise.
    pub inconsistency: f32,
    /// Noise of the readings, from the camera: of a pixel of the plain transform of all patterns;
    /// white is 1. `null` if it is not known.
    pub readings_noise: Option<f32>,
    /// Mean half-width of the 95 % intervals of the pixels; white is 1. `null` without intervals.
    pub mean_half_width: Option<f32>,
    /// Share of the pixels whose interval is so wide that the image is the prior's there and not
    /// the data's. `null` without intervals.
    pub prior_share: Option<f32>,
    /// Why there are no intervals.
    pub no_interval: Option<String>,
    /// The character in the image as the classifier reads it: the likeliest alternatives, that none
    /// is legible, or that the image shows no single character.
    pub reading: Reading,
    /// Number of depth zones that see the field and have a distance.
    pub depth_zones: usize,
    /// Name of the device that computed.
    pub device: String,
    /// Reasons not to trust the result.
    pub warnings: Vec<String>,
    /// Short forms of the warnings, for the picture.
    #[serde(skip)]
    pub short_warnings: Vec<String>,
    /// What the qualities compare.
    pub quality_note: &'static str,
}

impl StagesReport {
    /// The blur and its source, in words.
    #[must_use]
    pub fn blur_line(&self) -> String {
        let (taken, estimated) = (self.sigma_px, self.estimated_sigma_px);
        if taken > estimated {
            format!("{taken:.2} px by lens and distance, {estimated:.2} px estimated")
        } else {
            format!("{taken:.2} px estimated")
        }
    }

    /// How uncertain the deblurred image is, in two short lines.
    #[must_use]
    pub fn uncertainty(&self) -> Vec<String> {
        match (self.mean_half_width, self.prior_share) {
            (Some(mean), Some(share)) => vec![
                format!("95 % interval, mean ± {mean:.3} of white"),
                format!("{:.1} % of the pixels are the prior's", 100.0 * share),
            ],
            _ => vec!["no intervals".to_owned(), "not calibrated for this".to_owned()],
        }
    }

    /// The same and the character in the image, in one line.
    #[must_use]
    pub fn uncertainty_line(&self) -> String {
        let intervals = match &self.no_interval {
            Some(why) => why.clone(),
            None => format!("uncertainty: {}", self.uncertainty().join(", ")),
        };
        format!("{intervals}; as a single character: {}", self.reading)
    }
}

/// Runs the stages on an image in shares of white that was reconstructed from these Hadamard rows.
/// `readings` says by which method, and how noisy its readings were.
///
/// # Errors
/// [`StagesError`] if a stage failed.
pub fn enhance_stages(
    image: &Image,
    rows: &Rows,
    readings: Option<KnownReadings>,
    optics: &VirtualOptics,
    seed: u64,
    times: &mut StageTimes,
) -> Result<Stages, StagesError> {
    let view = optics.depth_view(seed)?;
    let pixels_m = view.pixels_mm.iter().map(|&mm| f32::from(mm) * 1e-3).collect();
    let depth = DepthMaps::new(pixels_m, [1, SIDE, SIDE], 1)?;
    let defocus_px = view.median_mm.map(|mm| optics.defocus_px(f64::from(mm), deblur::SIDE) as f32);
    let enhance = times.time("load_networks", || Enhance::built_in(&Device::cpu()))?;
    let known = ImageContext {
        rows: Some(rows),
        readings,
        depth: Some(&depth),
        least_blur_px: defocus_px,
        seed,
        copies: 0,
    };
    let made = times.time("enhance", || enhance.enhance(image, White::Known(1.0), &known))?;
    let upscaled = times.time("upscale", || upscaled(image))?;

    let truth = optics.focused(deblur::SIDE);
    let output = Side::new(deblur::SIDE as u64)?;
    let judge = |values: &[f32]| score(&Image::new(output, values.to_vec()), &truth);
    let fused = made.fused.clone().unwrap_or_default();
    let warnings = warnings(&made);
    let half_width = made.half_width.clone();
    let reading = times.time("read_character", || reading(&made.pixels, made.inconsistency))?;
    let report = StagesReport {
        upscaled: judge(&upscaled)?,
        fused: judge(&fused)?,
        deblurred: judge(&made.pixels)?,
        steps: 1,
        sigma_px: made.blur_px,
        estimated_sigma_px: made.estimated_blur_px,
        defocus_px,
        noise: made.noise,
        inconsistency: made.inconsistency,
        readings_noise: readings.map(|readings| readings.noise / made.white),
        mean_half_width: half_width.as_ref().map(|w| w.iter().sum::<f32>() / w.len().max(1) as f32),
        prior_share: half_width.as_deref().map(share_of_prior),
        no_interval: made.no_interval.clone(),
        reading,
        depth_zones: view.zones,
        device: enhance.device().name().to_owned(),
        warnings: warnings.iter().map(Warning::to_string).collect(),
        short_warnings: warnings.iter().map(|warning| warning.short().to_owned()).collect(),
        quality_note: "against the scene on a 64 x 64 grid without defocus; PSNR and SSIM after the gain and offset of \
                       least squares, which stand under fit; the images are not fitted",
    };
    Ok(Stages { truth, upscaled, fused, deblurred: made.pixels, half_width, report })
}

/// Twice the side, by Lanczos. [`upscale_2x`] takes and gives values in `[0, 1]` only; between its
/// clamps it is linear and keeps constants, so the image goes through around the middle of that
/// range and comes back with its noise below 0 and above 1.
fn upscaled(image: &Image) -> Result<Vec<f32>, UpscaleError> {
    let side = image.side().pixels();
    let most = image.pixels().iter().fold(1.0_f32, |most, value| most.max(value.abs()));
    let inside: Vec<f32> = image.pixels().iter().map(|value| 0.5 + value / (8.0 * most)).collect();
    let enlarged = upscale_2x(&inside, 1, side, side)?;
    Ok(enlarged.iter().map(|value| (value - 0.5) * 8.0 * most).collect())
}

/// Reads the character in an image of 64 x 64.
fn reading(pixels: &[f32], inconsistency: f32) -> Result<Reading, StagesError> {
    let scale = Intervals::shipped()?.calibration().characters.clone();
    let reader = Reader::new(&Weights::embedded("classifier")?, scale)?;
    let images = Images::new(pixels).map_err(EnhanceError::from)?;
    let mut read = reader.read(images, &[inconsistency]);
    Ok(read.swap_remove(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_enlarged_image_keeps_noise_below_black_and_above_white() {
        let side = Side::INSTRUMENT;
        let noisy: Vec<f32> = (0..1024).map(|at| ((at * 37 % 101) as f32) / 50.0 - 0.5).collect();
        let large = upscaled(&Image::new(side, noisy.clone())).unwrap();
        assert!(large.iter().any(|&v| v < -0.4) && large.iter().any(|&v| v > 1.4));
        // Where nothing is clamped, both are the same.
        let inside: Vec<f32> = noisy.iter().map(|v| 0.3 + 0.2 * v).collect();
        let same = upscaled(&Image::new(side, inside.clone())).unwrap();
        let known = upscale_2x(&inside, 1, 32, 32).unwrap();
        let off = same.iter().zip(&known).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off < 1e-5, "{off}");
    }
}
