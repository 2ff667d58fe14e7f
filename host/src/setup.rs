//! What is measured: order, number of patterns, timing, sweeps. The host's side of a wire configuration.

use nirspi_recon::{Order, OrderError, Side};
use nirspi_wire::{
    ADC_HZ, CLOCKS_PER_PATTERN, Configuration, PATTERNS, PatternOrder, SampleSource, samples::Words,
};
use serde::{Deserialize, Serialize};

/// One measurement setup, as it is sent to a camera and kept in a recording.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct MeasurementSetup {
    /// Name of the order, for people.
    pub order: String,
    /// Natural-order Hadamard row shown k-th; its length is the number of patterns of a sweep.
    pub rows: Vec<u16>,
    /// Whether each pattern is followed by its complement.
    pub differential: bool,
    /// ADC clocks that each pattern is shown.
    pub clocks_per_pattern: u16,
    /// ADC samples left out at the start of each pattern.
    pub blanked: u16,
    /// ADC clocks from light to sample.
    pub adc_latency: u8,
    /// Sweeps summed into one frame.
    pub sweeps: u32,
}

impl MeasurementSetup {
    /// The first `round(sampling * 1024)` patterns of `order` (at least one), differential, at 25 MHz, two
    /// of five samples blanked.
    ///
    /// # Errors
    /// If the order is no permutation of the 1024 patterns.
    pub fn new(order: &Order, sampling: f64) -> Result<Self, OrderError> {
        let mut rows: Vec<u16> =
            order.rows(Side::INSTRUMENT)?.iter().map(|&row| row as u16).collect();
        let patterns = (sampling * f64::from(PATTERNS)).round().clamp(1.0, f64::from(PATTERNS));
        rows.truncate(patterns as usize);
        Ok(Self {
            order: order.to_string(),
            rows,
            differential: true,
            clocks_per_pattern: CLOCKS_PER_PATTERN,
            blanked: 2,
            adc_latency: 0,
            sweeps: 1,
        })
    }

    /// ADC samples summed in each slot.
    #[must_use]
    pub fn window(&self) -> u16 {
        self.clocks_per_pattern.saturating_sub(self.blanked)
    }

    /// ADC clocks of one sweep.
    #[must_use]
    pub fn sweep_clocks(&self) -> u64 {
        let halves = if self.differential { 2 } else { 1 };
        self.rows.len() as u64 * halves * u64::from(self.clocks_per_pattern)
    }

    /// Duration of one frame at the ADC's rate.
    #[must_use]
    pub fn frame_ns(&self) -> f64 {
        self.sweep_clocks() as f64 * f64::from(self.sweeps) * 1e9 / f64::from(ADC_HZ)
    }

    /// Hands the wire configuration to `send`; it borrows the order table.
    pub fn with_configuration<T>(&self, send: impl FnOnce(Configuration<'_>) -> T) -> T {
        let mut table = vec![0; 2 * self.rows.len()];
        let natural = self.rows.iter().zip(0..).all(|(&row, k): (&u16, u16)| row == k);
        let order = match Words::pack(self.rows.iter().copied(), &mut table) {
            Ok(words) if !natural => PatternOrder::Table(words),
            _ => PatternOrder::Natural,
        };
        send(Configuration {
            order,
            patterns: self.rows.len() as u16,
            differential: self.differential,
            clocks_per_pattern: self.clocks_per_pattern,
            blanked: self.blanked,
            adc_latency: self.adc_latency,
            sweeps: self.sweeps,
            source: SampleSource::Detector,
            over_range_trip: 0,
        })
    }
}
