//! Checks at full speed that the faults of LEDs and lines cancel.
//!
//! What is the same in all pairs of a pattern and its complement falls on pixel (0, 0) of the image: LEDs that
//! rise unlike they fall. The charge of lines that switch falls on the first column and the first row. Both
//! cancel in four sweeps that alternate ([`mode::ALTERNATING`](nirspi_wire::register::mode::ALTERNATING)). If
//! they do not, the image of a white sheet shows it.

use super::leds::means;
use crate::check::{Check, Limit};
use crate::response::Settling;
use crate::session::{Session, SessionError};
use nirspi_recon::{Sweep, fwht};
use nirspi_wire::{CLOCKS_PER_PATTERN, Configuration, PATTERNS, PatternOrder, SIDE, SampleSource};

/// Name of the check.
pub const NAME: &str = "first pixel at 25 MHz";

/// Samples left out at the start of each pattern.
const BLANKED: u16 = 2;
/// Sweeps of a frame, and frames: 21 ms of light.
const SWEEPS: u32 = 256;
const FRAMES: u32 = 2;
/// The largest difference from the neighbours, as a share of white. LEDs of one array differ less, and the edges
/// of a circuit's LEDs alone make 3.7 of it (`docs/log/physics.md`).
const MOST: f64 = 0.5;
/// The limit allows noise of this many standard deviations.
const SIGMAS: f64 = 5.0;

/// Shows all patterns at full speed.
pub fn check(
    session: &mut Session,
    latency: u8,
    settling: &Settling,
) -> Result<Vec<Check>, SessionError> {
    let configuration = Configuration {
        order: PatternOrder::Natural,
        patterns: PATTERNS,
        differential: true,
        alternating: true,
        clocks_per_pattern: CLOCKS_PER_PATTERN,
        blanked: BLANKED,
        adc_latency: latency,
        sweeps: SWEEPS,
        source: SampleSource::Detector,
        over_range_trip: 0,
    };
    let Ok(leak) = settling.leak(CLOCKS_PER_PATTERN, BLANKED) else {
        return Ok(vec![Check::skipped(NAME, "needs light that follows the patterns")]);
    };
    let Some(mut image) = means(session, configuration, FRAMES)? else {
        return Ok(vec![Check::told(NAME, false, "no frame came")]);
    };
    leak.correct_differential(&mut image, Sweep::Alternating);
    // All patterns came, whose number is a power of two. A pixel is the transform divided by their number.
    if fwht(&mut image).is_err() {
        return Ok(vec![Check::told(NAME, false, "not all patterns came")]);
    }
    let samples = f64::from(FRAMES * SWEEPS) * f64::from(CLOCKS_PER_PATTERN - BLANKED);
    let noise = settling.noise_counts * (2.0 * f64::from(PATTERNS) / samples).sqrt();
    Ok(vec![verdict(&image, noise)])
}

/// `noise` is that of a pixel, in the units of `image`.
fn verdict(image: &[f64], noise: f64) -> Check {
    let side = usize::from(SIDE);
    let white = image.iter().sum::<f64>() / image.len() as f64;
    let mean = |pixels: &[f64]| pixels.iter().sum::<f64>() / pixels.len() as f64;
    let row = |r: usize| mean(&image[r * side + 1..(r + 1) * side]);
    let column =
        |c: usize| mean(&image.iter().skip(side + c).step_by(side).copied().collect::<Vec<_>>());
    let neighbours = mean(&[image[1], image[side], image[side + 1]]);
    let percent = |share: f64| (share * 1e3).round() / 10.0;
    let off = [image[0] - neighbours, row(0) - row(1), column(0) - column(1)]
        .map(|difference| percent(difference / white));
    // The worst is NaN if one is, and then the check fails.
    let worst =
        off.iter().fold(
            0.0,
            |worst: f64, off| {
                if off.is_nan() || off.abs() > worst { off.abs() } else { worst }
            },
        );
    let [pixel, row, column] = off;
    let limit = Limit::AtMost(percent(MOST + SIGMAS * noise / white));
    Check::measured(NAME, worst, "% of white", limit).noting(&format!(
        "pixel (0, 0) {pixel:+} %, first row {row:+} %, first column {column:+} % beside their neighbours"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::Verdict;

    fn white(change: impl Fn(usize) -> f64) -> Vec<f64> {
        (0..usize::from(PATTERNS)).map(|at| 100.0 + change(at)).collect()
    }

    #[test]
    fn a_corner_a_row_or_a_column_that_stands_out_is_named() {
        let sound = verdict(&white(|at| (at as f64).sin()), 1.0);
        assert_eq!(sound.verdict(), Verdict::Passed, "{sound:?}");
        let side = usize::from(SIDE);
        for (spoiled, words) in [
            (white(|at| if at == 0 { -370.0 } else { 0.0 }), "pixel (0, 0) -37"),
            (white(|at| if at % side == 0 { 80.0 } else { 0.0 }), "first column +7"),
            (white(|at| if at < side { 80.0 } else { 0.0 }), "first row +7"),
        ] {
            let found = verdict(&spoiled, 1.0);
            assert_eq!(found.verdict(), Verdict::Failed, "{found:?}");
            assert!(found.note().contains(words), "{found:?}");
        }
        assert_eq!(verdict(&white(|_| f64::NAN), 1.0).verdict(), Verdict::Failed);
    }

    #[test]
    fn a_dim_sheet_fails_for_no_noise_of_its_own() {
        let noisy = white(|at| if at == 0 { 90.0 } else { 0.0 });
        assert_eq!(verdict(&noisy, 1.0).verdict(), Verdict::Failed);
        assert_eq!(verdict(&noisy, 20.0).verdict(), Verdict::Passed);
    }
}
