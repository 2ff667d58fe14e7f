//! Tests of the throughput of the FPGA's host port: the firmware in front of the gateware's model, in simulated time.

use nirspi_hdl_model::{AdcSample, Gateware};
use nirspi_mcu::{BusError, HostPort};
use nirspi_tests::pages::{page, table};
use nirspi_tests::throughput::{PACKET_SCK_PS, Processor, SCK_PS, Stretch, TimedPort, stretch};
use nirspi_wire::host_port::{DUMMY_CYCLES, READ_FRAME, READ_PACKET, SEALED_BYTES, seal, unseal};
use nirspi_wire::ready::{FAST_LEAD_BYTES, LEAD_BYTES};
use nirspi_wire::register::Register;

/// Period of the ADC's clock.
const ADC_PS: u64 = 8_000;
/// Clocks of `sck` for an opcode and an address.
const BEGIN: u64 = 8 + 4;

/// The golden model at the end of wires.
struct Wires {
    fpga: Gateware,
    /// What the gateware says of its version.
    version: u32,
    now_ps: u64,
    ticked_ps: u64,
}

impl Wires {
    fn new(version: u32) -> Self {
        let mut fpga = Gateware::new();
        fpga.set_interlock(true);
        Self { fpga, version, now_ps: 0, ticked_ps: 0 }
    }

    fn sck(&mut self, clocks: u64) {
        self.pass(clocks * SCK_PS);
    }
}

impl HostPort for Wires {
    fn write(&mut self, address: u16, sealed: [u8; SEALED_BYTES]) -> Result<(), BusError> {
        self.sck(BEGIN + 2 * SEALED_BYTES as u64);
        self.fpga.write(address, unseal(address, sealed).expect("the firmware seals every write"));
        Ok(())
    }

    fn read(&mut self, address: u16) -> Result<[u8; SEALED_BYTES], BusError> {
        self.sck(BEGIN + u64::from(DUMMY_CYCLES));
        let value = self.fpga.read(address).unwrap_or(0);
        let is_version = address == Register::Version.address();
        let sealed = seal(address, if is_version { self.version } else { value });
        self.sck(2 * SEALED_BYTES as u64);
        Ok(sealed)
    }

    fn frame_ready(&mut self) -> bool {
        self.fpga.frame_ready()
    }

    fn raw_ready(&mut self) -> bool {
        self.fpga.raw_ready()
    }
}

impl TimedPort for Wires {
    fn transfer(&mut self, opcode: u8, into: &mut [u8]) {
        let (lead, period_ps) = match opcode {
            READ_PACKET => (FAST_LEAD_BYTES, PACKET_SCK_PS),
            READ_FRAME => (LEAD_BYTES, SCK_PS),
            other => panic!("opcode {other:#x}"),
        };
        self.pass((BEGIN + u64::from(DUMMY_CYCLES)) * period_ps);
        let packet = self.fpga.frame().expect("a frame is ready before it is read");
        into.fill(0);
        into[lead / 2..][..packet.len()].copy_from_slice(packet);
        self.pass(2 * into.len() as u64 * period_ps);
    }

    fn pass(&mut self, ps: u64) {
        self.now_ps += ps;
        while self.ticked_ps + ADC_PS <= self.now_ps {
            self.fpga.tick(AdcSample { code: 8_000, over_range: false });
            self.ticked_ps += ADC_PS;
        }
    }

    fn now_ps(&self) -> u64 {
        self.now_ps
    }

    fn pause_ps(&self) -> u64 {
        0
    }
}

/// The last gateware whose samples all have 32 bits.
const WIDE: u32 = 0x0000_0304;
/// The last gateware whose port samples `sck` for packets too.
const SAMPLED: u32 = 0x0000_0303;

fn measured(version: u32, patterns: u16) -> Stretch {
    let seen = stretch(Wires::new(version), patterns, 60, Processor::reference());
    println!("gateware {version:#x}, {patterns} patterns: {seen:.1?}");
    seen
}

/// The table of `docs/firmware.md`, its columns of today's gateware. The page has tens of frames a second.
#[test]
fn the_page_has_the_frames_a_second_that_firmware_and_gateware_give() {
    let rows = table(&page("docs/firmware.md"), "## Throughput");
    let mut compared = 0;
    for row in rows {
        let patterns: String = row[0].chars().take_while(char::is_ascii_digit).collect();
        let (Ok(patterns), 8) = (patterns.parse(), row.len()) else { continue };
        let columns = [Register::Version.reset(), WIDE, SAMPLED].into_iter().zip(&row[3..]);
        for (version, told) in columns {
            let seen = measured(version, patterns);
            let told: f64 = told.replace(' ', "").parse().unwrap();
            let off = (seen.frames_per_second - told).abs();
            assert!(
                off <= 5.0,
                "{patterns} patterns, gateware {version:#x}: {:.0} frames/s, the page says {told}",
                seen.frames_per_second
            );
            compared += 1;
        }
    }
    assert_eq!(compared, 9);
}

/// What the project asks for, and what a quarter less bytes give over the same wires.
#[test]
fn packets_that_sck_clocks_reach_4800_frames_a_second_and_those_of_24_bits_a_fifth_more() {
    let wide = measured(WIDE, 1024);
    assert!(wide.frames_per_second >= 4800.0, "{wide:?}");
    let narrow = measured(Register::Version.reset(), 1024);
    assert!(narrow.frames_per_second >= 1.2 * wide.frames_per_second, "{narrow:?}, {wide:?}");
}

/// With three banks the next frame waits complete, so that the period is the transfer and the work between two
/// transfers. With two banks it was the next whole number of sweeps.
#[test]
fn no_transfer_waits_for_the_end_of_a_sweep() {
    let seen = measured(SAMPLED, 1024);
    // No two of the frames follow each other: what is made meanwhile is lost, and counted.
    assert!(seen.lost > 4 * seen.sent, "{seen:?}");
    let waiting = seen.made - seen.lost - seen.sent;
    assert!(waiting <= 2, "{seen:?}");
    let sweep_us = 2.0 * 1024.0 * 0.04;
    let period_us = 1e6 / seen.frames_per_second;
    let work_us = period_us - seen.transfer_us;
    assert!(work_us < 0.6 * sweep_us, "{work_us:.1} us between two transfers");
    assert!(
        1e6 / (8.0 * sweep_us) + 25.0 < seen.frames_per_second,
        "no faster than with two banks"
    );
}
