//! Tests of the width of samples: 24 bits where no difference can leave them, 32 bits otherwise, and no run beyond.

use super::host_port::{Device, bus};
use super::support::*;
use nirspi_wire::host_port::READ_PACKET;
use nirspi_wire::ready::{self, MAX_NARROW_SAMPLES, MAX_SUMMED_SAMPLES};
use nirspi_wire::register::{Register, mode};
use nirspi_wire::samples::Width::{self, Bits24, Bits32};
use nirspi_wire::{Answer, Command, ConfigField, ConfigProblem, Configuration, Refusal, RunLength};
use std::vec::Vec;

/// The width of the samples of a run with this configuration, as the host reads them.
fn width_of(configuration: Configuration<'_>) -> Width {
    let mut bench = Bench::open();
    assert_eq!(bench.ask(Command::Configure(configuration)), Ok(Answer::Done));
    bench.ask(Command::Start(RunLength::Frames(3))).unwrap();
    for _ in 0..3 {
        bench.frame();
    }
    let heard = bench.heard();
    let widths: Vec<Width> = frames(&heard).iter().map(|frame| frame.samples.width()).collect();
    assert_eq!(widths, [widths[0]; 3]);
    let is_narrow = bench.fpga.get(Register::Mode) & mode::NARROW != 0;
    assert_eq!(is_narrow, widths[0] == Bits24);
    widths[0]
}

/// One sample more in a sum, and a bright pattern could leave 24 bits.
#[test]
fn a_run_whose_samples_can_leave_24_bits_has_samples_of_32() {
    for (clocks_per_pattern, blanked, sweeps) in [(5, 2, 170), (5, 4, 512), (514, 2, 1)] {
        let at = Configuration { clocks_per_pattern, blanked, sweeps, ..SMALL };
        assert!(u32::from(clocks_per_pattern - blanked) * sweeps <= MAX_NARROW_SAMPLES);
        assert_eq!(width_of(at), Bits24);
        let over = match clocks_per_pattern {
            514 => Configuration { clocks_per_pattern: 515, ..at },
            _ => Configuration { sweeps: sweeps + 1, ..at },
        };
        assert_eq!(width_of(over), Bits32);
    }
}

/// A frame may have as many sweeps as always fit into 32 bits, and not one more. The refusal names the most.
#[test]
fn a_run_whose_samples_can_leave_32_bits_is_refused() {
    for samples_a_sweep in [1, 2, 4] {
        let most = MAX_SUMMED_SAMPLES / u32::from(samples_a_sweep);
        let at = Configuration {
            clocks_per_pattern: 6,
            blanked: 6 - samples_a_sweep,
            sweeps: most,
            ..SMALL
        };
        assert_eq!(width_of(at), Bits32);
        for found in [most + 1, u32::MAX] {
            let over = Configuration { sweeps: found, ..at };
            let refused = Bench::open().ask(Command::Configure(over));
            let field = ConfigField::Sweeps;
            let problem = ConfigProblem::OutOfRange { field, found, min: 1, max: most };
            assert_eq!(refused, Err(Refusal::Configuration(problem)));
        }
    }
    // The slowest patterns still have a frame of one sweep.
    let slowest = Configuration { clocks_per_pattern: u16::MAX, blanked: 0, ..SMALL };
    assert_eq!(width_of(slowest), Bits32);
}

#[test]
fn a_packet_of_24_bits_is_read_by_as_many_bytes_as_it_has() {
    let mut device = Device::new(bus());
    let mut expected = Vec::new();
    let wide = Configuration { sweeps: 171, ..SMALL };
    for (configuration, width) in [(SMALL, Bits24), (wide, Bits32), (SMALL, Bits24)] {
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
