//! The response of a camera to a step of its light: latency, settling, and the leak that follows.

use crate::sag;
use nirspi_recon::{Leak, LeakError};
use nirspi_wire::ADC_MAX;
use nirspi_wire::register::LATENCY_MAX;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// The longest response in ADC clocks: as long as the LEDs stay on in the calibration burst.
pub const LONGEST: u16 = 128;

/// The largest value of a response. Neither overshoot nor the noise of a dim burst exceeds its step
/// by this factor.
const LARGEST_RESPONSE: f64 = 4.0;

/// The measured response of LEDs, amplifier and ADC.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Settling {
    /// Latency from light to sample, in whole clocks.
    pub adc_latency: u8,
    /// Step response by clock, from the first sample that shows the step to the sample that has
    /// settled at 1.
    pub response: Vec<f64>,
    /// Reading of a sample with all LEDs off: daylight and the ADC's offset.
    pub dark_counts: f64,
    /// Reading with all LEDs on, minus the reading with all LEDs off.
    pub step_counts: f64,
    /// Standard deviation of one sample.
    pub noise_counts: f64,
    /// Share of its light that a tile of LEDs loses while all of them are lit ([`crate::sag`]).
    #[serde(default)]
    pub tile_sag: f64,
}

/// A number that no burst can give.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{field} is {found}, expected {expected}")]
pub struct SettlingError {
    /// The name of the number.
    pub field: String,
    /// The number found.
    pub found: String,
    /// The values that a burst can give.
    pub expected: String,
}

impl Settling {
    /// Shares of a slot's light that are read in its own slot and in each later slot.
    ///
    /// # Errors
    /// If almost none of a slot's light is read in its own slot.
    pub fn leak(&self, clocks_per_pattern: u16, blanked: u16) -> Result<Leak, LeakError> {
        let dwell = i64::from(clocks_per_pattern);
        let step = |n: i64| -> f64 {
            match usize::try_from(n) {
                Err(_) => 0.0,
                Ok(n) => self.response.get(n).copied().unwrap_or(1.0),
            }
        };
        let window = i64::from(blanked)..dwell;
        let samples = (window.end - window.start) as f64;
        let slots = self.response.len() as i64 / dwell + 1;
        let mut taps: Vec<f64> = (0..=slots + 1)
            .map(|slot| {
                let passed = |n: i64| step(n + slot * dwell) - step(n + (slot - 1) * dwell);
                window.clone().map(passed).sum::<f64>() / samples
            })
            .collect();
        // Slots after the response's last sample contain no light.
        while taps.len() > 1 && taps.last() == Some(&0.0) {
            taps.pop();
        }
        Leak::new(taps)
    }

    /// Checks that a burst can give this calibration. Every calibration read from a file must pass.
    ///
    /// # Errors
    /// [`SettlingError`] names the first number that is out of range.
    pub fn check(&self) -> Result<(), SettlingError> {
        let wrong = |field: &str, found: &dyn ToString, expected: String| SettlingError {
            field: field.to_owned(),
            found: found.to_string(),
            expected,
        };
        if self.adc_latency > LATENCY_MAX {
            return Err(wrong("adc_latency", &self.adc_latency, format!("0 to {LATENCY_MAX}")));
        }
        let length = self.response.len();
        if length > usize::from(LONGEST) {
            let expected = format!("at most {LONGEST} samples");
            return Err(wrong("length of the response", &length, expected));
        }
        for (at, response) in self.response.iter().enumerate() {
            // NaN is outside every range.
            if !(-LARGEST_RESPONSE..=LARGEST_RESPONSE).contains(response) {
                let expected = format!("-{LARGEST_RESPONSE} to {LARGEST_RESPONSE}");
                return Err(wrong(&format!("response[{at}]"), response, expected));
            }
        }
        // The response begins with the first sample that shows the step.
        if let Some(first) = self.response.first().filter(|&&first| first <= 0.0) {
            return Err(wrong("response[0]", first, "more than 0".to_owned()));
        }
        let counts = f64::from(ADC_MAX);
        for (field, found, least) in [
            ("dark_counts", self.dark_counts, 0.0),
            // The step of a burst that is too dim may have either sign.
            ("step_counts", self.step_counts, -counts),
            ("noise_counts", self.noise_counts, 0.0),
        ] {
            if !(least..=counts).contains(&found) {
                return Err(wrong(field, &found, format!("{least} to {counts}")));
            }
        }
        if !(0.0..=sag::LARGEST).contains(&self.tile_sag) {
            return Err(wrong("tile_sag", &self.tile_sag, format!("0 to {}", sag::LARGEST)));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_calibration_that_no_burst_gives_names_the_number() {
        let sound = Settling {
            adc_latency: 6,
            response: vec![0.4, 0.9],
            dark_counts: 2048.0,
            step_counts: 8000.0,
            noise_counts: 18.5,
            tile_sag: 0.0165,
        };
        sound.check().unwrap();
        // A chain without any delay settles at once.
        Settling { response: Vec::new(), ..sound.clone() }.check().unwrap();
        for (changed, words) in [
            (Settling { adc_latency: 64, ..sound.clone() }, "adc_latency is 64, expected 0 to 63"),
            (
                Settling { response: vec![1.0; 129], ..sound.clone() },
                "length of the response is 129",
            ),
            (Settling { response: vec![0.0], ..sound.clone() }, "response[0] is 0, expected more"),
            (Settling { response: vec![0.5, f64::NAN], ..sound.clone() }, "response[1] is NaN"),
            (Settling { response: vec![1e300], ..sound.clone() }, "expected -4 to 4"),
            (
                Settling { dark_counts: -1.0, ..sound.clone() },
                "dark_counts is -1, expected 0 to 16383",
            ),
            (Settling { step_counts: f64::INFINITY, ..sound.clone() }, "step_counts is inf"),
            (Settling { noise_counts: 1e5, ..sound.clone() }, "noise_counts is 100000"),
            (
                Settling { tile_sag: f64::NAN, ..sound.clone() },
                "tile_sag is NaN, expected 0 to 0.5",
            ),
        ] {
            let error = changed.check().unwrap_err().to_string();
            assert!(error.contains(words), "{error}, expected {words}");
        }
    }
}
