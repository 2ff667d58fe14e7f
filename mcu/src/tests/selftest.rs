//! Tests that each check passes on a good device and fails on a device with one matching fault.

use super::support::*;
use crate::selftest::{Cells, memory_holds};
use nirspi_wire::register::{Register, clocks, mode};
use nirspi_wire::{
    Answer, Command, EventKind, Fault, Refusal, RunLength, SelfTestReport as Report, State,
};

use std::rc::Rc;
use std::vec::Vec;

const ALL: u32 = 0b111_1011_1111;

/// What a test of the LED enables adds.
const LIT: u32 = Report::BOARD_ENABLE | Report::FPGA_ENABLE;

fn self_test(bench: &mut Bench) -> Report {
    bench.fpga.instant = true;
    match bench.ask_slowly(Command::SelfTest) {
        Ok(Answer::SelfTest(report)) => report,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_good_device_passes_everything_in_any_resting_state() {
    let mut idle = Bench::open();
    assert_eq!(self_test(&mut idle), Report { ran: ALL, failed: 0 });
    assert_eq!(idle.camera.state(), State::Idle);

    let mut bench = Bench::configured();
    assert_eq!(self_test(&mut bench), Report { ran: ALL, failed: 0 });
    assert_eq!(bench.camera.state(), State::Configured);
    let mode = mode::DIFFERENTIAL | mode::ALTERNATING | mode::PACKETS | mode::NARROW;
    assert_eq!(bench.fpga.get(Register::Mode), mode, "the configuration is back");
    assert_eq!(bench.fpga.get(Register::Patterns), 4);
    bench.fpga.instant = false;
    assert_eq!(bench.ask(Command::Start(RunLength::Continuous)), Ok(Answer::Done));
}

#[test]
fn the_test_frame_is_one_sweep_and_nothing_is_taken_meanwhile() {
    let mut bench = Bench::open();
    bench.send(Command::SelfTest);
    assert_eq!(bench.camera.state(), State::Running);
    assert!(bench.fpga.running && !bench.fpga.leds_on(), "it is without light");
    assert_eq!((bench.fpga.get(Register::Frames), bench.fpga.get(Register::Sweeps)), (1, 1));
    assert_eq!(bench.receive(&packet(9, Command::Status)), 0);
    bench.fpga.make_frame();
    // The LED enables follow, whose frames do not come here.
    bench.poll();
    bench.poll();
    assert_eq!(bench.receive(&packet(9, Command::Status)), 0);
    assert_eq!(bench.camera.state(), State::Running);
    bench.after(1_000);
    bench.after(100_001);
    assert_eq!(bench.camera.state(), State::Idle);
    assert_eq!(bench.heard().len(), 1);
}

#[test]
fn a_wrong_sum_fails_the_test_frame() {
    let mut bench = Bench::configured();
    bench.send(Command::SelfTest);
    // One clock of latency too many gives an intact frame with wrong sums.
    bench.fpga.registers.insert(Register::Latency.address(), 4);
    bench.fpga.make_frame();
    bench.poll();
    let Ok(Answer::SelfTest(report)) = (match bench.heard()[0] {
        nirspi_wire::DeviceMessage::Reply(reply) => reply.outcome,
        ref other => panic!("{other:?}"),
    }) else {
        panic!("refused");
    };
    assert_eq!(report, Report { ran: ALL & !LIT, failed: Report::TEST_FRAME });
    assert_eq!(bench.fpga.get(Register::Latency), 3, "the configuration is back");
}

#[test]
fn a_test_frame_that_does_not_come_fails_and_leds_go_off() {
    let mut bench = Bench::open();
    bench.send(Command::SelfTest);
    bench.after(100_000);
    assert!(bench.heard().is_empty());
    bench.after(1);
    assert!(!bench.fpga.leds_on());
    assert_eq!(bench.heard().len(), 1);
}

#[test]
fn a_fault_in_mid_test_fails_it_and_is_reported() {
    let mut bench = Bench::open();
    bench.send(Command::SelfTest);
    bench.inputs.interlock_closed = false;
    bench.poll();
    assert!(!bench.fpga.leds_on());
    let heard = bench.heard();
    assert_eq!(heard.len(), 2);
    assert_eq!(events(&heard), [EventKind::Fault(Fault::Interlock)]);
}

#[test]
fn a_bit_of_the_bus_that_is_stuck_is_found_without_light() {
    let mut bench = Bench::configured();
    bench.fpga.stuck_ones = 1 << 18;
    let report = self_test(&mut bench);
    let left_out = LIT | Report::TEST_FRAME | Report::GATEWARE | Report::ADC_CLOCK;
    assert_eq!(report.ran, ALL & !left_out);
    assert_eq!(report.failed, Report::FPGA_IDENTITY | Report::FPGA_BUS);
    let mut bench = Bench::configured();
    bench.fpga.deaf = true;
    assert_eq!(self_test(&mut bench).failed, Report::FPGA_BUS);
}

#[test]
fn a_missing_adc_clock_and_other_gateware_fail_their_own_check_alone() {
    let mut bench = Bench::open();
    bench.fpga.clockless = true;
    let needs_clock = LIT | Report::FPGA_BUS | Report::LEDS_OFF | Report::TEST_FRAME;
    let expected = Report { ran: ALL & !needs_clock, failed: Report::ADC_CLOCK };
    assert_eq!(self_test(&mut bench), expected);

    let mut bench = Bench::open();
    let half_as_fast = bench.fpga.get(Register::Clocks) & !clocks::FREQUENCY | 6_250;
    bench.fpga.registers.insert(Register::Clocks.address(), half_as_fast);
    assert_eq!(self_test(&mut bench).failed, Report::ADC_CLOCK);

    for (register, other) in [(Register::Version, 0x0000_0100), (Register::Design, 9)] {
        let mut bench = Bench::open();
        bench.fpga.registers.insert(register.address(), other);
        assert_eq!(self_test(&mut bench).failed, Report::GATEWARE, "{register:?}");
    }
}

#[test]
fn sensors_are_told_apart() {
    let mut bench = Bench::open();
    bench.inputs.interlock_closed = false;
    assert_eq!(self_test(&mut bench).failed, Report::INTERLOCK);
    bench.inputs.temperature_centi_celsius = None;
    assert_eq!(self_test(&mut bench).failed, Report::INTERLOCK | Report::TEMPERATURE);
}

#[test]
fn leds_that_are_on_at_rest_are_found() {
    let mut bench = Bench::open();
    bench.fpga.running = true;
    assert_eq!(self_test(&mut bench).failed, Report::LEDS_OFF);
}

#[test]
fn a_standing_fault_forbids_the_light_of_the_test_frame() {
    let mut bench = Bench::open();
    bench.inputs.temperature_centi_celsius = Some(7_000);
    bench.poll();
    bench.inputs = GOOD_INPUTS;
    let ran = ALL & !LIT & !Report::TEST_FRAME;
    assert_eq!(self_test(&mut bench), Report { ran, failed: 0 });
    let standing = Fault::OverTemperature { centi_celsius: 7_000 };
    let refused = bench.ask(Command::Start(RunLength::Continuous));
    assert_eq!(refused, Err(Refusal::Fault(standing)));
}

/// Whether the self-test finds a scratch register that reads so.
fn bus_fails(scratch_of: impl Fn(u32) -> u32 + 'static) -> bool {
    let mut bench = Bench::open();
    bench.fpga.scratch_of = Rc::new(scratch_of);
    let failed = self_test(&mut bench).failed;
    assert_eq!(failed & !Report::FPGA_BUS, 0);
    failed != 0
}

#[test]
fn each_bit_of_the_bus_is_tried_as_0_and_as_1_alone_and_beside_another() {
    assert!(!bus_fails(|word| word));
    for bit in 0..32 {
        assert!(bus_fails(move |word| word | 1 << bit), "bit {bit} is always 1");
        assert!(bus_fails(move |word| word & !(1 << bit)), "bit {bit} is always 0");
        // Bits that pull each other up or down.
        let both = 1 << bit | 1 << ((bit + 1) % 32);
        assert!(bus_fails(move |word| if word & both != 0 { word | both } else { word }));
        assert!(bus_fails(move |word| if word & both != both { word & !both } else { word }));
        // A bit that stays 0, or goes to 0, only where all others are 1; and the reverse.
        assert!(bus_fails(move |word| if word == !(1 << bit) { word ^ both } else { word }));
        assert!(bus_fails(move |word| if word == 1 << bit { word ^ both } else { word }));
    }
}

/// Bytes, with a fault between what is written and what is read.
struct Faulty<F> {
    bytes: Vec<u8>,
    /// What is read of a byte, from its address and all bytes.
    reads: F,
}

impl<F: Fn(usize, &[u8]) -> u8> Cells for Faulty<F> {
    fn fill(&mut self, pattern: impl Fn(usize) -> u8) {
        self.bytes.iter_mut().enumerate().for_each(|(at, byte)| *byte = pattern(at));
    }

    fn reads(&mut self, pattern: impl Fn(usize) -> u8) -> bool {
        (0..self.bytes.len()).all(|at| (self.reads)(at, &self.bytes) == pattern(at))
    }
}

fn memory_fails(reads: impl Fn(usize, &[u8]) -> u8) -> bool {
    !memory_holds(&mut Faulty { bytes: std::vec![0; 1024], reads })
}

#[test]
fn a_bit_of_the_memory_that_is_stuck_and_an_address_line_that_is_are_found() {
    assert!(!memory_fails(|at, bytes| bytes[at]));
    for bit in 0..8 {
        for place in [0, 1, 500, 1023] {
            let here = move |at: usize| u8::from(at == place) << bit;
            assert!(memory_fails(|at, bytes| bytes[at] | here(at)), "bit {bit} of {place}");
            assert!(memory_fails(|at, bytes| bytes[at] & !here(at)), "bit {bit} of {place}");
        }
    }
    for line in 0..10 {
        assert!(memory_fails(|at, bytes| bytes[at | 1 << line]), "line {line} is always 1");
        assert!(memory_fails(|at, bytes| bytes[at & !(1 << line)]), "line {line} is always 0");
    }
}

/// A byte that fails between neighbours of one kind alone.
#[test]
fn each_pattern_of_the_memory_test_counts() {
    for value in [0x00, 0xFF, 0x55, 0xAA] {
        let all = |bytes: &[u8]| bytes.iter().all(|&byte| byte == value);
        assert!(memory_fails(|at, bytes| bytes[at] ^ u8::from(at == 77 && all(bytes))));
    }
    let differ = |bytes: &[u8]| bytes.iter().any(|&byte| byte != bytes[0]);
    assert!(memory_fails(|at, bytes| bytes[at] ^ u8::from(at == 77 && differ(bytes))));
}

/// A frame buffer without a fault, as a board has it.
#[test]
fn memory_without_a_fault_holds() {
    assert!(memory_holds(&mut [0u8; 300][..]));
}
