//! Tests that a stuck LED enable is found by its light, and that nothing else is taken for one.

use super::support::*;
use nirspi_wire::register::{Design, Register};
use nirspi_wire::{
    Answer, Command, EventKind, Fault, Refusal, RunLength, SelfTestReport as Report, State,
};
use std::vec::Vec;

const BOTH: u32 = Report::BOARD_ENABLE | Report::FPGA_ENABLE;

/// The bits of the two enables, that ran and that failed.
fn enables(bench: &mut Bench) -> (u32, u32) {
    bench.fpga.instant = true;
    match bench.ask_slowly(Command::SelfTest) {
        Ok(Answer::SelfTest(report)) => (report.ran & BOTH, report.failed),
        other => panic!("{other:?}"),
    }
}

/// The runs of a self-test that show pattern 0: whether they are without light, and the level of the board's enable.
fn runs(bench: &mut Bench) -> Vec<(bool, bool)> {
    bench.fpga.instant = true;
    bench.send(Command::SelfTest);
    for _ in 0..40 {
        bench.after(250);
    }
    core::mem::take(&mut bench.fpga.of_pattern_0)
}

#[test]
fn each_enable_is_tried_alone_and_then_both() {
    for mut bench in [Bench::open(), Bench::configured()] {
        let state = bench.camera.state();
        assert_eq!(runs(&mut bench), [(false, false), (true, true), (false, true)]);
        assert_eq!(bench.camera.state(), state);
        assert_eq!(bench.fpga.pin, state == State::Configured);
        assert_eq!(enables(&mut bench), (BOTH, 0));
    }
}

/// The pin changes after a poll, and the array's gates need a moment.
#[test]
fn each_run_begins_a_millisecond_after_the_change_of_the_boards_pin() {
    let mut bench = Bench::open();
    bench.fpga.instant = true;
    bench.send(Command::SelfTest);
    let (mut last, mut pins, mut changed) = (0, bench.fpga.pin, bench.now);
    for _ in 0..400 {
        bench.after(25);
        let runs = bench.fpga.of_pattern_0.len();
        assert!(runs == last || bench.now.since(changed).0 >= 1_000, "run {runs}");
        if bench.fpga.pin != pins {
            (pins, changed) = (bench.fpga.pin, bench.now);
        }
        last = runs;
    }
    assert_eq!(last, 3);
}

#[test]
fn both_enables_are_high_only_after_each_has_kept_the_array_dark() {
    for (stuck, expected) in [
        ((false, true), &[(false, false)][..]),
        ((true, false), &[(false, false), (true, true)]),
        ((true, true), &[(false, false)]),
    ] {
        let mut bench = Bench::configured();
        bench.fpga.stuck = stuck;
        assert_eq!(runs(&mut bench), expected, "{stuck:?}");
        assert!(!bench.fpga.pin && !bench.fpga.running, "{stuck:?}");
    }
}

#[test]
fn a_stuck_enable_is_a_fault_that_no_configuration_acknowledges() {
    for (stuck, fault, seen) in [
        ((false, true), Fault::BoardEnableStuck, (Report::BOARD_ENABLE, Report::BOARD_ENABLE)),
        ((true, false), Fault::FpgaEnableStuck, (BOTH, Report::FPGA_ENABLE)),
    ] {
        let mut bench = Bench::configured();
        bench.fpga.stuck = stuck;
        assert_eq!(enables(&mut bench), seen);
        assert_eq!(bench.heard_events(), [EventKind::Fault(fault)]);
        assert_eq!((bench.camera.state(), bench.status().fault), (State::Fault, Some(fault)));
        for command in [Command::Configure(SMALL), Command::Start(RunLength::Continuous)] {
            assert_eq!(bench.ask(command), Err(Refusal::Fault(fault)));
        }
        assert_eq!(enables(&mut bench).0, 0, "no light with a fault latched");
        assert!(!bench.fpga.leds_on() && !bench.fpga.pin);
    }
}

#[test]
fn without_light_darkness_proves_nothing() {
    for (counts, expected) in [(0, (0, 0)), (63, (0, 0)), (64, (BOTH, 0))] {
        let mut bench = Bench::open();
        bench.fpga.array_counts = counts;
        assert_eq!(enables(&mut bench), expected, "{counts}");
        assert_eq!(bench.camera.state(), State::Idle);
    }
}

/// Daylight is the same in a pattern and its complement; the noise of a mean is a count or two.
#[test]
fn daylight_and_noise_are_no_light_of_the_leds() {
    for (counts, stuck) in [(15, None), (16, Some(Fault::FpgaEnableStuck))] {
        let mut bench = Bench::open();
        (bench.fpga.light, bench.fpga.array_counts) = (9_000, counts);
        bench.fpga.stuck.0 = true;
        enables(&mut bench);
        assert_eq!(bench.status().fault, stuck, "{counts}");
    }
}

#[test]
fn a_frame_that_does_not_come_or_comes_damaged_is_no_stuck_enable() {
    let mut bench = Bench::open();
    bench.send(Command::SelfTest);
    bench.fpga.make_frame();
    bench.poll();
    bench.after(1_000);
    assert!(bench.fpga.running && bench.fpga.get(Register::Patterns) == 1);
    let mut damaged = bench.clone();
    damaged.fpga.make_frame();
    if let Some(frame) = &mut damaged.fpga.frame {
        frame[33] ^= 1;
    }
    damaged.poll();
    bench.after(100_001);
    for mut bench in [bench, damaged] {
        let replies = bench.heard();
        let [nirspi_wire::DeviceMessage::Reply(reply)] = &replies[..] else {
            panic!("{replies:?}")
        };
        let Ok(Answer::SelfTest(report)) = reply.outcome else { panic!("{reply:?}") };
        assert_eq!((report.ran & BOTH, report.failed), (0, Report::TEST_FRAME));
        assert!(bench.status().fault.is_none() && !bench.fpga.running);
    }
}

#[test]
fn an_open_interlock_ends_the_test_in_the_dark() {
    let mut bench = Bench::configured();
    bench.fpga.instant = true;
    bench.send(Command::SelfTest);
    while !(bench.fpga.pin && bench.fpga.get(Register::Patterns) == 1) {
        bench.after(500);
    }
    bench.inputs.interlock_closed = false;
    bench.poll();
    assert!(!bench.fpga.pin && !bench.fpga.running);
    assert_eq!(events(&bench.heard()), [EventKind::Fault(Fault::Interlock)]);
}

/// The bring-up design has no LEDs: its samples are the levels of its own pins, whatever the board's pin does.
#[test]
fn the_bring_up_design_has_no_enables_to_try() {
    let mut bench = Bench::open();
    bench.fpga.registers.insert(Register::Design.address(), Design::BringUp as u32);
    bench.fpga.stuck = (false, true);
    assert_eq!(enables(&mut bench), (0, 0));
    assert_eq!(bench.status().fault, None);
}
