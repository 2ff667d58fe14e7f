//! One picture taken with the virtual camera, from light to image, and one with an ordinary camera.

use crate::cli::camera::Rain;
use anyhow::{Result, bail};
use indicatif::{ProgressBar, ProgressStyle};
use nirspi::calibrate::CalibrationError;
use nirspi::capture::{Calibration, Capture, CaptureOptions, Ended, Progress, capture};
use nirspi::session::Session;
use nirspi::setup::MeasurementSetup;
use nirspi::virtual_camera::{MemoryLink, VirtualOptics};
use nirspi_optics::rain::Drops;
use nirspi_optics::visible::VisibleCamera;
use nirspi_optics::{Projector, Scene};
use nirspi_recon::{Image, Order, Side, reconstruct};
use std::ops::ControlFlow;

/// Conditions of a table.
#[derive(Debug, Clone, Copy)]
pub struct Conditions {
    pub distance_m: f64,
    pub rain: Rain,
    /// Differential sweeps that are summed.
    pub frames: u32,
}

/// How the pictures of a table are taken.
#[derive(Debug, clap::Args)]
pub struct Exposure {
    /// Rain, as in the paper's Table 2
    #[arg(long, value_enum, default_value_t = Rain::Heavy)]
    pub rain: Rain,
    /// Differential sweeps summed into a picture; 244 are 20 ms
    #[arg(long, value_name = "N", default_value_t = FRAMES,
          value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub frames: u32,
    /// Seed of the first picture
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
}

/// All 1024 patterns and their complements: 244 times is 20 ms, the paper's T_pre (Table 1).
const FRAMES: u32 = 244;

/// What both cameras give of one scene.
pub struct Shots {
    /// What a perfect camera of 32 x 32 pixels would see.
    pub truth: Vec<f32>,
    /// What one of 64 x 64 pixels would.
    pub truth_fine: Vec<f32>,
    pub nir_spi: Image,
    pub vis: Image,
}

/// A progress bar for `total` shots.
pub fn progress(total: usize, what: &str) -> ProgressBar {
    let template = format!("{what} {{bar:30}} {{pos}}/{{len}} pictures, {{eta}} left");
    let style =
        ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(total as u64).with_style(style)
}

/// Takes `scene` with both cameras.
pub fn shoot(scene: Scene, conditions: Conditions, seed: u64) -> Result<Shots> {
    let distance_mm = conditions.distance_m * 1e3;
    let drops = conditions.rain.drops()?;
    let visible = VisibleCamera::default().picture(
        &scene,
        &Projector::default(),
        distance_mm,
        drops.as_ref().unwrap_or(&Drops::none()),
        seed,
    )?;
    // Sums over a pixel's share of the scene end a rounding below 0 at times.
    let truth_fine = fine(&scene, Projector::default().field_mm(distance_mm))
        .into_iter()
        .map(|v| v.clamp(0.0, 1.0))
        .collect();
    let mut optics = VirtualOptics::new(scene, distance_mm)?;
    if let Some(drops) = drops {
        optics = optics.in_rain(drops)?;
    }
    let truth = optics.focused_footprint()?.weights().to_vec();
    let nir_spi = expose(&optics, conditions.frames, seed)?;
    Ok(Shots { truth, truth_fine, nir_spi, vis: Image::new(Side::INSTRUMENT, visible) })
}

/// The scene over the field, on 64 x 64 pixels.
fn fine(scene: &Scene, field_mm: f64) -> Vec<f32> {
    const SIDE: usize = 64;
    let pitch_mm = field_mm / SIDE as f64;
    let at_mm = |pixel: usize| (pixel as f64 + 0.5 - SIDE as f64 / 2.0) * pitch_mm;
    (0..SIDE * SIDE)
        .map(|at| scene.mean_over_square(at_mm(at % SIDE), at_mm(at / SIDE), pitch_mm) as f32)
        .collect()
}

/// What a white sheet gives a pixel of NIR-SPI under these conditions: the scale of its images, as a user would measure
/// it.
pub fn white_level(conditions: Conditions, seed: u64) -> Result<f32> {
    let field_mm = Projector::default().field_mm(conditions.distance_m * 1e3);
    let sheet = Scene::new(vec![1.0], 1, field_mm)?.with_surround(1.0)?;
    let image = shoot(sheet, conditions, seed)?.nir_spi;
    let white = image.pixels().iter().sum::<f32>() / image.pixels().len() as f32;
    if white > 0.0 { Ok(white) } else { bail!("a white sheet gives no light: {white} counts") }
}

/// One capture of all patterns by the whole virtual camera, reconstructed.
fn expose(optics: &VirtualOptics, frames: u32, seed: u64) -> Result<Image> {
    let setup = MeasurementSetup::new(&Order::Natural, 1.0)?;
    let captured = record(optics, setup, frames, seed)?;
    let measurements =
        captured.integrated.measurements(&captured.setup, captured.settling.as_ref(), false)?;
    Ok(reconstruct::hadamard(&measurements))
}

/// One calibrated capture by the whole virtual camera.
pub fn record(
    optics: &VirtualOptics,
    setup: MeasurementSetup,
    frames: u32,
    seed: u64,
) -> Result<Capture> {
    let mut session = Session::open(Box::new(MemoryLink::new(optics.camera(seed)?)))?;
    let calibration = Calibration::Measure;
    let options = CaptureOptions { setup, frames: Some(frames), calibration, record: None };
    let mut watch = |_: &Progress| ControlFlow::Continue(());
    let captured = capture(&mut session, &options, &mut watch)?;
    match &captured.ended {
        Ended::Complete => {}
        Ended::Fault(fault) => bail!("the virtual camera switched its LEDs off: {fault}"),
        other => bail!("the capture did not end by itself: {other:?}"),
    }
    // Too little light for a calibration is part of the picture; an answer that came too late is not.
    if let Some(problem @ CalibrationError::Incomplete { .. }) = &captured.calibration_problem {
        bail!("not calibrated: {problem}");
    }
    Ok(captured)
}
