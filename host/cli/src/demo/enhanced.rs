//! The demo's learned stages: the camera's image becomes a reflectance, is fused with depth, and deblurred.

use super::super::quality::{Quality, compare};
use super::super::report::StageTimes;
use anyhow::Result;
use nirspi::virtual_camera::VirtualOptics;
use nirspi_nets::{
    DepthMaps, Device, Enhancer, Images, Known, KnownEstimate, MeasuredRows, Options, deblur,
    fusion, upscale_2x,
};
use nirspi_optics::DEPTH_SIDE;
use nirspi_recon::{Image, Side};
use serde::Serialize;

/// The scene as a perfect camera of 64 x 64 pixels would see it, and what the stages made of it.
pub struct Stages {
    pub truth: Vec<f32>,
    pub upscaled: Vec<f32>,
    pub fused: Vec<f32>,
    pub deblurred: Vec<f32>,
    pub report: Report,
}

/// Quality of each 64 x 64 stage, and what the networks found out.
#[derive(Debug, Serialize)]
pub struct Report {
    /// Lanczos interpolation, which learned nothing.
    pub upscaled: Quality,
    /// FSRCNN with depth.
    pub fused: Quality,
    /// The diffusion bridge.
    pub deblurred: Quality,
    pub steps: u32,
    /// Blur in pixels of the 64 x 64 grid that was taken out: the larger one of the next two.
    pub sigma_px: f32,
    /// As the image shows it.
    pub estimated_sigma_px: f32,
    /// As lens and depth map have it, where there is a depth map.
    pub defocus_px: Option<f32>,
    /// Noise of a reading of full scale 1, as estimated.
    pub noise: f32,
    /// Distance of the readings from those of the result, over their noise.
    pub inconsistency: f32,
    /// Depth zones that saw something.
    pub depth_zones: usize,
    pub device: String,
    pub quality_note: &'static str,
}

/// Inconsistency from which the readings contradict the image: an image that agrees with them ends at 1.1 or below, the
/// radius that it is moved to.
const CONTRADICTED: f32 = 1.2;

impl Report {
    /// What is to be said of an image that the readings do not bear out.
    pub fn doubt(&self, frames: u32) -> Option<String> {
        (self.inconsistency > CONTRADICTED).then(|| {
            format!(
                "the readings do not bear the deblurred image out (inconsistency {:.2}): do not trust its strokes; more \
                 light helps, as with --frames {}",
                self.inconsistency,
                frames.saturating_mul(10)
            )
        })
    }
}

/// Runs the stages on an image in ADC counts that was reconstructed from these Hadamard rows.
pub fn run(
    image: &Image,
    rows: &[u16],
    optics: &VirtualOptics,
    seed: u64,
    times: &mut StageTimes,
) -> Result<Stages> {
    // The gain that turns a white target at this distance into counts is known from the photon budget, as
    // a user knows it from a white sheet held there.
    let white_counts = optics.budget().electrons_per_led / optics.chain().electrons_per_count;
    let reflectance: Vec<f32> = image
        .pixels()
        .iter()
        .map(|&counts| (f64::from(counts) / white_counts).clamp(0.0, 1.0) as f32)
        .collect();
    let readings: Images<'_, { fusion::SIDE }> = Images::new(&reflectance)?;
    let zones_m: Vec<f32> =
        optics.depth(seed)?.reading().iter().map(|&mm| f32::from(mm) * 1e-3).collect();
    let seen_m = seen(&zones_m);
    let depth_zones = seen_m.len();
    // The lens and the distance say how far it is out of focus; noise hides that from the estimator, which says too little then.
    let defocus_px = seen_m
        .get(depth_zones / 2)
        .map(|&m| optics.defocus_px(f64::from(m) * 1e3, deblur::SIDE) as f32);
    let depth = DepthMaps::new(zones_m, [1, DEPTH_SIDE, DEPTH_SIDE], 1)?;

    let device = Device::cpu();
    let enhancer = times.time("load_networks", || Enhancer::built_in(&device))?;
    let rows: Vec<u32> = rows.iter().map(|&row| row.into()).collect();
    let measured = MeasuredRows::new(fusion::SIDE, &rows)?;
    let sigma_px = defocus_px.map_or(Known::Nothing, Known::AtLeast);
    let estimate = KnownEstimate { sigma_px, ..KnownEstimate::default() };
    let options = Options { measured, seed, estimate, ..Options::default() };
    let result = times
        .time("enhance", || enhancer.enhance(readings, Some(&depth), &options, &mut |_| {}))?;
    let used = result.estimates[0];
    let estimated = result.estimated.map_or(used, |estimated| estimated[0]);
    let side = fusion::SIDE;
    let upscaled = times.time("upscale", || upscale_2x(&reflectance, 1, side, side))?;

    let truth = optics.focused(deblur::SIDE);
    let output = Side::new(deblur::SIDE as u64)?;
    let judge = |values: &[f32]| compare(&Image::new(output, values.to_vec()), &truth);
    let fused = result.upscaled.unwrap_or_default();
    let (upscaled_fit, fused_fit, deblurred_fit) =
        (judge(&upscaled)?, judge(&fused)?, judge(&result.images)?);
    let report = Report {
        upscaled: upscaled_fit.quality,
        fused: fused_fit.quality,
        deblurred: deblurred_fit.quality,
        steps: 1,
        sigma_px: used.sigma_px,
        estimated_sigma_px: estimated.sigma_px,
        defocus_px,
        noise: used.noise,
        inconsistency: result.inconsistency[0],
        depth_zones,
        device: device.name().to_owned(),
        quality_note: "against the scene on a 64 x 64 grid without defocus, after the gain and offset of least \
                       squares",
    };
    Ok(Stages {
        truth,
        upscaled: upscaled_fit.values,
        fused: fused_fit.values,
        deblurred: deblurred_fit.values,
        report,
    })
}

/// Distances of the zones that saw something, sorted.
fn seen(zones_m: &[f32]) -> Vec<f32> {
    let mut seen: Vec<f32> = zones_m.iter().copied().filter(|&m| m > 0.0).collect();
    seen.sort_by(f32::total_cmp);
    seen
}
