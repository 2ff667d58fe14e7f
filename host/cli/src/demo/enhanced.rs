//! The demo's learned stages and their quality: the image divided by white, fused with depth,
//! deblurred.

use super::super::report::StageTimes;
use anyhow::Result;
use nirspi::imaging::{Enhance, ImageContext, Quality, Warning, White, compare, warnings};
use nirspi::virtual_camera::VirtualOptics;
use nirspi_nets::{DepthMaps, Device, deblur, upscale_2x};
use nirspi_optics::SIDE;
use nirspi_recon::{Image, Rows, Side};
use serde::Serialize;

/// The scene as taken by a perfect camera of 64 x 64 pixels, and the results of the stages.
pub struct Stages {
    pub truth: Vec<f32>,
    pub upscaled: Vec<f32>,
    pub fused: Vec<f32>,
    pub deblurred: Vec<f32>,
    pub report: Report,
}

/// Quality of each 64 x 64 stage, and the estimates of the networks.
#[derive(Debug, Serialize)]
pub struct Report {
    /// Lanczos interpolation, without learning.
    pub upscaled: Quality,
    /// FSRCNN with depth.
    pub fused: Quality,
    /// The diffusion bridge.
    pub deblurred: Quality,
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
    /// Number of depth zones that see the field and have a distance.
    pub depth_zones: usize,
    pub device: String,
    /// Reasons not to trust the result.
    pub warnings: Vec<String>,
    #[serde(skip)]
    pub short_warnings: Vec<String>,
    pub quality_note: &'static str,
}

/// Runs the stages on an image in ADC counts that was reconstructed from these Hadamard rows.
pub fn run(
    image: &Image,
    rows: &Rows,
    optics: &VirtualOptics,
    seed: u64,
    times: &mut StageTimes,
) -> Result<Stages> {
    let view = optics.depth_view(seed)?;
    let pixels_m = view.pixels_mm.iter().map(|&mm| f32::from(mm) * 1e-3).collect();
    let depth = DepthMaps::new(pixels_m, [1, SIDE, SIDE], 1)?;
    let defocus_px = view.median_mm.map(|mm| optics.defocus_px(f64::from(mm), deblur::SIDE) as f32);
    let enhance = times.time("load_networks", || Enhance::built_in(&Device::cpu()))?;
    // The photon budget gives the counts of a white target at this distance, which a user would
    // measure with a white sheet.
    let white = White::Known(optics.white_counts() as f32);
    let known =
        ImageContext { rows: Some(rows), depth: Some(&depth), least_blur_px: defocus_px, seed };
    let made = times.time("enhance", || enhance.enhance(image, white, &known))?;
    let side = image.side().pixels();
    let upscaled = times.time("upscale", || upscale_2x(&made.scaled, 1, side, side))?;

    let truth = optics.focused(deblur::SIDE);
    let output = Side::new(deblur::SIDE as u64)?;
    let judge = |values: &[f32]| compare(&Image::new(output, values.to_vec()), &truth);
    let (upscaled, fused, deblurred) = (
        judge(&upscaled)?,
        judge(made.fused.as_deref().unwrap_or_default())?,
        judge(&made.pixels)?,
    );
    let warnings = warnings(&made);
    let report = Report {
        upscaled: upscaled.quality,
        fused: fused.quality,
        deblurred: deblurred.quality,
        steps: 1,
        sigma_px: made.blur_px,
        estimated_sigma_px: made.estimated_blur_px,
        defocus_px,
        noise: made.noise,
        inconsistency: made.inconsistency,
        depth_zones: view.zones,
        device: enhance.device().name().to_owned(),
        warnings: warnings.iter().map(Warning::to_string).collect(),
        short_warnings: warnings.iter().map(|warning| warning.short().to_owned()).collect(),
        quality_note: "against the scene on a 64 x 64 grid without defocus, after the gain and offset of least \
                       squares",
    };
    Ok(Stages {
        truth,
        upscaled: upscaled.values,
        fused: fused.values,
        deblurred: deblurred.values,
        report,
    })
}
