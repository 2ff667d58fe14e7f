//! Tests of the effect of each command, and of each reason for refusing a command.

use super::support::*;
use nirspi_wire::packet::MAX_HOST_PACKET;
use nirspi_wire::register::{Design, IDENTITY, ORDER_TABLE, Register, mode};
use nirspi_wire::samples::Words;
use nirspi_wire::{
    Answer, Capabilities, Command, ConfigField, ConfigProblem, Configuration, DeviceMessage,
    EventKind, Identity, PatternOrder, RebootInto, Refusal, RunLength, SampleSource, State,
    Version, version,
};
use std::vec::Vec;

#[test]
fn hello_tells_who_the_device_is() {
    let mut bench = Bench::new();
    let Ok(Answer::Hello(identity)) = bench.ask(Command::Hello { protocol: version::CURRENT })
    else {
        panic!("no identity");
    };
    let expected = Identity {
        protocol: version::CURRENT,
        firmware: Version(1, 2, 3),
        gateware: Version(0, 4, 0),
        board: "bench",
        serial: "0001",
        side: 32,
        adc_hz: 125_000_000,
        adc_bits: 14,
        wavelength_nm: 1550,
        capabilities: Capabilities::LOAD_GATEWARE,
    };
    assert_eq!(identity, expected);
}

#[test]
fn a_camera_says_in_its_greeting_that_its_fpga_runs_the_bring_up_design() {
    let mut bench = Bench::new();
    bench.fpga.registers.insert(Register::Design.address(), Design::BringUp as u32);
    let Ok(Answer::Hello(identity)) = bench.ask(Command::Hello { protocol: version::CURRENT })
    else {
        panic!("no identity");
    };
    let capabilities = Capabilities::LOAD_GATEWARE.with(Capabilities::BRING_UP);
    assert_eq!(identity.capabilities, capabilities);
}

#[test]
fn the_longest_identity_fits_its_packet() {
    let mut bench = Bench::new();
    let long = "N".repeat(40);
    let info = crate::BoardInfo::new(&long, &long, Version(255, 255, 255));
    bench.camera = crate::Camera::new(info, crate::Limits::SIMULATED);
    bench.fpga.registers.insert(Register::Version.address(), 0x00FF_FFFF);
    bench.next_id = u16::MAX - 1;
    let Ok(Answer::Hello(identity)) = bench.ask(Command::Hello { protocol: version::CURRENT })
    else {
        panic!("no identity");
    };
    assert_eq!(identity.board, &long[..crate::NAME_BYTES]);
}

#[test]
fn a_gateware_that_does_not_answer_has_version_zero() {
    let mut bench = Bench::new();
    bench.fpga.identity = 0xFFFF_FFFF;
    let answer = bench.ask(Command::Hello { protocol: version::CURRENT });
    assert!(matches!(answer, Ok(Answer::Hello(identity)) if identity.gateware == Version(0, 0, 0)));
}

#[test]
fn a_host_of_another_version_is_told_ours_and_nothing_else() {
    let mut bench = Bench::new();
    let answer = bench.ask(Command::Hello { protocol: version::CURRENT + 1 });
    assert!(matches!(answer, Ok(Answer::Hello(identity)) if identity.protocol == version::CURRENT));
    let refused = Err(Refusal::Protocol { device: version::CURRENT });
    assert_eq!(bench.ask(Command::Status), refused);
    assert_eq!(bench.ask(Command::Configure(SMALL)), refused);
    assert_eq!(bench.camera.state(), State::Idle);
    // A later Hello of the right version opens the session after all.
    assert!(bench.ask(Command::Hello { protocol: version::CURRENT }).is_ok());
    bench.status();
}

#[test]
fn nothing_is_done_before_hello() {
    let mut bench = Bench::new();
    let refused = Err(Refusal::Protocol { device: version::CURRENT });
    assert_eq!(bench.ask(Command::Status), refused);
    assert_eq!(bench.ask(Command::Configure(SMALL)), refused);
}

#[test]
fn hello_in_mid_run_ends_the_run() {
    let mut bench = Bench::running(RunLength::Continuous);
    bench.fpga.make_frame();
    assert!(bench.ask(Command::Hello { protocol: version::CURRENT }).is_ok());
    assert!(!bench.fpga.leds_on());
    let heard = bench.heard();
    assert_eq!(frames(&heard).len(), 1);
    assert!(matches!(events(&heard)[..], [EventKind::RunEnded { frames_made: 1, .. }]));
    assert_eq!(bench.camera.state(), State::Configured);
}

#[test]
fn a_configuration_is_in_the_registers_to_the_last_bit() {
    let table: Vec<u16> = (0..1024).rev().collect();
    let mut room = [0; 2048];
    let words = Words::pack(table.iter().copied(), &mut room).unwrap();
    let mut bench = Bench::open();
    let configuration = Configuration {
        order: PatternOrder::Table(words),
        patterns: 1024,
        differential: true,
        alternating: true,
        clocks_per_pattern: 9,
        blanked: 4,
        adc_latency: 63,
        sweeps: 26_000,
        source: SampleSource::TestPattern,
        over_range_trip: 17,
    };
    assert_eq!(bench.ask(Command::Configure(configuration)), Ok(Answer::Done));
    assert_eq!(bench.camera.state(), State::Configured);
    let modes = mode::DIFFERENTIAL
        | mode::ALTERNATING
        | mode::ORDER_TABLE
        | mode::TEST_SOURCE
        | mode::PACKETS;
    for (register, value) in [
        (Register::Mode, modes),
        (Register::Patterns, 1024),
        (Register::Dwell, 9),
        (Register::Blank, 4),
        (Register::Latency, 63),
        (Register::Sweeps, 26_000),
        (Register::OverRangeTrip, 17),
        (Register::Watchdog, 25_000_000),
        (Register::DutyLimit, 1_310_720),
    ] {
        assert_eq!(bench.fpga.get(register), value, "{register:?}");
    }
    for (address, entry) in (ORDER_TABLE..).zip(table) {
        assert_eq!(bench.fpga.registers[&address], u32::from(entry));
    }
    assert_eq!(bench.status().duty_permille, 500);
}

#[test]
fn settings_that_do_not_arrive_leave_nothing_configured() {
    let mut bench = Bench::configured();
    bench.fpga.deaf = true;
    let other = Configuration { sweeps: 2, ..SMALL };
    assert_eq!(bench.ask(Command::Configure(other)), Err(Refusal::Bus));
    assert_eq!(bench.camera.state(), State::Idle);
}

#[test]
fn one_entry_of_the_order_that_does_not_arrive_is_noticed() {
    let mut room = [0; 8];
    let words = Words::pack([5u16, 6, 7, 8].into_iter(), &mut room).unwrap();
    let mut bench = Bench::open();
    bench.fpga.lost_address = Some(ORDER_TABLE + 2);
    let order = PatternOrder::Table(words);
    let refused = bench.ask(Command::Configure(Configuration { order, ..SMALL }));
    assert_eq!(refused, Err(Refusal::Bus));
}

fn problem(configuration: Configuration<'_>) -> ConfigProblem {
    let mut bench = Bench::configured();
    let registers = bench.fpga.registers.clone();
    match bench.ask(Command::Configure(configuration)) {
        Err(Refusal::Configuration(problem)) => {
            assert_eq!(bench.camera.state(), State::Configured, "the one before still stands");
            assert_eq!(bench.fpga.registers, registers, "nothing was written");
            problem
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_number_out_of_range_is_named_with_its_range() {
    use ConfigField::*;
    let wide = Configuration { differential: false, patterns: 100, ..SMALL };
    for (field, found, min, max, configuration) in [
        (Patterns, 0, 1, 1024, Configuration { patterns: 0, ..SMALL }),
        (Patterns, 1025, 1, 1024, Configuration { patterns: 1025, ..SMALL }),
        (ClocksPerPattern, 0, 1, 65_535, Configuration { clocks_per_pattern: 0, ..SMALL }),
        (Blanked, 5, 0, 4, Configuration { blanked: 5, ..SMALL }),
        (AdcLatency, 64, 0, 63, Configuration { adc_latency: 64, ..SMALL }),
        (Sweeps, 0, 1, 43_690, Configuration { sweeps: 0, ..SMALL }),
        (Sweeps, 43_691, 1, 43_690, Configuration { sweeps: 43_691, ..SMALL }),
        (DutyPermille, 1000, 0, 625, Configuration { patterns: 1, ..wide }),
        (DutyPermille, 667, 0, 625, Configuration { patterns: 3, ..wide }),
    ] {
        let expected = ConfigProblem::OutOfRange { field, found, min, max };
        assert_eq!(problem(configuration), expected);
    }
}

#[test]
fn an_order_table_must_name_each_of_its_patterns_once() {
    let mut room = [0; 8];
    let cases: [(&[u16], ConfigProblem); 4] = [
        (&[1, 2, 1, 3], ConfigProblem::OrderEntry { index: 2, found: 1 }),
        (&[1, 2, 3, 1024], ConfigProblem::OrderEntry { index: 3, found: 1024 }),
        (&[1, 2, 3, u16::MAX], ConfigProblem::OrderEntry { index: 3, found: u16::MAX }),
        (
            &[1, 2, 3],
            ConfigProblem::OutOfRange { field: ConfigField::OrderLength, found: 3, min: 4, max: 4 },
        ),
    ];
    for (table, expected) in cases {
        let words = Words::pack(table.iter().copied(), &mut room).unwrap();
        let order = PatternOrder::Table(words);
        assert_eq!(problem(Configuration { order, ..SMALL }), expected);
    }
}

#[test]
fn a_run_of_no_frames_is_refused() {
    let mut bench = Bench::configured();
    let problem =
        ConfigProblem::OutOfRange { field: ConfigField::Frames, found: 0, min: 1, max: u32::MAX };
    let refused = Err(Refusal::Configuration(problem));
    assert_eq!(bench.ask(Command::Start(RunLength::Frames(0))), refused);
    assert!(!bench.fpga.running);
}

#[test]
fn each_state_refuses_what_it_cannot_do() {
    let idle = Err(Refusal::State(State::Idle));
    let mut bench = Bench::open();
    assert_eq!(bench.ask(Command::Start(RunLength::Continuous)), idle);
    assert_eq!(bench.ask(Command::RawBurst { samples: 1 }), idle);
    assert_eq!(bench.ask(Command::Stop), Ok(Answer::Done));

    let running = Err(Refusal::State(State::Running));
    let mut bench = Bench::running(RunLength::Continuous);
    assert_eq!(bench.ask(Command::Configure(SMALL)), running);
    assert_eq!(bench.ask(Command::Start(RunLength::Continuous)), running);
    assert_eq!(bench.ask(Command::RawBurst { samples: 1 }), running);
    assert_eq!(bench.ask(Command::SelfTest), running);
    let chunk = nirspi_wire::GatewareChunk { offset: 0, total: 1, crc: 0, data: &[1] };
    assert_eq!(bench.ask(Command::LoadGateware(chunk)), running);
    assert!(bench.fpga.leds_on());
}

#[test]
fn a_register_is_read_and_one_that_is_not_there_is_named() {
    let mut bench = Bench::configured();
    let read = |bench: &mut Bench, address| bench.ask(Command::ReadRegister { address });
    assert_eq!(read(&mut bench, 0), Ok(Answer::Register(IDENTITY)));
    assert_eq!(read(&mut bench, ORDER_TABLE + 1023), Ok(Answer::Register(0)));
    let beyond = Register::ALL.len() as u16;
    for address in [beyond, ORDER_TABLE - 1, ORDER_TABLE + 1024, u16::MAX] {
        assert_eq!(read(&mut bench, address), Err(Refusal::NoSuchRegister { address }));
    }
    bench.fpga.dead = true;
    assert_eq!(read(&mut bench, 0), Err(Refusal::Bus));
}

#[test]
fn status_counts_and_measures() {
    let mut bench = Bench::running(RunLength::Continuous);
    for _ in 0..3 {
        bench.frame();
    }
    let _ = bench.receive(&[1, 2, 3, 0]);
    let status = bench.status();
    assert_eq!(status.state, State::Running);
    assert_eq!((status.run, status.frames_made, status.frames_sent), (1, 3, 3));
    assert_eq!(status.commands_damaged, 1);
    assert_eq!(status.temperature_centi_celsius, 2500);
    assert_eq!(status.uptime_us, bench.now.0);
    assert!(status.leds_on && status.interlock_closed && status.fault.is_none());
}

/// Somebody may open the enclosure because the status says that the LEDs are off.
#[test]
fn leds_of_an_fpga_that_does_not_answer_count_as_on_in_a_run() {
    for (mut bench, leds_on) in
        [(Bench::running(RunLength::Continuous), true), (Bench::configured(), false)]
    {
        bench.fpga.dead = true;
        assert_eq!(bench.status().leds_on, leds_on);
    }
}

#[test]
fn damaged_commands_are_counted_reported_and_done_with() {
    let mut bench = Bench::open();
    let mut damaged = packet(9, Command::Status);
    damaged[3] ^= 0x40;
    let _ = bench.receive(&damaged);
    let too_long = std::vec![1; MAX_HOST_PACKET + 10];
    assert_eq!(bench.receive(&too_long), too_long.len());
    let _ = bench.receive(&[0]);
    assert_eq!(bench.heard_events(), [EventKind::CommandDamaged; 2]);
    assert_eq!(bench.status().commands_damaged, 2);
}

#[test]
fn a_reboot_is_asked_for_when_its_reply_is_out_and_leds_are_off() {
    let mut bench = Bench::running(RunLength::Continuous);
    bench.link.room = 0;
    bench.send(Command::Reboot(RebootInto::Bootloader));
    assert!(!bench.fpga.leds_on());
    assert_eq!(bench.poll().reboot, None);
    assert_eq!(bench.receive(&packet(50, Command::Status)), 0, "nothing is taken any more");
    bench.link.room = usize::MAX;
    assert_eq!(bench.poll().reboot, Some(RebootInto::Bootloader));
    assert!(
        matches!(bench.heard()[0], DeviceMessage::Reply(reply) if reply.outcome == Ok(Answer::Done))
    );
}

#[test]
fn a_reboot_waits_for_no_host_that_is_gone() {
    let mut bench = Bench::open();
    bench.link.room = 0;
    bench.send(Command::Reboot(RebootInto::Application));
    bench.close_link();
    assert_eq!(bench.poll().reboot, Some(RebootInto::Application));
}

#[test]
fn a_host_that_does_not_read_is_slowed_down_and_loses_no_reply() {
    let mut bench = Bench::running(RunLength::Continuous);
    bench.link.room = 0;
    let bytes: Vec<u8> = (100..150).flat_map(|id| packet(id, Command::Status)).collect();
    let mut taken = bench.receive(&bytes);
    assert!(taken < bytes.len());
    bench.inputs.interlock_closed = false;
    bench.poll();
    assert!(!bench.fpga.leds_on());
    bench.inputs.interlock_closed = true;
    bench.link.room = usize::MAX;
    let mut heard = Vec::new();
    for _ in 0..50 {
        bench.after(10);
        taken += bench.receive(&bytes[taken..]);
        heard.extend(bench.heard());
    }
    assert_eq!(taken, bytes.len());
    let ids: Vec<u16> = heard
        .iter()
        .filter_map(|message| match message {
            DeviceMessage::Reply(reply) => Some(reply.id),
            _ => None,
        })
        .collect();
    assert_eq!(ids, (100..150).collect::<Vec<u16>>());
    assert_eq!(events(&heard).len(), 2, "the fault and the end of the run");
}

#[test]
fn a_link_that_closes_forgets_half_a_command_and_the_session() {
    let mut bench = Bench::configured();
    let whole = packet(7, Command::Status);
    let _ = bench.receive(&whole[..4]);
    bench.close_link();
    assert_eq!(bench.camera.state(), State::Idle);
    let refused = Err(Refusal::Protocol { device: version::CURRENT });
    assert_eq!(bench.ask(Command::Status), refused, "the half command does not damage this one");
}
