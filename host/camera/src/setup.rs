//! The setup of a measurement: order, number of patterns, timing, sweeps. The host's form of a wire
//! configuration.

use nirspi_recon::{Order, Rows, RowsError, Side};
use nirspi_wire::ready::MAX_SUMMED_SAMPLES;
use nirspi_wire::register::LATENCY_MAX;
use nirspi_wire::{
    ADC_HZ, CLOCKS_PER_PATTERN, Configuration, PATTERNS, PatternOrder, SampleSource, samples::Words,
};
use serde::{Deserialize, Serialize};
use thiserror::Error;

// The reconstruction does not depend on the protocol, so each has the number of LEDs.
const _: () = assert!(Side::INSTRUMENT.pixels() == nirspi_wire::SIDE as usize);

/// One measurement setup, as sent to a camera and stored in a recording.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct MeasurementSetup {
    /// Name of the order, for users.
    pub order: String,
    /// Hadamard rows of [`Side::INSTRUMENT`] in the order shown. Their number is the number of
    /// patterns of a sweep.
    #[serde(with = "shown")]
    pub rows: Rows,
    /// Whether each pattern is followed by its complement.
    pub differential: bool,
    /// Whether sweeps differ so that the faults of LEDs and lines cancel in every four
    /// ([`mode::ALTERNATING`](nirspi_wire::register::mode::ALTERNATING)). Changes nothing unless
    /// `differential`.
    #[serde(default)]
    pub alternating: bool,
    /// ADC clocks for which each pattern is shown.
    pub clocks_per_pattern: u16,
    /// ADC samples excluded at the start of each pattern.
    pub blanked: u16,
    /// ADC clocks from light to sample.
    pub adc_latency: u8,
    /// Number of sweeps summed into one frame.
    pub sweeps: u32,
}

/// A number of a setup that cameras do not accept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("{field} is {found}, expected {min} to {max}")]
pub struct SetupError {
    /// The name of the number.
    pub field: &'static str,
    /// The value found.
    pub found: u32,
    /// The smallest value that a camera accepts.
    pub min: u32,
    /// The largest value that a camera accepts.
    pub max: u32,
}

impl MeasurementSetup {
    /// Checks that a camera accepts this setup. The limits are those of the firmware's `Configure`.
    ///
    /// # Errors
    /// [`SetupError`] names the first number out of range.
    pub fn check(&self) -> Result<(), SetupError> {
        let dwell = self.clocks_per_pattern;
        let limits = [
            ("clocks_per_pattern", u32::from(dwell), 1, u32::from(u16::MAX)),
            ("blanked", u32::from(self.blanked), 0, u32::from(dwell.saturating_sub(1))),
            ("adc_latency", u32::from(self.adc_latency), 0, u32::from(LATENCY_MAX)),
            ("sweeps", self.sweeps, 1, self.most_sweeps()),
        ];
        match limits.into_iter().find(|(_, found, min, max)| !(min..=max).contains(&found)) {
            Some((field, found, min, max)) => Err(SetupError { field, found, min, max }),
            None => Ok(()),
        }
    }

    /// A short name that is the same for all frames of one setup, for tables.
    #[must_use]
    pub fn id(&self) -> String {
        let setup = serde_json::to_value(self).unwrap_or_default();
        format!("{:08x}", nirspi_wire::crc32(setup.to_string().as_bytes()))
    }

    /// The first `round(sampling * 1024)` patterns of `order` (at least one), differential and
    /// alternating, at 25 MHz, with two of five samples blanked.
    ///
    /// # Errors
    /// If the order is not a permutation of the 1024 patterns.
    pub fn new(order: &Order, sampling: f64) -> Result<Self, RowsError> {
        let patterns = (sampling * f64::from(PATTERNS)).round().clamp(1.0, f64::from(PATTERNS));
        Ok(Self {
            order: order.to_string(),
            rows: order.rows(Side::INSTRUMENT)?.first(patterns as usize),
            differential: true,
            alternating: true,
            clocks_per_pattern: CLOCKS_PER_PATTERN,
            blanked: 2,
            adc_latency: 0,
            sweeps: 1,
        })
    }

    /// The same setup with each pattern shown for `clocks_per_pattern` ADC clocks, of which the
    /// first `blanked` samples are excluded.
    #[must_use]
    pub fn timed(self, clocks_per_pattern: u16, blanked: u16) -> Self {
        Self { clocks_per_pattern, blanked, ..self }
    }

    /// Whether the faults of LEDs and lines cancel in every four sweeps.
    #[must_use]
    pub fn alternates(&self) -> bool {
        self.differential && self.alternating
    }

    /// Number of ADC samples summed in each slot.
    #[must_use]
    pub fn window(&self) -> u16 {
        self.clocks_per_pattern.saturating_sub(self.blanked)
    }

    /// Number of ADC clocks of one sweep.
    #[must_use]
    pub fn sweep_clocks(&self) -> u64 {
        let halves = if self.differential { 2 } else { 1 };
        self.rows.len() as u64 * halves * u64::from(self.clocks_per_pattern)
    }

    /// The most sweeps of a frame: the sums of a frame have 32 bits. A measurement of more light has more frames.
    #[must_use]
    pub fn most_sweeps(&self) -> u32 {
        MAX_SUMMED_SAMPLES / u32::from(self.window()).max(1)
    }

    /// The number of sweeps that take about as long as one sweep of all patterns, or the most that a frame can have. Frames
    /// of so many sweeps come as fast, and take as much light, as frames of all patterns.
    #[must_use]
    pub fn sweeps_as_long_as_all(&self) -> u32 {
        let sweeps = (f64::from(PATTERNS) / self.rows.len() as f64).round() as u32;
        sweeps.min(self.most_sweeps())
    }

    /// Duration of one frame at the ADC's rate.
    #[must_use]
    pub fn frame_ns(&self) -> f64 {
        self.sweep_clocks() as f64 * f64::from(self.sweeps) * 1e9 / f64::from(ADC_HZ)
    }

    /// Calls `send` with the wire configuration, which borrows the order table.
    pub fn with_configuration<T>(&self, send: impl FnOnce(Configuration<'_>) -> T) -> T {
        let mut table = vec![0; 2 * self.rows.len()];
        let natural = self.rows.iter().copied().eq(0..self.rows.len() as u32);
        // No side has rows above 65 535.
        let order = match Words::pack(self.rows.iter().map(|&row| row as u16), &mut table) {
            Ok(words) if !natural => PatternOrder::Table(words),
            _ => PatternOrder::Natural,
        };
        send(Configuration {
            order,
            patterns: self.rows.len() as u16,
            differential: self.differential,
            alternating: self.alternating,
            clocks_per_pattern: self.clocks_per_pattern,
            blanked: self.blanked,
            adc_latency: self.adc_latency,
            sweeps: self.sweeps,
            source: SampleSource::Detector,
            over_range_trip: 0,
        })
    }
}

/// Rows in a recording: a list of numbers that is checked when it is read.
mod shown {
    use super::{Rows, Side};
    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    pub fn serialize<S: Serializer>(rows: &Rows, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(rows.iter())
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Rows, D::Error> {
        let rows = Vec::<i64>::deserialize(deserializer)?;
        Rows::new(Side::INSTRUMENT, rows).map_err(D::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_setup_comes_back_from_json_as_it_was() {
        let setup = MeasurementSetup::new(&Order::CakeCutting, 0.3).unwrap();
        let json = serde_json::to_string(&setup).unwrap();
        assert!(json.contains("\"rows\":[0,"), "{json}");
        assert_eq!(serde_json::from_str::<MeasurementSetup>(&json).unwrap(), setup);
    }

    #[test]
    fn a_setup_that_no_camera_takes_names_the_number() {
        let sound = MeasurementSetup::new(&Order::CakeCutting, 0.3).unwrap();
        sound.check().unwrap();
        for (changed, words) in [
            (
                MeasurementSetup { clocks_per_pattern: 0, ..sound.clone() },
                "clocks_per_pattern is 0, expected 1 to 65535",
            ),
            (MeasurementSetup { blanked: 5, ..sound.clone() }, "blanked is 5, expected 0 to 4"),
            (
                MeasurementSetup { adc_latency: 64, ..sound.clone() },
                "adc_latency is 64, expected 0 to 63",
            ),
            (MeasurementSetup { sweeps: 0, ..sound.clone() }, "sweeps is 0, expected 1 to 43690"),
            (
                MeasurementSetup { sweeps: 43_691, ..sound.clone() },
                "sweeps is 43691, expected 1 to 43690",
            ),
        ] {
            assert_eq!(changed.check().unwrap_err().to_string(), words);
        }
    }

    /// Of one pattern a sweep of all would be 1024 sweeps, and with 998 samples each their sum does not fit.
    #[test]
    fn the_default_number_of_sweeps_fits_the_sums_of_a_frame() {
        let setup = MeasurementSetup::new(&Order::Natural, 1.0 / 1024.0).unwrap();
        assert_eq!(setup.sweeps_as_long_as_all(), 1024);
        let slow = setup.timed(1_000, 2);
        assert_eq!(slow.sweeps_as_long_as_all(), (1 << 17) / 998);
        MeasurementSetup { sweeps: slow.sweeps_as_long_as_all(), ..slow }.check().unwrap();
    }

    #[test]
    fn a_setup_with_rows_that_the_instrument_lacks_is_refused_when_it_is_read() {
        let setup = MeasurementSetup::new(&Order::Natural, 2.0 / 1024.0).unwrap();
        let json = serde_json::to_string(&setup).unwrap();
        for (rows, why) in [
            ("[0,1024]", "h_row[1] is 1024, expected 0 to 1023"),
            ("[7,7]", "h_row[1] repeats row 7, first at h_row[0]"),
            ("[]", "h_row is empty"),
        ] {
            let broken = json.replace("[0,1]", rows);
            let error = serde_json::from_str::<MeasurementSetup>(&broken).unwrap_err().to_string();
            assert!(error.contains(why), "{error}");
        }
    }
}
