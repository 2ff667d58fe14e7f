//! ADC latency and settling response, measured from a raw burst.
//!
//! All LEDs go on and off every [`HALF_PERIOD`] ADC clocks (pattern 0 and its complement, in sweeps
//! that alternate). Every second period has all lines inverted, so that the charge which they inject
//! into the receiver cancels. The mean of the periods is the camera's step response `s[n]`, `n`
//! clocks after the step: 0 before the light has passed LEDs, amplifier and ADC, and 1 when the
//! light has settled. The clock at which the response leaves 0 is the latency. The leak, a pattern's
//! light in later slots, follows from the response for any dwell and blanking.
//!
//! Latency and response belong to the instrument and not to the scene. Both are measured once,
//! against a white sheet, and kept ([`KeptCalibration`](super::KeptCalibration)).
//!
//! # Invariant
//! A burst that does not show the latency is an error and never a latency of 0
//! (`tests::a_burst_too_dim_or_without_an_edge_is_an_error`). With a wrong latency every picture is
//! wrong, and most pictures are inverted.

use crate::response::{self, Settling};
use crate::sag;
use crate::session::{Listener, Session, SessionError, request};
use crate::setup::MeasurementSetup;
use nirspi_files::clock::Instant;
use nirspi_recon::{Rows, Side};
use nirspi_wire::register::RAW_SAMPLES_MAX;
use nirspi_wire::{DeviceMessage, PacketError, Raw, State};
use std::time::Duration;
use thiserror::Error;

/// Clocks that the LEDs stay on, and off, in the calibration burst: 1 us.
pub const HALF_PERIOD: u16 = response::LONGEST;
/// Clocks of a slot of the burst. Sweeps of one pair that alternate are on, off, off, on, and so on: LEDs change
/// after every second slot.
const SLOT: u16 = HALF_PERIOD / 2;
/// Clocks from the start of a burst until the LEDs first go on after they were off.
const RISE: usize = 3 * SLOT as usize;
/// Clocks after which the lines repeat: two periods of the light.
const CYCLE: usize = 4 * HALF_PERIOD as usize;
/// The step must exceed the noise of its mean by this factor.
const MIN_STEP_TO_NOISE: f64 = 20.0;
/// The response has left zero when it exceeds this share of the step.
pub(crate) const ONSET: f64 = 0.05;
/// The response has settled when the mean of this many samples is within its noise of 1.
const SETTLED_SAMPLES: usize = 4;
/// Interval at which a camera with an incomplete burst is asked whether it still sends samples.
const ASK_EVERY: Duration = Duration::from_millis(500);
/// A burst without a new sample for this long is incomplete, whatever the camera reports.
const STALLED: Duration = Duration::from_secs(30);
/// Number of averaged bursts: 2 ms of light reduce the noise of the taps to about a thousandth.
pub const BURSTS: usize = 64;

/// Why a burst gives no calibration.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// The session with the camera ended.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// The user stopped the calibration.
    #[error("stopped while the camera was being calibrated")]
    Stopped,
    /// Samples of the burst are missing.
    #[error("only {found} of {expected} samples of the calibration burst came")]
    Incomplete {
        /// Samples received.
        found: usize,
        /// Samples requested.
        expected: usize,
    },
    /// Too little light reaches the detector.
    #[error(
        "the calibration burst is too dim to show the ADC latency: a step of {step_counts:.1} ADC counts with a noise of \
         {noise_counts:.1}"
    )]
    NoStep {
        /// Reading with all LEDs on, minus the reading with all LEDs off.
        step_counts: f64,
        /// Standard deviation of one sample.
        noise_counts: f64,
    },
    /// The light changes, but not once in each half period.
    #[error(
        "the calibration burst has no edge that could be the LEDs': is another lamp flickering?"
    )]
    NoEdge,
}

/// The second row in natural order lights half of each tile.
const _: () = assert!(sag::HALF_OF_EACH_TILE == 1);

/// The setup for a burst of the first `patterns` rows in natural order.
fn burst_setup(patterns: usize) -> MeasurementSetup {
    MeasurementSetup {
        order: "calibration".to_owned(),
        rows: Rows::natural(Side::INSTRUMENT).first(patterns),
        differential: true,
        alternating: true,
        clocks_per_pattern: SLOT,
        blanked: 0,
        adc_latency: 0,
        sweeps: 1,
    }
}

struct BurstListener<'l> {
    samples: Vec<Option<u16>>,
    /// Time at which the last new sample arrived.
    progressed: Instant,
    inner: &'l mut dyn Listener,
}

impl Listener for BurstListener<'_> {
    fn packet(&mut self, raw: &[u8], content: &Result<DeviceMessage<'_>, PacketError>) {
        self.inner.packet(raw, content);
        if let Ok(DeviceMessage::Raw(Raw { first_clock, samples, .. })) = content {
            let places = self.samples.iter_mut().skip(usize::from(*first_clock));
            for (place, sample) in places.zip(samples.iter()) {
                if place.replace(sample & nirspi_wire::ADC_MAX).is_none() {
                    self.progressed = Instant::now();
                }
            }
        }
    }
}

impl BurstListener<'_> {
    fn is_whole(&self) -> bool {
        self.samples.iter().all(Option::is_some)
    }

    /// Waits until all samples have arrived, or the camera reports that it sends no more. A camera
    /// sends its samples before this report. A slow line or a busy machine is therefore harmless,
    /// as long as samples arrive.
    fn await_end(&mut self, session: &mut Session) -> Result<(), CalibrationError> {
        let mut state = State::Running;
        while !self.is_whole() && state == State::Running && self.progressed.elapsed() < STALLED {
            let asked = Instant::now();
            while !self.is_whole() && asked.elapsed() < ASK_EVERY {
                if !self.inner.goes_on() {
                    // A camera that runs takes no other setup, and a burst is a run.
                    session.command(request::Stop, self)?;
                    return Err(CalibrationError::Stopped);
                }
                session.listen(Duration::from_millis(50), self)?;
            }
            if !self.is_whole() {
                state = session.status(self)?.state;
            }
        }
        Ok(())
    }
}

/// Takes raw bursts and evaluates their mean. The camera must be idle or configured, and stays
/// configured for the burst.
///
/// # Errors
/// [`CalibrationError`] if the burst does not show latency and response.
pub fn calibrate(
    session: &mut Session,
    listener: &mut dyn Listener,
) -> Result<Settling, CalibrationError> {
    let settling = evaluate(&bursts(session, listener, 1)?)?;
    let tile_sag = tile_sag(&bursts(session, listener, 2)?, &settling);
    Ok(Settling { tile_sag, ..settling })
}

/// As [`calibrate`], with an earlier calibration `known`, whose sag of the supplies holds on. If the burst is too dim to show latency
/// and response, the result has the latency and response of `known` with the dark level and the
/// step of this burst, and the error is returned with the result.
///
/// # Errors
/// [`CalibrationError`] if the burst does not arrive.
pub fn calibrate_or(
    session: &mut Session,
    listener: &mut dyn Listener,
    known: &Settling,
) -> Result<(Settling, Option<CalibrationError>), CalibrationError> {
    let samples = bursts(session, listener, 1)?;
    Ok(match evaluate(&samples) {
        Ok(settling) => (Settling { tile_sag: known.tile_sag, ..settling }, None),
        Err(problem) => (known.at_levels_of(&samples), Some(problem)),
    })
}

/// The samples of all bursts of `patterns` patterns, one after another.
fn bursts(
    session: &mut Session,
    listener: &mut dyn Listener,
    patterns: usize,
) -> Result<Vec<f64>, CalibrationError> {
    let expected = usize::from(RAW_SAMPLES_MAX);
    burst_setup(patterns)
        .with_configuration(|c| session.command(request::Configure(c), listener))?;
    let mut samples = Vec::with_capacity(BURSTS * expected);
    for _ in 0..BURSTS {
        let (samples_of_burst, progressed) = (vec![None; expected], Instant::now());
        let mut burst = BurstListener { samples: samples_of_burst, progressed, inner: listener };
        session.command(request::RawBurst(RAW_SAMPLES_MAX), &mut burst)?;
        burst.await_end(session)?;
        let before = samples.len();
        samples.extend(burst.samples.iter().flatten().map(|&s| f64::from(s)));
        let found = samples.len() - before;
        if found < expected {
            return Err(CalibrationError::Incomplete { found, expected });
        }
    }
    Ok(samples)
}

/// The mean of all periods of the light except the first two of each burst.
struct MeanPeriod {
    /// ADC counts by clock, from the clock in which the LEDs go on.
    counts: Vec<f64>,
    /// Number of periods in the mean.
    periods: f64,
    /// Standard deviation of one sample.
    noise_counts: f64,
}

impl MeanPeriod {
    fn of(samples: &[f64]) -> Self {
        // The first cycle of a burst starts from dark and unsettled.
        let bursts = samples.chunks_exact(usize::from(RAW_SAMPLES_MAX));
        let cycles: Vec<&[f64]> =
            bursts.flat_map(|burst| burst.chunks_exact(CYCLE).skip(1)).collect();
        let count = cycles.len() as f64;
        let means: Vec<f64> =
            (0..CYCLE).map(|n| cycles.iter().map(|c| c[n]).sum::<f64>() / count).collect();
        let variance = cycles
            .iter()
            .flat_map(|c| c.iter().zip(&means).map(|(s, m)| (s - m).powi(2)))
            .sum::<f64>()
            / ((count - 1.0) * CYCLE as f64);
        let (lines, inverted) = means.split_at(CYCLE / 2);
        let mut counts: Vec<f64> =
            lines.iter().zip(inverted).map(|(a, b)| f64::midpoint(*a, *b)).collect();
        counts.rotate_left(RISE);
        Self { counts, periods: 2.0 * count, noise_counts: variance.sqrt() }
    }
}

/// Step response and latency of the mean period.
fn evaluate(samples: &[f64]) -> Result<Settling, CalibrationError> {
    let half = usize::from(HALF_PERIOD);
    let period = 2 * half;
    let MeanPeriod { counts: mean, periods: count, noise_counts } = MeanPeriod::of(samples);

    // The light is on for half of the time, so the median of each half, the brighter and the darker, is a settled
    // level at any latency. A charge that drives the ADC to the end of its range does not move a median.
    let mut sorted = mean.clone();
    sorted.sort_by(f64::total_cmp);
    let (darker, brighter) = sorted.split_at(half);
    let (low, high) = (middle(darker), middle(brighter));
    let step_counts = high - low;
    let noise_of_mean = (noise_counts / count.sqrt()).max(0.5 / count.sqrt());
    if step_counts < MIN_STEP_TO_NOISE * noise_of_mean {
        return Err(CalibrationError::NoStep { step_counts, noise_counts });
    }

    // In a linear chain the responses to on and off mirror each other; their mean halves the noise.
    let response_at = |n: usize| {
        let on = (mean[n % period] - low) / step_counts;
        let off = (mean[(n + half) % period] - low) / step_counts;
        f64::midpoint(on, 1.0 - off)
    };
    let onset = ONSET.max(5.0 * noise_of_mean / step_counts);
    let latency = (0..half)
        .find(|&n| response_at(n) > onset && response_at((n + period - 1) % period) <= onset)
        .ok_or(CalibrationError::NoEdge)?;
    let mut response: Vec<f64> = (0..half).map(|n| response_at(latency + n)).collect();
    // After the response has settled, it contains only noise. Each further tap would add its noise
    // to the image.
    let noise_of_response = noise_of_mean / step_counts / std::f64::consts::SQRT_2;
    let noise_of_window = noise_of_response / (SETTLED_SAMPLES as f64).sqrt();
    let settled = response.windows(SETTLED_SAMPLES).position(|window| {
        let mean = window.iter().sum::<f64>() / SETTLED_SAMPLES as f64;
        (1.0 - mean).abs() < 2.0 * noise_of_window
    });
    if let Some(settled) = settled {
        response.truncate(settled);
    }
    let adc_latency = latency as u8;
    Ok(Settling {
        adc_latency,
        response,
        dark_counts: low,
        step_counts,
        noise_counts,
        tile_sag: 0.0,
    })
}

/// The sag of the LEDs' supplies from bursts of two patterns: all LEDs, and half of each tile. Light that settles too
/// slowly for a slot shows none.
///
/// Pattern and complement of both are read within microseconds of each other, so that a lamp that flickers adds the same
/// to all, and with their lines inverted in every second pair of sweeps, so that the charge of the lines cancels.
fn tile_sag(samples: &[f64], known: &Settling) -> f64 {
    let slot = usize::from(SLOT);
    let settled = known.response.len()..slot;
    // Sweeps of four slots: pattern first, complement first, and both with all lines inverted.
    let cycle = 16 * slot;
    if settled.len() < slot / 4 {
        return 0.0;
    }
    let levels = |burst: &[f64]| {
        // The first sweep begins from dark and unsettled.
        let cycles = burst[usize::from(known.adc_latency) + 4 * slot..].chunks_exact(cycle);
        let (mut sums, mut count) = ([0.0; 4], 0.0);
        for cycle in cycles {
            for (at, light) in cycle.chunks_exact(slot).enumerate() {
                // All LEDs, none, half, the other half; in every second sweep, as in this one, none and the other half first.
                let is_swapped = at / 4 % 2 == 0;
                let shown = if is_swapped { (at % 4) ^ 1 } else { at % 4 };
                sums[shown] += light[settled.clone()].iter().sum::<f64>();
            }
            count += (cycle.len() / slot / 4 * settled.len()) as f64;
        }
        let [all, none, half, rest] = sums.map(|sum| sum / count);
        (all - none, half + rest - 2.0 * none)
    };
    let bursts = samples.chunks_exact(usize::from(RAW_SAMPLES_MAX));
    let (all, halves): (Vec<f64>, Vec<f64>) = bursts.map(levels).unzip();
    sag::of_levels(&all, &halves)
}

/// The median of sorted values.
fn middle(sorted: &[f64]) -> f64 {
    let at = |index: usize| sorted.get(index).copied().unwrap_or(0.0);
    f64::midpoint(at(sorted.len() / 2), at(sorted.len().saturating_sub(1) / 2))
}

impl Settling {
    /// The same latency and response, with dark level, step and noise of these samples.
    fn at_levels_of(&self, samples: &[f64]) -> Self {
        let half = usize::from(HALF_PERIOD);
        let MeanPeriod { counts, noise_counts, .. } = MeanPeriod::of(samples);
        // The range from the settled response to the start of the next response.
        let settled = self.response.len().min(half - 1);
        let level = |step: usize| {
            let at = |n: usize| counts[(usize::from(self.adc_latency) + step + n) % counts.len()];
            let mut sorted: Vec<f64> = (settled..half).map(at).collect();
            sorted.sort_by(f64::total_cmp);
            middle(&sorted)
        };
        let (on, off) = (level(0), level(half));
        Self { dark_counts: off, step_counts: on - off, noise_counts, ..self.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chain of two poles behind a delay, in ADC counts.
    fn burst(latency: usize, step: f64, pole: f64) -> Vec<f64> {
        let (mut led, mut amplifier) = (0.0, 0.0);
        let light = |n: usize| match n / usize::from(SLOT) % 4 {
            0 | 3 => step,
            _ => 0.0,
        };
        let settled: Vec<f64> = (0..usize::from(RAW_SAMPLES_MAX))
            .map(|n| {
                led += (light(n) - led) * pole;
                amplifier += (led - amplifier) * pole;
                200.0 + amplifier
            })
            .collect();
        let mut samples = vec![200.0; latency];
        samples.extend(&settled[..settled.len() - latency]);
        samples
    }

    #[test]
    fn latency_and_response_of_a_known_chain_are_found() {
        for latency in [0, 1, 7, 30, 63] {
            let settling = evaluate(&burst(latency, 9000.0, 0.8)).unwrap();
            assert_eq!(usize::from(settling.adc_latency), latency);
            assert!((settling.step_counts - 9000.0).abs() < 1.0);
            assert!((settling.dark_counts - 200.0).abs() < 0.1);
            let expected = 0.8 * 0.8;
            assert!(
                (settling.response[0] - expected).abs() < 1e-6,
                "{:?}",
                &settling.response[..4]
            );
        }
    }

    #[test]
    fn the_unsettled_first_cycle_of_each_burst_does_not_count() {
        let one = burst(7, 9000.0, 0.8);
        let samples = [&one[..], &one[..]].concat();
        let mut unsettled = samples.clone();
        for burst in unsettled.chunks_exact_mut(usize::from(RAW_SAMPLES_MAX)) {
            burst[..CYCLE].fill(16_000.0);
        }
        assert_eq!(evaluate(&unsettled).unwrap(), evaluate(&samples).unwrap());
        let known = evaluate(&samples).unwrap();
        assert_eq!(known.at_levels_of(&unsettled), known.at_levels_of(&samples));
        // The second cycle counts.
        unsettled[CYCLE] += 1000.0;
        assert_ne!(evaluate(&unsettled).unwrap(), evaluate(&samples).unwrap());
    }

    /// Lines that rise inject a charge, and lines that fall as much of the other sign.
    #[test]
    fn the_charge_of_the_lines_cancels() {
        let clean = burst(7, 9000.0, 0.5);
        let mut charged = clean.clone();
        // On, off, off, on, and the same with all lines inverted: lines that rise less lines that fall, at each slot.
        let risen = [-64.0, 32.0, 0.0, -32.0, 64.0, -32.0, 0.0, 32.0];
        for (n, sample) in charged.iter_mut().enumerate().skip(7) {
            let (slot, clock) = ((n - 7) / usize::from(SLOT), (n - 7) % usize::from(SLOT));
            *sample += 100.0 * risen[slot % 8] * 0.3_f64.powi(clock as i32);
        }
        let (found, expected) = (evaluate(&charged).unwrap(), evaluate(&clean).unwrap());
        assert_eq!(found.adc_latency, 7);
        assert!((found.response[0] - expected.response[0]).abs() < 1e-9, "{:?}", found.response);
        // A charge beyond the ADC's range spoils the first samples after a change of the lines, and no more.
        for (charged, clean) in charged.iter_mut().zip(&clean) {
            *charged =
                (clean + 10.0 * (*charged - clean)).clamp(0.0, f64::from(nirspi_wire::ADC_MAX));
        }
        let found = evaluate(&charged).unwrap();
        assert_eq!(found.adc_latency, 7);
        assert!((found.step_counts - 9000.0).abs() < 1.0, "{}", found.step_counts);
        assert!((found.response[6] - expected.response[6]).abs() < 0.01, "{:?}", found.response);
        let dim = expected.at_levels_of(&charged);
        assert!((dim.step_counts - 9000.0).abs() < 1.0, "{}", dim.step_counts);
    }

    #[test]
    fn the_taps_share_out_all_of_the_light() {
        let settling = evaluate(&burst(5, 9000.0, 0.5)).unwrap();
        let leak = settling.leak(5, 2).unwrap();
        assert!((leak.taps().iter().sum::<f64>() - 1.0).abs() < 1e-4, "{:?}", leak.taps());
        assert!(leak.taps()[1] > 0.01);
    }

    #[test]
    fn a_burst_too_dim_or_without_an_edge_is_an_error() {
        let dark = vec![200.0; usize::from(RAW_SAMPLES_MAX)];
        assert!(matches!(evaluate(&dark), Err(CalibrationError::NoStep { .. })));
        // Light that goes on and off twice as fast as the LEDs: the responses to on and off do not
        // mirror each other.
        let flicker: Vec<f64> =
            (0..dark.len()).map(|n| if n / 64 % 2 == 0 { 9000.0 } else { 200.0 }).collect();
        assert!(matches!(evaluate(&flicker), Err(CalibrationError::NoEdge)));
    }

    #[test]
    fn a_dim_burst_gives_its_own_levels_to_a_known_response() {
        let known = evaluate(&burst(7, 9000.0, 0.5)).unwrap();
        let dim = known.at_levels_of(&burst(7, 3.0, 0.5));
        assert_eq!((dim.adc_latency, &dim.response), (7, &known.response));
        assert!((dim.dark_counts - 200.0).abs() < 0.01, "{}", dim.dark_counts);
        assert!((dim.step_counts - 3.0).abs() < 0.01, "{}", dim.step_counts);
    }
}
