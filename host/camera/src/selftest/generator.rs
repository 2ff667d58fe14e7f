//! Test frames: the FPGA's generator replaces the ADC, and the host compares every sum of every
//! frame.
//!
//! The compared sums have passed through sequencer, windowing, accumulators, host port, firmware,
//! packets and link, and are known to the last bit.

use super::stream::{Shot, shots};
use crate::check::{Check, Limit};
use crate::session::{Session, SessionError};
use nirspi_wire::register::{TEST_SEED, test_sample};
use nirspi_wire::{CLOCKS_PER_PATTERN, Configuration, PATTERNS, PatternOrder, SampleSource};

/// Name of the check.
pub const NAME: &str = "test frames through the whole chain";

/// Number of frames of each setting.
const FRAMES: u32 = 4;

/// Two very different settings. Their frames last two milliseconds, so that all links but the
/// slowest are fast enough.
const SETTINGS: [Configuration<'static>; 2] = [
    Configuration {
        order: PatternOrder::Natural,
        patterns: PATTERNS,
        differential: true,
        alternating: true,
        clocks_per_pattern: CLOCKS_PER_PATTERN,
        blanked: 2,
        adc_latency: 3,
        sweeps: 25,
        source: SampleSource::TestPattern,
        over_range_trip: 0,
    },
    Configuration {
        order: PatternOrder::Sequency,
        patterns: 1000,
        differential: false,
        alternating: false,
        clocks_per_pattern: 7,
        blanked: 0,
        adc_latency: 63,
        sweeps: 36,
        source: SampleSource::TestPattern,
        over_range_trip: 0,
    },
];

/// Takes the test frames.
pub fn check(session: &mut Session) -> Result<Vec<Check>, SessionError> {
    let mut compared = 0u32;
    let mut wrong = Vec::new();
    for configuration in SETTINGS {
        let found = shots(session, configuration, FRAMES)?;
        let expected = frames(&configuration, FRAMES);
        compared += found.len() as u32;
        wrong.extend(found.iter().filter_map(|shot| difference(shot, &expected)));
    }
    let all = FRAMES * SETTINGS.len() as u32;
    let check = Check::measured(NAME, wrong.len() as f64, "frames differ", Limit::Exactly(0.0));
    Ok(vec![match (compared, wrong.first()) {
        (0, _) => Check::told(NAME, false, "no test frame came"),
        (_, Some(first)) => check.noting(first),
        (_, None) => check.noting(&format!("{compared} of {all} came, and were compared")),
    }])
}

/// The first difference between a frame and its expected values.
fn difference(shot: &Shot, expected: &[Vec<i64>]) -> Option<String> {
    let sequence = shot.sequence;
    let Some(expected) = expected.get(sequence as usize) else {
        return Some(format!("a frame {sequence}, of {}", expected.len()));
    };
    if shot.samples.len() != expected.len() {
        let (found, patterns) = (shot.samples.len(), expected.len());
        return Some(format!("frame {sequence} has {found} samples, expected {patterns}"));
    }
    let (at, (found, expected)) = shot
        .samples
        .iter()
        .zip(expected)
        .enumerate()
        .find(|(_, (found, expected))| found != expected)?;
    Some(format!("frame {sequence}, sample {at}: {found}, expected {expected}"))
}

/// The first `count` frames that the generator must give. The sample of clock `t` of the run
/// belongs to the pattern shown at `t - latency` (`nirspi_wire::register`).
fn frames(configuration: &Configuration<'_>, count: u32) -> Vec<Vec<i64>> {
    let mut period = vec![TEST_SEED];
    loop {
        match period.last().map(|&state| test_sample(state)) {
            Some(next) if next != TEST_SEED => period.push(next),
            _ => break,
        }
    }
    let sample = |clock: u64| -> i64 {
        period.get((clock % period.len() as u64) as usize).copied().map_or(0, i64::from)
    };
    let dwell = u64::from(configuration.clocks_per_pattern);
    let latency = u64::from(configuration.adc_latency);
    let halves = if configuration.differential { 2 } else { 1 };
    let patterns = u64::from(configuration.patterns);
    let reading = |slot: u64| -> i64 {
        let window = u64::from(configuration.blanked)..dwell;
        window.map(|clock| sample(slot * dwell + clock + latency)).sum()
    };
    let sweeps = u64::from(configuration.sweeps);
    (0..u64::from(count))
        .map(|frame| {
            let mut sums = vec![0; usize::from(configuration.patterns)];
            for sweep in frame * sweeps..(frame + 1) * sweeps {
                for (sum, pattern) in sums.iter_mut().zip(0..) {
                    let slot = (sweep * patterns + pattern) * halves;
                    let complement = if halves == 2 { reading(slot + 1) } else { 0 };
                    let difference = reading(slot) - complement;
                    let is_swapped = configuration.alternating && sweep % 2 == 1;
                    *sum += if is_swapped { -difference } else { difference };
                }
            }
            sums
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_count_in_one_sample_is_seen_and_named() {
        let expected = frames(&SETTINGS[0], 2);
        let mut shot = Shot { sequence: 1, samples: expected[1].clone() };
        assert_eq!(difference(&shot, &expected), None);
        shot.samples[700] += 1;
        let found = difference(&shot, &expected).unwrap();
        assert!(found.starts_with("frame 1, sample 700: "), "{found}");
        shot.samples.pop();
        assert!(difference(&shot, &expected).unwrap().contains("1023 samples"));
    }

    #[test]
    fn the_frames_of_a_run_are_all_different() {
        let frames = frames(&SETTINGS[1], 3);
        assert!(frames[0] != frames[1] && frames[1] != frames[2] && frames[0] != frames[2]);
    }
}
