//! Frames -> measurements: sums the frames of a run, undoes the settling leak, names the rows.

use crate::calibrate::Settling;
use crate::setup::MeasurementSetup;
use nirspi_recon::{LeakError, MeasurementError, Measurements, Side, Sweep};
use nirspi_wire::{Frame, FrameFlags};

/// The sum of the frames of one run, in ADC counts.
#[derive(Debug, Clone)]
pub struct Integrated {
    sums: Vec<i64>,
    frames: u64,
    sweeps: u64,
    flags: FrameFlags,
}

impl Integrated {
    /// Nothing summed yet.
    #[must_use]
    pub fn new(setup: &MeasurementSetup) -> Self {
        let sums = vec![0; setup.rows.len()];
        Self { sums, frames: 0, sweeps: 0, flags: FrameFlags::default() }
    }

    /// Whether a frame has the setup's number of samples.
    #[must_use]
    pub fn fits(&self, frame: &Frame<'_>) -> bool {
        frame.samples.len() == self.sums.len()
    }

    /// Adds one frame that [fits](Self::fits).
    pub fn add(&mut self, frame: &Frame<'_>) {
        for (sum, sample) in self.sums.iter_mut().zip(frame.samples.iter()) {
            *sum = sum.saturating_add(sample);
        }
        self.frames += 1;
        self.sweeps += u64::from(frame.sweeps);
        self.flags = self.flags.with(frame.flags);
    }

    /// Frames summed.
    #[must_use]
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// What the frames' flags say against them, a line each.
    #[must_use]
    pub fn warnings(&self) -> Vec<&'static str> {
        [
            (
                FrameFlags::OVER_RANGE,
                "some samples were outside the ADC's range: too much light, or gain",
            ),
            (
                FrameFlags::OVERFLOW,
                "a sum has overflowed: fewer sweeps a frame, or shorter patterns",
            ),
            (
                FrameFlags::TEST_SOURCE,
                "the samples are those of the test generator, not of the detector",
            ),
        ]
        .into_iter()
        .filter(|(flag, _)| self.flags.contains(*flag))
        .map(|(_, warning)| warning)
        .collect()
    }

    /// Mean ADC counts of one sample, for each pattern in the order shown; 0 where nothing was summed.
    #[must_use]
    pub fn means(&self, setup: &MeasurementSetup) -> Vec<f64> {
        let samples = self.sweeps as f64 * f64::from(setup.window());
        let scale = if samples > 0.0 { 1.0 / samples } else { 0.0 };
        self.sums.iter().map(|&sum| sum as f64 * scale).collect()
    }

    /// Measurements in ADC counts. With the camera's response the dark level of single readings is subtracted, and what
    /// leaked from slot to slot is put back unless `keep_leak`; without it the dark level is estimated.
    ///
    /// # Errors
    /// [`IntegrateError`] where the setup's rows are not ones of the instrument, or the response cannot be undone.
    pub fn measurements(
        &self,
        setup: &MeasurementSetup,
        settling: Option<&Settling>,
        keep_leak: bool,
    ) -> Result<Measurements, IntegrateError> {
        let rows: Vec<i64> = setup.rows.iter().map(|&row| i64::from(row)).collect();
        let mut values = self.means(setup);
        let leak = settling
            .filter(|_| !keep_leak)
            .map(|settling| settling.leak(setup.clocks_per_pattern, setup.blanked))
            .transpose()?;
        if setup.differential {
            if let Some(leak) = &leak {
                leak.correct_differential(&mut values);
            }
            return Ok(Measurements::from_differential(Side::INSTRUMENT, &rows, &values)?);
        }
        let dark = settling.map_or(0.0, |settling| settling.dark_counts);
        values.iter_mut().for_each(|value| *value -= dark);
        if let Some(leak) = &leak {
            leak.correct_single(&mut values, Sweep::Repeating);
        }
        let mut measurements = Measurements::from_single(Side::INSTRUMENT, &rows, &values)?;
        if settling.is_none() {
            measurements.remove_dark_level();
        }
        Ok(measurements)
    }
}

/// Why a sum of frames gives no measurements.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum IntegrateError {
    /// The setup.
    #[error(transparent)]
    Measurements(#[from] MeasurementError),
    /// The camera's response.
    #[error(transparent)]
    Leak(#[from] LeakError),
}
