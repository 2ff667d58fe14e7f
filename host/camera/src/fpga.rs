//! What a camera's FPGA says of itself, and what to check where that is not as expected.
//!
//! # Invariant
//! Each cause has words of its own (`tests::every_cause_is_told_apart`), and the words name the value
//! that was read and the value that was expected.

use crate::session::{Listener, Session, SessionError};
use nirspi_wire::register::{Design, IDENTITY, Register, clocks, has_this_map, sampling};
use nirspi_wire::{ADC_HZ, Version};
use std::fmt;
use thiserror::Error;

/// The registers that an FPGA answers with or without an ADC; `None` for a register that the camera could
/// not read, or that an older firmware does not know.
#[derive(Debug, Clone, Copy, Default)]
pub struct Fpga {
    identity: Option<u32>,
    version: Option<u32>,
    design: Option<u32>,
    clocks: Option<u32>,
    sampling: Option<u32>,
}

/// The result of a scan of the ADC's sampling phase ([`sampling`]).
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Sampling {
    /// The FPGA runs the bring-up design.
    NoAdc,
    /// The FPGA has made no scan: a simulated FPGA.
    NoScan,
    /// No phase showed the ADC's checkerboard. The clock stays at the phase at which the gateware was built.
    NoPattern,
    /// The clock stands in the middle of this window of phases in which every sample was right.
    Window {
        /// Width of the window.
        width_steps: u32,
        /// Steps from the phase at which the gateware was built.
        phase_steps: u32,
        /// Steps of a period of the ADC's clock.
        period_steps: u32,
        /// Duration of a step.
        step_ns: f64,
    },
}

/// Why an FPGA cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum FpgaProblem {
    /// Every bit of the answer is the same.
    #[error(
        "the FPGA does not answer: its identity reads {found:#010x}, expected {IDENTITY:#010x}. Check the FPGA's \
         power, whether it is configured (DONE high), the wires cs_n, sck and io0 to io3, and the grounds"
    )]
    Silent {
        /// The identity register.
        found: u32,
    },
    /// Another identity.
    #[error("the FPGA's identity reads {found:#010x}, expected {IDENTITY:#010x}: {}", cause(*.found))]
    Foreign {
        /// The identity register.
        found: u32,
    },
    /// Gateware of another version.
    #[error(
        "the FPGA runs gateware {}, and this program knows {}: load the gateware of this version (nirspi camera gateware \
         FILE, or nirspi camera update)",
        Version::of_register(*.found),
        Version::of_register(Register::Version.reset())
    )]
    Version {
        /// The version register.
        found: u32,
    },
    /// Gateware for a purpose that this program does not know.
    #[error("the FPGA runs gateware of design {found}, expected 1 (camera) or 2 (bring-up)")]
    Design {
        /// The design register.
        found: u32,
    },
    /// The host port answers, and the ADC's domain does not.
    #[error(
        "the FPGA answers without the ADC's clock: Clocks reads {found:#010x}, that is {}. {}",
        clock_in_words(*.found),
        what_to_check(*.found)
    )]
    Clock {
        /// The clocks register.
        found: u32,
    },
}

/// What a wrong identity points to.
fn cause(found: u32) -> String {
    // Every order of io1 to io3 but the right one. Each wire carries one bit of every four.
    let crossed = [[1, 3, 2], [2, 1, 3], [2, 3, 1], [3, 1, 2], [3, 2, 1]].into_iter().find(
        |&[one, two, three]| {
            let bit = |from: u32, to: u32| (IDENTITY >> from & 0x1111_1111) << to;
            found == bit(0, 0) | bit(1, one) | bit(2, two) | bit(3, three)
        },
    );
    match crossed {
        Some([one, two, three]) => {
            format!("the wires of io1, io2 and io3 arrive as io{one}, io{two} and io{three}")
        }
        None if found == IDENTITY >> 4 || found == IDENTITY << 4 => {
            "the answer is one clock off. Shorten the wires of the host port".to_owned()
        }
        None => "another design, or a wire of io0 to io3 that is open, stuck or crossed".to_owned(),
    }
}

fn mhz(word: u32) -> f64 {
    f64::from(word & clocks::FREQUENCY) * f64::from(clocks::UNIT_HZ) * 1e-6
}

/// The clocks register in words.
fn clock_in_words(word: u32) -> String {
    let state = |bit, yes: &'static str, no: &'static str| if word & bit != 0 { yes } else { no };
    format!(
        "{:.2} MHz, PLL {}, {}",
        mhz(word),
        state(clocks::LOCKED, "locked", "not locked"),
        state(clocks::READY, "ADC domain running", "ADC domain in reset"),
    )
}

fn what_to_check(word: u32) -> String {
    let expected = format!("{} MHz within {} %", ADC_HZ / 1_000_000, clocks::TOLERANCE_PERCENT);
    if word & clocks::FREQUENCY == 0 {
        format!(
            "Expected {expected}. Check the ADC's supply and the wire of its data clock; without an ADC, load the \
             bring-up gateware (docs/bring-up.md)"
        )
    } else if word & clocks::LOCKED == 0 || word & clocks::READY != 0 {
        format!("Expected {expected}. Check the ADC's sample clock and the edges of its data clock")
    } else {
        "Check the FPGA's reset button, and look again".to_owned()
    }
}

impl Fpga {
    /// Reads the registers through the camera's firmware.
    ///
    /// # Errors
    /// [`SessionError`] if the link ends. A register that the camera refuses to read is `None`.
    pub fn ask(session: &mut Session, listener: &mut dyn Listener) -> Result<Self, SessionError> {
        let mut read = |register| match session.register(register, listener) {
            Ok(value) => Ok(Some(value)),
            Err(SessionError::Refused { .. }) => Ok(None),
            Err(error) => Err(error),
        };
        Ok(Self {
            identity: read(Register::Identity)?,
            version: read(Register::Version)?,
            design: read(Register::Design)?,
            clocks: read(Register::Clocks)?,
            sampling: read(Register::Sampling)?,
        })
    }

    /// Whether the FPGA answers with nirspi's identity.
    #[must_use]
    pub fn answers(&self) -> bool {
        self.identity == Some(IDENTITY)
    }

    /// The version register of an FPGA that answers.
    #[must_use]
    pub fn version(&self) -> Option<u32> {
        self.version.filter(|_| self.answers())
    }

    /// Checks the identity.
    ///
    /// # Errors
    /// [`FpgaProblem::Silent`] or [`FpgaProblem::Foreign`].
    pub fn check_identity(&self) -> Result<(), FpgaProblem> {
        match self.identity.unwrap_or_default() {
            IDENTITY => Ok(()),
            found @ (0 | u32::MAX) => Err(FpgaProblem::Silent { found }),
            found => Err(FpgaProblem::Foreign { found }),
        }
    }

    /// Checks the version, and returns what the gateware is built for.
    ///
    /// # Errors
    /// [`FpgaProblem::Version`] or [`FpgaProblem::Design`].
    pub fn check_gateware(&self) -> Result<Design, FpgaProblem> {
        let version = self.version.unwrap_or_default();
        let design = self.design.unwrap_or_default();
        if has_this_map(version) {
            Design::from_register(design).ok_or(FpgaProblem::Design { found: design })
        } else {
            Err(FpgaProblem::Version { found: version })
        }
    }

    /// Checks the ADC's clock, and returns its frequency in MHz, as the FPGA's oscillator measures it.
    ///
    /// # Errors
    /// [`FpgaProblem::Clock`].
    pub fn check_clock(&self) -> Result<f64, FpgaProblem> {
        let found = self.clocks.unwrap_or_default();
        if clocks::fit(found) { Ok(mhz(found)) } else { Err(FpgaProblem::Clock { found }) }
    }

    /// What the FPGA's scan of the ADC's sampling phase has found.
    #[must_use]
    pub fn sampling(&self) -> Sampling {
        let word = self.sampling.unwrap_or_default();
        let width_steps = (word & sampling::WIDTH) >> sampling::WIDTH.trailing_zeros();
        let period_steps = (word & sampling::PERIOD) >> sampling::PERIOD.trailing_zeros();
        if self.design.and_then(Design::from_register) == Some(Design::BringUp) {
            Sampling::NoAdc
        } else if word & sampling::DONE == 0 || period_steps == 0 {
            Sampling::NoScan
        } else if width_steps == 0 {
            Sampling::NoPattern
        } else {
            let phase_steps = word & sampling::PHASE;
            let step_ns = 1e9 / f64::from(ADC_HZ) / f64::from(period_steps);
            Sampling::Window { width_steps, phase_steps, period_steps, step_ns }
        }
    }

    /// The first problem, if there is one.
    ///
    /// # Errors
    /// [`FpgaProblem`].
    pub fn check(&self) -> Result<Design, FpgaProblem> {
        self.check_identity()?;
        let design = self.check_gateware()?;
        self.check_clock().map(|_| design)
    }
}

impl fmt::Display for Fpga {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.check() {
            Ok(design) => {
                let clock = clock_in_words(self.clocks.unwrap_or_default());
                write!(f, "FPGA: {design}; ADC clock {clock}")
            }
            Err(problem) => write!(f, "{problem}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const READY: u32 = clocks::LOCKED | clocks::ALIVE | clocks::READY;

    fn good() -> Fpga {
        Fpga {
            identity: Some(IDENTITY),
            version: Some(Register::Version.reset()),
            design: Some(1),
            clocks: Some(READY | 12_500),
            sampling: Some(0),
        }
    }

    #[test]
    fn a_good_fpga_says_what_it_is() {
        assert_eq!(good().check(), Ok(Design::Camera));
        assert_eq!(
            good().to_string(),
            "FPGA: camera; ADC clock 125.00 MHz, PLL locked, ADC domain running"
        );
        let bring_up = Fpga { design: Some(2), clocks: Some(READY | 12_480), ..good() };
        assert!(
            bring_up.to_string().contains("bring-up") && bring_up.to_string().contains("124.80")
        );
    }

    #[test]
    fn every_cause_is_told_apart() {
        let cases = [
            (Fpga { identity: Some(0), ..good() }, ["0x00000000", "DONE"]),
            (Fpga { identity: Some(u32::MAX), ..good() }, ["0xffffffff", "DONE"]),
            (Fpga { identity: None, ..good() }, ["0x4e535049", "cs_n"]),
            (Fpga { identity: Some(0x1234), ..good() }, ["0x00001234", "another design"]),
            (Fpga { version: Some(0x0100), ..good() }, ["0.1.0", "0.4.0"]),
            (Fpga { design: Some(9), ..good() }, ["design 9", "2 (bring-up)"]),
            (Fpga { clocks: Some(0), ..good() }, ["0.00 MHz, PLL not locked", "bring-up gateware"]),
            (Fpga { clocks: Some(8_000), ..good() }, ["80.00 MHz, PLL not locked", "sample clock"]),
            (Fpga { clocks: Some(READY | 6_250), ..good() }, ["62.50 MHz, PLL locked", "125 MHz"]),
            (
                Fpga { clocks: Some(clocks::LOCKED | clocks::ALIVE | 12_500), ..good() },
                ["in reset", "button"],
            ),
        ];
        for (fpga, words) in cases {
            let told = fpga.to_string();
            assert!(
                fpga.check().is_err() && words.iter().all(|word| told.contains(word)),
                "{told}"
            );
        }
    }

    #[test]
    fn a_scan_of_the_sampling_phase_is_read() {
        let word =
            |width: u32, phase: u32| sampling::DONE | sampling::STEPS << 16 | width << 8 | phase;
        let found = |word| Fpga { sampling: word, ..good() }.sampling();
        assert_eq!(found(None), Sampling::NoScan);
        assert_eq!(found(Some(word(15, 17) & !sampling::DONE)), Sampling::NoScan);
        assert_eq!(found(Some(word(0, 0))), Sampling::NoPattern);
        let Sampling::Window { width_steps, phase_steps, period_steps, step_ns } =
            found(Some(word(15, 17)))
        else {
            panic!("no window");
        };
        assert_eq!((width_steps, phase_steps, period_steps), (15, 17, 40));
        assert!((step_ns - 0.2).abs() < 1e-9);
        let bring_up = Fpga { design: Some(2), ..good() };
        assert_eq!(bring_up.sampling(), Sampling::NoAdc);
    }

    #[test]
    fn crossed_wires_are_named() {
        // io1 and io2 exchanged: bits 1 and 2 of every four.
        let kept = IDENTITY & 0x9999_9999;
        let crossed = kept | (IDENTITY & 0x2222_2222) << 1 | (IDENTITY & 0x4444_4444) >> 1;
        let told = Fpga { identity: Some(crossed), ..good() }.to_string();
        assert!(told.contains("arrive as io2, io1 and io3"), "{told}");
        let late = Fpga { identity: Some(IDENTITY >> 4), ..good() }.to_string();
        assert!(late.contains("one clock off"), "{late}");
    }
}
