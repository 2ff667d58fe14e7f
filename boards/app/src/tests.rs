//! Tests of the loop and its link, polled by hand: no executor, and a clock that a test moves.

use crate::bench::{FakeBoard, FakeFpga, FakeLoader, Pins, configuration, packet};
use crate::link::{CameraEnd, HostIn, HostOut, Link, Packet};
use crate::{DepthMailbox, Device, board_info, crash, run};
use core::future::Future;
use core::pin::Pin;
use core::task::{Context, Waker};
use embassy_futures::poll_once;
use nirspi_mcu::{Crash, Lamps, Limits, PacketSink};
use nirspi_wire::fpga::MAX_FRAME_BYTES;
use nirspi_wire::packet::{MAX_DEVICE_PACKET, MAX_HOST_PACKET};
use nirspi_wire::{
    Answer, Command, Deframed, Deframer, DeviceMessage, Reply, RunLength, open, version,
};
use std::borrow::ToOwned;
use std::boxed::Box;
use std::rc::Rc;
use std::vec::Vec;

const TRANSFER: usize = 64;
const PATTERNS: u16 = 2;
/// So many bytes go out where they lie.
const LONGEST: usize = 4 * TRANSFER;

/// A running board, and the task that serves its host.
struct Bench {
    camera: Pin<Box<dyn Future<Output = ()>>>,
    from_host: HostIn<'static>,
    to_host: HostOut<'static, TRANSFER>,
    pins: Rc<Pins>,
    deframer: Box<Deframer<MAX_DEVICE_PACKET>>,
}

impl Bench {
    fn new(places: usize) -> Self {
        let pins: Rc<Pins> = Rc::default();
        let link = Box::leak(Box::new(Link::new(std::vec![Packet::EMPTY; places].leak())));
        let (camera_end, from_host, to_host) = link.split();
        let device = Device {
            board: FakeBoard(Rc::clone(&pins)),
            port: FakeFpga::new(Rc::clone(&pins)),
            frame: Box::leak(Box::new([0; MAX_FRAME_BYTES])),
            loader: FakeLoader(Rc::clone(&pins)),
            info: board_info("bench", "0001"),
            limits: Limits::SIMULATED,
            crash: None,
            restarts: 0,
        };
        let depth: &'static DepthMailbox = Box::leak(Box::new(DepthMailbox::new()));
        let camera = Box::pin(async move { run(device, camera_end, depth).await });
        Self { camera, from_host, to_host, pins, deframer: Box::default() }
    }

    /// Runs the camera's loop for some turns.
    fn turn(&mut self) {
        for _ in 0..20 {
            let polled = self.camera.as_mut().poll(&mut Context::from_waker(Waker::noop()));
            assert!(polled.is_pending());
        }
    }

    /// Sends bytes from the host; all of them must find room at once.
    fn send(&mut self, bytes: &[u8]) {
        assert!(poll_once(self.from_host.received(bytes)).is_ready());
    }

    /// Takes the transfers that wait.
    fn transfers(&mut self) -> Vec<Vec<u8>> {
        let mut transfers = Vec::new();
        while let core::task::Poll::Ready(transfer) = poll_once(self.to_host.transfer()) {
            transfers.push(transfer.to_vec());
        }
        transfers
    }

    /// The kind of each message that waits.
    fn heard(&mut self) -> Vec<Heard> {
        let bytes = self.transfers().concat();
        let mut rest = &bytes[..];
        let mut heard = Vec::new();
        while let Some(found) = self.deframer.next(&mut rest) {
            let Deframed::Packet(packet) = found else { panic!("{found:?}") };
            heard.push(match open::<DeviceMessage<'_>>(packet).unwrap() {
                DeviceMessage::Reply(Reply { id, outcome: Ok(Answer::Hello(_)) }) => {
                    Heard::Hello(id)
                }
                DeviceMessage::Reply(Reply { id, outcome: Ok(_) }) => Heard::Done(id),
                DeviceMessage::Frame(frame) => Heard::Frame(frame.sequence),
                other => Heard::Other(std::format!("{other:?}")),
            });
        }
        heard
    }
}

#[derive(Debug, PartialEq)]
enum Heard {
    Hello(u16),
    Done(u16),
    Frame(u32),
    Other(std::string::String),
}

fn hello(id: u16) -> Vec<u8> {
    packet(id, Command::Hello { protocol: version::CURRENT })
}

#[test]
fn a_greeting_is_answered_and_the_watchdog_fed() {
    let mut bench = Bench::new(4);
    bench.turn();
    let fed = bench.pins.fed.get();
    bench.send(&hello(7));
    bench.turn();
    assert_eq!(bench.heard(), [Heard::Hello(7)]);
    assert!(bench.pins.fed.get() > fed);
}

#[test]
fn leds_are_let_on_from_the_configuration_until_the_host_is_gone() {
    let mut bench = Bench::new(8);
    bench.send(&hello(1));
    bench.turn();
    assert!(!bench.pins.leds_enabled.get());
    bench.send(&packet(2, Command::Configure(configuration(PATTERNS))));
    bench.turn();
    assert!(bench.pins.leds_enabled.get(), "before anything is lit");
    bench.send(&packet(3, Command::Start(RunLength::Continuous)));
    bench.turn();
    assert!(bench.pins.running.get());
    assert_eq!(bench.pins.lamps.get(), Lamps { ready: true, light: true, fault: false });

    // The first host leaves half a command behind.
    bench.send(&hello(4)[..5]);
    {
        let mut closed = core::pin::pin!(bench.from_host.closed());
        let mut context = Context::from_waker(Waker::noop());
        assert!(closed.as_mut().poll(&mut context).is_pending(), "the camera is asked first");
        for _ in 0..20 {
            let _ = bench.camera.as_mut().poll(&mut context);
        }
        assert!(closed.as_mut().poll(&mut context).is_ready());
    }
    assert!(!bench.pins.leds_enabled.get() && !bench.pins.running.get());
    assert!(!bench.pins.lamps.get().light);
    bench.to_host.discard();
    bench.send(&hello(5));
    bench.turn();
    assert_eq!(bench.heard(), [Heard::Hello(5)], "nothing of the session before");
}

#[test]
fn leds_are_off_and_the_watchdog_is_fed_while_the_fpga_is_loaded() {
    let mut bench = Bench::new(8);
    bench.send(&hello(1));
    bench.send(&packet(2, Command::Configure(configuration(PATTERNS))));
    bench.turn();
    assert!(bench.pins.leds_enabled.get());
    bench.heard();

    bench.pins.loading.set(true);
    let fed = bench.pins.fed.get();
    bench.send(&packet(3, Command::Status));
    bench.turn();
    assert!(!bench.pins.leds_enabled.get(), "the pins of an FPGA without gateware may float");
    assert!(bench.pins.fed.get() > fed);
    assert_eq!(bench.heard(), [], "the camera is not polled");
    bench.pins.loading.set(false);
    bench.turn();
    assert_eq!(bench.heard(), [Heard::Done(3)]);
}

/// The first crash is the cause, and those that follow from it are not.
#[test]
fn the_first_of_two_crashes_is_kept_until_it_is_taken() {
    let text = |crash: Option<Crash>| crash.map(|crash| crash.text.as_str().to_owned());
    assert_eq!(crash::take(), None);
    crash::store(format_args!("the stack ran into its guard"));
    crash::store(format_args!("a fault in the logger"));
    assert_eq!(text(crash::take()).as_deref(), Some("the stack ran into its guard"));
    assert_eq!(crash::take(), None);
    crash::store(format_args!("another day"));
    assert_eq!(text(crash::take()).as_deref(), Some("another day"));
}

#[test]
fn frames_come_in_order_and_a_full_link_drops_whole_ones() {
    let mut bench = Bench::new(4);
    for (id, command) in [
        (1, Command::Hello { protocol: version::CURRENT }),
        (2, Command::Configure(configuration(PATTERNS))),
        (3, Command::Start(RunLength::Continuous)),
    ] {
        bench.send(&packet(id, command));
        bench.turn();
        bench.heard();
    }
    let next = bench.pins.sequence.get();
    for _ in 0..10 {
        bench.turn();
    }
    // The host has taken no packet: four packets wait, and the other frames were dropped.
    let heard = bench.heard();
    let expected: Vec<Heard> = (0..4).map(|k| Heard::Frame(next + k)).collect();
    assert_eq!(heard, expected);
    assert!(bench.pins.sequence.get() > next + 10);
}

#[test]
fn a_long_transfer_delays_the_answer_and_loses_nothing() {
    let mut bench = Bench::new(64);
    for (id, command) in [
        (1, Command::Hello { protocol: version::CURRENT }),
        (2, Command::Configure(configuration(PATTERNS))),
    ] {
        bench.send(&packet(id, command));
        bench.turn();
    }
    bench.heard();
    bench.pins.transfer_polls.set(30);
    bench.send(&packet(3, Command::Start(RunLength::Continuous)));
    bench.turn();
    bench.send(&packet(4, Command::Status));
    for _ in 0..10 {
        bench.turn();
    }
    let heard = bench.heard();
    assert!(heard.contains(&Heard::Done(4)));
    let frames: Vec<&Heard> = heard.iter().filter(|h| matches!(h, Heard::Frame(_))).collect();
    assert!(frames.len() > 2, "{heard:?}");
    assert!(frames.iter().zip(0..).all(|(frame, k)| **frame == Heard::Frame(k)), "{heard:?}");
}

#[test]
fn transfers_are_full_but_for_the_last() {
    let mut bench = Bench::new(8);
    for id in 0..4 {
        bench.send(&hello(id));
        bench.turn();
    }
    let transfers = bench.transfers();
    let (last, full) = transfers.split_last().unwrap();
    assert!(full.len() > 1 && full.iter().all(|transfer| transfer.len() == TRANSFER));
    assert!(last.len() < TRANSFER);
}

#[test]
fn bytes_that_find_no_room_wait_and_are_not_lost() {
    let mut bench = Bench::new(64);
    let many: Vec<u8> = (0..400).flat_map(hello).collect();
    let mut heard = Vec::new();
    {
        // The bytes are longer than the pipe: the pipe takes what fits, and the rest as the camera
        // takes commands.
        assert!(many.len() > MAX_HOST_PACKET);
        let Bench { camera, from_host, to_host, .. } = &mut bench;
        let mut sending = core::pin::pin!(from_host.received(&many));
        let mut context = Context::from_waker(Waker::noop());
        assert!(sending.as_mut().poll(&mut context).is_pending());
        for _ in 0..20 {
            let _ = camera.as_mut().poll(&mut context);
        }
        while sending.as_mut().poll(&mut context).is_pending() {
            let _ = camera.as_mut().poll(&mut context);
            // The host reads.
            let mut transfer = core::pin::pin!(to_host.transfer());
            if let core::task::Poll::Ready(transfer) = transfer.as_mut().poll(&mut context) {
                heard.extend_from_slice(transfer);
            }
        }
    }
    for _ in 0..50 {
        bench.turn();
        heard.extend(bench.transfers().concat());
    }
    let answers = heard.iter().filter(|&&byte| byte == 0).count();
    assert_eq!(answers, 400);
}

/// A link without a camera: packets of these lengths are put in, with bytes before and after that are not to go out.
/// Returns what went in and the transfers that came out.
fn carried(lengths: &[usize], places: usize) -> (Vec<u8>, Vec<Vec<u8>>) {
    let mut link = Link::new(std::vec![Packet::EMPTY; places].leak());
    let (mut camera, _, mut to_host) = link.split::<TRANSFER>();
    let (mut sent, mut transfers) = (Vec::new(), Vec::new());
    let mut take = |transfers: &mut Vec<Vec<u8>>| {
        while let core::task::Poll::Ready(transfer) = poll_once(to_host.transfer()) {
            transfers.push(transfer.to_vec());
        }
    };
    for (&length, number) in lengths.iter().zip(0usize..) {
        let (_, sink) = camera.both();
        if sink.claim(1).is_none() {
            take(&mut transfers);
        }
        let before = number % 7;
        let room = sink.claim(before + length + 3).expect("a place is free");
        room.fill(0xEE);
        let bytes = (0..length).map(|at| (number * 31 + at * 7) as u8);
        room[before..before + length].iter_mut().zip(bytes).for_each(|(place, byte)| *place = byte);
        sent.extend_from_slice(&room[before..before + length]);
        sink.commit(before..before + length);
    }
    take(&mut transfers);
    (sent, transfers)
}

#[test]
fn packets_of_any_length_go_out_whole_and_in_order_and_the_end_is_told() {
    let mut seed = 1usize;
    for places in [1, 2, 5] {
        for _ in 0..200 {
            let lengths: Vec<usize> = (0..12)
                .map(|_| {
                    seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(99);
                    1 + (seed >> 33) % [10, 70, 300, 1000][(seed >> 20) % 4]
                })
                .collect();
            let (sent, transfers) = carried(&lengths, places);
            assert_eq!(transfers.concat(), sent, "{lengths:?}");
            assert!(transfers.iter().all(|transfer| transfer.len() <= TRANSFER));
            assert!(transfers.last().unwrap().len() < TRANSFER, "the reader is told the end");
        }
    }
}

#[test]
fn a_long_packet_fills_transfers_of_its_own_and_short_ones_share() {
    let lengths = |lengths: &[usize]| {
        let (_, transfers) = carried(lengths, 8);
        transfers.iter().map(Vec::len).collect::<Vec<_>>()
    };
    // 10 bytes that wait go ahead of a packet of four transfers.
    assert_eq!(lengths(&[10, 4 * TRANSFER + 5]), [10, 64, 64, 64, 64, 5]);
    assert_eq!(lengths(&[4 * TRANSFER, 4 * TRANSFER]), [64, 64, 64, 64, 64, 64, 64, 64, 0]);
    // Shorter ones fill up what is begun.
    assert_eq!(lengths(&[10, 2 * TRANSFER, 30]), [64, 64, 40]);
}

/// A host may go in the middle of a packet. The next one must get its own packets from their first byte on.
#[test]
fn a_host_that_goes_in_the_middle_of_a_packet_leaves_nothing_for_the_next() {
    let next: Vec<u8> = (0..2 * LONGEST).map(|at| (at * 13) as u8).collect();
    for before in [10, TRANSFER, TRANSFER + 10, 3 * TRANSFER, LONGEST, LONGEST + 10] {
        for taken in 0..=before / TRANSFER + 1 {
            for length in [7, TRANSFER, TRANSFER + 1, 2 * TRANSFER + 7, next.len()] {
                let mut link = Link::new(std::vec![Packet::EMPTY; 4].leak());
                let (mut camera, _, mut to_host) = link.split::<TRANSFER>();
                let put = |camera: &mut CameraEnd<'_>, bytes: &[u8]| {
                    let (_, sink) = camera.both();
                    sink.claim(bytes.len()).expect("a place is free").copy_from_slice(bytes);
                    sink.commit(0..bytes.len());
                };
                put(&mut camera, &std::vec![0xEE; before]);
                put(&mut camera, &[0xDD; 20]);
                for _ in 0..taken {
                    let _ = poll_once(to_host.transfer());
                }
                to_host.discard();
                assert!(poll_once(to_host.transfer()).is_pending(), "not even an empty transfer");
                put(&mut camera, &next[..length]);
                let mut got = Vec::new();
                while let core::task::Poll::Ready(transfer) = poll_once(to_host.transfer()) {
                    got.extend_from_slice(transfer);
                }
                assert_eq!(got, next[..length], "{taken} transfers of {before} bytes were taken");
            }
        }
    }
}

/// Packets of the firmware begin at 0, those of the FPGA anywhere, with bytes of the FPGA before them.
#[test]
fn a_packet_goes_out_whole_from_where_dma_can_reach_it() {
    const USB_PACKET: usize = 64;
    let link = Box::leak(Box::new(Link::new(std::vec![Packet::EMPTY; 4].leak())));
    let (mut camera, _, mut to_host) = link.split::<TRANSFER>();
    for (start, length, follows) in (0..9).flat_map(|start| {
        let lengths = [1, 63, 64, 65, 124, 125, 126, 127, 128, 4132];
        lengths.into_iter().flat_map(move |length| [(start, length, false), (start, length, true)])
    }) {
        let mut commit = |length: usize| {
            let (_, sink) = camera.both();
            let room = sink.claim(start + length).expect("room");
            room[..start].fill(0xEE);
            room[start..].fill(0x11);
            sink.commit(start..start + length);
        };
        commit(length);
        if follows {
            commit(5);
        }
        for length in [length, 5].into_iter().take(1 + usize::from(follows)) {
            let core::task::Poll::Ready(bytes) = poll_once(to_host.packet()) else {
                panic!("bytes")
            };
            assert_eq!(bytes.as_ptr().addr() % 4, 0, "from {start}, {length} bytes");
            assert_eq!(bytes, [std::vec![0; start % 4], std::vec![0x11; length]].concat());
        }
        // A read of the host ends with a USB packet that is not full.
        let last = start % 4 + if follows { 5 } else { length };
        if last.is_multiple_of(USB_PACKET) {
            let core::task::Poll::Ready(bytes) = poll_once(to_host.packet()) else {
                panic!("an end")
            };
            assert!(bytes.is_empty());
        }
        assert!(poll_once(to_host.packet()).is_pending(), "from {start}, {length} bytes");
    }
}
