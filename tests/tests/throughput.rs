//! Tests of the throughput of the FPGA's host port: the firmware in front of the gateware's model, in simulated time.

use nirspi_hdl_model::{AdcSample, Gateware};
use nirspi_mcu::{BusError, HostPort, Micros, Ring, RingMemory};
use nirspi_tests::pages::{page, table};
use nirspi_tests::throughput::{
    PACKET_SCK_PS, Processor, RING_WORDS, Reader, SCK_PS, Stretch, TimedPort, meter_share, stretch,
};
use nirspi_wire::host_port::{DUMMY_CYCLES, READ_PACKET, SEALED_BYTES, seal, unseal};
use nirspi_wire::ready::FAST_LEAD_BYTES;
use std::sync::atomic::Ordering;

/// Period of the ADC's clock.
const ADC_PS: u64 = 8_000;
/// Clocks of `sck` for an opcode and an address.
const BEGIN: u64 = 8 + 4;

/// The golden model at the end of wires.
struct Wires {
    fpga: Gateware,
    now_ps: u64,
    ticked_ps: u64,
}

impl Wires {
    fn new() -> Self {
        let mut fpga = Gateware::new();
        fpga.set_interlock(true);
        Self { fpga, now_ps: 0, ticked_ps: 0 }
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
        self.sck(2 * SEALED_BYTES as u64);
        Ok(seal(address, value))
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
        assert_eq!(opcode, READ_PACKET);
        self.pass((BEGIN + u64::from(DUMMY_CYCLES)) * PACKET_SCK_PS);
        let packet = self.fpga.frame().expect("a frame is ready before it is read");
        into.fill(0);
        into[FAST_LEAD_BYTES / 2..][..packet.len()].copy_from_slice(packet);
        self.pass(2 * into.len() as u64 * PACKET_SCK_PS);
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

fn measured(patterns: u16) -> Stretch {
    let seen = stretch(Wires::new(), patterns, (4, 60), Processor::reference());
    println!("{patterns} patterns: {seen:.1?}");
    seen
}

/// The table of `docs/log/firmware.md`.
#[test]
fn the_page_has_the_frames_a_second_that_firmware_and_gateware_give() {
    let rows = table(&page("docs/log/firmware.md"), "## Throughput");
    let mut compared = 0;
    for row in rows {
        let patterns: String = row[0].chars().take_while(char::is_ascii_digit).collect();
        let (Ok(patterns), 4) = (patterns.parse(), row.len()) else { continue };
        let seen = measured(patterns).frames_per_second;
        let told: f64 = row[3].replace(' ', "").parse().unwrap();
        let off = (seen - told).abs();
        assert!(off <= 5.0, "{patterns} patterns: {seen:.0} frames/s, the page says {told}");
        compared += 1;
    }
    assert_eq!(compared, 3);
}

/// What the project asks for.
#[test]
fn packets_of_the_host_port_reach_4800_frames_a_second() {
    let seen = measured(1024);
    assert!(seen.frames_per_second >= 4800.0, "{seen:?}");
}

/// With three banks the next frame waits complete, so that the period is the transfer and the work between two
/// transfers. With two banks it was the next whole number of sweeps.
#[test]
fn no_transfer_waits_for_the_end_of_a_sweep() {
    let seen = measured(1024);
    // No two of the frames follow each other: what is made meanwhile is lost, and counted.
    assert!(seen.lost > seen.sent / 2, "{seen:?}");
    let waiting = seen.made - seen.lost - seen.sent;
    assert!(waiting <= 2, "{seen:?}");
    let sweep_us = 2.0 * 1024.0 * 0.04;
    let period_us = 1e6 / seen.frames_per_second;
    let work_us = period_us - seen.transfer_us;
    assert!(work_us < 0.6 * sweep_us, "{work_us:.1} us between two transfers");
    let sweeps = (period_us / sweep_us).ceil();
    assert!(
        1e6 / (sweeps * sweep_us) * 1.2 < seen.frames_per_second,
        "no faster than with two banks"
    );
}

/// Clocks of the ADC for a byte by the parallel port.
const BYTE: u64 = 3;
/// Clocks between two packets, while the FPGA makes the beginning of the next one: with these the RTL's own figure
/// comes out, 9927 frames/s of 32-bit samples to a receiver that is always ready (`docs/log/gateware.md`, Parallel port).
const LEAD: u64 = 184;

/// The golden model at the end of the same wires and of its parallel port, whose bytes a DMA channel writes into a
/// ring.
struct Parallel {
    wires: Wires,
    ring: Ring,
    memory: &'static RingMemory<RING_WORDS>,
    /// Until when the port may send.
    until_ps: u64,
    /// What the port sends, how much of it has been sent, and when the next byte goes.
    sending: Option<(Vec<u8>, usize, u64)>,
    clock: u64,
    /// Bytes of the unfinished word, and bytes in the ring since power-up.
    fifo: Vec<u8>,
    written: usize,
}

impl Parallel {
    fn new() -> Self {
        let memory: &'static RingMemory<RING_WORDS> = Box::leak(Box::new(RingMemory::new()));
        Self {
            wires: Wires::new(),
            ring: Ring::new(memory),
            memory,
            until_ps: 0,
            sending: None,
            clock: 0,
            fifo: Vec::new(),
            written: 0,
        }
    }

    /// A clock of the ADC. The port waits where the line has fallen.
    fn tick(&mut self) {
        let fpga = &mut self.wires.fpga;
        fpga.tick(AdcSample { code: 8_000, over_range: false });
        self.clock += 1;
        let Some((bytes, sent, at)) = &mut self.sending else {
            self.sending = fpga.outgoing().map(|bytes| (bytes, 0, self.clock + LEAD));
            return;
        };
        if self.clock < *at {
            return;
        }
        if self.clock * ADC_PS >= self.until_ps {
            *at = self.clock + 1;
            return;
        }
        *at += BYTE;
        self.fifo.push(bytes[*sent]);
        *sent += 1;
        if *sent == bytes.len() {
            fpga.sent();
            self.sending = None;
        }
        if let Ok(word) = <[u8; 4]>::try_from(&self.fifo[..]) {
            let place = self.written / 4 % RING_WORDS;
            self.memory.words()[place].store(u32::from_le_bytes(word), Ordering::Relaxed);
            self.written += 4;
            self.fifo.clear();
        }
    }

    /// Time passes for the port too while the wires are busy.
    fn follow<T>(&mut self, access: impl FnOnce(&mut Wires) -> T) -> T {
        let before = self.wires.now_ps;
        // The model ticks here and not in the wires.
        self.wires.ticked_ps = u64::MAX / 2;
        let done = access(&mut self.wires);
        let passed = self.wires.now_ps - before;
        self.wires.now_ps = before;
        self.pass(passed);
        done
    }
}

impl HostPort for Parallel {
    fn write(&mut self, address: u16, sealed: [u8; SEALED_BYTES]) -> Result<(), BusError> {
        self.follow(|wires| wires.write(address, sealed))
    }

    fn read(&mut self, address: u16) -> Result<[u8; SEALED_BYTES], BusError> {
        self.follow(|wires| wires.read(address))
    }

    fn frame_ready(&mut self) -> bool {
        self.wires.frame_ready()
    }

    fn raw_ready(&mut self) -> bool {
        self.wires.raw_ready()
    }

    fn ring(&mut self) -> Option<&mut Ring> {
        Some(&mut self.ring)
    }

    fn look(&mut self) {
        self.ring.came(self.written % (4 * RING_WORDS));
        let Micros(grant) = self.ring.grant();
        self.until_ps = self.wires.now_ps + grant * 1_000_000;
    }
}

impl TimedPort for Parallel {
    fn transfer(&mut self, opcode: u8, _into: &mut [u8]) {
        panic!("a transfer by the host port, opcode {opcode:#x}");
    }

    fn pass(&mut self, ps: u64) {
        self.wires.now_ps += ps;
        while (self.clock + 1) * ADC_PS <= self.wires.now_ps {
            self.tick();
        }
    }

    fn now_ps(&self) -> u64 {
        self.wires.now_ps
    }

    fn pause_ps(&self) -> u64 {
        0
    }
}

fn streamed(processor: Processor) -> Stretch {
    let seen = stretch(Parallel::new(), 1024, (150, 2400), processor);
    println!("parallel port: {seen:.2?}");
    seen
}

/// A row of `docs/log/firmware.md` for the parallel port.
fn row(begins: &str) -> Vec<String> {
    let rows = table(&page("docs/log/firmware.md"), "## Packets by the parallel port");
    rows.into_iter().find(|cells| cells[0].starts_with(begins)).expect("the page has this row")
}

/// The first number of a cell.
fn number(cell: &str) -> f64 {
    let is_end = |c: char| c == ':' || c == '%';
    let digits = cell.split(is_end).next().expect("a first part").replace(' ', "");
    digits.parse().expect("a number")
}

/// What the project asks for: as many frames as USB carries, in simulated time.
#[test]
fn packets_of_the_parallel_port_reach_10_500_frames_a_second() {
    let seen = streamed(Processor::streaming());
    assert!(seen.frames_per_second >= 10_500.0, "{seen:?}");
    let row = row("33 MB/s, by USB");
    let (told, busy) = (number(&row[1]), number(&row[2]));
    let busy_at_all = seen.busy + meter_share();
    println!("busy {:.4}, with the signal meter {busy_at_all:.4}", seen.busy);
    assert!(busy_at_all < 0.1, "the goal: {busy_at_all}, {seen:?}");
    assert!(seen.usb_idle < 0.01, "the ring always has something to send: {seen:?}");
    assert!((seen.frames_per_second - told).abs() <= 5.0, "the page says {told}: {seen:?}");
    assert!((100.0 * busy_at_all - busy).abs() <= 0.5, "the page says {busy} %: {busy_at_all}");
}

/// Why replies and packets share one endpoint.
#[test]
fn a_reply_waits_behind_packets_for_no_longer_than_the_page_says() {
    let text = page("docs/log/firmware.md").split_whitespace().collect::<Vec<_>>().join(" ");
    let (_, told) = text.split_once("A reply waits behind them for at most ").expect("a figure");
    let told: f64 = told.split(' ').next().and_then(|told| told.parse().ok()).expect("a number");
    let seen = streamed(Processor::streaming()).reply_ms;
    assert!((told - 0.5..=told).contains(&seen), "{seen} ms, the page says {told}");
}

/// With a host that takes everything at once the FPGA's port is the limit, and the ring loses nothing.
#[test]
fn to_a_host_that_is_fast_enough_the_ring_forwards_all_that_the_port_sends() {
    let processor = Processor { host: Reader::AtOnce, ..Processor::streaming() };
    let seen = streamed(processor);
    assert!((seen.frames_per_second / 12_207.0 - 1.0).abs() < 0.01, "{seen:?}");
    assert_eq!(seen.lost, 0, "{seen:?}");
    let waiting = seen.made - seen.sent;
    // What has come since the last look of the loop, and what waits in the FPGA.
    assert!(waiting <= 17, "{seen:?}");
    let told = number(&row("all at once")[1]);
    assert!((seen.frames_per_second - told).abs() <= 5.0, "the page says {told}: {seen:?}");
}
