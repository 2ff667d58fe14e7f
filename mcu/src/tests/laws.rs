//! Property tests: what holds whatever host, link and FPGA do.

use super::support::*;
use crate::{Inputs, Micros};
use nirspi_wire::fpga::Sums;
use nirspi_wire::packet::encode;
use nirspi_wire::register::FaultCode;
use nirspi_wire::{
    Answer, Command, Configuration, DeviceMessage, EventKind, GatewareChunk, PatternOrder,
    RebootInto, RunLength, SampleSource, State, open, version,
};
use proptest::collection;
use proptest::prelude::*;
use std::vec;
use std::vec::Vec;

/// An event during a run.
#[derive(Debug, Clone)]
enum Happening {
    Frame,
    Poll(u64),
    Room(usize),
    Damage,
    SlowTransfer(u32),
    BusDies,
    BusLives,
    Status,
}

fn happening() -> impl Strategy<Value = Happening> {
    prop_oneof![
        6 => Just(Happening::Frame),
        6 => (0u64..2_000).prop_map(Happening::Poll),
        2 => (0usize..5).prop_map(Happening::Room),
        1 => Just(Happening::Damage),
        1 => (1u32..3).prop_map(Happening::SlowTransfer),
        1 => Just(Happening::Status),
    ]
}

fn ending() -> impl Strategy<Value = Happening> {
    prop_oneof![Just(Happening::BusDies), Just(Happening::BusLives), happening()]
}

fn happen(bench: &mut Bench, happening: &Happening) {
    match *happening {
        Happening::Frame => bench.fpga.make_frame(),
        Happening::Poll(micros) => {
            bench.after(micros);
        }
        Happening::Room(packets) => bench.link.room = packets,
        Happening::Damage => {
            if let Some(frame) = &mut bench.fpga.frame {
                frame[33] ^= 0x10;
            }
        }
        Happening::SlowTransfer(polls) => bench.fpga.transfer_polls = polls,
        Happening::BusDies => bench.fpga.dead = true,
        Happening::BusLives => bench.fpga.dead = false,
        Happening::Status => {
            let _ = bench.receive(&packet(7, Command::Status));
        }
    }
}

/// Whether a packet has come undamaged.
fn opens(packet: &[u8]) -> bool {
    let mut packet = packet.to_vec();
    packet.pop();
    open::<DeviceMessage<'_>>(&mut packet).is_ok()
}

#[derive(Debug, Clone)]
enum End {
    Stop,
    Fault,
    Hello,
    Interlock,
}

proptest! {
    #[test]
    fn every_frame_made_is_sent_or_counted_and_the_run_ends_once(
        length in prop_oneof![Just(None), (1u32..40).prop_map(Some)],
        happenings in collection::vec(happening(), 0..80),
        afterwards in collection::vec(ending(), 0..10),
        end in prop_oneof![Just(End::Stop), Just(End::Fault), Just(End::Hello), Just(End::Interlock)],
    ) {
        let length = length.map_or(RunLength::Continuous, RunLength::Frames);
        let mut bench = Bench::running(length);
        for happening in &happenings {
            happen(&mut bench, happening);
        }
        match end {
            End::Stop => { let _ = bench.receive(&packet(8, Command::Stop)); }
            End::Hello => {
                let _ = bench.receive(&packet(8, Command::Hello { protocol: version::CURRENT }));
            }
            End::Fault => bench.fpga.trip(FaultCode::Duty),
            End::Interlock => bench.inputs.interlock_closed = false,
        }
        for happening in &afterwards {
            happen(&mut bench, happening);
        }
        // With a working bus, the run ends even if a stop was refused or had no room before.
        bench.fpga.dead = false;
        bench.inputs.interlock_closed = false;
        bench.link.room = usize::MAX;
        for _ in 0..20 {
            bench.after(50_000);
        }
        let made = bench.fpga.made;
        // Whatever the wires have made of a packet goes to the host, which sees the damage.
        let all = bench.link.packets.len();
        bench.link.packets.retain(|packet| opens(packet));
        let damaged = (all - bench.link.packets.len()) as u32;
        let heard = bench.heard();
        let sent = frames(&heard);
        prop_assert!(sent.windows(2).all(|pair| pair[0].sequence < pair[1].sequence));
        for frame in &sent {
            let sums = bench.fpga.sums(frame.sequence);
            prop_assert!(frame.samples.iter().eq(sums.iter().map(Sums::difference)));
        }
        let ends: Vec<usize> = heard.iter().enumerate().filter_map(|(place, message)| {
            matches!(message, DeviceMessage::Event(e) if matches!(e.kind, EventKind::RunEnded { .. }))
                .then_some(place)
        }).collect();
        prop_assert_eq!(ends.len(), 1, "{:?}", heard);
        prop_assert!(!heard[ends[0]..].iter().any(|m| matches!(m, DeviceMessage::Frame(_))));
        let DeviceMessage::Event(event) = heard[ends[0]] else { unreachable!() };
        let EventKind::RunEnded {
            frames_made, frames_dropped, fpga_frames_lost, fpga_frames_corrupt, ..
        } = event.kind else { unreachable!() };
        let accounted =
            sent.len() as u32 + damaged + frames_dropped + fpga_frames_lost + fpga_frames_corrupt;
        prop_assert_eq!(accounted, frames_made);
        // A bus that died during the transfer of a frame may have hidden the last frames from the
        // firmware.
        if !afterwards.iter().any(|happening| matches!(happening, Happening::BusDies)) {
            prop_assert_eq!(frames_made, made);
        }
    }
}

/// An action of the host, a user or the environment.
#[derive(Debug, Clone)]
enum Step {
    Command(Order),
    Bytes(Vec<u8>),
    /// An intact packet with any content.
    Sealed([u8; 12]),
    Poll(u64),
    Frame,
    Room(usize),
    Sensors {
        closed: bool,
        reading: Option<i16>,
    },
    Fpga(u8),
    Depth(u8),
    Close,
}

/// A command with owned data.
#[derive(Debug, Clone)]
enum Order {
    Hello(u16),
    Configure { patterns: u16, dwell: u16, blanked: u16, sweeps: u32, pairs: [bool; 2] },
    Start(Option<u32>),
    Stop,
    Status,
    SelfTest,
    Read(u16),
    Load { offset: u32, total: u32, data: Vec<u8> },
    Raw(u16),
    Reboot,
}

fn order() -> impl Strategy<Value = Order> {
    prop_oneof![
        2 => (1u16..3).prop_map(Order::Hello),
        4 => (0u16..1100, 0u16..12, 0u16..4, 0u32..3, any::<[bool; 2]>()).prop_map(
            |(patterns, dwell, blanked, sweeps, pairs)| Order::Configure {
                patterns, dwell, blanked, sweeps, pairs,
            }
        ),
        4 => proptest::option::of(0u32..5).prop_map(Order::Start),
        2 => Just(Order::Stop),
        1 => Just(Order::Status),
        1 => Just(Order::SelfTest),
        1 => any::<u16>().prop_map(Order::Read),
        1 => (0u32..4, 0u32..9, collection::vec(any::<u8>(), 0..8)).prop_map(
            |(offset, total, data)| Order::Load { offset, total, data }
        ),
        1 => (0u16..5000).prop_map(Order::Raw),
        1 => Just(Order::Reboot),
    ]
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        8 => order().prop_map(Step::Command),
        1 => collection::vec(any::<u8>(), 0..40).prop_map(Step::Bytes),
        1 => any::<[u8; 12]>().prop_map(Step::Sealed),
        6 => prop_oneof![0u64..2_000, Just(300_000), Just(3_000_000), Just(1 << 50)]
            .prop_map(Step::Poll),
        4 => Just(Step::Frame),
        1 => (0usize..30).prop_map(Step::Room),
        1 => (any::<bool>(), proptest::option::of(any::<i16>()))
            .prop_map(|(closed, reading)| Step::Sensors { closed, reading }),
        2 => Just(Step::Sensors { closed: true, reading: Some(2_500) }),
        1 => (0u8..8).prop_map(Step::Fpga),
        1 => any::<u8>().prop_map(Step::Depth),
        1 => Just(Step::Close),
    ]
}

fn bytes_of(id: u16, order: &Order) -> Vec<u8> {
    let command = match *order {
        Order::Hello(protocol) => Command::Hello { protocol },
        Order::Configure { patterns, dwell, blanked, sweeps, pairs } => {
            let [differential, alternating] = pairs;
            Command::Configure(Configuration {
                order: PatternOrder::Sequency,
                patterns,
                differential,
                alternating,
                clocks_per_pattern: dwell,
                blanked,
                adc_latency: 0,
                sweeps,
                source: SampleSource::Detector,
                over_range_trip: 0,
            })
        }
        Order::Start(length) => {
            Command::Start(length.map_or(RunLength::Continuous, RunLength::Frames))
        }
        Order::Stop => Command::Stop,
        Order::Status => Command::Status,
        Order::SelfTest => Command::SelfTest,
        Order::Read(address) => Command::ReadRegister { address },
        Order::Load { offset, total, ref data } => {
            Command::LoadGateware(GatewareChunk { offset, total, crc: 0, data })
        }
        Order::Raw(samples) => Command::RawBurst { samples },
        Order::Reboot => Command::Reboot(RebootInto::Application),
    };
    packet(id, command)
}

/// A host that offers the bytes that were not taken again.
#[derive(Default)]
struct Host {
    unsent: Vec<u8>,
    next_id: u16,
    asked: Vec<u16>,
}

impl Host {
    fn push(&mut self, bench: &mut Bench) {
        let taken = bench.receive(&self.unsent);
        self.unsent.drain(..taken);
    }

    fn close(&mut self) {
        self.unsent.clear();
        self.asked.clear();
    }
}

fn take(bench: &mut Bench, host: &mut Host, step: &Step) {
    match step {
        Step::Command(order) => {
            host.unsent.extend(bytes_of(host.next_id, order));
            host.asked.push(host.next_id);
            host.next_id = host.next_id.wrapping_add(1);
            host.push(bench);
        }
        Step::Bytes(bytes) => {
            // The delimiter keeps these bytes apart from the next command.
            host.unsent.extend(bytes);
            host.unsent.push(0);
            host.push(bench);
        }
        Step::Sealed(content) => {
            let mut room = [0; 64];
            host.unsent.extend(encode(content, &mut room).unwrap());
            host.push(bench);
        }
        Step::Poll(micros) => {
            bench.now = Micros(bench.now.0.saturating_add(*micros));
            bench.poll();
            host.push(bench);
        }
        Step::Frame => bench.fpga.make_frame(),
        Step::Room(packets) => bench.link.room = *packets,
        &Step::Sensors { closed, reading } => {
            bench.inputs = Inputs { interlock_closed: closed, temperature_centi_celsius: reading };
            bench.poll();
        }
        Step::Fpga(what) => match what {
            0 => bench.fpga.reset(),
            1 => bench.fpga.trip(FaultCode::OverRange),
            2 => bench.fpga.interlock_closed = false,
            3 => bench.fpga.deaf = !bench.fpga.deaf,
            4 => bench.fpga.transfer_polls = 2,
            5 => bench.fpga.instant = !bench.fpga.instant,
            6 => bench.fpga.stuck_ones = 0x10,
            _ => {
                bench.fpga.interlock_closed = true;
                bench.fpga.stuck_ones = 0;
                bench.fpga.deaf = false;
            }
        },
        Step::Depth(side) => {
            let map = std::vec![7; usize::from(*side) * usize::from(*side)];
            bench.depth(*side, &map);
        }
        Step::Close => {
            bench.close_link();
            host.close();
            bench.link.packets.clear();
        }
    }
}

proptest! {
    #[test]
    fn nothing_panics_and_light_means_running(steps in collection::vec(step(), 0..150)) {
        let (mut bench, mut host) = (Bench::open(), Host::default());
        for step in &steps {
            take(&mut bench, &mut host, step);
            if !bench.fpga.deaf && bench.fpga.leds_on() {
                // The next poll repeats a stop that the bus has lost.
                bench.poll();
            }
            if !bench.fpga.deaf && bench.fpga.leds_on() {
                prop_assert_eq!(bench.camera.state(), State::Running, "after {:?}", step);
            }
        }
        for packet in bench.link.packets {
            message(&packet);
        }
    }

    #[test]
    fn each_command_is_answered_once_and_in_order(
        steps in collection::vec(step().prop_filter("no noise", |step| !matches!(
            step,
            Step::Sealed(_) | Step::Bytes(_) | Step::Close | Step::Command(Order::Reboot)
        )), 0..150),
    ) {
        let (mut bench, mut host) = (Bench::open(), Host::default());
        for step in &steps {
            take(&mut bench, &mut host, step);
        }
        bench.link.room = usize::MAX;
        for _ in 0..host.asked.len() + 10 {
            take(&mut bench, &mut host, &Step::Poll(100_001));
        }
        let answered: Vec<u16> = bench.heard().iter().filter_map(|message| match message {
            DeviceMessage::Reply(reply) => Some(reply.id),
            _ => None,
        }).collect();
        prop_assert_eq!(answered, host.asked);
    }

    #[test]
    fn any_chunking_of_the_bytes_gives_the_same_output(
        orders in collection::vec(order(), 1..20),
        cuts in collection::vec(1usize..20, 1..10),
    ) {
        let stream: Vec<u8> =
            (0..).zip(&orders).flat_map(|(id, order)| bytes_of(id, order)).collect();
        let talk = |pieces: &mut dyn Iterator<Item = usize>| {
            let (mut bench, mut rest) = (Bench::open(), &stream[..]);
            bench.fpga.instant = true;
            let mut idle = 0;
            while !rest.is_empty() && idle < 3 {
                let length = pieces.next().unwrap_or(usize::MAX).min(rest.len());
                let taken = bench.receive(&rest[..length]);
                rest = &rest[taken..];
                // The bench polls only where the camera asks for a poll, so both cameras are polled
                // at the same points.
                if taken < length {
                    bench.poll();
                }
                idle = if taken == 0 { idle + 1 } else { 0 };
            }
            for _ in 0..10 {
                bench.poll();
            }
            bench.link.packets
        };
        prop_assert_eq!(talk(&mut cuts.iter().copied().cycle()), talk(&mut core::iter::empty()));
    }
}

#[test]
fn two_cameras_know_nothing_of_each_other() {
    let mut one = Bench::running(RunLength::Continuous);
    let mut other = Bench::configured();
    one.inputs.interlock_closed = false;
    one.frame();
    assert_eq!(one.camera.state(), State::Fault);
    assert_eq!(other.ask(Command::Start(RunLength::Frames(1))), Ok(Answer::Done));
    other.frame();
    assert_eq!(frames(&other.heard()).len(), 1);
    assert_eq!(other.camera.state(), State::Configured);
}

#[test]
fn a_camera_is_as_large_as_its_page_says() {
    let bytes = size_of::<crate::Camera>();
    assert!((7_000..8_500).contains(&bytes), "{bytes}");
}
