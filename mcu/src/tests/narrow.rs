//! Tests of samples of 24 bits: who gets them, when, and that they are the samples of 32 bits.

use super::host_port::{Device, bus};
use super::support::*;
use crate::Micros;
use nirspi_wire::host_port::READ_PACKET;
use nirspi_wire::ready::{self, MAX_NARROW_SAMPLES, MAX_SUMMED_SAMPLES};
use nirspi_wire::register::{Register, mode};
use nirspi_wire::samples::Width::{self, Bits24, Bits32};
use nirspi_wire::{
    Answer, Capabilities, Command, Configuration, Frame, RunLength, Signal, Tail, version,
};
use std::vec::Vec;

/// Gateware that makes no packets, packets of 32 bits alone, and packets of both widths.
const GATEWARE: [u32; 3] = [0x0300, 0x0304, 0x0305];

const ASKING: Configuration<'static> = Configuration { narrow: Tail(Some(true)), ..SMALL };

/// A camera with this gateware whose host speaks this protocol version and has sent this configuration.
fn configured(protocol: u16, gateware: u32, configuration: Configuration<'_>) -> Bench {
    let mut bench = Bench::new();
    bench.fpga.registers.insert(Register::Version.address(), gateware);
    bench.ask(Command::Hello { protocol }).unwrap();
    assert_eq!(bench.ask(Command::Configure(configuration)), Ok(Answer::Done));
    bench
}

/// The frames of a run of three.
fn run(mut bench: Bench) -> Vec<Frame<'static>> {
    bench.ask(Command::Start(RunLength::Frames(3))).unwrap();
    for _ in 0..3 {
        bench.fpga.clock += 125 * 300;
        bench.frame();
    }
    frames(&bench.heard())
}

/// The one width of these frames.
fn width(frames: &[Frame<'_>]) -> Width {
    let width = frames[0].samples.width();
    assert!(frames.iter().all(|frame| frame.samples.width() == width));
    width
}

#[test]
fn samples_of_24_bits_go_to_a_host_that_asks_for_them_and_to_no_other() {
    for gateware in GATEWARE {
        let able = if gateware == 0x0305 { Bits24 } else { Bits32 };
        for (protocol, narrow, expected) in [
            (version::CURRENT, Some(true), able),
            (version::CURRENT, Some(false), Bits32),
            (version::CURRENT, None, Bits32),
            // A host of an earlier version does not know them, whatever follows its configuration.
            (Width::NARROW_SINCE - 1, Some(true), Bits32),
            (1, Some(true), Bits32),
        ] {
            let configuration = Configuration { narrow: Tail(narrow), ..SMALL };
            let bench = configured(protocol, gateware, configuration);
            let bits = bench.fpga.get(Register::Mode);
            let by_fpga = gateware == 0x0305 && expected == Bits24;
            assert_eq!(bits & mode::NARROW != 0, by_fpga, "{gateware:#x}, {protocol}, {narrow:?}");
            assert_eq!(width(&run(bench)), expected, "{gateware:#x}, {protocol}, {narrow:?}");
        }
    }
}

#[test]
fn a_camera_says_that_it_has_them_since_version_4() {
    for protocol in 2..=version::CURRENT {
        let mut bench = Bench::new();
        let Ok(Answer::Hello(identity)) = bench.ask(Command::Hello { protocol }) else { panic!() };
        let Tail(Some(capabilities)) = identity.capabilities else { panic!("{identity:?}") };
        assert_eq!(capabilities.contains(Capabilities::NARROW_SAMPLES), protocol >= 4);
    }
}

#[test]
fn a_frame_is_the_same_in_both_widths() {
    let of = |frame: &Frame<'_>| {
        let &Frame { run, sequence, device_time_us, sweeps, flags, ref samples } = frame;
        (run, sequence, device_time_us, sweeps, flags, samples.iter().collect::<Vec<_>>())
    };
    let mut runs = Vec::new();
    for gateware in GATEWARE {
        for configuration in [SMALL, ASKING] {
            let frames = run(configured(version::CURRENT, gateware, configuration));
            runs.push(frames.iter().map(of).collect::<Vec<_>>());
        }
    }
    assert_eq!(runs[0].len(), 3);
    assert!(runs[0][0].5.iter().any(|&sample| sample < 0));
    assert!(runs.iter().all(|run| *run == runs[0]), "{runs:?}");
}

/// One sample more in a sum, and a bright pattern could leave 24 bits.
#[test]
fn a_run_whose_samples_can_leave_24_bits_has_samples_of_32() {
    let width_of = |configuration| width(&run(configured(version::CURRENT, 0x0305, configuration)));
    for (clocks_per_pattern, blanked, sweeps) in [(5, 2, 170), (5, 4, 512), (514, 2, 1)] {
        let at = Configuration { clocks_per_pattern, blanked, sweeps, ..ASKING };
        assert!(u32::from(clocks_per_pattern - blanked) * sweeps <= MAX_NARROW_SAMPLES);
        assert_eq!(width_of(at), Bits24);
        let over = match clocks_per_pattern {
            514 => Configuration { clocks_per_pattern: 515, ..at },
            _ => Configuration { sweeps: sweeps + 1, ..at },
        };
        assert_eq!(width_of(over), Bits32);
    }
    for sweeps in [10_000, u32::MAX] {
        assert_eq!(width_of(Configuration { sweeps, ..ASKING }), Bits32);
    }
}

/// The packets of the FPGA have no shift, so its sums may have as many samples as always fit, and not one more.
#[test]
fn the_fpga_makes_packets_of_sums_that_always_fit() {
    let makes = |blanked, sweeps| {
        let configuration = Configuration { clocks_per_pattern: 6, blanked, sweeps, ..SMALL };
        let bench = configured(version::CURRENT, 0x0305, configuration);
        bench.fpga.get(Register::Mode) & mode::PACKETS != 0
    };
    for samples_a_sweep in [2, 4] {
        let most = MAX_SUMMED_SAMPLES / u32::from(samples_a_sweep);
        assert!(makes(6 - samples_a_sweep, most));
        assert!(!makes(6 - samples_a_sweep, most + 1));
    }
}

/// The next configuration may ask for something else, and the next host may know nothing of 24 bits.
#[test]
fn each_configuration_asks_for_itself() {
    let mut bench = configured(version::CURRENT, 0x0305, ASKING);
    assert_ne!(bench.fpga.get(Register::Mode) & mode::NARROW, 0);
    bench.ask(Command::Configure(SMALL)).unwrap();
    assert_eq!(width(&run(bench.clone())), Bits32);
    bench.ask(Command::Configure(ASKING)).unwrap();
    bench.ask(Command::Hello { protocol: 3 }).unwrap();
    bench.ask(Command::Configure(ASKING)).unwrap();
    assert_eq!(width(&run(bench)), Bits32);
}

/// What the signal meter says of light that flickers, with samples of this width.
fn signal(gateware: u32, configuration: Configuration<'_>) -> Signal {
    let mut bench = configured(version::CURRENT, gateware, configuration);
    bench.fpga.noise_of = |sequence, k| 3_000 * k + u64::from(sequence * 7 + k as u32 * 5) % 11;
    bench.ask(Command::Start(RunLength::Continuous)).unwrap();
    for _ in 0..4 {
        bench.frame();
    }
    bench.now = Micros(bench.now.0 + 1);
    bench.status().signal.0.flatten().expect("a signal")
}

#[test]
fn the_signal_meter_sees_the_same_in_both_widths() {
    let expected = signal(0x0300, SMALL);
    assert!(expected.noise_milli_counts > 0 && expected.signal_milli_counts > 0);
    for gateware in GATEWARE {
        assert_eq!(signal(gateware, ASKING), expected, "{gateware:#x}");
    }
}

#[test]
fn a_packet_of_24_bits_is_read_by_as_many_bytes_as_it_has() {
    let mut device = Device::new(bus());
    device.bus.port().fpga.make_packets();
    let mut expected = Vec::new();
    for (configuration, width) in [(ASKING, Bits24), (SMALL, Bits32), (ASKING, Bits24)] {
        device.ask(Command::Configure(configuration));
        device.ask(Command::Start(RunLength::Continuous));
        device.bus.port().fpga.make_frame();
        let made = device.bus.port().fpga.frame.clone().unwrap();
        device.turn(&[]);
        assert_eq!(device.link.packets.last(), Some(&made));
        device.heard();
        device.ask(Command::Stop);
        expected.push((READ_PACKET, ready::fast_read_bytes(4, width)));
    }
    assert_eq!(device.bus.port().transfers, expected);
    assert_eq!(expected[0].1 + 4, expected[1].1);
}
