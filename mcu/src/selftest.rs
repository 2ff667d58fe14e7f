//! Checks the device without any optics.
//!
//! # Invariant
//! A self-test leaves the configuration as it was
//! (`tests::selftest::a_good_device_passes_everything_in_any_resting_state`). Its test frame is one sweep of the FPGA's test
//! generator, which takes 82 microseconds, without light
//! (`tests::selftest::the_test_frame_is_one_sweep_and_nothing_is_taken_meanwhile`). The array is lit by the test of its
//! [`enables`](crate::enables) alone, half of 0.3 milliseconds.
//!
//! Test frame and enables are left out (not in [`SelfTestReport::ran`]) if a fault is latched, a sensor forbids light, the
//! bus has failed, or a bitstream is being loaded: meanwhile no poll repeats a stop that was lost.

use crate::test_frame::{GENERATOR, GENERATOR_FLAGS, expected_sums, look};
use crate::{BusError, FpgaBus, Inputs, Limits, Micros, fpga, safety};
use nirspi_wire::SelfTestReport;
use nirspi_wire::fpga::FpgaFrame;
use nirspi_wire::register::{Register, clocks, status};

/// A test frame in progress.
#[derive(Debug)]
#[cfg_attr(test, derive(Clone))]
pub(crate) struct TestFrame {
    id: u16,
    report: SelfTestReport,
    since: Micros,
}

/// Does the checks that are immediate.
pub(crate) fn examine(bus: &mut impl FpgaBus, inputs: &Inputs, limits: &Limits) -> SelfTestReport {
    let mut report = SelfTestReport::default();
    let answers = fpga::identify(bus).is_ok();
    note(&mut report, SelfTestReport::FPGA_IDENTITY, answers);
    let mut clock = true;
    if answers {
        note(&mut report, SelfTestReport::GATEWARE, fpga::design(bus).is_ok());
        clock = fpga::read(bus, Register::Clocks).is_ok_and(clocks::fit);
        note(&mut report, SelfTestReport::ADC_CLOCK, clock);
    }
    // These registers need the ADC's clock.
    if clock {
        note(&mut report, SelfTestReport::FPGA_BUS, every_bit_holds(bus).unwrap_or(false));
        let dark = fpga::read(bus, Register::Status)
            .is_ok_and(|status| status & (status::LEDS_ON | status::RUNNING) == 0);
        note(&mut report, SelfTestReport::LEDS_OFF, dark);
    }
    let reading = inputs.temperature_centi_celsius;
    let plausible = reading.is_some_and(|reading| safety::plausible(reading, limits));
    note(&mut report, SelfTestReport::TEMPERATURE, plausible);
    note(&mut report, SelfTestReport::INTERLOCK, inputs.interlock_closed);
    if let Some(memory) = bus.memory() {
        note(&mut report, SelfTestReport::MEMORY, memory_holds(memory));
    }
    report
}

fn note(report: &mut SelfTestReport, check: u32, passed: bool) {
    report.ran |= check;
    if !passed {
        report.failed |= check;
    }
}

/// Walks a 1 through zeros and a 0 through ones.
fn every_bit_holds(bus: &mut impl FpgaBus) -> Result<bool, BusError> {
    for bit in 0..u32::BITS {
        for word in [1 << bit, !(1 << bit)] {
            fpga::write(bus, Register::Scratch, word)?;
            if fpga::read(bus, Register::Scratch)? != word {
                return Ok(false);
            }
        }
    }
    Ok(true)
}

/// Memory under test. A trait, so that tests can give one with a fault.
pub(crate) trait Cells {
    /// Writes every byte with the value of its address.
    fn fill(&mut self, pattern: impl Fn(usize) -> u8);
    /// Whether every byte reads so.
    fn reads(&mut self, pattern: impl Fn(usize) -> u8) -> bool;
}

impl Cells for [u8] {
    fn fill(&mut self, pattern: impl Fn(usize) -> u8) {
        for (at, byte) in self.iter_mut().enumerate() {
            *byte = pattern(at);
        }
    }

    fn reads(&mut self, pattern: impl Fn(usize) -> u8) -> bool {
        // Without `black_box` the compiler knows the contents and removes the reads.
        let memory = core::hint::black_box(self);
        memory.iter().enumerate().all(|(at, &byte)| byte == pattern(at))
    }
}

/// Writes and reads every bit as 0 and as 1 between neighbours of either kind, and every byte with
/// a value of its own address.
pub(crate) fn memory_holds(memory: &mut (impl Cells + ?Sized)) -> bool {
    let same = |byte: u8| move |_: usize| byte;
    // The factor is odd and above 256, so bytes that a stuck address line would confuse differ.
    let address = |at: usize| (at.wrapping_mul(0x9E37) >> 8) as u8;
    holds(memory, same(0x00))
        && holds(memory, same(0xFF))
        && holds(memory, same(0x55))
        && holds(memory, same(0xAA))
        && holds(memory, address)
}

fn holds(memory: &mut (impl Cells + ?Sized), pattern: impl Fn(usize) -> u8) -> bool {
    memory.fill(&pattern);
    memory.reads(pattern)
}

fn is_the_test_frame(bytes: &[u8]) -> bool {
    FpgaFrame::parse(bytes).is_ok_and(|frame| {
        frame.header.sweeps == GENERATOR.sweeps
            && frame.header.flags == GENERATOR_FLAGS
            && frame.sums().eq(expected_sums())
    })
}

impl TestFrame {
    /// `report` holds the immediate checks; `id` is the command that waits for the reply.
    pub fn new(id: u16, report: SelfTestReport, now: Micros) -> Self {
        Self { id, report, since: now }
    }

    /// What the rest of the test depends on, with ages for times.
    #[cfg(test)]
    pub fn key(&self, age: impl Fn(Micros) -> u64) -> [u64; 2] {
        [self.id.into(), age(self.since)]
    }

    /// Whether the test frame was right; `None` while the frame may still come.
    pub fn step(&self, now: Micros, bus: &mut impl FpgaBus) -> Option<bool> {
        Some(look(now, self.since, bus, is_the_test_frame)?.unwrap_or(false))
    }

    /// The number of the command to answer, and the whole report.
    pub fn verdict(&self, passed: bool) -> (u16, SelfTestReport) {
        let mut report = self.report;
        note(&mut report, SelfTestReport::TEST_FRAME, passed);
        (self.id, report)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_frame;
    use crate::tests::fake_fpga::FakeFpga;

    #[test]
    fn a_test_frame_passes_when_it_comes_and_fails_when_it_is_late() {
        let (mut bus, limits) = (FakeFpga::default(), Limits::default());
        assert!(test_frame::begin(&mut bus, &GENERATOR, &limits));
        let test = TestFrame::new(7, SelfTestReport::default(), Micros(0));
        assert_eq!(test.step(Micros(1), &mut bus), None);
        assert_eq!(test.step(Micros(200_000), &mut bus), Some(false), "late");
        bus.make_frame();
        assert_eq!(test.step(Micros(1), &mut bus), Some(true));

        let (id, report) = test.verdict(true);
        assert_eq!((id, report.ran, report.failed), (7, SelfTestReport::TEST_FRAME, 0));
        assert_eq!(test.verdict(false).1.failed, SelfTestReport::TEST_FRAME);
    }
}
