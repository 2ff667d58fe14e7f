//! Test support: a link with as much room as a test gives, and a camera between that link and a
//! fake FPGA.

use super::fake_fpga::FakeFpga;
use crate::training::Port;
use crate::{
    BoardInfo, Camera, GatewareLoader, Inputs, Limits, LoadError, Loan, Micros, PacketSink, Ports,
    Progress,
};
use core::ops::Range;
use core::sync::atomic::Ordering;
use nirspi_wire::packet::{MAX_HOST_PACKET, encode, open};
use nirspi_wire::{
    Answer, Capabilities, Command, Configuration, DeviceMessage, Event, EventKind, Frame,
    PatternOrder, Refusal, Reply, Request, RunLength, SampleSource, Status, Version, version,
};
use std::boxed::Box;
use std::collections::VecDeque;
use std::vec::Vec;

/// A link that takes `room` more packets.
#[derive(Clone)]
pub struct Link {
    pub room: usize,
    /// Number of claims that find no room before the next claim succeeds.
    pub refusals: u32,
    pub packets: Vec<Vec<u8>>,
    /// The host does not fetch what lies in a ring until [`fetch`](Self::fetch) is called.
    pub holds: bool,
    /// What it has not fetched.
    pub loans: VecDeque<Loan>,
    staging: Vec<u8>,
}

impl Default for Link {
    fn default() -> Self {
        Self {
            room: usize::MAX,
            refusals: 0,
            packets: Vec::new(),
            holds: false,
            loans: VecDeque::new(),
            staging: Vec::new(),
        }
    }
}

impl Link {
    /// The host fetches the first loan, which must be packets with zeros between them.
    pub fn fetch(&mut self) {
        let Some(mut loan) = self.loans.pop_front() else { return };
        let mut bytes = Vec::new();
        while !loan.is_over() {
            let (words, length) = loan.next();
            let words = words.iter().flat_map(|word| word.load(Ordering::Relaxed).to_le_bytes());
            bytes.extend(words.take(length));
            loan.sent(length);
        }
        assert_eq!(bytes.last(), Some(&0), "a whole packet");
        let packets = bytes.split_inclusive(|byte| *byte == 0);
        self.packets.extend(packets.filter(|packet| packet.len() > 1).map(<[u8]>::to_vec));
    }
}

impl PacketSink for Link {
    fn claim(&mut self, length: usize) -> Option<&mut [u8]> {
        if self.refusals > 0 {
            self.refusals -= 1;
            return None;
        }
        if self.room == 0 {
            return None;
        }
        self.staging.resize(length, 0xAA);
        Some(&mut self.staging[..length])
    }

    fn commit(&mut self, part: Range<usize>) {
        self.room -= 1;
        self.packets.push(self.staging[part].to_vec());
    }

    fn lend(&mut self, loan: Loan) -> bool {
        if self.room == 0 {
            return false;
        }
        self.room -= 1;
        self.loans.push_back(loan);
        if !self.holds {
            self.fetch();
        }
        true
    }
}

/// A loader that keeps the bytes it gets.
#[derive(Clone, Default)]
pub struct Loader {
    pub unsupported: bool,
    pub data: Vec<u8>,
    pub finished: u32,
    pub forgotten: u32,
}

impl GatewareLoader for Loader {
    fn begin(&mut self, _total: u32) -> Result<(), LoadError> {
        self.data.clear();
        if self.unsupported { Err(LoadError::Unsupported) } else { Ok(()) }
    }

    fn write(&mut self, data: &[u8]) -> Result<(), LoadError> {
        self.data.extend(data);
        Ok(())
    }

    fn finish(&mut self) -> Result<(), LoadError> {
        self.finished += 1;
        Ok(())
    }

    fn forget(&mut self) {
        self.forgotten += 1;
    }
}

/// A camera with a fake FPGA, a link and a loader.
#[derive(Clone)]
pub struct Bench {
    pub camera: Camera,
    pub fpga: FakeFpga,
    pub link: Link,
    pub loader: Loader,
    pub inputs: Inputs,
    pub now: Micros,
    pub next_id: u16,
}

pub const GOOD_INPUTS: Inputs =
    Inputs { interlock_closed: true, temperature_centi_celsius: Some(2500) };

/// Four patterns, differential, one sweep.
pub const SMALL: Configuration<'static> = Configuration {
    order: PatternOrder::Natural,
    patterns: 4,
    differential: true,
    alternating: true,
    clocks_per_pattern: 5,
    blanked: 2,
    adc_latency: 3,
    sweeps: 1,
    source: SampleSource::Detector,
    over_range_trip: 100,
};

impl Bench {
    /// A bench after power-up and the first polls.
    ///
    /// Its first light waits for no test of the LED enables, so that each test here has its own runs alone.
    pub fn new() -> Self {
        Self::with(Limits::SIMULATED)
    }

    /// The same with these limits.
    pub fn with(limits: Limits) -> Self {
        let info =
            BoardInfo::new("bench", "0001", Version(1, 2, 3)).can(Capabilities::LOAD_GATEWARE);
        let mut bench = Self {
            camera: Camera::new(info, limits),
            fpga: FakeFpga::default(),
            link: Link::default(),
            loader: Loader::default(),
            inputs: GOOD_INPUTS,
            now: Micros(1_000),
            next_id: 1,
        };
        bench.train();
        bench
    }

    /// Polls until the packet port has been tried.
    pub fn train(&mut self) {
        for _ in 0..9 {
            if self.camera.machine().port == Port::Sound {
                return;
            }
            self.poll();
        }
        panic!("no training");
    }

    /// A bench with a session.
    pub fn open() -> Self {
        Self::new().opened()
    }

    /// The same with a session.
    pub fn opened(mut self) -> Self {
        let bench = &mut self;
        let answer = bench.ask(Command::Hello { protocol: version::CURRENT });
        assert!(matches!(answer, Ok(Answer::Hello(_))), "{answer:?}");
        self
    }

    /// A bench with a configuration.
    pub fn configured() -> Self {
        let mut bench = Self::open();
        assert_eq!(bench.ask(Command::Configure(SMALL)), Ok(Answer::Done));
        bench
    }

    /// A bench with the LEDs on.
    pub fn running(length: RunLength) -> Self {
        let mut bench = Self::configured();
        assert_eq!(bench.ask(Command::Start(length)), Ok(Answer::Done));
        assert!(bench.fpga.leds_on());
        bench
    }

    pub fn receive(&mut self, bytes: &[u8]) -> usize {
        let mut ports =
            Ports { bus: &mut self.fpga, sink: &mut self.link, loader: &mut self.loader };
        self.camera.receive(self.now, bytes, &self.inputs, &mut ports)
    }

    pub fn poll(&mut self) -> Progress {
        let mut ports =
            Ports { bus: &mut self.fpga, sink: &mut self.link, loader: &mut self.loader };
        let progress = self.camera.poll(self.now, &self.inputs, &mut ports);
        self.fpga.pin = self.camera.may_light();
        progress
    }

    pub fn close_link(&mut self) {
        let mut ports =
            Ports { bus: &mut self.fpga, sink: &mut self.link, loader: &mut self.loader };
        self.camera.link_closed(self.now, &mut ports);
    }

    pub fn depth(&mut self, side: u8, distances_mm: &[u16]) {
        let mut ports =
            Ports { bus: &mut self.fpga, sink: &mut self.link, loader: &mut self.loader };
        self.camera.depth(self.now, side, distances_mm, &mut ports);
    }

    /// Lets time pass, then polls.
    pub fn after(&mut self, micros: u64) -> Progress {
        self.now.0 += micros;
        self.poll()
    }

    /// Sends a whole command; returns its id.
    pub fn send(&mut self, command: Command<'_>) -> u16 {
        let id = self.next_id;
        self.next_id += 1;
        let bytes = packet(id, command);
        assert_eq!(self.receive(&bytes), bytes.len(), "not taken: {command:?}");
        id
    }

    /// Sends a command and polls until its reply comes. Messages before the reply stay on the link.
    pub fn ask(&mut self, command: Command<'_>) -> Result<Answer<'static>, Refusal> {
        self.ask_in_steps(command, 0)
    }

    /// The same with half a millisecond between two polls.
    pub fn ask_slowly(&mut self, command: Command<'_>) -> Result<Answer<'static>, Refusal> {
        self.ask_in_steps(command, 500)
    }

    fn ask_in_steps(
        &mut self,
        command: Command<'_>,
        step_us: u64,
    ) -> Result<Answer<'static>, Refusal> {
        let id = self.send(command);
        for _ in 0..20 {
            let replies = self.link.packets.iter().map(|packet| message(packet));
            let place = replies.enumerate().find_map(|(place, message)| match message {
                DeviceMessage::Reply(Reply { id: found, outcome }) if found == id => {
                    Some((place, outcome))
                }
                _ => None,
            });
            if let Some((place, outcome)) = place {
                self.link.packets.remove(place);
                return outcome;
            }
            self.after(step_us);
        }
        panic!("no reply to {command:?}");
    }

    pub fn status(&mut self) -> Status {
        match self.ask(Command::Status) {
            Ok(Answer::Status(status)) => status,
            other => panic!("{other:?}"),
        }
    }

    /// Takes the messages that the link has carried.
    pub fn heard(&mut self) -> Vec<DeviceMessage<'static>> {
        self.link.packets.drain(..).map(|packet| message(&packet)).collect()
    }

    pub fn heard_events(&mut self) -> Vec<EventKind> {
        events(&self.heard())
    }

    /// The FPGA completes a frame, and the camera polls once.
    pub fn frame(&mut self) {
        self.fpga.make_frame();
        self.after(100);
    }
}

pub fn packet(id: u16, command: Command<'_>) -> Vec<u8> {
    let mut room = std::vec![0; MAX_HOST_PACKET + 1];
    encode(&Request { id, command }, &mut room).unwrap().to_vec()
}

/// Decodes a packet. Its memory is leaked, so that the message can borrow it for the whole test.
pub fn message(packet: &[u8]) -> DeviceMessage<'static> {
    let (0, encoded) = packet.split_last().map(|(&last, rest)| (last, rest)).unwrap() else {
        panic!("no delimiter");
    };
    open(Box::leak(encoded.to_vec().into_boxed_slice())).unwrap()
}

pub fn events(messages: &[DeviceMessage<'_>]) -> Vec<EventKind> {
    let kind = |message: &DeviceMessage<'_>| match message {
        DeviceMessage::Event(Event { kind, .. }) => Some(*kind),
        _ => None,
    };
    messages.iter().filter_map(kind).collect()
}

pub fn frames(messages: &[DeviceMessage<'static>]) -> Vec<Frame<'static>> {
    let frame = |message: &DeviceMessage<'static>| match message {
        DeviceMessage::Frame(frame) => Some(*frame),
        _ => None,
    };
    messages.iter().filter_map(frame).collect()
}

/// The event at the end of run 1.
pub fn ended(made: u32, dropped: u32, lost: u32, corrupt: u32) -> EventKind {
    EventKind::RunEnded {
        run: 1,
        frames_made: made,
        frames_dropped: dropped,
        fpga_frames_lost: lost,
        fpga_frames_corrupt: corrupt,
    }
}

/// Numbers of the frames among these messages.
pub fn sequences(heard: &[DeviceMessage<'static>]) -> Vec<u32> {
    frames(heard).iter().map(|frame| frame.sequence).collect()
}
