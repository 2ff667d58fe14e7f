//! One test for each safety rule: LEDs off within one poll, an event, and no start until the cause
//! is gone and acknowledged.

use super::support::*;
use crate::limits::CLOCK_CHECK;
use crate::{Limits, Micros};
use nirspi_wire::register::{FaultCode, IDENTITY, NO_CLOCK, Register, clocks};
use nirspi_wire::{
    ADC_HZ, Answer, Command, Configuration, EventKind, Fault, Refusal, RunLength, State,
};

/// Breaks something in a running camera, lets `wait` pass, polls once, and checks everything that a
/// fault must cause; then repairs the cause and checks that the camera works again.
fn expect_fault(break_it: impl Fn(&mut Bench), wait: u64, fault: Fault, mend: impl Fn(&mut Bench)) {
    let mut bench = Bench::running(RunLength::Continuous);
    bench.frame();
    bench.heard();
    break_it(&mut bench);
    bench.after(wait);
    assert!(!bench.fpga.leds_on(), "{fault:?}: LEDs still on");
    assert_eq!(bench.camera.state(), State::Fault);

    bench.after(1_000_000);
    let events = bench.heard_events();
    assert_eq!(events[0], EventKind::Fault(fault));
    assert!(matches!(events[1], EventKind::RunEnded { .. }), "{events:?}");
    assert_eq!(events.len(), 2, "{events:?}");
    let refused = Err(Refusal::Fault(fault));
    assert_eq!(bench.ask(Command::Start(RunLength::Continuous)), refused);
    assert_eq!(bench.status().fault, Some(fault));

    mend(&mut bench);
    bench.poll();
    assert_eq!(bench.ask(Command::Start(RunLength::Continuous)), refused, "acknowledged by itself");
    assert_eq!(bench.ask(Command::Configure(SMALL)), Ok(Answer::Done));
    assert_eq!(bench.camera.state(), State::Configured);
    assert_eq!(bench.ask(Command::Start(RunLength::Continuous)), Ok(Answer::Done));
    assert!(bench.fpga.leds_on());
    assert!(bench.heard_events().is_empty());
}

fn fine(_: &mut Bench) {}

#[test]
fn an_open_interlock() {
    expect_fault(
        |bench| bench.inputs.interlock_closed = false,
        0,
        Fault::Interlock,
        |bench| bench.inputs.interlock_closed = true,
    );
}

#[test]
fn too_hot_an_array() {
    expect_fault(
        |bench| bench.inputs.temperature_centi_celsius = Some(6_000),
        0,
        Fault::OverTemperature { centi_celsius: 6_000 },
        |bench| bench.inputs.temperature_centi_celsius = Some(5_000),
    );
}

#[test]
fn a_sensor_that_does_not_answer() {
    expect_fault(
        |bench| bench.inputs.temperature_centi_celsius = None,
        0,
        Fault::TemperatureSensor,
        |bench| bench.inputs = GOOD_INPUTS,
    );
}

#[test]
fn a_sensor_that_reads_what_cannot_be() {
    for reading in [-4_001, 12_501, i16::MIN, i16::MAX] {
        expect_fault(
            |bench| bench.inputs.temperature_centi_celsius = Some(reading),
            0,
            Fault::TemperatureSensor,
            |bench| bench.inputs = GOOD_INPUTS,
        );
    }
}

#[test]
fn each_fault_that_the_fpga_latches() {
    for (code, fault) in [
        (FaultCode::Watchdog, Fault::FpgaWatchdog),
        (FaultCode::Duty, Fault::Duty),
        (FaultCode::OverRange, Fault::OverRange),
        (FaultCode::Interlock, Fault::Interlock),
    ] {
        expect_fault(move |bench| bench.fpga.trip(code), 1_000, fault, fine);
    }
}

#[test]
fn an_fpga_of_another_identity() {
    expect_fault(
        |bench| bench.fpga.identity = 0xFFFF_FFFF,
        1_000,
        Fault::FpgaAbsent { identity: 0xFFFF_FFFF },
        |bench| bench.fpga.identity = IDENTITY,
    );
}

#[test]
fn an_adc_clock_that_is_lost_and_comes_back() {
    expect_fault(
        |bench| bench.fpga.clockless = true,
        1_000,
        Fault::FpgaAbsent { identity: NO_CLOCK },
        |bench| bench.fpga.reset(),
    );
}

fn clock(bench: &mut Bench, hz: u32) {
    let ready = bench.fpga.get(Register::Clocks) & !clocks::FREQUENCY;
    bench.fpga.registers.insert(Register::Clocks.address(), ready | (hz / clocks::UNIT_HZ));
}

/// A PLL without its input coasts, and ticks on.
#[test]
fn an_adc_clock_of_another_frequency() {
    for hz in [0, 22_000_000, 30_000_000, 106_000_000, 144_000_000] {
        expect_fault(
            |bench| clock(bench, hz),
            CLOCK_CHECK.0,
            Fault::FpgaAbsent { identity: NO_CLOCK },
            |bench| clock(bench, ADC_HZ),
        );
    }
    // The time of a watchdog that runs on this clock is not to be trusted, so the look comes before its end.
    let watchdog_us = u64::from(Limits::REFERENCE.watchdog_clocks) / crate::CLOCKS_PER_MICRO;
    assert!(2 * CLOCK_CHECK.0 <= watchdog_us);
}

#[test]
fn an_adc_clock_as_exact_as_the_fpga_can_tell_ends_no_run_and_a_wrong_one_is_not_acknowledged() {
    for hz in [107_000_000, ADC_HZ, 143_000_000] {
        let mut bench = Bench::running(RunLength::Continuous);
        clock(&mut bench, hz);
        bench.after(100_000);
        assert!(bench.fpga.leds_on(), "{hz}");
    }
    let mut bench = Bench::running(RunLength::Continuous);
    clock(&mut bench, 30_000_000);
    bench.after(100_000);
    let fault = Fault::FpgaAbsent { identity: NO_CLOCK };
    assert_eq!(bench.ask(Command::Configure(SMALL)), Err(Refusal::Fault(fault)));
}

#[test]
fn one_wrong_bit_in_a_check_ends_no_run_and_a_wrong_bit_in_each_does() {
    for read in 0..2 {
        for bit in 0..u32::BITS {
            let mut bench = Bench::running(RunLength::Continuous);
            bench.fpga.noise = Some((read, 1 << bit));
            bench.after(1_000);
            assert_eq!(bench.fpga.noise, Some((0, 0)), "no check has read it");
            assert!(bench.fpga.leds_on(), "bit {bit} of read {read}");
            assert_eq!(bench.heard_events(), []);
        }
    }
    let mut bench = Bench::running(RunLength::Continuous);
    bench.fpga.identity = IDENTITY ^ 1;
    bench.after(1_000);
    assert!(!bench.fpga.leds_on());
}

#[test]
fn gateware_of_another_version_or_design_is_refused_before_light() {
    for (register, other) in [(Register::Version, 0x0000_0100), (Register::Design, 9)] {
        let mut bench = Bench::open();
        bench.fpga.registers.insert(register.address(), other);
        let refused = Err(Refusal::Fault(Fault::FpgaAbsent { identity: IDENTITY }));
        assert_eq!(bench.ask(Command::Configure(SMALL)), refused, "{register:?}");
        bench.fpga.registers.insert(register.address(), register.reset());
        assert_eq!(bench.ask(Command::Configure(SMALL)), Ok(Answer::Done));
    }
}

#[test]
fn an_fpga_that_has_been_reset() {
    expect_fault(|bench| bench.fpga.reset(), 1_000, Fault::FpgaStalled, fine);
}

#[test]
fn a_run_that_makes_no_frames() {
    expect_fault(fine, 250_001, Fault::FpgaStalled, fine);
}

#[test]
fn a_run_of_long_frames_is_given_the_time_of_eight() {
    let mut bench = Bench::configured();
    // 500 000 clocks a sweep: one second a frame.
    let slow = Configuration { clocks_per_pattern: 62_500, sweeps: 250, blanked: 62_499, ..SMALL };
    bench.ask(Command::Configure(slow)).unwrap();
    bench.ask(Command::Start(RunLength::Continuous)).unwrap();
    for _ in 0..8 {
        bench.after(1_000_000);
        bench.status();
    }
    assert!(bench.fpga.leds_on());
    bench.after(1);
    assert!(!bench.fpga.leds_on());
    assert_eq!(bench.status().fault, Some(Fault::FpgaStalled));
}

#[test]
fn a_silent_host() {
    let limit = Limits::SIMULATED.host_silence.0;
    let mut bench = Bench::running(RunLength::Continuous);
    for _ in 0..limit / 10_000 {
        bench.fpga.make_frame();
        bench.after(10_000);
    }
    assert!(bench.fpga.leds_on());
    bench.after(1);
    assert!(!bench.fpga.leds_on());
    assert!(bench.heard_events().contains(&EventKind::Fault(Fault::HostSilent)));
    assert_eq!(bench.ask(Command::Configure(SMALL)), Ok(Answer::Done));
}

#[test]
fn a_host_that_asks_for_status_is_not_silent() {
    let mut bench = Bench::running(RunLength::Continuous);
    for _ in 0..1_000 {
        bench.fpga.make_frame();
        bench.after(10_000);
        if bench.now.0 % 1_000_000 < 10_000 {
            bench.status();
        }
    }
    assert!(bench.fpga.leds_on());
    assert_eq!(bench.heard_events(), []);
}

#[test]
fn a_dead_bus_is_an_absent_fpga_and_is_told_again_to_stop_on_every_poll() {
    let mut bench = Bench::running(RunLength::Continuous);
    bench.fpga.dead = true;
    bench.after(1_000);
    assert_eq!(bench.camera.state(), State::Fault);
    assert_eq!(bench.heard_events()[0], EventKind::Fault(Fault::FpgaAbsent { identity: 0 }));
    bench.fpga.dead = false;
    assert!(bench.fpga.leds_on(), "the stop cannot have arrived yet");
    bench.after(1);
    assert!(!bench.fpga.leds_on());
}

#[test]
fn a_stop_that_is_lost_on_the_bus_is_repeated() {
    let mut bench = Bench::running(RunLength::Continuous);
    bench.fpga.deaf = true;
    bench.send(Command::Stop);
    bench.fpga.deaf = false;
    assert!(bench.fpga.leds_on(), "the stop cannot have arrived yet");
    bench.after(1);
    assert!(!bench.fpga.leds_on());
}

#[test]
fn a_rule_also_speaks_where_only_bytes_come_in() {
    let mut bench = Bench::running(RunLength::Continuous);
    bench.inputs.interlock_closed = false;
    let _ = bench.receive(&[0]);
    assert!(!bench.fpga.leds_on());
}

#[test]
fn an_over_temperature_lasts_until_the_release_point() {
    let mut bench = Bench::running(RunLength::Continuous);
    bench.inputs.temperature_centi_celsius = Some(6_100);
    bench.poll();
    bench.inputs.temperature_centi_celsius = Some(5_001);
    let still_hot = Fault::OverTemperature { centi_celsius: 5_001 };
    assert_eq!(bench.ask(Command::Configure(SMALL)), Err(Refusal::Fault(still_hot)));
    bench.inputs.temperature_centi_celsius = Some(5_000);
    assert_eq!(bench.ask(Command::Configure(SMALL)), Ok(Answer::Done));
    // Between release point and trip point a running camera goes on.
    bench.inputs.temperature_centi_celsius = Some(5_999);
    assert_eq!(bench.ask(Command::Start(RunLength::Continuous)), Ok(Answer::Done));
    bench.poll();
    assert!(bench.fpga.leds_on());
}

#[test]
fn a_fault_is_not_acknowledged_while_its_cause_stands() {
    let mut bench = Bench::running(RunLength::Continuous);
    bench.inputs.interlock_closed = false;
    bench.poll();
    let refused = Err(Refusal::Fault(Fault::Interlock));
    assert_eq!(bench.ask(Command::Configure(SMALL)), refused);
    // The FPGA's own interlock input counts as much as the board's.
    bench.inputs.interlock_closed = true;
    bench.fpga.interlock_closed = false;
    assert_eq!(bench.ask(Command::Configure(SMALL)), refused);
    assert_eq!(bench.camera.state(), State::Fault);
    bench.fpga.interlock_closed = true;
    bench.fpga.identity = 0;
    let absent = Fault::FpgaAbsent { identity: 0 };
    assert_eq!(bench.ask(Command::Configure(SMALL)), Err(Refusal::Fault(absent)));
}

#[test]
fn the_first_reason_stands_and_is_told_once() {
    let mut bench = Bench::running(RunLength::Continuous);
    bench.inputs.interlock_closed = false;
    bench.poll();
    bench.inputs.temperature_centi_celsius = None;
    bench.after(10_000_000);
    let faults: usize = bench
        .heard_events()
        .iter()
        .map(|event| usize::from(matches!(event, EventKind::Fault(_))))
        .sum();
    assert_eq!(faults, 1);
    assert_eq!(bench.status().fault, Some(Fault::Interlock));
}

#[test]
fn rules_hold_at_rest_and_without_a_host() {
    let mut bench = Bench::new();
    bench.inputs.interlock_closed = false;
    bench.poll();
    assert_eq!(bench.camera.state(), State::Fault);
    assert!(bench.link.packets.is_empty(), "nobody listens");
}

#[test]
fn leds_found_on_at_rest_go_off_at_the_first_poll() {
    let mut bench = Bench::new();
    bench.fpga.running = true;
    bench.after(100_000);
    assert!(!bench.fpga.leds_on());
    assert_eq!(bench.camera.state(), State::Idle);
}

#[test]
fn a_host_that_is_gone_leaves_no_light_and_no_acknowledged_fault() {
    let mut bench = Bench::running(RunLength::Continuous);
    bench.close_link();
    assert!(!bench.fpga.leds_on());
    assert_eq!(bench.camera.state(), State::Idle);

    let mut bench = Bench::running(RunLength::Continuous);
    bench.inputs.interlock_closed = false;
    bench.poll();
    bench.close_link();
    assert_eq!(bench.camera.state(), State::Fault);
}

#[test]
fn a_start_that_the_fpga_does_not_take_is_a_fault() {
    let mut bench = Bench::configured();
    bench.fpga.interlock_closed = false;
    let refused = bench.ask(Command::Start(RunLength::Continuous));
    assert_eq!(refused, Err(Refusal::Fault(Fault::Interlock)));
    assert_eq!(bench.heard_events(), [EventKind::Fault(Fault::Interlock)]);

    // The FPGA has lost its settings since they were written.
    let mut bench = Bench::configured();
    bench.fpga.reset();
    let refused = bench.ask(Command::Start(RunLength::Continuous));
    assert_eq!(refused, Err(Refusal::Fault(Fault::FpgaConfiguration)));
    assert!(!bench.fpga.leds_on());

    let mut bench = Bench::configured();
    bench.fpga.deaf = true;
    let refused = bench.ask(Command::Start(RunLength::Continuous));
    assert_eq!(refused, Err(Refusal::Fault(Fault::FpgaStalled)));
}

#[test]
fn a_jump_of_the_clock_with_a_frame_waiting_is_no_stall() {
    let mut bench = Bench::running(RunLength::Continuous);
    bench.fpga.make_frame();
    bench.after(1_900_000);
    assert!(bench.fpga.leds_on());
    bench.now = Micros(0);
    bench.poll();
    assert!(bench.fpga.leds_on(), "time that goes backwards is no time");
}

#[test]
fn the_fpga_is_left_in_peace_between_checks() {
    let mut bench = Bench::running(RunLength::Continuous);
    bench.after(1_000);
    let before = bench.fpga.accesses;
    for _ in 0..99 {
        bench.after(10);
    }
    assert_eq!(bench.fpga.accesses, before);
    bench.after(10);
    assert_eq!(bench.fpga.accesses, before + 2);
    assert_eq!(bench.fpga.get(Register::Watchdog), 25_000_000);
}
