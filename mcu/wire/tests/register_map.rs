//! The register map, the frame of the FPGA and the USB identity, which gateware, firmware and hosts share.
//!
//! Until the first release, a change of the map raises the minor [`Register::Version`] and changes this file. From the first
//! release on: if a test in this file fails, do not change the test, because the change would alter what a released
//! gateware means. A new register at a free address is then appended here with a higher minor version; anything else needs
//! a new `Register::Identity` or a new major version, and a new file beside this one.

use nirspi_wire::{
    FrameFlags, SelfTestReport,
    fpga::{self, FpgaFrame, Header, Sums},
    register::{
        self, Design, FaultCode, Register, clocks, control, mode, sampling, status, test_sample,
    },
    usb,
};

/// Address, name, access, value after reset.
const REGISTERS: &str = "\
0x0000 Identity      ReadOnly  0x4e535049
0x0001 Version       ReadOnly  0x00000400
0x0002 Scratch       ReadWrite 0x00000000
0x0003 Control       Command   0x00000000
0x0004 Status        ReadOnly  0x00000000
0x0005 Fault         ReadOnly  0x00000000
0x0006 Clocks        ReadOnly  0x00000000
0x0007 Design        ReadOnly  0x00000001
0x0008 Mode          ReadWrite 0x00000000
0x0009 Patterns      ReadWrite 0x00000400
0x000a Dwell         ReadWrite 0x00000005
0x000b Blank         ReadWrite 0x00000002
0x000c Latency       ReadWrite 0x00000000
0x000d Sweeps        ReadWrite 0x00000001
0x000e Frames        ReadWrite 0x00000000
0x000f RawLength     ReadWrite 0x00001000
0x0010 Watchdog      ReadWrite 0x017d7840
0x0011 DutyLimit     ReadWrite 0x00140000
0x0012 OverRangeTrip ReadWrite 0x00001000
0x0013 FramesMade    ReadOnly  0x00000000
0x0014 FramesLost    ReadOnly  0x00000000
0x0015 ClockLow      ReadOnly  0x00000000
0x0016 ClockHigh     ReadOnly  0x00000000
0x0017 Writes        ReadOnly  0x00000000
0x0018 Run           ReadWrite 0x00000000
0x0019 TimeLow       ReadWrite 0x00000000
0x001a TimeHigh      ReadWrite 0x00000000
0x001b SumLow        ReadOnly  0x00000000
0x001c SumHigh       ReadOnly  0x00000000
0x001d OverRange     ReadOnly  0x00000000
0x001e Sampling      ReadOnly  0x00000000
";

#[test]
fn registers_are_these() {
    let map: String = Register::ALL
        .iter()
        .map(|register| {
            let name = format!("{register:?}");
            let access = format!("{:?}", register.access());
            format!("{:#06x} {name:13} {access:9} {:#010x}\n", register.address(), register.reset())
        })
        .collect();
    assert_eq!(map, REGISTERS);
}

#[test]
fn bits_codes_and_limits_are_these() {
    let control =
        [control::STOP, control::CLEAR_FAULT, control::RELEASE, control::START, control::START_RAW];
    assert_eq!(control, [1, 2, 4, 8, 16]);
    let status = [
        status::RUNNING,
        status::FRAME_READY,
        status::RAW_READY,
        status::LEDS_ON,
        status::FAULT,
        status::INTERLOCK_CLOSED,
        status::CONFIG_ERROR,
        status::WRITE_REFUSED,
    ];
    assert_eq!(status, [1, 2, 4, 8, 16, 32, 64, 128]);
    let mode = [
        mode::DIFFERENTIAL,
        mode::ORDER_SEQUENCY,
        mode::ORDER_TABLE,
        mode::TEST_SOURCE,
        mode::PACKETS,
        mode::NARROW,
        mode::PARALLEL,
        mode::ALTERNATING,
        mode::UNLIT,
    ];
    assert_eq!((mode, mode::DEFINED), ([1, 2, 4, 8, 16, 32, 64, 128, 256], 511));
    let flags = [
        FrameFlags::OVER_RANGE,
        FrameFlags::OVERFLOW,
        FrameFlags::AFTER_LOSS,
        FrameFlags::TEST_SOURCE,
        FrameFlags::DIFFERENTIAL,
    ];
    assert_eq!(flags.map(|flag| flag.0), [1, 2, 4, 8, 16]);
    let codes: Vec<_> = (0..=5).map(FaultCode::from_register).collect();
    let expected = [
        Some(FaultCode::None),
        Some(FaultCode::Watchdog),
        Some(FaultCode::Duty),
        Some(FaultCode::OverRange),
        Some(FaultCode::Interlock),
        None,
    ];
    assert_eq!(codes, expected);
    for code in expected.into_iter().flatten() {
        assert_eq!(FaultCode::from_register(code as u32), Some(code));
    }
    let checks = SelfTestReport::NAMES.map(|(bit, name)| format!("{bit} {name}"));
    let expected = [
        "1 FPGA identity",
        "2 FPGA bus",
        "4 LEDs off at rest",
        "8 test frame",
        "16 temperature sensor",
        "32 interlock",
        "64 frame memory",
        "128 gateware",
        "256 ADC clock",
        "512 board's LED enable",
        "1024 FPGA's LED enable",
    ];
    assert_eq!(checks, expected);
    assert_eq!(register::ORDER_TABLE, 0x0400);
    assert_eq!(register::RAW_SAMPLES_MAX, 4096);
    assert_eq!(register::WAITING_FRAMES, 2);
    assert_eq!(register::WATCHDOG_MAX, 125_000_000);
    assert_eq!(register::DUTY_WINDOW, 1_048_576);
    assert_eq!(register::DUTY_LIMIT_MAX, 1_310_720);
    assert_eq!(register::LATENCY_MAX, 63);
    assert_eq!([register::NO_CLOCK, register::DAMAGED], [0xDEAD_C10C, 0xBAD0_C4EC]);
    let clocks = [clocks::FREQUENCY, clocks::LOCKED, clocks::ALIVE, clocks::READY];
    assert_eq!(clocks, [0xFFFF, 1 << 16, 1 << 17, 1 << 18]);
    assert_eq!([clocks::UNIT_HZ, clocks::WINDOW, clocks::PRESCALER], [10_000, 41_333, 4]);
    let good = clocks::LOCKED | clocks::ALIVE | clocks::READY;
    let fit = |units: u32| clocks::fit(good | units);
    assert_eq!([10_624, 10_625, 12_500, 14_375, 14_376].map(fit), [false, true, true, true, false]);
    assert!(!clocks::fit(0));
    for bit in [clocks::LOCKED, clocks::ALIVE, clocks::READY] {
        assert!(!clocks::fit(12_500 | good & !bit) && !clocks::fit(12_500 | bit), "{bit:#x}");
    }
    let fits = [0x0000_0300, 0x0000_0400, 0x0000_0403, 0x0000_0500, 0x0001_0400]
        .map(register::has_this_map);
    assert_eq!(fits, [false, true, true, false, false]);
    let fields = [sampling::PHASE, sampling::WIDTH, sampling::PERIOD, sampling::DONE];
    assert_eq!(fields, [0xFF, 0xFF00, 0x00FF_0000, 1 << 24]);
    let designs: Vec<_> = (0..=3).map(Design::from_register).collect();
    assert_eq!(designs, [None, Some(Design::Camera), Some(Design::BringUp), None]);
}

#[test]
fn the_test_generator_begins_like_this() {
    let samples: Vec<u16> =
        std::iter::successors(Some(register::TEST_SEED), |&state| Some(test_sample(state)))
            .take(12)
            .collect();
    assert_eq!(samples, [1, 3, 7, 14, 29, 59, 118, 236, 473, 946, 1893, 3786]);
}

#[test]
fn the_bring_up_design_sees_the_lit_leds_of_the_diagonal() {
    assert_eq!(register::loopback(0, 0, true), 512 + 32 * 256);
    assert_eq!(register::loopback(0x8000_0001, 0x8000_0000, true), 512 + 31 * 256);
    assert_eq!(register::loopback(0, u32::MAX, true), 512);
    assert_eq!(register::loopback(0, 0, false), 512);
}

#[test]
fn a_frame_of_the_fpga_has_these_bytes() {
    let header = Header {
        patterns: 2,
        flags: FrameFlags::DIFFERENTIAL.with(FrameFlags::AFTER_LOSS),
        sequence: 0x0403_0201,
        sweeps: 0x0807_0605,
        over_range: 0x0C0B_0A09,
        lost: 0x100F_0E0D,
        clock: 0x1817_1615_1413_1211,
    };
    let sums = [
        Sums { positive: 0x0605_0403_0201, negative: 0x0C0B_0A09_0807 },
        Sums { positive: 0, negative: fpga::SUM_MODULUS - 1 },
    ];
    let frame = [
        &b"NSPF"[..],                                      // magic
        &[0x02, 0x00, 0x14, 0x00],                         // patterns, flags
        &[0x01, 0x02, 0x03, 0x04],                         // sequence
        &[0x05, 0x06, 0x07, 0x08],                         // sweeps
        &[0x09, 0x0A, 0x0B, 0x0C],                         // over-range samples
        &[0x0D, 0x0E, 0x0F, 0x10],                         // lost
        &[0x11, 0x12, 0x13, 0x14, 0x15, 0x16, 0x17, 0x18], // clock
        &[0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x08, 0x09, 0x0A, 0x0B, 0x0C],
        &[0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF],
        &[0x8F, 0x62, 0x0D, 0x35], // CRC-32
    ]
    .concat();
    assert_eq!(frame.len(), fpga::frame_bytes(2));
    let parsed = FpgaFrame::parse(&frame).unwrap();
    assert_eq!(parsed.header, header);
    assert!(parsed.sums().eq(sums));
    let written = [&header.to_bytes()[..], &sums[0].to_bytes(), &sums[1].to_bytes()].concat();
    assert_eq!(written, frame[..56]);
}

#[test]
fn the_usb_identity_is_this() {
    assert_eq!((usb::VENDOR_ID, usb::PRODUCT_ID), (0x1209, 0x0001));
    assert_eq!((usb::MANUFACTURER, usb::PRODUCT), ("nirspi project", "nirspi"));
    let interface = (usb::INTERFACE_CLASS, usb::INTERFACE_SUBCLASS, usb::INTERFACE_PROTOCOL);
    assert_eq!(interface, (0xFF, 0x53, 1));
    assert_eq!((usb::ENDPOINT_OUT, usb::ENDPOINT_IN), (0x01, 0x81));
    assert_eq!(usb::MS_OS_VENDOR_CODE, 0x20);
    assert_eq!(usb::DEVICE_INTERFACE_GUID, "{6E697273-7069-4E49-8001-00001550A032}");
}
