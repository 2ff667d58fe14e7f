//! A board, an FPGA and a clock without hardware, for tests on the host (feature `bench`).
//!
//! The clock belongs to the thread, so tests beside each other do not move each other's time.

use crate::{Board, FpgaPort};
use core::cell::{Cell, RefCell};
use core::task::Waker;
use nirspi_mcu::{BusError, GatewareLoader, HostPort, Inputs, Lamps, LoadError, Micros, Ring};
use nirspi_wire::host_port::{SEALED_BYTES, seal, unseal};
use nirspi_wire::packet::{MAX_HOST_PACKET, seal as seal_packet};
use nirspi_wire::register::{IDENTITY, Register, clocks, control, mode, status};
use nirspi_wire::{
    ADC_HZ, Command, Configuration, FrameFlags, PatternOrder, RebootInto, Request, SampleSource,
    encode, ready,
};
use std::rc::Rc;
use std::vec::Vec;

mod parallel;

use parallel::Parallel;
pub use parallel::ROUND_BYTES;

std::thread_local! {
    static NOW: Cell<u64> = const { Cell::new(0) };
    static ALARMS: RefCell<Vec<(u64, Waker)>> = const { RefCell::new(Vec::new()) };
}

/// A clock that advances ten microseconds at every read.
struct Clock;

impl embassy_time_driver::Driver for Clock {
    fn now(&self) -> u64 {
        NOW.with(|now| now.replace(now.get() + 10))
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        ALARMS.with(|alarms| alarms.borrow_mut().push((at, waker.clone())));
    }
}

embassy_time_driver::time_driver_impl!(static CLOCK: Clock = Clock);

/// The time of this thread's clock in microseconds.
#[must_use]
pub fn now_us() -> u64 {
    NOW.with(Cell::get)
}

/// Moves this thread's clock, and wakes the tasks whose time has come.
pub fn advance(micros: u64) {
    let now = NOW.with(|now| {
        now.set(now.get() + micros);
        now.get()
    });
    let due: Vec<Waker> = ALARMS.with(|alarms| {
        let mut alarms = alarms.borrow_mut();
        let (due, later) = alarms.drain(..).partition(|(at, _)| *at <= now);
        *alarms = later;
        let due: Vec<(u64, Waker)> = due;
        due.into_iter().map(|(_, waker)| waker).collect()
    });
    due.iter().for_each(Waker::wake_by_ref);
}

/// The board's pins, as a test reads and sets them.
pub struct Pins {
    /// The pin that enables the LED drivers.
    pub leds_enabled: Cell<bool>,
    /// The lamps that people see.
    pub lamps: Cell<Lamps>,
    /// The FPGA lights LEDs.
    pub running: Cell<bool>,
    /// Number of the frame that the FPGA has ready.
    pub sequence: Cell<u32>,
    /// How often the watchdog was fed.
    pub fed: Cell<u32>,
    /// Number of polls that a transfer takes.
    pub transfer_polls: Cell<u32>,
    /// Microseconds from one frame to the next. With 0 a frame is ready during every run.
    pub frame_us: Cell<u64>,
    /// Bytes that have come by the FPGA's parallel port.
    pub by_port: Cell<usize>,
    /// The FPGA is being loaded with gateware, and has no host port.
    pub loading: Cell<bool>,
    next_frame_us: Cell<u64>,
    /// The FPGA's registers have lost their values, which its next access finds out.
    registers_lost: Cell<bool>,
    /// A frame is ready that was ready before a write to `Control`.
    held: Cell<bool>,
}

impl Default for Pins {
    fn default() -> Self {
        Self {
            leds_enabled: Cell::default(),
            lamps: Cell::default(),
            running: Cell::default(),
            sequence: Cell::default(),
            fed: Cell::default(),
            transfer_polls: Cell::default(),
            frame_us: Cell::default(),
            by_port: Cell::default(),
            loading: Cell::default(),
            next_frame_us: Cell::default(),
            registers_lost: Cell::default(),
            held: Cell::default(),
        }
    }
}

impl Pins {
    /// The FPGA loses its run, its frame and its registers.
    pub fn reset_fpga(&self) {
        self.running.set(false);
        self.held.set(false);
        self.sequence.set(0);
        self.registers_lost.set(true);
    }
}

/// A board that is pins only.
pub struct FakeBoard(pub Rc<Pins>);

impl Board for FakeBoard {
    fn inputs(&mut self) -> Inputs {
        Inputs { interlock_closed: true, temperature_centi_celsius: Some(2500) }
    }

    fn enable_leds(&mut self, enabled: bool) {
        self.0.leds_enabled.set(enabled);
    }

    fn show(&mut self, lamps: Lamps) {
        self.0.lamps.set(lamps);
    }

    fn feed_watchdog(&mut self) {
        self.0.fed.set(self.0.fed.get() + 1);
    }

    fn restart(&mut self, _into: RebootInto) -> ! {
        panic!("restarted")
    }
}

/// A loader that takes as long as [`Pins::loading`] says, and loads nothing.
pub struct FakeLoader(pub Rc<Pins>);

impl GatewareLoader for FakeLoader {
    fn begin(&mut self, _total: u32) -> Result<(), LoadError> {
        Ok(())
    }

    fn write(&mut self, _data: &[u8]) -> Result<(), LoadError> {
        Ok(())
    }

    fn finish(&mut self) -> Result<(), LoadError> {
        self.0.loading.set(true);
        Ok(())
    }

    fn step(&mut self, _now: Micros) -> bool {
        self.0.loading.get()
    }
}

/// A fake FPGA: registers in memory, and frames during every run.
pub struct FakeFpga {
    pins: Rc<Pins>,
    registers: [u32; 32],
    parallel: Option<Parallel>,
}

impl FakeFpga {
    /// An FPGA without a configuration.
    #[must_use]
    pub fn new(pins: Rc<Pins>) -> Self {
        Self { pins, registers: [0; 32], parallel: None }
    }

    /// The same with a parallel port, behind which a DMA channel fills a ring.
    #[must_use]
    pub fn with_ring(self) -> Self {
        Self { parallel: Some(Parallel::new()), ..self }
    }

    /// What the parallel port has done until now, if frames leave by it.
    fn follow(&mut self) {
        let parallel = self.registers[usize::from(Register::Mode.address())] & mode::PARALLEL != 0;
        let Some(port) = self.parallel.as_mut().filter(|_| parallel) else { return };
        let frames = self.registers[usize::from(Register::Frames.address())];
        let patterns = self.registers[usize::from(Register::Patterns.address())] as u16;
        let run = self.registers[usize::from(Register::Run.address())] as u16;
        let pins = &self.pins;
        while pins.running.get() && pins.next_frame_us.get() <= now_us() {
            port.send_until(pins.next_frame_us.get());
            port.make(|sequence| frame_packet(run, sequence, patterns));
            pins.running.set(frames != port.made);
            pins.next_frame_us.set(pins.next_frame_us.get() + pins.frame_us.get().max(50));
        }
        port.send_until(now_us());
        pins.by_port.set(port.written);
    }

    /// The parallel port, if frames leave by it.
    fn streaming(&mut self) -> Option<&mut Parallel> {
        self.follow();
        let parallel = self.registers[usize::from(Register::Mode.address())] & mode::PARALLEL != 0;
        self.parallel.as_mut().filter(|_| parallel)
    }
}

impl HostPort for FakeFpga {
    fn write(&mut self, address: u16, sealed: [u8; SEALED_BYTES]) -> Result<(), BusError> {
        self.notice_reset();
        self.follow();
        let value = unseal(address, sealed).expect("no wire damages a write");
        self.registers[usize::from(Register::Writes.address())] += 1;
        if address == Register::Control.address() {
            let bits = |bits: u32| value & bits != 0;
            let is_ready = self.frame_ready();
            let pins = &self.pins;
            if bits(control::START) {
                pins.sequence.set(0);
                if let Some(port) = &mut self.parallel {
                    port.start();
                }
            }
            // A frame that is ready outlives a stop.
            pins.held.set(is_ready && !bits(control::START | control::RELEASE));
            pins.running.set(bits(control::START) || pins.running.get() && !bits(control::STOP));
            pins.sequence.set(pins.sequence.get() + u32::from(bits(control::RELEASE)));
            // This FPGA makes a frame when the one before is released, so the last release ends the run.
            let frames = self.registers[usize::from(Register::Frames.address())];
            if bits(control::RELEASE) && frames == pins.sequence.get() {
                pins.running.set(false);
            }
            if bits(control::START | control::RELEASE) {
                pins.next_frame_us.set(now_us() + pins.frame_us.get());
            }
        } else {
            // This FPGA has no runs without light, so nothing is compared at the start.
            let is_mode = address == Register::Mode.address();
            let value = if is_mode { value & !mode::UNLIT } else { value };
            self.registers[usize::from(address)] = value;
        }
        Ok(())
    }

    fn read(&mut self, address: u16) -> Result<[u8; SEALED_BYTES], BusError> {
        self.notice_reset();
        let running = if self.pins.running.get() { status::RUNNING | status::LEDS_ON } else { 0 };
        let value = match Register::at(address) {
            Some(Register::Identity) => IDENTITY,
            Some(Register::Version) => Register::Version.reset(),
            Some(Register::Clocks) => {
                clocks::LOCKED | clocks::ALIVE | clocks::READY | (ADC_HZ / clocks::UNIT_HZ)
            }
            Some(Register::Design) => Register::Design.reset(),
            Some(Register::Status) => status::INTERLOCK_CLOSED | running,
            // The frame that is ready is made already.
            Some(Register::FramesMade) => self.pins.sequence.get() + u32::from(self.frame_ready()),
            _ => self.registers[usize::from(address)],
        };
        let value = match (Register::at(address), self.streaming()) {
            (Some(Register::FramesMade), Some(port)) => port.made,
            (Some(Register::FramesLost), Some(port)) => port.lost,
            _ => value,
        };
        Ok(seal(address, value))
    }

    fn ring(&mut self) -> Option<&mut Ring> {
        Some(&mut self.parallel.as_mut()?.ring)
    }

    fn look(&mut self) {
        self.follow();
        if let Some(port) = &mut self.parallel {
            port.look(now_us());
        }
    }

    fn frame_ready(&mut self) -> bool {
        if self.streaming().is_some() {
            return false;
        }
        let pins = &self.pins;
        pins.held.get() || pins.running.get() && now_us() >= pins.next_frame_us.get()
    }

    fn raw_ready(&mut self) -> bool {
        false
    }
}

impl FakeFpga {
    fn notice_reset(&mut self) {
        if self.pins.registers_lost.take() {
            self.registers = [0; 32];
            if let Some(port) = &mut self.parallel {
                port.start();
            }
        }
    }

    /// The frame that is ready as a packet, between zeros.
    fn packet(&self, patterns: u16, into: &mut [u8]) {
        let run = self.registers[usize::from(Register::Run.address())] as u16;
        let packet = frame_packet(run, self.pins.sequence.get(), patterns);
        into.fill(0);
        into[ready::LEAD_BYTES / 2..][..packet.len()].copy_from_slice(&packet);
    }
}

/// A frame as the FPGA makes a packet of it.
fn frame_packet(run: u16, sequence: u32, patterns: u16) -> Vec<u8> {
    let head = ready::Head {
        run,
        sequence,
        device_time_us: now_us(),
        sweeps: 1,
        flags: FrameFlags::DIFFERENTIAL,
        patterns,
        width: nirspi_wire::samples::Width::Bits24,
    };
    let mut payload = head.to_bytes().to_vec();
    payload.extend((0..i32::from(patterns)).flat_map(|k| {
        let [low, middle, high, _] = (93 + k).to_le_bytes();
        [low, middle, high]
    }));
    let mut room = std::vec![0; payload.len() + payload.len() / 254 + 8];
    seal_packet(&payload, &mut room).expect("a packet has room").to_vec()
}

impl FpgaPort for FakeFpga {
    async fn read_bytes(&mut self, _opcode: u8, into: &mut [u8]) -> Result<(), BusError> {
        for _ in 0..self.pins.transfer_polls.get() {
            embassy_futures::yield_now().await;
        }
        let patterns = self.registers[usize::from(Register::Patterns.address())] as u16;
        self.packet(patterns, into);
        Ok(())
    }

    async fn ready(&mut self) {
        if !self.frame_ready() {
            core::future::pending::<()>().await;
        }
    }
}

/// A configuration that the camera takes.
#[must_use]
pub fn configuration(patterns: u16) -> Configuration<'static> {
    Configuration {
        order: PatternOrder::Natural,
        patterns,
        differential: true,
        alternating: true,
        clocks_per_pattern: 5,
        blanked: 2,
        adc_latency: 3,
        sweeps: 1,
        source: SampleSource::Detector,
        over_range_trip: 0,
    }
}

/// A command as it is on the wire.
#[must_use]
pub fn packet(id: u16, command: Command<'_>) -> Vec<u8> {
    let mut room = [0; MAX_HOST_PACKET + 1];
    let encoded = encode(&Request { id, command }, &mut room);
    encoded.expect("a command fits a packet").to_vec()
}
