//! How many frames a second reach the host's link: the firmware's own code and the FPGA's own answers, in simulated
//! time.
//!
//! Each access of the host port takes as long as its clocks of `sck`. The processor takes as long as the instructions
//! that emulation counts, at an estimated number of clocks an instruction. What the peripherals cost beside that is an
//! estimate too ([`Processor`]): no board has been measured.

use crate::pages::{page, table};
use nirspi_mcu::{
    BoardInfo, BusError, Camera, HostPort, Inputs, Limits, Loan, Micros, NoLoader, PacketSink,
    PortBus, Ports, Ring, Target, Wanted,
};
use nirspi_wire::fpga::MAX_FRAME_BYTES;
use nirspi_wire::host_port::SEALED_BYTES;
use nirspi_wire::packet::{MAX_HOST_PACKET, unseal};
use nirspi_wire::register::Register;
use nirspi_wire::{
    Command, Configuration, PatternOrder, Request, RunLength, SampleSource, Version, encode,
    version,
};
use std::collections::VecDeque;
use std::ops::Range;
use std::sync::atomic::Ordering;

/// Period of `sck` of the reference board, but for packets: 160 MHz / 11.
pub const SCK_PS: u64 = 68_750;

/// Period of `sck` of the reference board for packets that `sck` clocks: 160 MHz / 3.
pub const PACKET_SCK_PS: u64 = 18_750;

/// Words of the reference board's ring: 128 KB.
pub const RING_WORDS: usize = 32 * 1024;

/// Packets that can wait for the host, as on the reference board.
const PLACES: usize = 32;

/// What a USB 2.0 host takes in a microsecond, as measured by others (`docs/log/gateware.md`, Parallel port). No board of
/// ours has measured it.
const USB_BYTES_PER_MICRO: u64 = 33;

const INPUTS: Inputs = Inputs { interlock_closed: true, temperature_centi_celsius: Some(2500) };

/// A host port whose accesses take simulated time.
pub trait TimedPort: HostPort {
    /// Reads a frame or packet by four lines.
    fn transfer(&mut self, opcode: u8, into: &mut [u8]);

    /// Time passes in which the processor leaves the port alone.
    fn pass(&mut self, ps: u64);

    /// Time since power-up.
    fn now_ps(&self) -> u64;

    /// The time that this port stands still between two accesses anyway.
    fn pause_ps(&self) -> u64;
}

/// What a board's processor and its peripherals cost, beside the clocks of `sck`.
#[derive(Debug, Clone, Copy)]
pub struct Processor {
    /// The camera's work with one packet. By the parallel port all work with it, up to the end of its transfer by USB.
    pub packet_ps: u64,
    /// A turn of the loop in which no packet comes. `None`: packets come by the host port, and wake the loop.
    pub turn_ps: Option<u64>,
    /// Setting up one register access and waiting for its end.
    pub access_ps: u64,
    /// Setting up a transfer by DMA, its interrupt, and waking the camera's task.
    pub transfer_ps: u64,
    /// The host.
    pub host: Reader,
}

/// How fast the host takes what the link has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reader {
    /// Every packet at once.
    AtOnce,
    /// As fast as USB carries them.
    Usb,
}

/// The time that so many instructions take on the reference board, of 160 MHz.
fn instructions_ps(instructions: f64) -> u64 {
    (instructions * 1.3 / 160e6 * 1e12) as u64
}

/// A row of the page's table of instructions.
fn instructions_of(part: &str) -> f64 {
    let rows = table(&page("docs/log/firmware.md"), "### Instructions");
    let row = rows.iter().find(|row| row[0] == part).expect("a row");
    row[1].replace(' ', "").parse().expect("a number")
}

/// Share of the reference board's processor that the signal meter takes while packets come by the parallel port.
///
/// # Panics
/// If the page has no such row.
#[must_use]
pub fn meter_share() -> f64 {
    const MILLISECOND_PS: f64 = 1e9;
    instructions_ps(instructions_of("streaming_meter")) as f64 / MILLISECOND_PS
}

impl Processor {
    /// The reference board, of 160 MHz: the instructions that `docs/log/firmware.md` has from emulation, at 1.3 clocks
    /// each.
    ///
    /// # Panics
    /// If the page has no such row.
    #[must_use]
    pub fn reference() -> Self {
        let packet_ps = instructions_ps(instructions_of("packet_without_meter"));
        Self {
            packet_ps,
            turn_ps: None,
            access_ps: 2_000_000,
            transfer_ps: 5_000_000,
            host: Reader::AtOnce,
        }
    }

    /// The reference board where packets come by the parallel port, with USB behind it, whose core reads them out of the
    /// ring.
    ///
    /// # Panics
    /// If the page has no such rows.
    #[must_use]
    pub fn streaming() -> Self {
        Self {
            packet_ps: instructions_ps(instructions_of("streaming_packet")),
            turn_ps: Some(instructions_ps(instructions_of("streaming_millisecond"))),
            host: Reader::Usb,
            ..Self::reference()
        }
    }
}

/// A port with the cost of each access.
struct Costly<P> {
    port: P,
    processor: Processor,
}

impl<P: TimedPort> Costly<P> {
    fn prepare(&mut self) {
        self.port.pass(self.processor.access_ps.saturating_sub(self.port.pause_ps()));
    }
}

impl<P: TimedPort> HostPort for Costly<P> {
    fn write(&mut self, address: u16, sealed: [u8; SEALED_BYTES]) -> Result<(), BusError> {
        self.prepare();
        self.port.write(address, sealed)
    }

    fn read(&mut self, address: u16) -> Result<[u8; SEALED_BYTES], BusError> {
        self.prepare();
        self.port.read(address)
    }

    fn frame_ready(&mut self) -> bool {
        self.port.frame_ready()
    }

    fn raw_ready(&mut self) -> bool {
        self.port.raw_ready()
    }

    fn ring(&mut self) -> Option<&mut Ring> {
        self.port.ring()
    }

    fn look(&mut self) {
        self.port.look();
    }
}

/// A link whose host takes every packet at once, or as fast as USB carries them.
struct Host {
    room: Vec<u8>,
    /// Lengths of the packets.
    packets: Vec<usize>,
    reader: Reader,
    /// What waits in the link: loans, and packets of so many bytes.
    waiting: VecDeque<(Option<Loan>, u64)>,
    /// Microseconds in which USB had nothing to carry.
    idle_us: u64,
    /// Until when USB has carried bytes.
    carried_us: u64,
    /// The most bytes that waited in the link at once.
    most_waiting: u64,
}

impl Host {
    /// USB carries what it can until now.
    fn carry(&mut self, now: Micros) {
        let micros = now.since(Micros(self.carried_us)).0;
        self.carried_us = now.0;
        let mut bytes = micros * USB_BYTES_PER_MICRO;
        while let Some((_, first)) = self.waiting.front_mut() {
            if *first > bytes {
                *first -= bytes;
                return;
            }
            bytes -= *first;
            self.fetch();
        }
        self.idle_us += bytes / USB_BYTES_PER_MICRO;
    }

    /// Puts something on the link.
    fn queue(&mut self, loan: Option<Loan>, bytes: u64) {
        self.waiting.push_back((loan, bytes));
        let waiting = self.waiting.iter().map(|(_, bytes)| bytes).sum();
        self.most_waiting = self.most_waiting.max(waiting);
    }

    /// The host has the whole of what waits first.
    fn fetch(&mut self) {
        if let Some((Some(mut loan), _)) = self.waiting.pop_front() {
            loan.give_back();
        }
    }
}

impl PacketSink for Host {
    fn claim(&mut self, length: usize) -> Option<&mut [u8]> {
        if self.waiting.len() >= PLACES { None } else { self.room.get_mut(..length) }
    }

    fn commit(&mut self, part: Range<usize>) {
        if self.reader == Reader::Usb {
            self.queue(None, part.len() as u64);
        }
        self.packets.push(part.len());
    }

    fn lend(&mut self, loan: Loan) -> bool {
        if self.waiting.len() >= PLACES {
            return false;
        }
        let mut bytes = Vec::new();
        for (words, length) in loan.pieces() {
            let found = words.iter().flat_map(|word| word.load(Ordering::Relaxed).to_le_bytes());
            bytes.extend(found.take(length));
        }
        self.queue(Some(loan), bytes.len() as u64);
        for packet in bytes.split_mut(|byte| *byte == 0).filter(|packet| !packet.is_empty()) {
            self.packets.push(packet.len() + 1);
            unseal(packet).expect("a packet as the FPGA made it");
        }
        if self.reader == Reader::AtOnce {
            self.fetch();
        }
        true
    }
}

/// What went through in a stretch of a run.
#[derive(Debug, Clone, Copy)]
pub struct Stretch {
    /// Frames a second that reached the link.
    pub frames_per_second: f64,
    /// Microseconds of a transfer, its set-up included.
    pub transfer_us: f64,
    /// Frames that the FPGA has counted as lost, and as made, since the start.
    pub lost: u32,
    /// See `lost`.
    pub made: u32,
    /// Frames that reached the link since the start.
    pub sent: u32,
    /// Share of the time in which the processor worked.
    pub busy: f64,
    /// Share of the time in which USB had nothing to carry.
    pub usb_idle: f64,
    /// Milliseconds that a reply waits at most behind what the link had before it.
    pub reply_ms: f64,
}

/// Runs a camera of this many patterns, one differential sweep a frame, and measures the stretch in which so many
/// frames go through, after the first `before` of them.
///
/// # Panics
/// If the camera refuses a command or nothing goes through for a second.
pub fn stretch<P: TimedPort>(
    port: P,
    patterns: u16,
    (before, frames): (u32, u32),
    processor: Processor,
) -> Stretch {
    let mut buffer = [0; MAX_FRAME_BYTES];
    let mut bus = PortBus::new(Costly { port, processor }, &mut buffer);
    let info = BoardInfo::new("timed", "", Version(0, 0, 0));
    let mut camera = Camera::new(info, Limits::SIMULATED);
    let mut host = Host {
        room: vec![0; MAX_FRAME_BYTES],
        packets: Vec::new(),
        reader: processor.host,
        waiting: VecDeque::new(),
        idle_us: 0,
        carried_us: 0,
        most_waiting: 0,
    };
    let configuration = Configuration {
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
    };
    for command in [
        Command::Hello { protocol: version::CURRENT },
        Command::Configure(configuration),
        Command::Start(RunLength::Continuous),
    ] {
        let mut room = [0; MAX_HOST_PACKET];
        let bytes = encode(&Request { id: 0, command }, &mut room).expect("a command");
        let now = now(&mut bus);
        let ports = &mut Ports { bus: &mut bus, sink: &mut host, loader: &mut NoLoader };
        assert_eq!(camera.receive(now, bytes, &INPUTS, ports), bytes.len(), "a command in pieces");
    }
    assert_eq!(camera.state(), nirspi_wire::State::Running, "the camera refused a command");
    host.packets.clear();
    let (mut began, mut moving_ps, mut idle_ps) = (None, 0, 0);
    let deadline = bus.port().port.now_ps() + 1_000_000_000_000;
    loop {
        let sent = host.packets.len() as u32;
        let at = bus.port().port.now_ps();
        assert!(at < deadline, "{sent} frames in a second");
        if sent >= before && began.is_none() {
            (began, moving_ps, idle_ps) = (Some((at, sent)), 0, 0);
            (host.idle_us, host.most_waiting) = (0, 0);
        }
        if let Some((since, first)) = began
            && sent >= first + frames
        {
            let through = sent - first;
            let seconds = (at - since) as f64 * 1e-12;
            let [lost, made] = [Register::FramesLost, Register::FramesMade].map(|register| {
                let sealed = bus.port().read(register.address()).expect("an answer");
                nirspi_wire::host_port::unseal(register.address(), sealed).expect("a check")
            });
            return Stretch {
                frames_per_second: f64::from(through) / seconds,
                transfer_us: moving_ps as f64 * 1e-6 / f64::from(through),
                lost,
                made,
                sent,
                busy: 1.0 - (moving_ps + idle_ps) as f64 * 1e-12 / seconds,
                usb_idle: host.idle_us as f64 * 1e-6 / seconds,
                reply_ms: host.most_waiting as f64 / USB_BYTES_PER_MICRO as f64 * 1e-3,
            };
        }
        let (moving, idle) = turn(&mut camera, &mut bus, &mut host, processor);
        moving_ps += moving;
        idle_ps += idle;
    }
}

fn now<P: TimedPort>(bus: &mut PortBus<'_, Costly<P>>) -> Micros {
    Micros(bus.port().port.now_ps() / 1_000_000)
}

/// A turn of the camera's loop (`boards/app/src/run.rs`); returns the time of its transfer and the time that it slept.
fn turn<P: TimedPort>(
    camera: &mut Camera,
    bus: &mut PortBus<'_, Costly<P>>,
    host: &mut Host,
    processor: Processor,
) -> (u64, u64) {
    if processor.turn_ps.is_none() {
        bus.port().port.pass(processor.packet_ps / 2);
    }
    let at = now(bus);
    host.carry(at);
    let sent = host.packets.len();
    let ports = &mut Ports { bus: &mut *bus, sink: &mut *host, loader: &mut NoLoader };
    let worked = camera.poll(at, &INPUTS, ports).worked;
    match bus.wanted() {
        Some(Wanted { port, opcode, into: Target::Link(length) }) => {
            let began = port.port.now_ps();
            port.port.pass(processor.transfer_ps);
            port.port.transfer(opcode, host.claim(length).expect("room"));
            let moving = port.port.now_ps() - began;
            bus.transferred(Ok(()));
            bus.port().port.pass(processor.packet_ps / 2);
            let at = now(bus);
            camera.forward(
                at,
                &mut Ports { bus: &mut *bus, sink: &mut *host, loader: &mut NoLoader },
            );
            (moving, 0)
        }
        Some(wanted) => panic!("not a packet: {:?}", wanted.into),
        None => {
            if let Some(turn_ps) = processor.turn_ps {
                let packets = (host.packets.len() - sent) as u64;
                let turn_ps = if worked { 0 } else { turn_ps };
                bus.port().port.pass(packets * processor.packet_ps + turn_ps);
            }
            // The line of a ready frame wakes the loop.
            let slept = bus.port().port.now_ps();
            let tick = slept + 1_000_000_000;
            while !worked && !bus.port().frame_ready() && bus.port().port.now_ps() < tick {
                bus.port().port.pass(1_000_000);
            }
            (0, bus.port().port.now_ps() - slept)
        }
    }
}
