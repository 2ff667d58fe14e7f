//! How strong the light at the detector is, as the camera itself measures it.

use nirspi_wire::{ADC_BITS, Status};
use serde::Serialize;
use std::fmt;

/// What the detector saw in two successive frames, in ADC counts of a single sample. It helps to
/// align the optics and to set the gain.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Signal {
    /// Mean of the samples: light of the LEDs, ambient light and the ADC's zero.
    pub level_counts: f64,
    /// Root mean square of what the readings of the patterns differ by, without the noise.
    pub signal_counts: f64,
    /// Root mean square of the noise of a reading. A moving scene counts as noise.
    pub noise_counts: f64,
    /// Signal to noise: -20 dB where the noise hides the signal, 120 dB where no reading changes.
    pub snr_db: f64,
    /// Share of the samples that were outside the ADC's range, from 0 to 1.
    pub over_range_share: f64,
}

impl Signal {
    /// The signal of this run or the last one; `None` before a run has shown two frames, and from a
    /// camera without a meter.
    #[must_use]
    pub fn of(status: &Status) -> Option<Self> {
        let signal = status.signal?;
        let counts = |milli_counts: u32| f64::from(milli_counts) / 1e3;
        Some(Self {
            level_counts: counts(signal.mean_milli_counts),
            signal_counts: counts(signal.signal_milli_counts),
            noise_counts: counts(signal.noise_milli_counts),
            snr_db: f64::from(signal.snr_centi_db) / 100.0,
            over_range_share: f64::from(signal.over_range_ppm) / 1e6,
        })
    }
}

/// `signal 240.1 counts, noise 4.7 counts (34.2 dB); level 5321 of 16384 counts`.
impl fmt::Display for Signal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { level_counts, signal_counts, noise_counts, snr_db, over_range_share } = self;
        let range = 1_u32 << ADC_BITS;
        write!(f, "signal {signal_counts:.1} counts, noise {noise_counts:.1} counts ")?;
        write!(f, "({snr_db:.1} dB); level {level_counts:.0} of {range} counts")?;
        if *over_range_share > 0.0 {
            write!(f, ", {:.2} % of the samples over range", 100.0 * over_range_share)?;
        }
        Ok(())
    }
}
