//! A small image of the newest frames while a capture runs.

use super::{Observer, Progress, StopCause};
use nirspi_camera::account::LossCounters;
use nirspi_camera::calibration::CalibrationError;
use nirspi_camera::integrate::Integrated;
use nirspi_camera::response::Settling;
use nirspi_camera::setup::MeasurementSetup;
use nirspi_files::clock::Instant;
use nirspi_recon::Image;
use nirspi_recon::reconstruct::{Method, MethodSettings, Reconstruct};
use nirspi_wire::Frame;
use std::ops::ControlFlow;
use std::time::Duration;

/// Time between two images.
const PERIOD: Duration = Duration::from_millis(250);

/// Watches a capture as a function does that is called at least ten times a second and breaks to
/// stop. Four times a second the function also gets an image of the frames since the last one,
/// (32, 32) ADC counts, by `--method hadamard`: the inverse transform with zeros for the patterns
/// that were not shown. This is quick enough for the thread that drains the link.
pub struct Preview<W> {
    watch: W,
    run: Option<Run>,
    made: Instant,
}

/// A run and the frames since the last image.
struct Run {
    setup: MeasurementSetup,
    settling: Option<Settling>,
    method: Box<dyn Reconstruct>,
    newest: Integrated,
}

impl<W: FnMut(&Progress, Option<Image>) -> ControlFlow<StopCause>> Preview<W> {
    /// A preview for this function.
    pub fn new(watch: W) -> Self {
        Self { watch, run: None, made: Instant::now() }
    }
}

impl Run {
    /// The image of the frames since the last one. `None` without frames, and where they cannot be
    /// corrected: the report at the end says why.
    fn image(&mut self) -> Option<Image> {
        let newest = std::mem::replace(&mut self.newest, Integrated::new(&self.setup));
        if newest.frames() == 0 {
            return None;
        }
        let seen = newest.measurements(&self.setup, self.settling.as_ref(), false).ok()?;
        Some(self.method.reconstruct(&seen).ok()?.image)
    }
}

impl<W: FnMut(&Progress, Option<Image>) -> ControlFlow<StopCause>> Observer for Preview<W> {
    fn begins(
        &mut self,
        setup: &MeasurementSetup,
        settling: Option<&Settling>,
        _: Option<&CalibrationError>,
    ) {
        let method = Method::HADAMARD.prepare(&MethodSettings::default()).ok();
        self.run = method.map(|method| Run {
            setup: setup.clone(),
            settling: settling.cloned(),
            method,
            newest: Integrated::new(setup),
        });
    }

    fn frame(&mut self, frame: &Frame<'_>, _: &LossCounters) {
        if let Some(run) = self.run.as_mut().filter(|run| run.newest.fits(frame)) {
            run.newest.add(frame);
        }
    }

    fn watch(&mut self, progress: &Progress) -> ControlFlow<StopCause> {
        let mut image = None;
        if self.made.elapsed() >= PERIOD {
            self.made = Instant::now();
            image = self.run.as_mut().and_then(Run::image);
        }
        (self.watch)(progress, image)
    }
}
