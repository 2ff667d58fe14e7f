//! The self-test: checks that the camera measures correctly, from the light to the host.
//!
//! The self-test has stages, each of which builds on earlier stages: the device's own checks; test
//! frames of the FPGA's generator through the whole chain; settling and latency from raw bursts;
//! latency again, by stepping the FPGA's setting; the LEDs, by the light of each line and each
//! pattern at the detector, and by the image of a white sheet at full speed; the link, by its speed and its losses. Point the camera at a bright and
//! evenly lit target, such as white paper.
//!
//! # Invariant
//! A verdict follows from a measured value and a limit, and both are shown
//! (`check::tests::the_verdict_follows_from_value_and_limit`).

mod first_pixel;
mod generator;
mod latency;
mod leds;
mod link;
mod stream;

use crate::calibration::{CalibrationError, calibrate};
use crate::check::{Check, Limit, Verdict};
use crate::fpga::{Fpga, FpgaProblem, Sampling};
use crate::response::Settling;
use crate::session::{IgnorePackets, Session, SessionError};
use nirspi_files::causes;
use nirspi_wire::register::{IDENTITY, clocks};
use nirspi_wire::{ADC_HZ, ADC_MAX, CLOCKS_PER_PATTERN, Fault, SelfTestReport, Version};
use std::time::Duration;

/// Least step of all LEDs together, as a share of the ADC's range. With a smaller step, a single
/// LED changes a reading by less than a sixth of a count.
const MIN_STEP_SHARE: f64 = 0.01;
/// Blanked samples of the fastest setting, for which the leak is reported.
const BLANKED: u16 = 2;
/// Least share of a slot's light that must be read in its own slot at the fastest setting. With a
/// smaller share, correcting the leak more than doubles the noise.
const MIN_OWN_SHARE: f64 = 0.5;

/// Without these, every later check would fail for the reason that they name.
const NEEDED: u32 =
    SelfTestReport::FPGA_IDENTITY | SelfTestReport::GATEWARE | SelfTestReport::ADC_CLOCK;
/// Least width of the window of phases in which the ADC's samples are right. The clock stands in its middle, so
/// that the lines may move by half of it, as they do with temperature and supply.
const MIN_SAMPLING_WINDOW_NS: f64 = 1.0;
const SAMPLING: &str = "ADC sampling phase";
const STEP: &str = "light of all LEDs";
const OWN: &str = "settling at 25 MHz";

/// The demands on a link.
#[derive(Debug, Clone, Copy)]
pub struct LinkDemands {
    /// Frames of 1024 patterns a second; 0 if any speed is enough.
    pub min_frames_per_s: f64,
    /// Duration of each of the two measurements.
    pub duration: Duration,
}

/// Names of the stages in order, for progress messages.
pub const STAGES: [&str; 6] =
    ["device", "test frames", "settling", "ADC latency", "LEDs", "link throughput"];

/// The result of a self-test.
#[derive(Debug)]
pub struct SelfTest {
    /// Every check, in order.
    pub checks: Vec<Check>,
    /// The calibration to keep, if the latency could be measured and is confirmed.
    pub settling: Option<Settling>,
}

impl SelfTest {
    /// Whether no check has failed.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.checks.iter().all(|check| check.verdict() != Verdict::Failed)
    }
}

/// Runs all stages. `begin` receives the number of each stage in [`STAGES`] at its start.
///
/// # Errors
/// If the camera disconnects. A command that the camera refuses is a failed check.
pub fn run(
    session: &mut Session,
    demands: LinkDemands,
    begin: &mut dyn FnMut(usize),
) -> Result<SelfTest, SessionError> {
    begin(0);
    let report = session.self_test(&mut IgnorePackets)?;
    let fpga = Fpga::ask(session, &mut IgnorePackets)?;
    let mut checks = device(report, &fpga);
    if report.failed & NEEDED != 0 {
        let later = [
            SAMPLING,
            generator::NAME,
            STEP,
            OWN,
            latency::NAME,
            leds::LINES,
            leds::SUPPLY,
            first_pixel::NAME,
            link::SPEED,
            link::LOSSES,
        ];
        checks.extend(later.map(|name| Check::skipped(name, "needs the FPGA and its ADC clock")));
        return Ok(SelfTest { checks, settling: None });
    }
    checks.push(sampling_phase(fpga.sampling()));
    begin(1);
    checks.extend(unless_refused(&[generator::NAME], generator::check(session))?);
    begin(2);
    let settling = match calibrate(session, &mut IgnorePackets) {
        Ok(settling) => Ok(settling),
        Err(CalibrationError::Session(error)) => Err(refusal_in_words(error)?),
        Err(problem) => Err(causes::in_one_line(&problem)),
    };
    checks.extend(light_and_settling(settling.as_ref()));
    let settling = settling.ok();
    let (mut agrees, stages) =
        (false, [latency::NAME, leds::LINES, leds::SUPPLY, first_pixel::NAME]);
    match settling.as_ref().filter(|settling| settling.step_counts >= min_step_counts()) {
        None => checks.extend(stages.map(|name| Check::skipped(name, "too little light"))),
        Some(settling) => {
            begin(3);
            let stepped = latency::check(session, settling);
            let stepped = unless_refused(&stages[..1], stepped)?;
            agrees = stepped.iter().all(|check| check.verdict() == Verdict::Passed);
            // If burst and stepping disagree, the stepped setting places the windows correctly.
            let setting = stepped.iter().find_map(Check::value);
            checks.extend(stepped);
            begin(4);
            checks.extend(match setting {
                None => stages[1..]
                    .iter()
                    .map(|name| Check::skipped(name, "needs the ADC latency"))
                    .collect(),
                Some(setting) => {
                    let latency = setting as u8;
                    let lit = leds::check(session, latency, settling.noise_counts);
                    let mut lit = unless_refused(&stages[1..3], lit)?;
                    let skipped = |why| vec![Check::skipped(first_pixel::NAME, why)];
                    lit.extend(if fpga.sampling() == Sampling::NoAdc {
                        skipped("the bring-up design sees no sheet")
                    } else if lit.iter().any(|check| check.verdict() != Verdict::Passed) {
                        skipped("needs sound LEDs")
                    } else {
                        let first = first_pixel::check(session, latency, settling);
                        unless_refused(&stages[3..], first)?
                    });
                    lit
                }
            });
        }
    }
    begin(5);
    checks.extend(unless_refused(&[link::SPEED, link::LOSSES], link::check(session, demands))?);
    Ok(SelfTest { checks, settling: settling.filter(|_| agrees) })
}

/// The checks of a stage. A refusal of the camera becomes a failed check.
fn unless_refused(
    names: &[&str],
    outcome: Result<Vec<Check>, SessionError>,
) -> Result<Vec<Check>, SessionError> {
    outcome.or_else(|error| {
        let refusal = refusal_in_words(error)?;
        Ok(names.iter().map(|name| Check::told(name, false, &refusal)).collect())
    })
}

/// The camera's refusal in words; any other error stays an error.
fn refusal_in_words(error: SessionError) -> Result<String, SessionError> {
    match error {
        SessionError::Refused { .. } => Ok(error.to_string()),
        other => Err(other),
    }
}

fn min_step_counts() -> f64 {
    (MIN_STEP_SHARE * f64::from(ADC_MAX)).round()
}

/// One check for each bit of the device's report, named as in the protocol. A bit that this program
/// does not know has its number as name. What the FPGA's registers say stands beside the checks of the FPGA.
fn device(report: SelfTestReport, fpga: &Fpga) -> Vec<Check> {
    let told = |words: Result<String, FpgaProblem>| words.unwrap_or_else(|p| p.to_string());
    let failed = |check: u32| report.failed & check != 0;
    let alone = |check: u32, stuck: Fault| {
        if failed(check) { stuck.to_string() } else { "dark while it alone is low".to_owned() }
    };
    let note = |bit: u32| match 1 << bit {
        SelfTestReport::FPGA_IDENTITY => {
            told(fpga.check_identity().map(|()| format!("{IDENTITY:#010x} as expected")))
        }
        SelfTestReport::GATEWARE => told(fpga.check_gateware().map(|design| {
            let version = Version::of_register(fpga.version().unwrap_or_default());
            format!("{version}, {design}")
        })),
        SelfTestReport::ADC_CLOCK => told(fpga.check_clock().map(|mhz| {
            let (expected, off) = (ADC_HZ / 1_000_000, clocks::TOLERANCE_PERCENT);
            format!("{mhz:.2} MHz by the FPGA's oscillator, expected {expected} MHz within {off} %")
        })),
        SelfTestReport::BOARD_ENABLE => {
            alone(SelfTestReport::BOARD_ENABLE, Fault::BoardEnableStuck)
        }
        SelfTestReport::FPGA_ENABLE => alone(SelfTestReport::FPGA_ENABLE, Fault::FpgaEnableStuck),
        _ => String::new(),
    };
    let named = |bit: u32| SelfTestReport::NAMES.iter().find(|(mask, _)| *mask == 1 << bit);
    (0..u32::BITS)
        .filter_map(|bit| {
            let name = match named(bit) {
                Some((_, name)) => format!("device: {name}"),
                None if report.ran >> bit & 1 != 0 => format!("device: check {bit}"),
                None => return None,
            };
            Some(match (report.ran >> bit & 1 != 0, report.failed >> bit & 1 != 0) {
                (false, _) => Check::skipped(&name, "left out by the device"),
                (true, failed) => Check::told(&name, !failed, &note(bit)),
            })
        })
        .collect()
}

/// The check of the phase at which the FPGA takes the ADC's samples.
fn sampling_phase(found: Sampling) -> Check {
    match found {
        Sampling::NoAdc => Check::skipped(SAMPLING, "the bring-up design has no ADC"),
        Sampling::NoScan => Check::skipped(SAMPLING, "this FPGA has made no scan"),
        Sampling::NoPattern => Check::skipped(
            SAMPLING,
            "no phase shows the ADC's checkerboard. Wire the ADC's serial port, or compare a raw burst of its test \
             pattern by hand (docs/log/gateware.md, ADC interface)",
        ),
        Sampling::Window { width_steps, phase_steps, period_steps, step_ns } => {
            let ns = |steps: u32| f64::from(steps) * step_ns;
            let limit = Limit::AtLeast(MIN_SAMPLING_WINDOW_NS);
            Check::measured(SAMPLING, ns(width_steps), "ns wide", limit).noting(&format!(
                "samples are right in {width_steps} of {period_steps} steps; the clock stands in the middle, \
                 {:.1} ns after the phase of the build",
                ns(phase_steps)
            ))
        }
    }
}

/// The checks of the raw bursts.
fn light_and_settling(settling: Result<&Settling, &String>) -> Vec<Check> {
    let settling = match settling {
        Err(problem) => {
            return vec![
                Check::told(STEP, false, problem),
                Check::skipped(OWN, "no calibration burst"),
            ];
        }
        Ok(settling) => settling,
    };
    let noise = format!("noise {:.1} counts a sample", settling.noise_counts);
    let step =
        Check::measured(STEP, settling.step_counts, "counts", Limit::AtLeast(min_step_counts()))
            .noting(&noise);
    let own = match settling.leak(CLOCKS_PER_PATTERN, BLANKED) {
        Ok(leak) => {
            let own = leak.taps().first().copied().unwrap_or(0.0);
            let after = settling.response.len();
            Check::measured(
                OWN,
                own * 100.0,
                "% in its slot",
                Limit::AtLeast(MIN_OWN_SHARE * 100.0),
            )
            .noting(&format!("settled after {after} clocks of 8 ns"))
        }
        Err(problem) => Check::told(OWN, false, &problem.to_string()),
    };
    vec![step, own]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_narrow_window_of_the_sampling_phase_fails_and_an_unknown_one_is_skipped() {
        let window = |width_steps| {
            sampling_phase(Sampling::Window {
                width_steps,
                phase_steps: 17,
                period_steps: 40,
                step_ns: 0.2,
            })
        };
        assert_eq!(window(4).verdict(), Verdict::Failed);
        let wide = window(15);
        assert_eq!(wide.verdict(), Verdict::Passed);
        assert!(wide.note().contains("15 of 40") && wide.note().contains("3.4 ns"), "{wide:?}");
        for unknown in [Sampling::NoAdc, Sampling::NoScan, Sampling::NoPattern] {
            assert_eq!(sampling_phase(unknown).verdict(), Verdict::Skipped);
        }
    }

    #[test]
    fn a_bit_that_only_a_newer_device_knows_is_shown_by_its_number() {
        let report = SelfTestReport { ran: 1 << 30 | 1, failed: 1 << 30 };
        let checks = device(report, &Fpga::default());
        let verdict = |name: &str| {
            checks.iter().find(|check| check.name() == name).map(Check::verdict).unwrap()
        };
        assert_eq!(verdict("device: FPGA identity"), Verdict::Passed);
        assert_eq!(verdict("device: FPGA bus"), Verdict::Skipped);
        assert_eq!(verdict("device: check 30"), Verdict::Failed);
    }
}
