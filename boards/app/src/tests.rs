//! Tests of the loop and its link, polled by hand: no executor, and a clock that a test moves.

use crate::bench::{FakeBoard, FakeFpga, Pins, configuration, packet};
use crate::link::{HostIn, HostOut, Link, Packet};
use crate::{DepthMailbox, Device, board_info, run};
use core::future::Future;
use core::pin::Pin;
use core::task::{Context, Waker};
use embassy_futures::poll_once;
use nirspi_mcu::{Limits, NoLoader};
use nirspi_wire::fpga::MAX_FRAME_BYTES;
use nirspi_wire::packet::{MAX_DEVICE_PACKET, MAX_HOST_PACKET};
use nirspi_wire::{
    Answer, Command, Deframed, Deframer, DeviceMessage, Reply, RunLength, open, version,
};
use std::boxed::Box;
use std::rc::Rc;
use std::vec::Vec;

const TRANSFER: usize = 64;
const PATTERNS: u16 = 2;

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
            spare: Some(Box::leak(Box::new([0; MAX_FRAME_BYTES]))),
            loader: NoLoader,
            info: board_info("bench", "0001"),
            limits: Limits::default(),
            crash: None,
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
    bench.to_host.discard();
    bench.send(&hello(5));
    bench.turn();
    assert_eq!(bench.heard(), [Heard::Hello(5)], "nothing of the session before");
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
    // The FPGA has its buffer back before the frame is packed.
    let kept = next - 1;
    let expected: Vec<Heard> = (0..4).map(|k| Heard::Frame(kept + k)).collect();
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
