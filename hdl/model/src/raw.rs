//! Records a burst of plain samples.
//!
//! # Invariant
//! Word `t` is the sample of the burst's clock `t`
//! (`golden::raw::a_burst_is_every_sample_from_the_first_clock_of_the_sweep_on`), and only a whole
//! burst can be read (`golden::raw::a_burst_cut_short_is_not_delivered`).

use crate::settings::Settings;
use crate::source::AdcSample;

/// Bit of a raw word: the sample was over range.
const OVER_RANGE_BIT: u16 = 1 << 15;

/// A burst in progress.
#[derive(Debug, Clone)]
pub(crate) struct RawCapture {
    /// Little-endian words.
    bytes: Vec<u8>,
    over_range: u32,
}

impl RawCapture {
    pub(crate) fn start(settings: &Settings) -> Self {
        Self { bytes: Vec::with_capacity(2 * usize::from(settings.raw_length)), over_range: 0 }
    }

    /// Stores the sample of this clock; returns the number of the burst's over-range samples so
    /// far.
    pub(crate) fn take(&mut self, sample: AdcSample) -> u32 {
        let flag = if sample.over_range { OVER_RANGE_BIT } else { 0 };
        self.bytes.extend((sample.code | flag).to_le_bytes());
        self.over_range += u32::from(sample.over_range);
        self.over_range
    }

    /// The burst, once it is whole.
    pub(crate) fn complete(&mut self, settings: &Settings) -> Option<Vec<u8>> {
        (self.bytes.len() == 2 * usize::from(settings.raw_length))
            .then(|| std::mem::take(&mut self.bytes))
    }
}
