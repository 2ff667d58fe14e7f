//! The bytes of protocol version 1.
//!
//! Until the first release, a change of the protocol changes this file. From the first release on: if a test in this file
//! fails, do not change the test, because the change would lock out every camera and every recording of version 1.

use super::bytes::{holds, packet, samples, unhex, words};
use nirspi_wire::samples::Width;
use nirspi_wire::{
    Answer, Capabilities, Command, ConfigField, ConfigProblem, Configuration, CrashReport, Depth,
    DeviceMessage, Event, EventKind, Fault, Frame, FrameFlags, GatewareChunk, Identity,
    PatternOrder, Raw, RebootInto, Refusal, Reply, Request, RunLength, SampleSource,
    SelfTestReport, Signal, State, Status, Version, open,
};

/// Every command, with its payload.
pub fn requests() -> Vec<(Request<'static>, &'static str)> {
    vec![
        (Request { id: 1, command: Command::Hello { protocol: 1 } }, "01 00 01"),
        (Request { id: 300, command: Command::Hello { protocol: 0xFFFF } }, "ac 02 00 ff ff 03"),
        (
            Request {
                id: 2,
                command: Command::Configure(Configuration {
                    order: PatternOrder::Natural,
                    patterns: 1024,
                    differential: true,
                    alternating: true,
                    clocks_per_pattern: 5,
                    blanked: 2,
                    adc_latency: 7,
                    sweeps: 1,
                    source: SampleSource::Detector,
                    over_range_trip: 4096,
                }),
            },
            "02 01 00 80 08 01 01 05 02 07 01 00 80 20",
        ),
        (
            Request {
                id: 3,
                command: Command::Configure(Configuration {
                    order: PatternOrder::Sequency,
                    patterns: 307,
                    differential: false,
                    alternating: false,
                    clocks_per_pattern: 65_535,
                    blanked: 0,
                    adc_latency: 63,
                    sweeps: u32::MAX,
                    source: SampleSource::TestPattern,
                    over_range_trip: 0,
                }),
            },
            "03 01 01 b3 02 00 00 ff ff 03 00 3f ff ff ff ff 0f 01 00",
        ),
        (
            Request {
                id: 4,
                command: Command::Configure(Configuration {
                    order: PatternOrder::Table(words(&[0x03, 0x00, 0xFF, 0x03, 0x00, 0x00])),
                    patterns: 3,
                    differential: true,
                    alternating: false,
                    clocks_per_pattern: 5,
                    blanked: 2,
                    adc_latency: 0,
                    sweeps: 1,
                    source: SampleSource::Detector,
                    over_range_trip: 4096,
                }),
            },
            "04 01 02 06 03 00 ff 03 00 00 03 01 00 05 02 00 01 00 80 20",
        ),
        (Request { id: 5, command: Command::Start(RunLength::Continuous) }, "05 02 00"),
        (Request { id: 6, command: Command::Start(RunLength::Frames(1000)) }, "06 02 01 e8 07"),
        (Request { id: 7, command: Command::Stop }, "07 03"),
        (Request { id: 8, command: Command::Status }, "08 04"),
        (Request { id: 9, command: Command::SelfTest }, "09 05"),
        (Request { id: 10, command: Command::ReadRegister { address: 0x0400 } }, "0a 06 80 08"),
        (
            Request {
                id: 11,
                command: Command::LoadGateware(GatewareChunk {
                    offset: 2048,
                    total: 582_376,
                    crc: 0xCBF4_3926,
                    data: &[0xFF, 0x00, 0xBD, 0xB3],
                }),
            },
            "0b 07 80 10 e8 c5 23 a6 f2 d0 df 0c 04 ff 00 bd b3",
        ),
        (Request { id: 12, command: Command::RawBurst { samples: 4096 } }, "0c 08 80 20"),
        (Request { id: 13, command: Command::Reboot(RebootInto::Application) }, "0d 09 00"),
        (
            Request { id: 65_535, command: Command::Reboot(RebootInto::Bootloader) },
            "ff ff 03 09 01",
        ),
    ]
}

/// Every message of the device, with its payload.
pub fn device_messages() -> Vec<(DeviceMessage<'static>, &'static str)> {
    vec![
        (
            DeviceMessage::Reply(Reply {
                id: 1,
                outcome: Ok(Answer::Hello(Identity {
                    protocol: 1,
                    firmware: Version(0, 1, 0),
                    gateware: Version(0, 1, 2),
                    board: "virtual",
                    serial: "42",
                    side: 32,
                    adc_hz: 125_000_000,
                    adc_bits: 14,
                    wavelength_nm: 1550,
                    capabilities: Capabilities::DEPTH.with(Capabilities::BOOTLOADER),
                })),
            }),
            "00 01 00 00 01 00 01 00 00 01 02 07 76 69 72 74 75 61 6c 02 34 32 20 c0 b2 cd 3b 0e \
             8e 0c 05",
        ),
        (DeviceMessage::Reply(Reply { id: 2, outcome: Ok(Answer::Done) }), "00 02 00 01"),
        (
            DeviceMessage::Reply(Reply {
                id: 3,
                outcome: Ok(Answer::Status(Status {
                    state: State::Running,
                    fault: None,
                    uptime_us: 1_000_000,
                    run: 3,
                    frames_made: 24_414,
                    frames_sent: 24_410,
                    frames_dropped: 3,
                    fpga_frames_lost: 1,
                    fpga_frames_corrupt: 2,
                    commands_damaged: 4,
                    temperature_centi_celsius: 2_345,
                    duty_permille: 500,
                    leds_on: true,
                    interlock_closed: true,
                    signal: Some(Signal {
                        mean_milli_counts: 8_192_000,
                        signal_milli_counts: 1_000,
                        noise_milli_counts: 10,
                        snr_centi_db: -150,
                        over_range_ppm: 3,
                    }),
                })),
            }),
            "00 03 00 02 02 00 c0 84 3d 03 de be 01 da be 01 03 01 02 04 d2 24 f4 03 01 01 01 80 \
             80 f4 03 e8 07 0a ab 02 03",
        ),
        (
            DeviceMessage::Reply(Reply {
                id: 4,
                outcome: Ok(Answer::Status(Status {
                    state: State::Fault,
                    fault: Some(Fault::OverTemperature { centi_celsius: -4_000 }),
                    uptime_us: u64::MAX,
                    run: u16::MAX,
                    frames_made: 0,
                    frames_sent: 0,
                    frames_dropped: 0,
                    fpga_frames_lost: 0,
                    fpga_frames_corrupt: 0,
                    commands_damaged: 0,
                    temperature_centi_celsius: -4_000,
                    duty_permille: 0,
                    leds_on: false,
                    interlock_closed: false,
                    signal: None,
                })),
            }),
            "00 04 00 02 03 01 01 bf 3e ff ff ff ff ff ff ff ff ff 01 ff ff 03 00 00 00 00 00 00 \
             bf 3e 00 00 00 00",
        ),
        (
            DeviceMessage::Reply(Reply {
                id: 5,
                outcome: Ok(Answer::SelfTest(SelfTestReport { ran: 0b11_1111, failed: 0b1000 })),
            }),
            "00 05 00 03 3f 08",
        ),
        (
            DeviceMessage::Reply(Reply { id: 6, outcome: Ok(Answer::Register(0x4E53_5049)) }),
            "00 06 00 04 c9 a0 cd f2 04",
        ),
        (
            DeviceMessage::Reply(Reply {
                id: 7,
                outcome: Ok(Answer::Gateware { next_offset: 2048 }),
            }),
            "00 07 00 05 80 10",
        ),
        (
            DeviceMessage::Reply(Reply { id: 8, outcome: Err(Refusal::Protocol { device: 1 }) }),
            "00 08 01 00 01",
        ),
        (
            DeviceMessage::Reply(Reply { id: 9, outcome: Err(Refusal::State(State::Idle)) }),
            "00 09 01 01 00",
        ),
        (
            DeviceMessage::Reply(Reply { id: 9, outcome: Err(Refusal::State(State::Configured)) }),
            "00 09 01 01 01",
        ),
        (
            DeviceMessage::Reply(Reply { id: 9, outcome: Err(Refusal::State(State::Running)) }),
            "00 09 01 01 02",
        ),
        (
            DeviceMessage::Reply(Reply { id: 9, outcome: Err(Refusal::State(State::Fault)) }),
            "00 09 01 01 03",
        ),
        (
            DeviceMessage::Reply(Reply {
                id: 10,
                outcome: Err(Refusal::Configuration(ConfigProblem::OutOfRange {
                    field: ConfigField::Patterns,
                    found: 1025,
                    min: 1,
                    max: 1024,
                })),
            }),
            "00 0a 01 02 00 00 81 08 01 80 08",
        ),
        (
            DeviceMessage::Reply(Reply {
                id: 10,
                outcome: Err(Refusal::Configuration(ConfigProblem::OutOfRange {
                    field: ConfigField::ClocksPerPattern,
                    found: 0,
                    min: 1,
                    max: 65_535,
                })),
            }),
            "00 0a 01 02 00 01 00 01 ff ff 03",
        ),
        (
            DeviceMessage::Reply(Reply {
                id: 10,
                outcome: Err(Refusal::Configuration(ConfigProblem::OutOfRange {
                    field: ConfigField::Blanked,
                    found: 5,
                    min: 0,
                    max: 4,
                })),
            }),
            "00 0a 01 02 00 02 05 00 04",
        ),
        (
            DeviceMessage::Reply(Reply {
                id: 10,
                outcome: Err(Refusal::Configuration(ConfigProblem::OutOfRange {
                    field: ConfigField::AdcLatency,
                    found: 64,
                    min: 0,
                    max: 63,
                })),
            }),
            "00 0a 01 02 00 03 40 00 3f",
        ),
        (
            DeviceMessage::Reply(Reply {
                id: 10,
                outcome: Err(Refusal::Configuration(ConfigProblem::OutOfRange {
                    field: ConfigField::Sweeps,
                    found: 0,
                    min: 1,
                    max: u32::MAX,
                })),
            }),
            "00 0a 01 02 00 04 00 01 ff ff ff ff 0f",
        ),
        (
            DeviceMessage::Reply(Reply {
                id: 10,
                outcome: Err(Refusal::Configuration(ConfigProblem::OutOfRange {
                    field: ConfigField::OrderLength,
                    found: 7,
                    min: 1024,
                    max: 1024,
                })),
            }),
            "00 0a 01 02 00 05 07 80 08 80 08",
        ),
        (
            DeviceMessage::Reply(Reply {
                id: 10,
                outcome: Err(Refusal::Configuration(ConfigProblem::OutOfRange {
                    field: ConfigField::DutyPermille,
                    found: 1000,
                    min: 0,
                    max: 625,
                })),
            }),
            "00 0a 01 02 00 06 e8 07 00 f1 04",
        ),
        (
            DeviceMessage::Reply(Reply {
                id: 10,
                outcome: Err(Refusal::Configuration(ConfigProblem::OutOfRange {
                    field: ConfigField::Frames,
                    found: 0,
                    min: 1,
                    max: u32::MAX,
                })),
            }),
            "00 0a 01 02 00 07 00 01 ff ff ff ff 0f",
        ),
        (
            DeviceMessage::Reply(Reply {
                id: 10,
                outcome: Err(Refusal::Configuration(ConfigProblem::OrderEntry {
                    index: 3,
                    found: 1024,
                })),
            }),
            "00 0a 01 02 01 03 80 08",
        ),
        (
            DeviceMessage::Reply(Reply { id: 11, outcome: Err(Refusal::Fault(Fault::Interlock)) }),
            "00 0b 01 03 00",
        ),
        (
            DeviceMessage::Reply(Reply {
                id: 11,
                outcome: Err(Refusal::Fault(Fault::OverTemperature { centi_celsius: 6_001 })),
            }),
            "00 0b 01 03 01 e2 5d",
        ),
        (
            DeviceMessage::Reply(Reply {
                id: 11,
                outcome: Err(Refusal::Fault(Fault::TemperatureSensor)),
            }),
            "00 0b 01 03 02",
        ),
        (
            DeviceMessage::Reply(Reply { id: 11, outcome: Err(Refusal::Fault(Fault::Duty)) }),
            "00 0b 01 03 03",
        ),
        (
            DeviceMessage::Reply(Reply { id: 11, outcome: Err(Refusal::Fault(Fault::OverRange)) }),
            "00 0b 01 03 04",
        ),
        (
            DeviceMessage::Reply(Reply {
                id: 11,
                outcome: Err(Refusal::Fault(Fault::FpgaWatchdog)),
            }),
            "00 0b 01 03 05",
        ),
        (
            DeviceMessage::Reply(Reply {
                id: 11,
                outcome: Err(Refusal::Fault(Fault::FpgaAbsent { identity: 0xFFFF_FFFF })),
            }),
            "00 0b 01 03 06 ff ff ff ff 0f",
        ),
        (
            DeviceMessage::Reply(Reply {
                id: 11,
                outcome: Err(Refusal::Fault(Fault::FpgaConfiguration)),
            }),
            "00 0b 01 03 07",
        ),
        (
            DeviceMessage::Reply(Reply {
                id: 11,
                outcome: Err(Refusal::Fault(Fault::FpgaStalled)),
            }),
            "00 0b 01 03 08",
        ),
        (
            DeviceMessage::Reply(Reply { id: 11, outcome: Err(Refusal::Fault(Fault::HostSilent)) }),
            "00 0b 01 03 09",
        ),
        (
            DeviceMessage::Reply(Reply {
                id: 11,
                outcome: Err(Refusal::Fault(Fault::BoardEnableStuck)),
            }),
            "00 0b 01 03 0a",
        ),
        (
            DeviceMessage::Reply(Reply {
                id: 11,
                outcome: Err(Refusal::Fault(Fault::FpgaEnableStuck)),
            }),
            "00 0b 01 03 0b",
        ),
        (
            DeviceMessage::Reply(Reply {
                id: 12,
                outcome: Err(Refusal::NoSuchRegister { address: 0x0FFF }),
            }),
            "00 0c 01 04 ff 1f",
        ),
        (
            DeviceMessage::Reply(Reply { id: 13, outcome: Err(Refusal::RawLength { max: 4096 }) }),
            "00 0d 01 05 80 20",
        ),
        (
            DeviceMessage::Reply(Reply {
                id: 14,
                outcome: Err(Refusal::GatewareOffset { expected: 4096 }),
            }),
            "00 0e 01 06 80 20",
        ),
        (DeviceMessage::Reply(Reply { id: 15, outcome: Err(Refusal::GatewareCrc) }), "00 0f 01 07"),
        (DeviceMessage::Reply(Reply { id: 16, outcome: Err(Refusal::Unsupported) }), "00 10 01 08"),
        (DeviceMessage::Reply(Reply { id: 17, outcome: Err(Refusal::Bus) }), "00 11 01 09"),
        (DeviceMessage::Reply(Reply { id: 300, outcome: Err(Refusal::Unknown) }), "00 ac 02 01 0a"),
        (
            DeviceMessage::Frame(Frame {
                run: 1,
                sequence: 0,
                device_time_us: 40,
                sweeps: 1,
                flags: FrameFlags::DIFFERENTIAL,
                samples: samples(Width::Bits32, &[0, 1, -1, 81_915, i32::MIN.into()]),
            }),
            "01 01 00 28 01 10 00 14 00 00 00 00 01 00 00 00 ff ff ff ff fb 3f 01 00 00 00 00 80",
        ),
        (
            DeviceMessage::Frame(Frame {
                run: u16::MAX,
                sequence: u32::MAX,
                device_time_us: u64::MAX,
                sweeps: u32::MAX,
                flags: FrameFlags::OVER_RANGE
                    .with(FrameFlags::OVERFLOW)
                    .with(FrameFlags::AFTER_LOSS)
                    .with(FrameFlags::TEST_SOURCE)
                    .with(FrameFlags::DIFFERENTIAL),
                samples: samples(Width::Bits24, &[1, -1, 0x7F_FFFF, -0x80_0000, 0x01_0203]),
            }),
            "01 ff ff 03 ff ff ff ff 0f ff ff ff ff ff ff ff ff ff 01 ff ff ff ff 0f 1f 80 0f 01 \
             00 00 ff ff ff ff ff 7f 00 00 80 03 02 01",
        ),
        (
            DeviceMessage::Frame(Frame {
                run: 0,
                sequence: 5,
                device_time_us: 0,
                sweeps: 1,
                flags: FrameFlags::default(),
                samples: samples(Width::Bits32, &[]),
            }),
            "01 00 05 00 01 00 00 00",
        ),
        (
            DeviceMessage::Raw(Raw {
                first_clock: 2048,
                total: 4096,
                samples: words(&[0x34, 0x12, 0xFF, 0xBF]),
            }),
            "02 80 10 80 20 04 34 12 ff bf",
        ),
        (
            DeviceMessage::Depth(Depth {
                device_time_us: 123_456,
                side: 2,
                distances_mm: words(&[0x2C, 0x01, 0x58, 0x02, 0xE8, 0x03, 0x00, 0x00]),
            }),
            "03 c0 c4 07 02 08 2c 01 58 02 e8 03 00 00",
        ),
        (
            DeviceMessage::Event(Event {
                device_time_us: 1_000,
                kind: EventKind::Fault(Fault::Interlock),
            }),
            "04 e8 07 00 00",
        ),
        (
            DeviceMessage::Event(Event {
                device_time_us: 2_000,
                kind: EventKind::RunEnded {
                    run: 3,
                    frames_made: 1000,
                    frames_dropped: 200,
                    fpga_frames_lost: 30,
                    fpga_frames_corrupt: 4,
                },
            }),
            "04 d0 0f 01 03 e8 07 c8 01 1e 04",
        ),
        (
            DeviceMessage::Event(Event { device_time_us: 3_000, kind: EventKind::RawDropped }),
            "04 b8 17 02",
        ),
        (
            DeviceMessage::Event(Event { device_time_us: 4_000, kind: EventKind::CommandDamaged }),
            "04 a0 1f 03",
        ),
        (
            DeviceMessage::Event(Event {
                device_time_us: 4_000,
                kind: EventKind::FpgaAccessesDamaged { total: 300 },
            }),
            "04 a0 1f 04 ac 02",
        ),
        (
            DeviceMessage::Crash(CrashReport { uptime_us: 5_000, text: "hard fault" }),
            "05 88 27 0a 68 61 72 64 20 66 61 75 6c 74",
        ),
    ]
}

#[test]
fn requests_have_these_bytes() {
    for (request, payload) in requests() {
        holds(&request, &mut packet(&unhex(payload)));
    }
}

#[test]
fn device_messages_have_these_bytes() {
    for (message, payload) in device_messages() {
        holds(&message, &mut packet(&unhex(payload)));
    }
}

#[test]
fn packets_have_these_bytes() {
    // COBS code, payload 07 03 (id 7, Stop), CRC-32, delimiter.
    let stop = Request { id: 7, command: Command::Stop };
    holds(&stop, &mut unhex("07 07 03 82 d5 91 97 00"));
    // Zeros in the payload: 00 02 00 01 (reply, id 2, Ok, Done).
    let done = DeviceMessage::Reply(Reply { id: 2, outcome: Ok(Answer::Done) });
    holds(&done, &mut unhex("01 02 02 06 01 e4 3b c7 55 00"));
    // A run of more than 254 bytes without a zero takes a second code.
    let chunk = GatewareChunk { offset: 1, total: 2, crc: 3, data: &[0x5A; 270] };
    let request = Request { id: 1, command: Command::LoadGateware(chunk) };
    let long = format!(
        "ff 01 07 01 02 03 8e 02 {} 1c {} 74 fe 5f 9d 00",
        ["5a"; 247].join(" "),
        ["5a"; 23].join(" ")
    );
    holds(&request, &mut unhex(&long));
}

/// In no version do these change: so two sides of different versions can say so.
#[test]
fn what_two_versions_tell_each_other_has_these_bytes() {
    // Id, Hello, protocol.
    let hello = Request { id: 300, command: Command::Hello { protocol: 300 } };
    holds(&hello, &mut packet(&unhex("ac 02 00 ac 02")));
    // Reply, id, Err, Protocol, protocol.
    let refusal = Err(Refusal::Protocol { device: 300 });
    let reply = DeviceMessage::Reply(Reply { id: 300, outcome: refusal });
    holds(&reply, &mut packet(&unhex("00 ac 02 01 00 ac 02")));
    // Reply, id, Ok, Hello, protocol; what follows may differ.
    let (_, payload) = device_messages()[0];
    assert!(payload.starts_with("00 01 00 00 01 "));
}

/// Before samples of 24 bits there is 0x80, before samples of 32 bits 0. Any other byte is refused, so that a later version
/// can give it a meaning.
#[test]
fn no_other_byte_stands_before_samples() {
    for form in 0..=u8::MAX {
        let mut bytes = packet(&unhex(&format!("01 00 05 00 01 00 {form:02x} 00")));
        let encoded = bytes.split_last_mut().unwrap().1;
        let taken = open::<DeviceMessage<'_>>(encoded).is_ok();
        assert_eq!(taken, [0, 0x80].contains(&form), "{form:#x}");
    }
}
