//! How many frames a second reach the host's link: the firmware's own code and the FPGA's own answers, in simulated time.
//!
//! Each access of the host port takes as long as its clocks of `sck`. The processor takes as long as the instructions
//! that emulation counts, at an estimated number of clocks an instruction. What the peripherals cost beside that is an
//! estimate too ([`Processor`]): no board has been measured.

use crate::pages::{page, table};
use nirspi_mcu::{
    BoardInfo, BusError, Camera, HostPort, Inputs, Limits, Micros, NoLoader, PacketSink, PortBus,
    Ports, Target, Wanted,
};
use nirspi_wire::fpga::MAX_FRAME_BYTES;
use nirspi_wire::host_port::SEALED_BYTES;
use nirspi_wire::packet::MAX_HOST_PACKET;
use nirspi_wire::register::Register;
use nirspi_wire::{
    Command, Configuration, PatternOrder, Request, RunLength, SampleSource, Tail, Version, encode,
    version,
};
use std::ops::Range;

/// Period of `sck` of the reference board, but for packets: 160 MHz / 11.
pub const SCK_PS: u64 = 68_750;

/// Period of `sck` of the reference board for packets that `sck` clocks: 160 MHz / 3.
pub const PACKET_SCK_PS: u64 = 18_750;

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
    /// The camera's work with one packet.
    pub packet_ps: u64,
    /// Setting up one register access and waiting for its end.
    pub access_ps: u64,
    /// Setting up a transfer by DMA, its interrupt, and waking the camera's task.
    pub transfer_ps: u64,
}

impl Processor {
    /// The reference board, of 160 MHz: the instructions that `docs/firmware.md` has from emulation, at 1.3 clocks each.
    ///
    /// # Panics
    /// If the page has no such row.
    #[must_use]
    pub fn reference() -> Self {
        let rows = table(&page("docs/firmware.md"), "### Instructions");
        let row = rows.iter().find(|row| row[0] == "packet_without_meter").expect("a row");
        let instructions: f64 = row[1].replace(' ', "").parse().expect("a number");
        let packet_ps = (instructions * 1.3 / 160e6 * 1e12) as u64;
        Self { packet_ps, access_ps: 2_000_000, transfer_ps: 5_000_000 }
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
}

/// A link whose host takes every packet at once.
struct Host {
    room: Vec<u8>,
    /// Lengths of the packets.
    packets: Vec<usize>,
}

impl PacketSink for Host {
    fn claim(&mut self, length: usize) -> Option<&mut [u8]> {
        self.room.get_mut(..length)
    }

    fn commit(&mut self, part: Range<usize>) {
        self.packets.push(part.len());
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
}

/// Runs a camera of this many patterns, one differential sweep a frame, and measures the stretch in which so many frames
/// go through, after the first four.
///
/// # Panics
/// If the camera refuses a command or nothing goes through for a second.
pub fn stretch<P: TimedPort>(port: P, patterns: u16, frames: u32, processor: Processor) -> Stretch {
    let mut buffer = [0; MAX_FRAME_BYTES];
    let mut bus = PortBus::new(Costly { port, processor }, &mut buffer);
    let info = BoardInfo::new("timed", "", Version(0, 0, 0));
    let mut camera = Camera::new(info, Limits::default());
    let mut host = Host { room: vec![0; MAX_FRAME_BYTES], packets: Vec::new() };
    let configuration = Configuration {
        order: PatternOrder::Natural,
        patterns,
        differential: true,
        clocks_per_pattern: 5,
        blanked: 2,
        adc_latency: 3,
        sweeps: 1,
        source: SampleSource::Detector,
        over_range_trip: 0,
        narrow: Tail(Some(true)),
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
    let (mut began, mut moving_ps) = (None, 0);
    let deadline = bus.port().port.now_ps() + 1_000_000_000_000;
    loop {
        let sent = host.packets.len() as u32;
        let at = bus.port().port.now_ps();
        assert!(at < deadline, "{sent} frames in a second");
        if sent >= 4 && began.is_none() {
            (began, moving_ps) = (Some((at, sent)), 0);
        }
        if let Some((since, before)) = began
            && sent >= before + frames
        {
            let through = sent - before;
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
            };
        }
        moving_ps += turn(&mut camera, &mut bus, &mut host, processor);
    }
}

fn now<P: TimedPort>(bus: &mut PortBus<'_, Costly<P>>) -> Micros {
    Micros(bus.port().port.now_ps() / 1_000_000)
}

/// A turn of the camera's loop (`boards/app/src/run.rs`); returns the time of its transfer.
fn turn<P: TimedPort>(
    camera: &mut Camera,
    bus: &mut PortBus<'_, Costly<P>>,
    host: &mut Host,
    processor: Processor,
) -> u64 {
    bus.port().port.pass(processor.packet_ps / 2);
    let at = now(bus);
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
            moving
        }
        Some(wanted) => panic!("not a packet: {:?}", wanted.into),
        None => {
            // The line of a ready frame wakes the loop.
            let tick = bus.port().port.now_ps() + 1_000_000_000;
            while !worked && !bus.port().frame_ready() && bus.port().port.now_ps() < tick {
                bus.port().port.pass(1_000_000);
            }
            0
        }
    }
}
