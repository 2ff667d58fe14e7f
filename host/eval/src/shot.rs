//! One picture taken with the virtual camera, from light to image, and one with an ordinary camera.

use crate::error::{EvalError, Result};
use nirspi::calibrate::CalibrationError;
use nirspi::capture::{Calibration, Capture, CaptureOptions, Ended, Progress, capture};
use nirspi::session::Session;
use nirspi::setup::MeasurementSetup;
use nirspi::virtual_camera::{MemoryLink, VirtualOptics};
use nirspi_optics::rain::{Drops, Rainfall};
use nirspi_optics::visible::VisibleCamera;
use nirspi_optics::{Projector, Scene};
use nirspi_recon::{Image, Order, Side, reconstruct};
use std::ops::ControlFlow;

/// The conditions of a picture.
#[derive(Debug, Clone, Copy)]
pub struct Conditions {
    /// Distance of the target.
    pub distance_m: f64,
    /// What falls between camera and target.
    pub rain: Rainfall,
    /// Differential sweeps that are summed.
    pub frames: u32,
}

/// How the pictures of a table are taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exposure {
    /// What falls between camera and target.
    pub rain: Rainfall,
    /// Differential sweeps summed into a picture.
    pub frames: u32,
    /// Seed of the first picture.
    pub seed: u64,
}

/// All 1024 patterns and their complements: 244 times is 20 ms, the paper's T_pre (Table 1).
pub const FRAMES: u32 = 244;

/// What both cameras give of one scene.
pub struct Shots {
    /// What a perfect camera of 32 x 32 pixels would see.
    pub truth: Vec<f32>,
    /// What a perfect camera of 64 x 64 pixels would see.
    pub truth_fine: Vec<f32>,
    /// What the single-pixel camera gives, in ADC counts.
    pub nir_spi: Image,
    /// What an ordinary camera gives.
    pub vis: Image,
}

/// Takes `scene` with both cameras.
///
/// # Errors
/// A scene or distance that the optics refuse, a capture that fails.
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
    let mut optics = VirtualOptics::new(scene, distance_mm)?;
    if let Some(drops) = drops {
        optics = optics.in_rain(drops)?;
    }
    let truth_fine = optics.focused(64);
    let truth = optics.focused_footprint()?.weights().to_vec();
    let nir_spi = expose(&optics, conditions.frames, seed)?;
    Ok(Shots { truth, truth_fine, nir_spi, vis: Image::new(Side::INSTRUMENT, visible) })
}

/// What a white sheet gives a pixel of NIR-SPI under these conditions: the scale of its images, as a user would measure
/// it.
///
/// # Errors
/// A sheet that gives no light, a capture that fails.
pub fn white_level(conditions: Conditions, seed: u64) -> Result<f32> {
    let field_mm = Projector::default().field_mm(conditions.distance_m * 1e3);
    let sheet = Scene::new(vec![1.0], 1, field_mm)?.with_surround(1.0)?;
    let image = shoot(sheet, conditions, seed)?.nir_spi;
    let white = image.pixels().iter().sum::<f32>() / image.pixels().len() as f32;
    if white > 0.0 {
        Ok(white)
    } else {
        failed(format!("a white sheet gives no light: {white} counts"))
    }
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
///
/// # Errors
/// A capture that does not end by itself, or is not calibrated.
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
        Ended::Fault(fault) => {
            return failed(format!("the virtual camera switched its LEDs off: {fault:?}"));
        }
        other => return failed(format!("the capture did not end by itself: {other:?}")),
    }
    // Too little light for a calibration is part of the picture; an answer that came too late is not.
    if let Some(problem @ CalibrationError::Incomplete { .. }) = &captured.calibration_problem {
        return failed(format!("not calibrated: {problem}"));
    }
    Ok(captured)
}

fn failed<T>(why: String) -> Result<T> {
    Err(EvalError::Library(why.into()))
}
