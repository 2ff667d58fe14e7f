//! Tests that a stuck LED enable is found by its light, and that nothing else is taken for one.

use super::support::*;
use crate::Limits;
use nirspi_wire::register::{Design, Register};
use nirspi_wire::{
    Answer, Command, EventKind, Fault, GatewareChunk, Refusal, RunLength, SelfTestReport as Report,
    State, crc32,
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

/// A camera that is configured, whose first light waits for the test, with an FPGA that makes frames at once.
fn untried() -> Bench {
    let mut bench = Bench::with(Limits::REFERENCE).opened();
    assert_eq!(bench.ask(Command::Configure(SMALL)), Ok(Answer::Done));
    bench.fpga.instant = true;
    bench
}

const RUN: Command<'_> = Command::Start(RunLength::Continuous);
const BURST: Command<'_> = Command::RawBurst { samples: 4 };
const TRIED: [(bool, bool); 3] = [(false, false), (true, true), (false, true)];

fn tried(bench: &mut Bench) -> Vec<(bool, bool)> {
    core::mem::take(&mut bench.fpga.of_pattern_0)
}

#[test]
fn the_first_light_waits_for_each_enable_to_keep_the_array_dark() {
    for first in [RUN, BURST] {
        let mut bench = untried();
        assert!(!bench.fpga.pin, "the configuration leaves the pin low");
        assert_eq!(bench.ask_slowly(first), Ok(Answer::Done), "{first:?}");
        assert_eq!(tried(&mut bench), TRIED, "{first:?}");
        assert_eq!(bench.camera.state(), State::Running);
        assert_eq!(bench.fpga.get(Register::Patterns), 4);
        if first == BURST {
            continue;
        }
        assert!(bench.fpga.leds_on());
        for next in [Command::Stop, Command::Configure(SMALL), RUN] {
            assert_eq!(bench.ask_slowly(next), Ok(Answer::Done), "{next:?}");
        }
        assert_eq!(tried(&mut bench), [], "once is enough");
        assert_eq!(bench.ask_slowly(Command::Stop), Ok(Answer::Done));
        assert!(bench.fpga.pin, "no frame of a later run begins dark");
    }
}

#[test]
fn a_self_test_that_found_both_sound_spares_the_first_light_its_own() {
    let mut bench = untried();
    assert_eq!(enables(&mut bench), (BOTH, 0));
    tried(&mut bench);
    assert_eq!(bench.ask_slowly(RUN), Ok(Answer::Done));
    assert_eq!(tried(&mut bench), []);
}

#[test]
fn a_stuck_enable_refuses_the_first_light() {
    for (stuck, fault) in
        [((false, true), Fault::BoardEnableStuck), ((true, false), Fault::FpgaEnableStuck)]
    {
        for first in [RUN, BURST] {
            let mut bench = untried();
            bench.fpga.stuck = stuck;
            assert_eq!(bench.ask_slowly(first), Err(Refusal::Fault(fault)));
            assert_eq!(bench.heard_events(), [EventKind::Fault(fault)]);
            assert!(!bench.fpga.running && !bench.fpga.pin);
            assert_eq!(bench.ask(Command::Configure(SMALL)), Err(Refusal::Fault(fault)));
        }
    }
}

/// A covered lens is no fault: the run begins, and the next one tries again.
#[test]
fn a_dark_scene_delays_the_first_light_and_does_not_forbid_it() {
    let mut bench = untried();
    bench.fpga.array_counts = 63;
    for _ in 0..2 {
        assert_eq!(bench.ask_slowly(RUN), Ok(Answer::Done));
        assert_eq!(tried(&mut bench), TRIED);
        assert!(bench.fpga.leds_on());
        assert_eq!(bench.ask_slowly(Command::Stop), Ok(Answer::Done));
    }
}

/// One wrong bit must not latch a fault.
#[test]
fn a_test_without_its_frame_refuses_the_first_light_and_latches_nothing() {
    let mut bench = untried();
    bench.fpga.instant = false;
    bench.send(RUN);
    bench.after(2_000);
    bench.after(100_001);
    bench.after(100_001);
    let replies = bench.heard();
    let [nirspi_wire::DeviceMessage::Reply(reply)] = &replies[..] else { panic!("{replies:?}") };
    assert_eq!(reply.outcome, Err(Refusal::Bus));
    assert_eq!((bench.camera.state(), bench.status().fault), (State::Configured, None));
    assert!(!bench.fpga.running);
    bench.fpga.instant = true;
    assert_eq!(bench.ask_slowly(RUN), Ok(Answer::Done));
}

#[test]
fn an_interlock_that_opens_during_the_test_refuses_the_first_light() {
    let mut bench = untried();
    bench.send(RUN);
    bench.after(500);
    bench.inputs.interlock_closed = false;
    bench.after(500);
    let replies = bench.heard();
    let refused = |message: &_| {
        matches!(message, nirspi_wire::DeviceMessage::Reply(reply)
            if reply.outcome == Err(Refusal::Fault(Fault::Interlock)))
    };
    assert!(replies.iter().any(refused), "{replies:?}");
    assert!(!bench.fpga.running && !bench.fpga.pin);
}

#[test]
fn a_length_that_no_run_has_is_refused_without_light() {
    for command in [Command::Start(RunLength::Frames(0)), Command::RawBurst { samples: 0 }] {
        let mut bench = untried();
        assert!(bench.ask(command).is_err());
        assert_eq!(tried(&mut bench), []);
    }
}

#[test]
fn gateware_that_was_loaded_is_tried_again() {
    let mut bench = untried();
    assert_eq!(bench.ask_slowly(RUN), Ok(Answer::Done));
    assert_eq!(bench.ask_slowly(Command::Stop), Ok(Answer::Done));
    tried(&mut bench);
    let piece = GatewareChunk { offset: 0, total: 1, crc: crc32(&[7]), data: &[7] };
    assert_eq!(bench.ask(Command::LoadGateware(piece)), Ok(Answer::Gateware { next_offset: 1 }));
    assert_eq!(bench.ask_slowly(Command::Configure(SMALL)), Ok(Answer::Done));
    assert_eq!(bench.ask_slowly(RUN), Ok(Answer::Done));
    assert_eq!(tried(&mut bench), TRIED);
}

#[test]
fn the_bring_up_design_lights_without_a_test() {
    let mut bench = untried();
    bench.fpga.registers.insert(Register::Design.address(), Design::BringUp as u32);
    assert_eq!(bench.ask(RUN), Ok(Answer::Done));
    assert_eq!(tried(&mut bench), []);
}
