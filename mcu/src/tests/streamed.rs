//! Tests of runs whose packets come by the FPGA's parallel port: a ring that a DMA channel fills, in front of the
//! camera.

use super::fake_fpga::FakeFpga;
use super::support::*;
use crate::{
    BoardInfo, Camera, Limits, Micros, NoLoader, PacketSink, PortBus, Ports, Progress, Target,
    Wanted, training,
};
use nirspi_wire::fpga::MAX_FRAME_BYTES;
use nirspi_wire::packet::open;
use nirspi_wire::register::{Register, mode};
use nirspi_wire::{
    Answer, Command, Configuration, DeviceMessage, EventKind, Fault, Reply, RunLength, State,
    version,
};
use proptest::prelude::*;
use std::boxed::Box;
use std::vec::Vec;
use wired::Wired;

mod wired;

/// A camera whose board has both ports.
struct Device {
    camera: Camera,
    bus: PortBus<'static, Wired>,
    link: Link,
    now: Micros,
}

impl Device {
    fn new() -> Self {
        let info = BoardInfo::new("bench", "0001", nirspi_wire::Version(1, 2, 3));
        let bus = PortBus::new(Wired::new(), Box::leak(Box::new([0; MAX_FRAME_BYTES])));
        let camera = Camera::new(info, Limits::SIMULATED);
        let mut device = Self { camera, bus, link: Link::default(), now: Micros(1_000) };
        // The packet of the training comes by the host port.
        for _ in 0..9 {
            if device.camera.machine().port != training::Port::Sound {
                device.turn();
            }
        }
        device.bus.port().port.transfers.clear();
        device.ask(Command::Hello { protocol: version::CURRENT });
        device
    }

    fn running(length: RunLength) -> Self {
        let mut device = Self::new();
        device.start(SMALL, length);
        device
    }

    fn start(&mut self, configuration: Configuration<'_>, length: RunLength) {
        let answer = self.ask(Command::Configure(configuration));
        assert!(
            matches!(answer[..], [DeviceMessage::Reply(Reply { outcome: Ok(_), .. })]),
            "{answer:?}"
        );
        let answer = self.ask(Command::Start(length));
        assert!(
            matches!(answer[..], [DeviceMessage::Reply(Reply { outcome: Ok(_), .. })]),
            "{answer:?}"
        );
    }

    fn fpga(&mut self) -> &mut FakeFpga {
        self.bus.port().fpga()
    }

    /// So much time passes.
    fn after(&mut self, micros: u64, bytes: &[u8]) {
        self.now.0 += micros;
        let now = self.now;
        let ports = &mut Ports { bus: &mut self.bus, sink: &mut self.link, loader: &mut NoLoader };
        let taken = self.camera.receive(now, bytes, &GOOD_INPUTS, ports);
        assert_eq!(taken, bytes.len());
        self.poll();
        if let Some(Wanted { port, opcode, into: Target::Link(length) }) = self.bus.wanted()
            && let Some(room) = self.link.claim(length)
        {
            let done = port.port.transfer(opcode, room);
            self.bus.transferred(done);
            let ports =
                &mut Ports { bus: &mut self.bus, sink: &mut self.link, loader: &mut NoLoader };
            self.camera.forward(now, ports);
        }
        self.fpga().pin = self.camera.may_light();
    }

    fn poll(&mut self) -> Progress {
        let ports = &mut Ports { bus: &mut self.bus, sink: &mut self.link, loader: &mut NoLoader };
        self.camera.poll(self.now, &GOOD_INPUTS, ports)
    }

    fn turn(&mut self) {
        self.after(10, &[]);
    }

    fn turns(&mut self, turns: u32) {
        for _ in 0..turns {
            self.turn();
        }
    }

    fn ask(&mut self, command: Command<'_>) -> Vec<DeviceMessage<'static>> {
        self.after(10, &packet(1, command));
        self.turns(2);
        self.heard()
    }

    /// The FPGA makes a frame and sends it.
    fn frame(&mut self) -> Vec<u8> {
        self.fpga().make_frame();
        self.bus.port().transmit(|_| {}).remove(0)
    }

    /// The FPGA makes so many frames, and the host reads nothing. Returns the number of loans, each of one frame, and of
    /// frames that the FPGA has lost.
    fn unread(&mut self, frames: u32) -> (u32, u32) {
        self.link.holds = true;
        for _ in 0..frames {
            self.fpga().make_frame();
            self.bus.port().transmit(|_| {});
            self.turn();
        }
        (self.link.loans.len() as u32, self.fpga().lost)
    }

    fn heard(&mut self) -> Vec<DeviceMessage<'static>> {
        self.link.packets.drain(..).map(|packet| message(&packet)).collect()
    }

    /// Stops the run, lets the patience with missing frames pass, and returns the event of its end.
    fn end(&mut self) -> (Vec<DeviceMessage<'static>>, EventKind) {
        let mut heard = self.ask(Command::Stop);
        for _ in 0..9 {
            self.bus.port().transmit(|_| {});
            self.turn();
        }
        self.after(100_001, &[]);
        self.turns(3);
        heard.extend(self.heard());
        let [event] = events(&heard)[..] else { panic!("{heard:?}") };
        (heard, event)
    }
}

#[test]
fn a_packet_goes_from_the_ring_to_the_host_as_the_fpga_made_it() {
    let mut device = Device::running(RunLength::Continuous);
    for _ in 0..100 {
        let made = device.frame();
        device.turn();
        assert_eq!(device.link.packets, [made]);
        device.link.packets.clear();
    }
    assert_eq!(device.bus.port().port.transfers, [], "nothing goes by the host port");
    assert_eq!(device.end().1, ended(100, 0, 0, 0));
}

/// A board sleeps after a poll that has not worked.
#[test]
fn a_poll_has_worked_if_a_packet_has_come() {
    let mut device = Device::running(RunLength::Continuous);
    assert!(!device.poll().worked);
    for _ in 0..3 {
        device.frame();
        assert!(device.poll().worked);
        assert!(!device.poll().worked);
    }
}

/// The FPGA of a board without wires to the port, and frames that come slowly.
#[test]
fn packets_leave_by_the_parallel_port_only_where_there_is_one_and_frames_are_fast() {
    // Four patterns and complements of 5 clocks are 40 clocks a sweep, and 27 500 clocks are 220 us.
    for (sweeps, is_parallel) in [(1, true), (687, true), (688, false)] {
        let mut device = Device::new();
        device.start(Configuration { sweeps, ..SMALL }, RunLength::Continuous);
        let found = device.fpga().get(Register::Mode);
        assert_eq!(found & mode::PARALLEL != 0, is_parallel, "{sweeps} sweeps");
        assert_ne!(found & mode::PACKETS, 0);
    }
    let mut bench = Bench::open();
    bench.ask(Command::Configure(SMALL)).unwrap();
    assert_eq!(bench.fpga.get(Register::Mode) & mode::PARALLEL, 0, "no ring");
}

#[test]
fn a_run_of_so_many_frames_ends_with_the_last() {
    let mut device = Device::running(RunLength::Frames(3));
    for _ in 0..3 {
        device.frame();
    }
    device.turns(5);
    let heard = device.heard();
    assert_eq!(sequences(&heard), [0, 1, 2]);
    assert_eq!(events(&heard), [ended(3, 0, 0, 0)]);
    assert_eq!(device.camera.state(), State::Configured);
}

#[test]
fn frames_that_wait_at_a_stop_still_come() {
    let mut device = Device::running(RunLength::Continuous);
    device.frame();
    device.fpga().make_frame();
    device.fpga().make_frame();
    let (heard, event) = device.end();
    assert_eq!(sequences(&heard), [0, 1, 2]);
    assert_eq!(event, ended(3, 0, 0, 0));
}

/// Loans of one packet each take the link's places long before the ring is full.
#[test]
fn packets_wait_in_the_ring_for_a_place_of_the_link() {
    let mut device = Device::running(RunLength::Continuous);
    device.link.room = 2;
    let made: Vec<_> = (0..30)
        .map(|_| {
            let made = device.frame();
            device.turn();
            made
        })
        .collect();
    assert_eq!(sequences(&device.heard()), [0, 1]);
    // Nothing stalls meanwhile.
    for _ in 0..10 {
        device.after(100_000, &packet(9, Command::Status));
        assert_eq!(device.camera.state(), State::Running);
    }
    device.link.room = usize::MAX;
    device.link.holds = true;
    device.turn();
    assert_eq!(device.heard().len(), 10, "the replies come first");
    device.turns(3);
    // The signal meter looks at two packets, and a poll ends behind each of them.
    assert_eq!(device.link.loans.len(), 3, "all that waited goes out together");
    (0..3).for_each(|_| device.link.fetch());
    assert_eq!(device.link.packets, made[2..]);
    device.link.packets.clear();
    device.link.holds = false;
    assert_eq!(device.end().1, ended(30, 0, 0, 0));
}

/// What comes at once goes out at once: one loan, and no byte of it is copied.
#[test]
fn packets_that_follow_each_other_go_out_together() {
    let mut device = Device::running(RunLength::Continuous);
    device.link.holds = true;
    let mut made = Vec::new();
    for _ in 0..5 {
        for _ in 0..9 {
            made.push(device.frame());
        }
        device.turn();
    }
    assert_eq!(device.link.loans.len(), 5);
    while !device.link.loans.is_empty() {
        device.link.fetch();
    }
    assert_eq!(device.link.packets, made);
    device.link.packets.clear();
    device.link.holds = false;
    assert_eq!(device.end().1, ended(45, 0, 0, 0));
}

/// What lies between two packets that do not follow each other stays out of the host's link, where it would be a
/// damaged packet.
#[test]
fn packets_with_other_bytes_between_them_go_out_apart() {
    let mut device = Device::running(RunLength::Continuous);
    // The signal meter looks at two packets, and a poll ends behind each of them.
    let mut made = Vec::new();
    for _ in 0..2 {
        made.push(device.frame());
        device.turn();
    }
    device.link.holds = true;
    made.push(device.frame());
    device.bus.port().send(&[7, 7, 7, 7, 7, 7, 7, 0]);
    made.push(device.frame());
    device.turn();
    assert_eq!(device.link.loans.len(), 2);
    while !device.link.loans.is_empty() {
        device.link.fetch();
    }
    assert_eq!(device.link.packets, made);
}

/// The ring fills, the FPGA waits and loses frames. That is no stalled FPGA, and nothing is overwritten.
#[test]
fn a_host_that_stops_reading_makes_the_fpga_lose_whole_frames() {
    let mut device = Device::running(RunLength::Continuous);
    let mut begun = Vec::new();
    for round in 0..40 {
        // For four seconds of eight.
        device.link.holds = (10..30).contains(&round);
        for _ in 0..30 {
            device.fpga().make_frame();
            begun.extend(device.bus.port().transmit(|_| {}));
            device.turn();
        }
        device.after(200_000, &[]);
        while !device.link.holds && !device.link.loans.is_empty() {
            device.link.fetch();
        }
        if round % 5 == 4 {
            device.after(10, &packet(9, Command::Status));
        }
        assert_eq!(device.camera.state(), State::Running, "round {round}");
    }
    let mut packets = core::mem::take(&mut device.link.packets);
    let (
        heard,
        EventKind::RunEnded {
            frames_made,
            frames_dropped: 0,
            fpga_frames_lost,
            fpga_frames_corrupt: 0,
            ..
        },
    ) = device.end()
    else {
        panic!()
    };
    packets.retain(|packet| is_intact(packet).is_some());
    assert_eq!(packets, begun[..packets.len()], "whole and in order");
    assert_eq!(frames_made, 1200);
    assert!(fpga_frames_lost > 400, "{fpga_frames_lost}");
    let got = packets.len() + sequences(&heard).len();
    assert_eq!(got as u32, frames_made - fpga_frames_lost);
}

/// What the FPGA could not send counts as dropped at the end of the run, because the host took nothing.
#[test]
fn frames_that_wait_for_a_host_that_reads_nothing_are_dropped_at_the_end() {
    let mut device = Device::running(RunLength::Continuous);
    let (sent, lost) = device.unread(200);
    assert!(lost > 100);
    assert_eq!(device.end().1, ended(200, 200 - lost - sent, lost, 0));
}

/// The host takes a loan just before the patience with the last frames is over: these are on their way, and not damaged.
#[test]
fn frames_for_which_room_comes_too_late_are_dropped_and_not_damaged() {
    let mut device = Device::running(RunLength::Continuous);
    let (sent, lost) = device.unread(200);
    device.ask(Command::Stop);
    device.after(99_000, &[]);
    device.link.fetch();
    device.link.packets.clear();
    device.after(1_001, &[]);
    device.turns(3);
    assert_eq!(events(&device.heard()), [ended(200, 200 - lost - sent, lost, 0)]);
}

/// The line on which the FPGA should wait is broken: packets are overwritten, and each is still counted once.
#[test]
fn packets_of_an_fpga_that_does_not_wait_count_as_damaged() {
    let mut device = Device::running(RunLength::Continuous);
    device.frame();
    device.turn();
    for _ in 0..100 {
        device.bus.port().granted = usize::MAX;
        device.frame();
    }
    device.turns(3);
    let first = sequences(&device.heard());
    device.frame();
    device.turn();
    assert_eq!(sequences(&device.heard()), [101]);
    let damaged = 102 - 1 - first.len() as u32;
    assert!(first[0] == 0 && damaged > 60, "{damaged}");
    let Ok(status) = device.status() else { panic!() };
    assert_eq!(status.fpga_frames_corrupt, damaged, "while the run goes on");
    assert_eq!(device.end().1, ended(102, 0, 0, damaged));
}

#[test]
fn frames_that_the_fpga_has_lost_are_not_damaged() {
    let mut device = Device::running(RunLength::Continuous);
    device.frame();
    for _ in 0..3 {
        device.fpga().make_frame();
    }
    for _ in 0..2 {
        device.bus.port().transmit(|_| {});
    }
    device.frame();
    device.turns(5);
    assert_eq!(sequences(&device.heard()), [0, 1, 2, 4]);
    let Ok(status) = device.status() else { panic!() };
    assert_eq!((status.fpga_frames_lost, status.fpga_frames_corrupt), (1, 0));
    assert_eq!(device.end().1, ended(5, 0, 1, 0));
}

/// The FPGA's clock was lost in a packet, and a start cuts what is left: no run gets a packet of another.
#[test]
fn a_run_gets_no_packet_of_the_run_before() {
    for cut in [7, 20, 70] {
        let mut device = Device::running(RunLength::Continuous);
        device.fpga().make_frame();
        let last = device.fpga().frame.take().unwrap();
        device.bus.port().send(&[&[0], &last[..cut.min(last.len())]].concat());
        let (heard, event) = device.end();
        assert_eq!((sequences(&heard), event), (Vec::new(), ended(1, 0, 0, 1)));
        // What was on its way comes after the start.
        device.after(10, &packet(2, Command::Start(RunLength::Frames(2))));
        device.bus.port().send(&[&last[cut.min(last.len())..], &[0; 3]].concat());
        let made = [device.frame(), device.frame()];
        device.turns(9);
        // Byte by byte: a packet of the run before has the same numbers of frames.
        let mut frames = device.link.packets.clone();
        frames.retain(|packet| is_intact(packet).is_some());
        assert_eq!(frames, made);
        let heard = device.heard();
        let [EventKind::RunEnded { run: 2, frames_made: 2, fpga_frames_corrupt: 0, .. }] =
            events(&heard)[..]
        else {
            panic!("{heard:?}");
        };
    }
}

/// A whole packet of the run before that comes after the start of the next one is recognised by its number.
#[test]
fn a_late_packet_is_not_taken_for_one_of_the_next_run() {
    let mut device = Device::running(RunLength::Continuous);
    let first = device.frame();
    device.turn();
    device.end();
    device.after(10, &packet(2, Command::Start(RunLength::Frames(2))));
    device.bus.port().send(&[&[0], &first[..], &[0; 3]].concat());
    device.turns(3);
    assert_eq!(sequences(&device.heard()), []);
    device.frame();
    device.frame();
    device.turns(5);
    assert_eq!(sequences(&device.heard()), [0, 1]);
}

/// The firmware counts its runs from 1 again after a restart, and the FPGA may send what it still has.
#[test]
fn packets_from_before_a_restart_are_not_taken_for_those_of_the_first_run() {
    let old = Device::running(RunLength::Continuous).frame();
    let mut device = Device::new();
    device.ask(Command::Configure(SMALL));
    device.bus.port().send(&[&[0], &old[..], &[0; 3]].concat());
    let heard = device.ask(Command::Start(RunLength::Frames(1)));
    assert_eq!(sequences(&heard), []);
    let new = device.frame();
    device.turn();
    assert_eq!(device.link.packets[0], new);
}

/// Number of the frame, with a wrong bit: the next ones must not be taken for old ones.
#[test]
fn a_number_that_the_wires_have_damaged_ends_no_run() {
    for bit in 0..8 {
        let mut device = Device::running(RunLength::Continuous);
        device.frame();
        device.turn();
        device.fpga().make_frame();
        // The fourth byte of the sequence.
        device.bus.port().transmit(|packet| packet[8] ^= 1 << bit);
        for _ in 0..3 {
            device.frame();
            device.turn();
        }
        device.turns(3);
        let intact: Vec<_> =
            device.link.packets.drain(..).filter_map(|packet| is_intact(&packet)).collect();
        assert_eq!(intact, [0, 2, 3, 4], "bit {bit}");
        let (_, EventKind::RunEnded { frames_made: 5, frames_dropped: 0, .. }) = device.end()
        else {
            panic!()
        };
    }
}

/// Number of the frame in a packet that is intact.
fn is_intact(packet: &[u8]) -> Option<u32> {
    let (_, encoded) = packet.split_last()?;
    match open::<DeviceMessage<'_>>(&mut encoded.to_vec()) {
        Ok(DeviceMessage::Frame(frame)) => Some(frame.sequence),
        _ => None,
    }
}

/// No wire, no clock on the wire, or a receiver that is never ready.
#[test]
fn a_run_whose_packets_never_come_ends_in_a_fault() {
    let mut device = Device::running(RunLength::Continuous);
    for _ in 0..30 {
        device.fpga().make_frame();
        device.after(10_000, &[]);
    }
    assert_eq!(device.camera.state(), State::Fault);
    device.after(100_001, &[]);
    device.turns(3);
    let heard = device.heard();
    let [EventKind::Fault(Fault::FpgaStalled), EventKind::RunEnded { .. }] = events(&heard)[..]
    else {
        panic!("{heard:?}");
    };
}

#[test]
fn a_self_test_and_a_burst_use_the_host_port_and_the_run_after_them_the_ring() {
    let mut device = Device::new();
    device.ask(Command::Configure(SMALL));
    device.fpga().instant = true;
    let serve = |device: &mut Device, command| {
        device.after(10, &packet(1, command));
        let mut heard = Vec::new();
        for _ in 0..20 {
            if let Some(Wanted { port, opcode, into: Target::Bus(bytes) }) = device.bus.wanted() {
                let done = port.port.transfer(opcode, bytes);
                device.bus.transferred(done);
            }
            device.after(500, &[]);
            heard.extend(device.heard());
        }
        heard
    };
    let heard = serve(&mut device, Command::SelfTest);
    let [DeviceMessage::Reply(Reply { outcome: Ok(Answer::SelfTest(report)), .. })] = heard[..]
    else {
        panic!("{heard:?}");
    };
    assert_eq!(report.failed, 0, "{report:?}");
    let heard = serve(&mut device, Command::RawBurst { samples: 8 });
    assert!(matches!(heard[..], [_, DeviceMessage::Raw(_)]), "{heard:?}");
    device.fpga().instant = false;
    device.ask(Command::Start(RunLength::Frames(1)));
    device.frame();
    device.turns(3);
    assert_eq!(sequences(&device.heard()), [0]);
}

impl Device {
    fn status(&mut self) -> Result<nirspi_wire::Status, Vec<DeviceMessage<'static>>> {
        let heard = self.ask(Command::Status);
        match heard[..] {
            [DeviceMessage::Reply(Reply { outcome: Ok(Answer::Status(status)), .. })] => Ok(status),
            _ => Err(heard),
        }
    }
}

/// The signal meter asks the FPGA for the level of the frame that is being sent, which is a later one; between two
/// frames the level is 0, and the meter tries again at its next time.
#[test]
fn the_meter_shows_a_signal_while_frames_are_being_sent() {
    let mut device = Device::running(RunLength::Continuous);
    for is_sending in [false, true] {
        for _ in 0..6 {
            device.frame();
            if is_sending {
                device.fpga().make_frame();
            }
            device.turns(3);
            // The meter looks four times a second.
            device.after(75_000, &[]);
        }
        device.heard();
        let signal = device.status().unwrap().signal;
        assert_eq!(signal.is_some(), is_sending);
    }
}

#[derive(Debug, Clone)]
enum Step {
    Make,
    Transmit,
    Spoil(prop::sample::Index, u8),
    Cut(prop::sample::Index),
    Turn,
    Room(usize),
    Holds(bool),
    Fetch,
    Pause,
    Status,
}

proptest! {
    #[test]
    fn whatever_happens_to_the_ring_every_frame_is_counted_once(
        steps in prop::collection::vec(
            prop_oneof![
                6 => Just(Step::Make),
                5 => Just(Step::Transmit),
                1 => (any::<prop::sample::Index>(), 1..=255u8).prop_map(|(at, bits)| Step::Spoil(at, bits)),
                1 => any::<prop::sample::Index>().prop_map(Step::Cut),
                6 => Just(Step::Turn),
                1 => (0..5usize).prop_map(Step::Room),
                2 => any::<bool>().prop_map(Step::Holds),
                4 => Just(Step::Fetch),
                1 => Just(Step::Pause),
                1 => Just(Step::Status),
            ],
            1..200,
        ),
    ) {
        let mut device = Device::running(RunLength::Continuous);
        let (mut made, mut got) = (Vec::new(), Vec::new());
        for step in steps {
            match step {
                Step::Make => device.fpga().make_frame(),
                Step::Transmit => made.extend(device.bus.port().transmit(|_| {})),
                Step::Spoil(at, bits) => made.extend(device.bus.port().transmit(|packet| {
                    let at = at.index(packet.len());
                    packet[at] ^= bits;
                })),
                Step::Cut(at) => made.extend(device.bus.port().transmit(|packet| {
                    packet.truncate(at.index(packet.len()));
                })),
                Step::Turn => device.turn(),
                Step::Room(room) => device.link.room = room,
                Step::Holds(holds) => device.link.holds = holds || !device.link.loans.is_empty(),
                Step::Fetch => device.link.fetch(),
                Step::Pause => device.after(200, &[]),
                Step::Status => {
                    device.link.room = device.link.room.max(1);
                    device.after(10, &packet(9, Command::Status));
                }
            }
            got.append(&mut device.link.packets);
        }
        device.link.room = usize::MAX;
        device.link.holds = true;
        device.after(10, &packet(8, Command::Stop));
        for _ in 0..200 {
            made.extend(device.bus.port().transmit(|_| {}));
            device.turn();
            device.link.fetch();
        }
        device.after(100_001, &[]);
        device.turns(3);
        got.append(&mut device.link.packets);

        let fpga = device.fpga();
        let (frames_made, fpga_frames_lost) = (fpga.made, fpga.lost);
        let (mut whole, mut damaged) = (0, 0);
        let mut last = None;
        let mut counts = None;
        for packet in got {
            let (_, encoded) = packet.split_last().unwrap();
            let mut encoded = encoded.to_vec();
            match open::<DeviceMessage<'_>>(&mut encoded) {
                Ok(DeviceMessage::Frame(frame)) => {
                    prop_assert!(last < Some(frame.sequence), "{last:?}, then {}", frame.sequence);
                    last = Some(frame.sequence);
                    prop_assert!(made.contains(&packet), "the FPGA has sent no such packet");
                    whole += 1;
                }
                Ok(DeviceMessage::Event(event)) => counts = Some(event.kind),
                Ok(_) => {}
                // A damaged frame, or a piece of one, which the host sees by its checksum.
                Err(_) => damaged += 1,
            }
        }
        let Some(EventKind::RunEnded { run: 1, frames_made: told, frames_dropped, fpga_frames_lost: lost, fpga_frames_corrupt }) = counts
        else { panic!("{counts:?}") };
        prop_assert_eq!((told, lost), (frames_made, fpga_frames_lost));
        let Ok(nirspi_wire::Status { frames_sent, .. }) = device.status() else { panic!() };
        prop_assert_eq!(told, frames_sent + frames_dropped + lost + fpga_frames_corrupt);
        prop_assert!((whole..=whole + damaged).contains(&frames_sent));
    }
}
