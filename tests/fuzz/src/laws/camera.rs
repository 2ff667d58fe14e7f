//! The firmware between a host and an FPGA that send anything, and the host before such a camera.

use crate::{Law, MIB, is_one_line, read, seeds};
use nirspi::capture::capture;
use nirspi::info::info;
use nirspi::link::{Link, Received};
use nirspi::session::Session;
use nirspi_mcu::{
    BoardInfo, BusError, Camera, HostPort, Inputs, Limits, Micros, NoLoader, PacketSink, PortBus,
    Ports, Target, Wanted,
};
use nirspi_wire::fpga::MAX_FRAME_BYTES;
use nirspi_wire::host_port::{SEALED_BYTES, seal};
use nirspi_wire::packet::{overhead, seal as seal_packet};
use nirspi_wire::register::{IDENTITY, Register, clocks};
use nirspi_wire::{ADC_HZ, Command, DeviceMessage, Reply, State, Version, open, version};
use std::collections::VecDeque;
use std::io;
use std::ops::{ControlFlow, Range};
use std::time::Duration;

pub const LAWS: &[Law] = &[
    Law {
        name: "commands",
        reads: "well-framed commands of a host at any time, with any bytes in them",
        readers: &[
            "mcu/src/commands.rs",
            "mcu/src/configure.rs",
            "mcu/src/machine.rs",
            "mcu/src/poll.rs",
            "mcu/src/run.rs",
        ],
        holds: commands,
        seeds: command_seeds,
        longest: 2048,
        most_memory: 8 * MIB,
    },
    Law {
        name: "answers-of-the-fpga",
        reads: "what an FPGA answers to the firmware: registers, frames, bursts, damaged or not",
        readers: &[
            "mcu/src/host_port.rs",
            "mcu/src/fpga.rs",
            "mcu/src/selftest.rs",
            "mcu/src/burst.rs",
        ],
        holds: answers,
        seeds: answer_seeds,
        longest: 2048,
        most_memory: MIB,
    },
    Law {
        name: "session",
        reads: "what a camera sends to the host: greeting, answers, frames, reports",
        readers: &[
            "host/camera/src/session.rs",
            "host/camera/src/session/conversation.rs",
            "host/camera/src/session/request.rs",
            "host/record/src/capture/run.rs",
            "host/camera/src/tally.rs",
        ],
        holds: session,
        seeds: || vec![seeds::camera_says()],
        longest: 4096,
        most_memory: 16 * MIB,
    },
];

/// ADC clocks of a step: 8 us.
const STEP_CLOCKS: u32 = 1000;
/// The most pieces of one input.
const PIECES: usize = 48;

/// The packet of these bytes.
fn sealed(payload: &[u8]) -> Vec<u8> {
    let mut room = vec![0; payload.len() + overhead(payload.len())];
    seal_packet(payload, &mut room).expect("room for the overhead").to_vec()
}

/// Pieces of an input: a byte for what happens, a length, and as many bytes.
fn pieces(bytes: &[u8]) -> Vec<(u8, &[u8])> {
    let (mut rest, mut all) = (bytes, Vec::new());
    while let Some((&[what, length], after)) = rest.split_first_chunk() {
        let (piece, after) = after.split_at(after.len().min(length.into()));
        all.push((what, piece));
        rest = after;
    }
    all.truncate(PIECES);
    all
}

fn piece(what: u8, bytes: &[u8]) -> Vec<u8> {
    [&[what, bytes.len() as u8], bytes].concat()
}

/// Each packet that waits for the host is a message.
fn hears(waiting: &[u8]) -> Vec<Option<u16>> {
    let heard = seeds::packets(waiting).into_iter().map(|mut packet| {
        packet.pop();
        match open::<DeviceMessage<'_>>(&mut packet).expect("a message of the camera") {
            DeviceMessage::Reply(Reply { id, .. }) => Some(id),
            _ => None,
        }
    });
    heard.collect()
}

fn commands(bytes: &[u8]) {
    let mut camera = seeds::camera();
    camera.receive(&seeds::packet(0, Command::Hello { protocol: version::CURRENT }));
    for (what, payload) in pieces(bytes) {
        let closed = what & 1 == 0;
        camera.set_interlock(closed);
        camera.set_temperature((what & 0x40 == 0).then_some(i16::from(what) * 50));
        // Noise on the line, or a command.
        if what & 0x80 == 0 {
            camera.receive(&sealed(payload))
        } else {
            camera.receive(payload)
        }
        camera.step(u32::from(what >> 1 & 0xF) * 64);
        assert!(closed || !camera.fpga().leds_on(), "lit with an open interlock");
        assert!(closed || camera.state() != State::Running, "a run with an open interlock");
        let waiting = camera.packets_out().waiting();
        hears(waiting);
        let length = if what & 0x20 == 0 { waiting.len() } else { 0 };
        camera.packets_out().sent(length);
    }
    // The host goes. The next one is greeted, whatever was before.
    camera.link_closed();
    camera.set_interlock(true);
    camera.set_temperature(Some(2500));
    assert!(!camera.fpga().leds_on(), "lit without a host");
    camera.receive(&seeds::packet(7, Command::Hello { protocol: version::CURRENT }));
    for _ in 0..100 {
        if hears(camera.packets_out().waiting()).contains(&Some(7)) {
            return;
        }
        camera.step(STEP_CLOCKS);
    }
    panic!("no answer to the greeting of the next host");
}

fn command_seeds() -> Vec<Vec<u8>> {
    let payloads: Vec<Vec<u8>> = seeds::commands(2).iter().map(|p| seeds::payload(p)).collect();
    let run = payloads.iter().flat_map(|bytes| piece(0x1E, bytes)).collect();
    let more = [
        Command::SelfTest,
        Command::RawBurst { samples: 64 },
        Command::ReadRegister { address: Register::Version.address() },
        Command::Status,
        Command::Reboot(nirspi_wire::RebootInto::Application),
    ];
    let more = more
        .into_iter()
        .flat_map(|command| piece(0x1E, &seeds::payload(&seeds::packet(9, command))));
    vec![run, more.collect()]
}

/// An FPGA that answers with the bytes of the input: two of noise, then a word.
struct AnyFpga<'b> {
    bytes: &'b [u8],
    accesses: u32,
}

impl AnyFpga<'_> {
    fn byte(&mut self) -> u8 {
        let Some((&byte, rest)) = self.bytes.split_first() else { return 0 };
        self.bytes = rest;
        byte
    }
}

impl HostPort for AnyFpga<'_> {
    fn write(&mut self, _: u16, _: [u8; SEALED_BYTES]) -> Result<(), BusError> {
        self.accesses += 1;
        if self.byte() == 0xEE { Err(BusError::Timeout) } else { Ok(()) }
    }

    fn read(&mut self, address: u16) -> Result<[u8; SEALED_BYTES], BusError> {
        self.accesses += 1;
        let known = match Register::at(address) {
            Some(Register::Identity) => Some(IDENTITY),
            Some(register @ (Register::Version | Register::Design)) => Some(register.reset()),
            Some(Register::Clocks) => {
                Some(clocks::LOCKED | clocks::ALIVE | clocks::READY | (ADC_HZ / clocks::UNIT_HZ))
            }
            Some(Register::Writes) => Some(self.accesses),
            _ => None,
        };
        Ok(match (self.byte(), known) {
            (0xEE, _) => return Err(BusError::Transfer),
            (0xED, _) => [(); SEALED_BYTES].map(|()| self.byte()),
            (0..=0xDF, Some(value)) => seal(address, value),
            _ => {
                let value = u32::from_le_bytes([(); 4].map(|()| self.byte()));
                seal(address, value)
            }
        })
    }

    fn frame_ready(&mut self) -> bool {
        self.byte() & 1 == 1
    }

    fn raw_ready(&mut self) -> bool {
        self.byte() & 1 == 1
    }
}

/// A link that takes everything.
#[derive(Default)]
struct Sink {
    room: Vec<u8>,
    sent: Vec<u8>,
}

impl PacketSink for Sink {
    fn claim(&mut self, length: usize) -> Option<&mut [u8]> {
        self.room.clear();
        self.room.resize(length, 0);
        Some(&mut self.room)
    }

    fn commit(&mut self, part: Range<usize>) {
        self.sent.extend(&self.room[part]);
    }
}

fn answers(bytes: &[u8]) {
    let mut buffer = Box::new([0; MAX_FRAME_BYTES]);
    let mut bus = PortBus::new(AnyFpga { bytes, accesses: 0 }, &mut buffer);
    let mut camera = Camera::new(BoardInfo::new("any", "1", Version(0, 1, 0)), Limits::default());
    let (mut sink, mut now) = (Sink::default(), Micros(0));
    let mut script = seeds::commands(2).into_iter().collect::<VecDeque<_>>();
    script.extend([
        seeds::packet(5, Command::SelfTest),
        seeds::packet(6, Command::RawBurst { samples: 8 }),
        seeds::packet(7, Command::ReadRegister { address: 0 }),
    ]);
    let mut inputs = Inputs { interlock_closed: true, temperature_centi_celsius: Some(2500) };
    let mut unsent = Vec::new();
    for turn in 0..120 {
        now = Micros(now.0 + 900);
        inputs.interlock_closed = bus.port().byte() != 0xEC;
        let loader = &mut NoLoader;
        let mut ports = Ports { bus: &mut bus, sink: &mut sink, loader };
        if unsent.is_empty() && turn % 8 == 0 {
            unsent = script.pop_front().unwrap_or_default();
        }
        let taken = camera.receive(now, &unsent, &inputs, &mut ports);
        unsent.drain(..taken);
        camera.poll(now, &inputs, &mut ports);
        if !inputs.interlock_closed {
            assert!(!camera.may_light(), "the pin allows light with an open interlock");
        }
        transfer(&mut bus, &mut camera, &mut sink, now);
    }
    let mut other = 0;
    for mut packet in seeds::packets(&sink.sent) {
        packet.pop();
        // Bytes that the FPGA calls a packet go to the host as they are; the host sees the damage.
        other += u32::from(open::<DeviceMessage<'_>>(&mut packet).is_err());
    }
    assert!(
        other == 0 || sink.sent.len() > 100,
        "{other} packets of the firmware do not read as messages"
    );
    assert!(bus.port().accesses < 100_000, "accesses without end");
}

/// As a board does.
fn transfer(bus: &mut PortBus<'_, AnyFpga<'_>>, camera: &mut Camera, sink: &mut Sink, now: Micros) {
    let Some(Wanted { port, into, .. }) = bus.wanted() else { return };
    match into {
        Target::Bus(bytes) => {
            bytes.fill_with(|| port.byte());
            let failed = port.byte() == 0xEE;
            bus.transferred(if failed { Err(BusError::Timeout) } else { Ok(()) });
        }
        Target::Link(length) => {
            if let Some(room) = sink.claim(length) {
                room.fill_with(|| port.byte());
                bus.transferred(Ok(()));
            }
            camera.forward(now, &mut Ports { bus, sink, loader: &mut NoLoader });
        }
    }
}

fn answer_seeds() -> Vec<Vec<u8>> {
    let quiet = vec![1; 400];
    let sound: Vec<u8> =
        (0..600).map(|at| if at % 5 == 0 { 0xE0 } else { (at % 3) as u8 }).collect();
    vec![quiet, sound]
}

/// A link on which the camera sends these packets and hangs up. They come one at a time, so that an answer comes
/// after its question.
struct Said(VecDeque<Vec<u8>>);

impl Link for Said {
    fn send(&mut self, _: &[u8]) -> io::Result<()> {
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], _: Duration) -> io::Result<Received> {
        let Some(packet) = self.0.front_mut() else { return Ok(Received::Closed) };
        let length = packet.len().min(buffer.len());
        for (to, byte) in buffer.iter_mut().zip(packet.drain(..length)) {
            *to = byte;
        }
        if packet.is_empty() {
            self.0.pop_front();
        }
        Ok(Received::Bytes(length))
    }
}

fn session(bytes: &[u8]) {
    let as_they_come = seeds::packets(bytes);
    // Packets with a wrong checksum get a right one, which no search finds.
    let mended = as_they_come.iter().cloned().map(mended).collect();
    for packets in [as_they_come.into(), mended] {
        talk(Box::new(Said(packets)));
    }
}

/// The packet with a right checksum, if its framing is sound.
fn mended(packet: Vec<u8>) -> Vec<u8> {
    let mut opened = packet.clone();
    opened.pop();
    if nirspi_wire::packet::unseal(&mut opened).is_ok() {
        return packet;
    }
    // The framing undone by hand: a zero for each code but the first.
    let (mut payload, mut rest) = (Vec::new(), &packet[..packet.len() - 1]);
    while let Some((&code, after)) = rest.split_first() {
        let Some((block, after)) = after.split_at_checked(usize::from(code).saturating_sub(1))
        else {
            return packet;
        };
        payload.extend(block);
        if code < 0xFF && !after.is_empty() {
            payload.push(0);
        }
        rest = after;
    }
    payload.truncate(payload.len().saturating_sub(4));
    sealed(&payload)
}

/// Greets, asks, and measures, as far as the camera lets the host.
fn talk(link: Box<dyn Link>) {
    let Some(mut session) = read(Session::open(link)) else { return };
    let identity = session.identity();
    for text in [&identity.board, &identity.serial, &identity.firmware, &identity.gateware] {
        assert!(!text.contains(char::is_control), "{text:?}");
    }
    let reports = session.reports();
    assert!(reports.lines.len() <= nirspi::session::Reports::MOST);
    reports.lines.iter().for_each(|line| is_one_line(line));
    if let Some(info) = read(info(&mut session)) {
        info.to_string().lines().for_each(is_one_line);
        assert!(serde_json::to_string(&info).is_ok());
    }
    let options = seeds::capture_options(None);
    let captured = capture(&mut session, &options, &mut |_| ControlFlow::Continue(()));
    if let Some(captured) = read(captured) {
        let counters = captured.counters;
        assert!(counters.received <= 4096, "{counters:?}");
        if let Ok(source) = nirspi::source::Source::of_capture(&captured) {
            assert!(source.measurements.values().iter().all(|value| value.is_finite()));
        }
    }
}
