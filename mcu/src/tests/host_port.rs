//! Tests of the host port as a bus: the right length, the same bytes until the release, and never
//! an older frame.

use super::fake_fpga::FakeFpga;
use super::support::*;
use crate::training;
use crate::{
    BoardInfo, BusError, Camera, FpgaBus, HostPort, Limits, Micros, NoLoader, PacketSink, PortBus,
    Ports, Target, Wanted,
};
use nirspi_wire::fpga::{MAX_FRAME_BYTES, frame_bytes};
use nirspi_wire::host_port::{READ_FRAME, READ_PACKET, READ_RAW, SEALED_BYTES, seal, unseal};
use nirspi_wire::register::{Register, control};
use nirspi_wire::{
    Answer, Command, DeviceMessage, EventKind, Reply, RunLength, SelfTestReport, version,
};
use std::boxed::Box;
use std::collections::VecDeque;
use std::vec::Vec;

/// An FPGA whose data needs a transfer, behind wires.
#[derive(Default)]
pub(super) struct Port {
    pub fpga: FakeFpga,
    /// Opcode and length of every transfer.
    pub transfers: Vec<(u8, usize)>,
    /// Number of transfers that fail before the next one succeeds.
    pub failures: u32,
    /// Bits that the wires invert in the next register accesses: address, value and check.
    pub wrong: VecDeque<u64>,
    /// Bits that the wires invert in every register access after those.
    pub always_wrong: u64,
    /// Each access has other wrong bits than the one before.
    pub is_noisy: bool,
    /// Lines that stand still: every byte of an answer, and no write arrives.
    pub stands_at: Option<u8>,
}

impl Port {
    /// Address and bytes as they come out of the wires.
    fn carry(&mut self, address: u16, sealed: [u8; SEALED_BYTES]) -> (u16, [u8; SEALED_BYTES]) {
        let [w0, w1, wrong @ ..] =
            self.wrong.pop_front().unwrap_or(self.always_wrong).to_be_bytes();
        if self.is_noisy {
            self.always_wrong = self.always_wrong.rotate_left(1);
        }
        let mut carried = sealed;
        carried.iter_mut().zip(wrong).for_each(|(byte, wrong)| *byte ^= wrong);
        (address ^ u16::from_be_bytes([w0, w1]), carried)
    }
}

impl HostPort for Port {
    fn write(&mut self, address: u16, sealed: [u8; SEALED_BYTES]) -> Result<(), BusError> {
        let (address, sealed) = self.carry(address, sealed);
        match unseal(address, sealed) {
            Some(value) if self.stands_at.is_none() => self.fpga.write(address, value),
            _ => Ok(()),
        }
    }

    fn read(&mut self, address: u16) -> Result<[u8; SEALED_BYTES], BusError> {
        // The same wires for both ways: first the address, then the answer.
        let (seen, wrong) = self.carry(address, [0; SEALED_BYTES]);
        let mut sealed = seal(seen, self.fpga.read(seen)?);
        sealed.iter_mut().zip(wrong).for_each(|(byte, wrong)| *byte ^= wrong);
        Ok(self.stands_at.map_or(sealed, |level| [level; SEALED_BYTES]))
    }

    fn frame_ready(&mut self) -> bool {
        self.fpga.frame_ready()
    }

    fn raw_ready(&mut self) -> bool {
        self.fpga.raw_ready()
    }
}

impl Port {
    /// Fills bytes beyond the end of the data with zeros, as the FPGA does.
    pub(super) fn transfer(&mut self, opcode: u8, into: &mut [u8]) -> Result<(), BusError> {
        self.transfers.push((opcode, into.len()));
        if self.failures > 0 {
            self.failures -= 1;
            return Err(BusError::Transfer);
        }
        let there = match opcode {
            READ_FRAME | READ_PACKET => self.fpga.frame.clone().unwrap_or_default(),
            READ_RAW => self.fpga.raw.clone().unwrap_or_default(),
            other => panic!("opcode {other:#x}"),
        };
        into.fill(0);
        // A packet comes between zeros.
        let start = if opcode != READ_RAW && self.fpga.sends_packets() { 5 } else { 0 };
        let length = (into.len() - start).min(there.len());
        into[start..start + length].copy_from_slice(&there[..length]);
        Ok(())
    }
}

pub(super) fn bus() -> PortBus<'static, Port> {
    PortBus::new(Port::default(), Box::leak(Box::new([0; MAX_FRAME_BYTES])))
}

/// Does a board's work between two polls, without the packing; true if there was any.
fn serve(bus: &mut PortBus<'_, Port>) -> bool {
    let Some(Wanted { port, opcode, into }) = bus.wanted() else { return false };
    let Target::Bus(bytes) = into else { panic!("{into:?}") };
    let done = port.transfer(opcode, bytes);
    bus.transferred(done);
    true
}

/// Bytes of the transfer that is wanted.
fn wanted(bus: &mut PortBus<'_, Port>) -> usize {
    match bus.wanted().unwrap().into {
        Target::Bus(bytes) => bytes.len(),
        Target::Link(length) => length,
    }
}

/// Asks for the frame that is ready, and transfers it.
fn fetch(bus: &mut PortBus<'_, Port>) -> u8 {
    bus.port().fpga.make_frame();
    assert_eq!(bus.frame(), Ok(None));
    assert!(serve(bus));
    sequence(bus.frame().unwrap().unwrap())
}

pub(super) fn start(bus: &mut PortBus<'_, Port>, patterns: u16) {
    bus.write(Register::Patterns.address(), patterns.into()).unwrap();
    control(bus, control::START);
}

fn control(bus: &mut PortBus<'_, Port>, bits: u32) {
    bus.write(Register::Control.address(), bits).unwrap();
}

/// Sequence number in a frame's header.
fn sequence(frame: &[u8]) -> u8 {
    frame[8]
}

#[test]
fn a_frame_is_transferred_once_and_given_until_it_is_released() {
    let mut bus = bus();
    start(&mut bus, 3);
    bus.port().fpga.make_frame();
    assert!(bus.wanted().is_none(), "nobody has asked");
    assert_eq!(bus.frame(), Ok(None));
    assert_eq!(bus.frame(), Ok(None));
    assert!(serve(&mut bus));
    let first = bus.frame().unwrap().unwrap().to_vec();
    assert_eq!(first, bus.port().fpga.frame.clone().unwrap());
    assert_eq!(bus.frame().unwrap().unwrap(), first);
    assert!(!serve(&mut bus));
    assert_eq!(bus.port().transfers, [(READ_FRAME, frame_bytes(3))]);
}

#[test]
fn after_a_release_an_older_frame_is_never_given() {
    let mut bus = bus();
    start(&mut bus, 2);
    for number in 0..3 {
        bus.port().fpga.make_frame();
        assert_eq!(bus.frame(), Ok(None), "frame {number} is to be transferred first");
        serve(&mut bus);
        assert_eq!(sequence(bus.frame().unwrap().unwrap()), number);
        control(&mut bus, control::RELEASE);
    }
}

#[test]
fn a_transfer_that_is_wanted_no_more_is_forgotten() {
    let mut bus = bus();
    start(&mut bus, 2);
    bus.port().fpga.make_frame();
    assert_eq!(bus.frame(), Ok(None));
    control(&mut bus, control::RELEASE);
    assert!(!serve(&mut bus));
    // A late report of the end of a transfer is ignored.
    bus.transferred(Ok(()));
    assert_eq!(bus.frame(), Ok(None));
}

/// The FPGA copies its settings when it starts.
#[test]
fn a_frame_is_as_long_as_the_run_was_started_with() {
    let mut bus = bus();
    start(&mut bus, 4);
    bus.write(Register::Patterns.address(), 9).unwrap();
    assert_eq!(bus.frame(), Ok(None));
    assert_eq!(wanted(&mut bus), frame_bytes(4));
    start(&mut bus, 9);
    assert_eq!(bus.frame(), Ok(None));
    assert_eq!(wanted(&mut bus), frame_bytes(9));
    start(&mut bus, u16::MAX);
    assert_eq!(bus.frame(), Ok(None));
    assert_eq!(wanted(&mut bus), MAX_FRAME_BYTES, "and never beyond the buffer");
}

#[test]
fn a_burst_is_as_long_as_asked_for_and_outlives_a_release() {
    let mut bus = bus();
    bus.write(Register::RawLength.address(), 5).unwrap();
    control(&mut bus, control::START_RAW);
    assert_eq!(bus.raw(), Ok(None));
    serve(&mut bus);
    assert_eq!(bus.raw().unwrap().unwrap().len(), 10);
    control(&mut bus, control::RELEASE);
    assert_eq!(bus.raw().unwrap().unwrap().len(), 10);
    control(&mut bus, control::START_RAW);
    assert_eq!(bus.raw(), Ok(None));
    assert_eq!(bus.port().transfers, [(READ_RAW, 10)]);
}

#[test]
fn a_burst_and_a_frame_are_ready_when_their_lines_say_so() {
    let mut bus = bus();
    start(&mut bus, 2);
    assert!(!bus.raw_ready() && !bus.frame_ready());
    bus.port().fpga.raw = Some(std::vec![9; 64]);
    assert!(bus.raw_ready() && !bus.frame_ready());
    bus.port().fpga.raw = None;
    bus.port().fpga.make_frame();
    assert!(!bus.raw_ready() && bus.frame_ready());
}

#[test]
fn a_failed_transfer_is_tried_again_and_given_up_after_three() {
    let mut bus = bus();
    start(&mut bus, 2);
    bus.port().fpga.make_frame();
    bus.port().failures = 2;
    assert_eq!(bus.frame(), Ok(None));
    while serve(&mut bus) {}
    assert_eq!(sequence(bus.frame().unwrap().unwrap()), 0);
    control(&mut bus, control::RELEASE);

    bus.port().fpga.make_frame();
    bus.port().failures = 3;
    assert_eq!(bus.frame(), Ok(None));
    while serve(&mut bus) {}
    assert_eq!(bus.frame(), Err(BusError::Transfer));
    assert_eq!(bus.frame(), Ok(None), "told once; then it is asked for anew");
}

#[test]
fn an_error_is_told_of_the_data_that_could_not_be_read_alone() {
    let mut bus = bus();
    start(&mut bus, 2);
    bus.port().fpga.make_frame();
    bus.port().failures = 3;
    assert_eq!(bus.frame(), Ok(None));
    while serve(&mut bus) {}
    assert_eq!(bus.raw(), Ok(None), "no burst has failed");
}

/// The last bytes transferred, and the transfer that is wanted next, are of one kind of data.
#[test]
fn a_frame_is_never_given_for_a_burst_nor_a_burst_fetched_for_a_frame() {
    let mut bus = bus();
    start(&mut bus, 2);
    assert_eq!(fetch(&mut bus), 0);
    bus.port().fpga.raw = Some(std::vec![9; 64]);
    assert_eq!(bus.raw(), Ok(None), "the buffer holds a frame");
    assert_eq!(bus.frame(), Ok(None), "its place is given away");
    assert!(serve(&mut bus));
    assert_eq!(bus.frame().unwrap().map(sequence), Some(0));
    assert_eq!(bus.port().transfers.last(), Some(&(READ_FRAME, frame_bytes(2))));
}

#[test]
fn a_stop_leaves_the_last_frame_until_its_release() {
    let mut bus = bus();
    start(&mut bus, 2);
    assert_eq!(fetch(&mut bus), 0);
    control(&mut bus, control::STOP);
    assert_eq!(bus.frame().unwrap().map(sequence), Some(0));
    assert_eq!(bus.port().transfers.len(), 1, "read once");
}

/// The camera over a host port, polled as a board does.
pub(super) struct Device {
    pub camera: Camera,
    pub bus: PortBus<'static, Port>,
    pub link: Link,
    pub now: Micros,
    /// Time that the transfer of a packet takes.
    pub transfer_us: u64,
}

impl Device {
    pub(super) fn new(bus: PortBus<'static, Port>) -> Self {
        let info = BoardInfo::new("bench", "0001", nirspi_wire::Version(1, 2, 3));
        let camera = Camera::new(info, Limits::SIMULATED);
        let mut device =
            Self { camera, bus, link: Link::default(), now: Micros(1_000), transfer_us: 0 };
        // The packet of the training.
        for _ in 0..9 {
            if device.camera.machine().port != training::Port::Sound {
                device.turn(&[]);
            }
        }
        device.bus.port().transfers.clear();
        device.ask(Command::Hello { protocol: version::CURRENT });
        device
    }

    pub(super) fn turn(&mut self, bytes: &[u8]) {
        self.now.0 += 100;
        let ports = &mut Ports { bus: &mut self.bus, sink: &mut self.link, loader: &mut NoLoader };
        let taken = self.camera.receive(self.now, bytes, &GOOD_INPUTS, ports);
        assert_eq!(taken, bytes.len());
        self.camera.poll(self.now, &GOOD_INPUTS, ports);
        match self.bus.wanted() {
            None => {}
            Some(Wanted { port, opcode, into: Target::Bus(bytes) }) => {
                let done = port.transfer(opcode, bytes);
                self.bus.transferred(done);
            }
            Some(Wanted { port, opcode, into: Target::Link(length) }) => {
                if let Some(room) = self.link.claim(length) {
                    let done = port.transfer(opcode, room);
                    self.bus.transferred(done);
                }
                self.now.0 += self.transfer_us;
                let ports =
                    &mut Ports { bus: &mut self.bus, sink: &mut self.link, loader: &mut NoLoader };
                self.camera.forward(self.now, ports);
            }
        }
    }

    pub(super) fn ask(&mut self, command: Command<'_>) -> Vec<DeviceMessage<'static>> {
        self.turn(&packet(1, command));
        self.turn(&[]);
        self.turn(&[]);
        self.heard()
    }

    pub(super) fn heard(&mut self) -> Vec<DeviceMessage<'static>> {
        self.link.packets.drain(..).map(|packet| message(&packet)).collect()
    }
}

/// Until the FPGA takes the release, its line still signals the frame that was read before.
#[test]
fn a_frame_is_read_once_however_long_its_release_does_not_come_through() {
    let mut device = Device::new(bus());
    device.ask(Command::Configure(SMALL));
    device.ask(Command::Start(RunLength::Continuous));
    device.bus.port().fpga.lost_address = Some(Register::Control.address());
    device.bus.port().fpga.make_frame();
    for _ in 0..20 {
        device.turn(&[]);
    }
    assert!(device.bus.port().fpga.frame.is_some(), "the release is lost");
    assert_eq!(device.bus.port().transfers.len(), 1);

    device.bus.port().fpga.lost_address = None;
    device.turn(&[]);
    device.bus.port().fpga.make_frame();
    for _ in 0..20 {
        device.turn(&[]);
    }
    assert_eq!(device.bus.port().transfers.len(), 2);
    let heard = device.heard();
    let sequences: Vec<u32> = frames(&heard).iter().map(|frame| frame.sequence).collect();
    assert_eq!(sequences, [0, 1]);
}

#[test]
fn a_run_of_frames_that_come_slowly_goes_on() {
    let mut device = Device::new(bus());
    device.ask(Command::Configure(SMALL));
    device.ask(Command::Start(RunLength::Continuous));
    // The transfer takes longer than the patience with an FPGA that makes no frame.
    device.transfer_us = Limits::SIMULATED.stall_min.0 + 50_000;
    for _ in 0..5 {
        device.bus.port().fpga.make_frame();
        device.turn(&[]);
    }
    let heard = device.heard();
    assert_eq!((frames(&heard).len(), events(&heard).len()), (5, 0));
}

/// A transfer over an emulated board's serial line takes longer than the end of a run waits.
#[test]
fn a_frame_that_comes_slowly_at_the_end_of_a_run_is_sent() {
    let mut device = Device::new(bus());
    device.ask(Command::Configure(SMALL));
    device.ask(Command::Start(RunLength::Frames(1)));
    device.bus.port().fpga.make_frame();
    device.transfer_us = 200_000;
    device.turn(&[]);
    device.turn(&[]);
    let heard = device.heard();
    assert_eq!(frames(&heard).len(), 1);
    assert!(matches!(events(&heard)[..], [EventKind::RunEnded { fpga_frames_corrupt: 0, .. }]));
}

#[test]
fn the_self_test_tries_the_frame_memory_too() {
    let mut device = Device::new(bus());
    device.bus.port().fpga.instant = true;
    let mut heard = device.ask(Command::SelfTest);
    while heard.is_empty() {
        device.bus.port().fpga.pin = device.camera.may_light();
        device.turn(&[]);
        heard = device.heard();
    }
    let [DeviceMessage::Reply(Reply { outcome: Ok(Answer::SelfTest(report)), .. })] = heard[..]
    else {
        panic!("{heard:?}");
    };
    assert_eq!(report, SelfTestReport { ran: 0b111_1111_1111, failed: 0 });
}
