//! Frames -> measurements: sums the frames of a run, undoes the settling leak, names the rows.

use crate::setup::MeasurementSetup;
use nirspi_recon::{Leak, MeasurementError, Measurements, Side, Sweep};
use nirspi_wire::{Frame, FrameFlags};

/// The sum of the frames of one run, in ADC counts.
#[derive(Debug, Clone)]
pub struct Integrated {
    sums: Vec<i64>,
    frames: u64,
    sweeps: u64,
    flags: FrameFlags,
}

/// A frame that does not belong to the setup.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a frame of {found} samples, expected {expected} as configured")]
pub struct ForeignFrame {
    /// Samples of the frame.
    pub found: usize,
    /// Patterns of the setup.
    pub expected: usize,
}

impl Integrated {
    /// Nothing summed yet.
    #[must_use]
    pub fn new(setup: &MeasurementSetup) -> Self {
        let sums = vec![0; setup.rows.len()];
        Self { sums, frames: 0, sweeps: 0, flags: FrameFlags::default() }
    }

    /// Adds one frame.
    ///
    /// # Errors
    /// [`ForeignFrame`] if it has another number of samples; nothing is added then.
    pub fn add(&mut self, frame: &Frame<'_>) -> Result<(), ForeignFrame> {
        let (found, expected) = (frame.samples.len(), self.sums.len());
        if found != expected {
            return Err(ForeignFrame { found, expected });
        }
        for (sum, sample) in self.sums.iter_mut().zip(frame.samples.iter()) {
            *sum = sum.saturating_add(sample);
        }
        self.frames += 1;
        self.sweeps += u64::from(frame.sweeps);
        self.flags = self.flags.with(frame.flags);
        Ok(())
    }

    /// Frames summed.
    #[must_use]
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Flags that any of the frames had.
    #[must_use]
    pub fn flags(&self) -> FrameFlags {
        self.flags
    }

    /// Mean ADC counts of one sample, for each pattern in the order shown; 0 where nothing was summed.
    #[must_use]
    pub fn means(&self, setup: &MeasurementSetup) -> Vec<f64> {
        let samples = self.sweeps as f64 * f64::from(setup.window());
        let scale = if samples > 0.0 { 1.0 / samples } else { 0.0 };
        self.sums.iter().map(|&sum| sum as f64 * scale).collect()
    }

    /// Measurements in ADC counts, with what leaked from slot to slot put back where a leak is given.
    ///
    /// # Errors
    /// [`MeasurementError`] where the setup's rows are not ones of the instrument.
    pub fn measurements(
        &self,
        setup: &MeasurementSetup,
        leak: Option<&Leak>,
    ) -> Result<Measurements, MeasurementError> {
        let rows: Vec<i64> = setup.rows.iter().map(|&row| i64::from(row)).collect();
        let mut values = self.means(setup);
        match leak {
            Some(leak) if setup.differential => leak.correct_differential(&mut values),
            Some(leak) => leak.correct_single(&mut values, Sweep::Repeating),
            None => {}
        }
        if setup.differential {
            Measurements::from_differential(Side::INSTRUMENT, &rows, &values)
        } else {
            Measurements::from_single(Side::INSTRUMENT, &rows, &values)
        }
    }
}
