//! Measures a flat field in front of a white sheet, and a dark frame with the lens covered.

use super::{Calibration, CaptureError, CaptureOptions, Ended, Progress, StopCause, capture};
use nirspi_camera::calibration::{FlatField, FramesError, Measured, Sweeps, pattern_noise};
use nirspi_camera::integrate::IntegrateError;
use nirspi_camera::response::Settling;
use nirspi_camera::session::Session;
use nirspi_camera::setup::MeasurementSetup;
use nirspi_recon::{Image, reconstruct};
use std::ops::ControlFlow;
use thiserror::Error;

/// Noise of a pixel of the white sheet, as a share of white. Above this noise a flat field would
/// make images worse.
const NOISIEST: f64 = 0.05;

/// Why there is no flat field. `Display` is one line.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FlatFieldError {
    /// The camera could not measure.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// The frames give no measurements.
    #[error(transparent)]
    Integrate(#[from] IntegrateError),
    /// Frames are missing.
    #[error("{received} of {asked} sweeps were received before the capture ended, expected all")]
    Ended {
        /// Frames received.
        received: u64,
        /// Frames requested.
        asked: u32,
    },
    /// The image is not that of a white sheet.
    #[error(transparent)]
    Frames(#[from] FramesError),
    /// There is too little light for this number of sweeps.
    #[error(
        "the noise of a pixel is {:.1} % of white after {sweeps} sweeps, expected at most {:.0} %: hold the sheet nearer or \
         sum more sweeps", 100.0 * noise, 100.0 * NOISIEST
    )]
    Noisy {
        /// Noise divided by white.
        noise: f64,
        /// Sweeps summed.
        sweeps: u32,
    },
    /// The LEDs differ by less than the flat field can measure.
    #[error(
        "the LEDs differ by {:.2} % and the flat field would leave {:.2} %: no flat field is needed, or one of more sweeps",
        100.0 * before, 100.0 * after
    )]
    NothingGained {
        /// Fixed pattern without the flat field.
        before: f64,
        /// Fixed pattern with the flat field.
        after: f64,
    },
}

/// Takes pictures with a camera whose latency and settling are known.
struct Camera<'c> {
    session: &'c mut Session,
    setup: &'c MeasurementSetup,
    settling: &'c Settling,
    watch: &'c mut dyn FnMut(&Progress) -> ControlFlow<StopCause>,
}

impl Camera<'_> {
    fn image(&mut self, sweeps: u32) -> Result<Image, FlatFieldError> {
        let options = CaptureOptions {
            setup: self.setup.clone(),
            frames: Some(sweeps),
            calibration: Calibration::Kept(self.settling.clone()),
            record: None,
        };
        let captured = capture(self.session, &options, self.watch)?;
        if !matches!(captured.ended, Ended::Complete) || !captured.counters.is_complete() {
            let received = captured.counters.received;
            return Err(FlatFieldError::Ended { received, asked: sweeps });
        }
        let settling = captured.settling.as_ref();
        let measurements = captured.integrated.measurements(&captured.setup, settling, false)?;
        Ok(reconstruct::hadamard(&measurements))
    }

    /// Two images of `sweeps` sweeps each, and the rms noise of one of their pixels.
    fn pair(&mut self, sweeps: u32) -> Result<(Image, Image, f64), FlatFieldError> {
        let (a, b) = (self.image(sweeps)?, self.image(sweeps)?);
        let squares = a.pixels().iter().zip(b.pixels()).map(|(a, b)| f64::from(a - b).powi(2));
        let noise = (squares.sum::<f64>() / 2.0 / a.pixels().len() as f64).sqrt();
        Ok((a, b, noise))
    }
}

/// Measures the flat field in front of a white sheet that fills the field. `setup` must have all
/// patterns and their complements. `watch` is called while frames arrive and may break to stop.
///
/// # Errors
/// [`FlatFieldError`] if frames are missing, the sheet is too dim or does not fill the field, or
/// the flat field would gain nothing.
pub fn measure_flat_field(
    session: &mut Session,
    setup: &MeasurementSetup,
    settling: &Settling,
    sweeps: Sweeps,
    watch: &mut dyn FnMut(&Progress) -> ControlFlow<StopCause>,
) -> Result<Measured, FlatFieldError> {
    let mut camera = Camera { session, setup, settling, watch };
    let white = camera.image(sweeps.map)?;
    let (a, b, check_noise) = camera.pair(sweeps.check)?;
    let noise_counts = check_noise * (f64::from(sweeps.check) / f64::from(sweeps.map)).sqrt();
    let flat = FlatField::of_white(&white, noise_counts as f32)?;
    let mean = white.pixels().iter().map(|&v| f64::from(v)).sum::<f64>() / 1024.0;
    let noise = noise_counts / mean;
    if noise > NOISIEST {
        return Err(FlatFieldError::Noisy { noise, sweeps: sweeps.map });
    }
    let pattern_before = pattern_noise(&a, &b);
    let pattern_after = pattern_noise(&flat.correct(&a), &flat.correct(&b));
    if pattern_after >= pattern_before {
        let (before, after) = (pattern_before, pattern_after);
        return Err(FlatFieldError::NothingGained { before, after });
    }
    Ok(Measured { flat, pattern_before, pattern_after, noise })
}

/// Measures the dark frame with the lens covered, and returns the flat field with the dark frame.
/// `sweeps` sweeps are summed twice.
///
/// # Errors
/// [`FlatFieldError`] if frames are missing, or the lens is not covered.
pub fn measure_dark(
    session: &mut Session,
    setup: &MeasurementSetup,
    settling: &Settling,
    flat: FlatField,
    sweeps: u32,
    watch: &mut dyn FnMut(&Progress) -> ControlFlow<StopCause>,
) -> Result<FlatField, FlatFieldError> {
    let mut camera = Camera { session, setup, settling, watch };
    let (a, b, noise) = camera.pair(sweeps)?;
    let mean = a.pixels().iter().zip(b.pixels()).map(|(a, b)| (a + b) / 2.0).collect();
    let dark = Image::new(a.side(), mean);
    Ok(flat.with_dark(&dark, (noise / 2.0_f64.sqrt()) as f32)?)
}
