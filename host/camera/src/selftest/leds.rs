//! Checks the LEDs by their light at the detector, because no other sensor measures their current.
//!
//! All patterns are shown slowly, once alone (`P`) and once with their complements (`P - N`). Two
//! checks follow:
//!
//! * The inverse Hadamard transform of the differences is the light of each LED. Sums along rows
//!   and columns are the light that follows each *line*. A stuck or broken line leaves the light of
//!   its LEDs equal in pattern and complement, or adds the light to the sum of another line, and
//!   its own sum vanishes.
//! * Pattern and complement together light every LED once, so `P + N` must be the same for every
//!   pattern. Pattern 0 lights all LEDs at once, every other pattern lights half. If the LEDs'
//!   supply drops under load, the halves add up to more.

use super::stream::shots;
use crate::check::{Check, Limit};
use crate::session::{Session, SessionError};
use nirspi_recon::{FwhtLengthError, fwht};
use nirspi_wire::{Configuration, PATTERNS, PatternOrder, SIDE, SampleSource};
use std::fmt;

/// Name of the check of the lines.
pub const LINES: &str = "LED lines";
/// Name of the check of the supply.
pub const SUPPLY: &str = "LED supply";

/// Clocks of a pattern, enough for any light to settle during the blanked clocks.
const CLOCKS: u16 = 64;
const BLANKED: u16 = 32;
const SWEEPS: u32 = 16;
const FRAMES: u32 = 2;
/// Number of samples of each reading.
const SAMPLES: f64 = (FRAMES * SWEEPS * (CLOCKS - BLANKED) as u32) as f64;
/// Least light of a line, as a share of the mean line. The lines of an array differ far less on an
/// evenly lit target.
const MIN_LINE_SHARE: f64 = 0.05;
/// The largest difference between pattern 0 and the sum of pattern and complement, a limit for the
/// drop of the supply: twice the deviation that an image of 8 bits would show, without noise.
const MAX_DEVIATION: f64 = 0.02;
/// The limit allows noise of this many standard deviations, which noise alone exceeds once in two
/// thousand self-tests of 1023 patterns.
const SIGMAS: f64 = 5.0;

fn configuration(differential: bool, adc_latency: u8) -> Configuration<'static> {
    Configuration {
        order: PatternOrder::Natural,
        patterns: PATTERNS,
        differential,
        // Column line 0 is the same in all patterns, unless sweeps invert the lines.
        alternating: differential,
        clocks_per_pattern: CLOCKS,
        blanked: BLANKED,
        adc_latency,
        sweeps: SWEEPS,
        source: SampleSource::Detector,
        over_range_trip: 0,
    }
}

/// Mean ADC counts of a sample, by pattern of all; `None` if no frame arrived.
pub(super) fn means(
    session: &mut Session,
    configuration: Configuration<'_>,
    frames: u32,
) -> Result<Option<Vec<f64>>, SessionError> {
    let found = shots(session, configuration, frames)?;
    let whole: Vec<_> =
        found.iter().filter(|shot| shot.samples.len() == usize::from(PATTERNS)).collect();
    if whole.is_empty() {
        return Ok(None);
    }
    let Configuration { clocks_per_pattern, blanked, sweeps, .. } = configuration;
    let samples = whole.len() as f64 * f64::from(sweeps) * f64::from(clocks_per_pattern - blanked);
    let sum = |pattern: usize| -> f64 {
        whole.iter().filter_map(|shot| shot.samples.get(pattern)).map(|&s| s as f64).sum()
    };
    Ok(Some((0..usize::from(PATTERNS)).map(|pattern| sum(pattern) / samples).collect()))
}

/// Both checks, at the latency setting that places the windows correctly. `noise_counts` is the
/// noise of one sample.
pub fn check(
    session: &mut Session,
    latency: u8,
    noise_counts: f64,
) -> Result<Vec<Check>, SessionError> {
    let (Some(single), Some(pairs)) = (
        means(session, configuration(false, latency), FRAMES)?,
        means(session, configuration(true, latency), FRAMES)?,
    ) else {
        return Ok([LINES, SUPPLY].map(|name| Check::told(name, false, "no frame came")).to_vec());
    };
    // The means are of all patterns, whose number is a power of two.
    let Ok(dead) = dead_lines(&pairs) else {
        return Ok([LINES, SUPPLY]
            .map(|name| Check::told(name, false, "not all patterns came"))
            .to_vec());
    };
    let lines = Check::measured(LINES, dead.count() as f64, "without light", Limit::Exactly(0.0));
    if dead.count() > 0 {
        let note = format!(
            "{dead}: stuck, broken, or the target is dark there; test with a white sheet before the \
             camera (nirspi dev virtual --scene white)"
        );
        return Ok(vec![lines.noting(&note), Check::skipped(SUPPLY, "needs all lines")]);
    }
    // Four readings: P and P - N, each of the pattern and of pattern 0.
    let noise = noise_counts * (12.0 / SAMPLES).sqrt();
    Ok(vec![lines.noting("64 lines follow their patterns"), supply(&single, &pairs, noise)])
}

fn dead_lines(pairs: &[f64]) -> Result<DeadLines, FwhtLengthError> {
    let side = usize::from(SIDE);
    let mut leds = pairs.to_vec();
    fwht(&mut leds)?;
    let row = |r: usize| -> f64 { leds.iter().skip(r * side).take(side).sum() };
    let column = |c: usize| -> f64 { leds.iter().skip(c).step_by(side).sum() };
    let least = MIN_LINE_SHARE * leds.iter().sum::<f64>() / side as f64;
    let rows: Vec<usize> = (0..side).filter(|&r| row(r) < least).collect();
    let columns: Vec<usize> = (0..side).filter(|&c| column(c) < least).collect();
    Ok(DeadLines { rows, columns })
}

/// Lines that the light of their LEDs does not follow.
#[derive(Debug, PartialEq, Eq)]
struct DeadLines {
    rows: Vec<usize>,
    columns: Vec<usize>,
}

impl DeadLines {
    fn count(&self) -> usize {
        self.rows.len() + self.columns.len()
    }
}

impl fmt::Display for DeadLines {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kinds = [("row", &self.rows), ("column", &self.columns)];
        let named: Vec<String> = kinds
            .iter()
            .filter(|(_, lines)| !lines.is_empty())
            .map(|(kind, lines)| {
                let plural = if lines.len() == 1 { "" } else { "s" };
                format!("{kind} line{plural} {}", ranges(lines))
            })
            .collect();
        f.write_str(&named.join(", "))
    }
}

/// Ranges in words: `0-2, 29` for 0, 1, 2, 29.
fn ranges(ascending: &[usize]) -> String {
    let mut runs: Vec<(usize, usize)> = Vec::new();
    for &line in ascending {
        match runs.last_mut() {
            Some((_, last)) if *last + 1 == line => *last = line,
            _ => runs.push((line, line)),
        }
    }
    let run = |&(first, last): &(usize, usize)| {
        if first == last { first.to_string() } else { format!("{first}-{last}") }
    };
    runs.iter().map(run).collect::<Vec<_>>().join(", ")
}

/// Whether pattern and complement together give the light of pattern 0. `noise` is the noise of
/// their sum, in counts.
fn supply(single: &[f64], pairs: &[f64], noise: f64) -> Check {
    let (Some(&lit), Some(&total)) = (single.first(), pairs.first()) else {
        return Check::told(SUPPLY, false, "no frame came");
    };
    // The complement of pattern 0 lights no LED.
    let dark = lit - total;
    let deviation = |(reading, difference): (&f64, &f64)| {
        (2.0 * reading - difference - 2.0 * dark) / total - 1.0
    };
    let deviations: Vec<f64> = single.iter().zip(pairs).skip(1).map(deviation).collect();
    let mean = deviations.iter().sum::<f64>() / deviations.len() as f64;
    let (pattern, worst) = (1..)
        .zip(&deviations)
        .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
        .map_or((0, f64::NAN), |(pattern, worst)| (pattern, *worst));
    let limit = MAX_DEVIATION + SIGMAS * noise / total;
    let note = if worst.abs() <= limit {
        format!("mean {:+.2} %", mean * 100.0)
    } else if mean > limit / 2.0 {
        format!("halves of the array give {:+.1} % on average: the supply gives way", mean * 100.0)
    } else {
        format!("pattern {pattern}, with its complement; mean {:+.2} %", mean * 100.0)
    };
    let percent = |share: f64| (share * 1e4).round() / 100.0;
    let limit = Limit::AtMost(percent(limit));
    Check::measured(SUPPLY, percent(worst.abs()), "% off pattern 0", limit).noting(&note)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_wire::walsh::{lit, pattern};

    /// Differences of an evenly lit array with changed lines, of sweeps that alternate. `wiring` changes
    /// the lines.
    fn pairs(wiring: impl Fn(u32, u32) -> (u32, u32)) -> Vec<f64> {
        let light = |k: u16, complement: bool| -> f64 {
            let (rows, columns) = pattern(k, complement);
            let leds = || (0..SIDE).flat_map(|r| (0..SIDE).map(move |c| (r, c)));
            let shown = [wiring(rows, columns), wiring(!rows, !columns)];
            let lit = |(rows, columns)| leds().filter(move |&(r, c)| lit(rows, columns, r, c));
            shown.map(|lines| lit(lines).count() as f64).iter().sum::<f64>() / 2.0
        };
        (0..PATTERNS).map(|k| light(k, false) - light(k, true)).collect()
    }

    #[test]
    fn each_line_is_missed_when_it_is_stuck_and_no_other() {
        assert_eq!(dead_lines(&pairs(|r, c| (r, c))).unwrap().count(), 0);
        for line in [0, 1, 16, 31] {
            for stuck in [0, 1] {
                let hold = |lines: u32| lines & !(1 << line) | stuck << line;
                let dead = dead_lines(&pairs(|r, c| (hold(r), c))).unwrap();
                assert_eq!(dead.to_string(), format!("row line {line}"), "stuck at {stuck}");
                let dead = dead_lines(&pairs(|r, c| (r, hold(c)))).unwrap();
                assert_eq!(dead.to_string(), format!("column line {line}"), "stuck at {stuck}");
            }
        }
    }

    #[test]
    fn many_lines_are_named_in_ranges() {
        let dead = DeadLines { rows: vec![0, 1, 2, 29], columns: vec![7] };
        assert_eq!(dead.to_string(), "row lines 0-2, 29, column line 7");
    }
}
