//! Measures the ADC's latency by stepping the FPGA's setting.
//!
//! All LEDs go on and off in slots of [`HALF_PERIOD`] clocks, and only the last clock of each slot
//! counts. Sweeps alternate (on, off, off, on), so that the charge of the lines cancels, and every
//! second slot is followed by a change. At a setting below the true latency, the FPGA takes an earlier sample of settled light
//! as the last clock's sample. At a setting above the true latency, the FPGA takes a sample from
//! after the change, and the difference of on and off becomes smaller. The last setting with the
//! full difference is the latency. The raw burst, which does not use the setting, must give the
//! same latency.

use super::stream::shots;
use crate::calibration::{HALF_PERIOD, ONSET};
use crate::check::{Check, Limit};
use crate::response::Settling;
use crate::session::{Session, SessionError};
use nirspi_wire::register::LATENCY_MAX;
use nirspi_wire::{Configuration, PatternOrder, SampleSource};

/// Name of the check.
pub const NAME: &str = "ADC latency by stepping";

/// Number of sweeps of each step: half a millisecond.
const SWEEPS: u32 = 256;
/// Number of frames of each step. The last sample of the last frame is of the dark after the run,
/// at any setting.
const FRAMES: u32 = 2;

/// An edge must exceed the noise by this many standard deviations, which noise alone does three
/// times in ten million.
const SIGMAS: f64 = 5.0;

/// Steps through all settings. `burst` is the result of the raw bursts.
pub fn check(session: &mut Session, burst: &Settling) -> Result<Vec<Check>, SessionError> {
    let from_burst = burst.adc_latency;
    let noise = burst.noise_counts * (2.0 / f64::from(SWEEPS)).sqrt();
    if SIGMAS * noise > ONSET * burst.step_counts {
        let reason = format!("too little light for a noise of {:.1} counts", burst.noise_counts);
        return Ok(vec![Check::skipped(NAME, &reason)]);
    }
    let mut differences = Vec::with_capacity(usize::from(LATENCY_MAX) + 1);
    for adc_latency in 0..=LATENCY_MAX {
        let configuration = Configuration {
            order: PatternOrder::Natural,
            patterns: 1,
            differential: true,
            alternating: true,
            clocks_per_pattern: HALF_PERIOD,
            blanked: HALF_PERIOD - 1,
            adc_latency,
            sweeps: SWEEPS,
            source: SampleSource::Detector,
            over_range_trip: 0,
        };
        let found = shots(session, configuration, FRAMES)?;
        let Some(sample) = found.first().and_then(|shot| shot.samples.first()) else {
            let problem = format!("no frame at setting {adc_latency}");
            return Ok(vec![Check::told(NAME, false, &problem)]);
        };
        differences.push(*sample as f64);
    }
    Ok(vec![match edge(&differences) {
        None => Check::told(NAME, false, "no edge at any setting: the light does not follow it"),
        Some(latency) => {
            let limit = Limit::Exactly(from_burst.into());
            let check = Check::measured(NAME, latency.into(), "clocks", limit);
            if latency == from_burst {
                check.noting("as the raw burst says")
            } else {
                check.noting("the raw burst says otherwise: the FPGA's latency setting is off")
            }
        }
    }])
}

/// The last setting before the difference of on and off falls; `None` if the difference does not
/// fall as one edge.
fn edge(differences: &[f64]) -> Option<u8> {
    let full = differences.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let fallen: Vec<bool> =
        differences.iter().map(|difference| 1.0 - difference / full > ONSET).collect();
    let first = fallen.iter().position(|&fallen| fallen)?;
    let falls_once = fallen.iter().skip(first).all(|&fallen| fallen);
    (full > 0.0 && falls_once).then(|| first.checked_sub(1)).flatten().map(|last| last as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Differences around a true latency, of light that keeps the share `rest` of a change in each
    /// clock.
    fn differences(latency: usize, rest: f64) -> Vec<f64> {
        let fallen = |past: usize| 1.0 - rest.powi(past as i32);
        (0..=usize::from(LATENCY_MAX))
            .map(|setting| 5000.0 * (1.0 - fallen(setting.saturating_sub(latency))))
            .collect()
    }

    #[test]
    fn the_edge_is_found_wherever_it_is() {
        for latency in [0, 1, 6, 40, 62] {
            for rest in [0.0, 0.5, 0.9] {
                assert_eq!(edge(&differences(latency, rest)), Some(latency as u8), "{rest}");
            }
        }
    }

    #[test]
    fn no_light_or_light_that_does_not_follow_has_no_edge() {
        assert_eq!(edge(&[5000.0; 64]), None);
        assert_eq!(edge(&[0.0; 64]), None);
        let mut twice = differences(20, 0.1);
        twice[50] = 5000.0;
        assert_eq!(edge(&twice), None);
    }
}
