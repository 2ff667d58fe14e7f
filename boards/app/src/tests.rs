//! Tests of the loop and its link, polled by hand: no executor, and a clock that a test moves.

use crate::link::{HostIn, HostOut, Link, Packet};
use crate::{Board, DepthMailbox, Device, FpgaPort, board_info, run};
use core::cell::Cell;
use core::future::Future;
use core::pin::Pin;
use core::sync::atomic::{AtomicU64, Ordering};
use core::task::{Context, Waker};
use embassy_futures::poll_once;
use nirspi_mcu::{BusError, HostPort, Inputs, Limits, NoLoader};
use nirspi_wire::fpga::{Header, MAX_FRAME_BYTES, Sums};
use nirspi_wire::packet::{MAX_DEVICE_PACKET, MAX_HOST_PACKET};
use nirspi_wire::register::{IDENTITY, Register, control, status};
use nirspi_wire::{
    Answer, Command, Configuration, Deframed, Deframer, DeviceMessage, FrameFlags, PatternOrder,
    RebootInto, Reply, Request, RunLength, SampleSource, encode, open, version,
};
use std::boxed::Box;
use std::rc::Rc;
use std::vec::Vec;

/// A clock that advances ten microseconds at every read.
struct Clock(AtomicU64);

impl embassy_time_driver::Driver for Clock {
    fn now(&self) -> u64 {
        self.0.fetch_add(10, Ordering::Relaxed)
    }

    fn schedule_wake(&self, _at: u64, _waker: &Waker) {}
}

embassy_time_driver::time_driver_impl!(static CLOCK: Clock = Clock(AtomicU64::new(0)));

const TRANSFER: usize = 64;
const PATTERNS: u16 = 2;

/// The board's pins, as a test reads and sets them.
#[derive(Default)]
struct Pins {
    leds_enabled: Cell<bool>,
    running: Cell<bool>,
    sequence: Cell<u32>,
    fed: Cell<u32>,
    /// Number of polls that a transfer takes.
    transfer_polls: Cell<u32>,
}

struct Fake(Rc<Pins>);

impl Board for Fake {
    fn inputs(&mut self) -> Inputs {
        Inputs { interlock_closed: true, temperature_centi_celsius: Some(2500) }
    }

    fn enable_leds(&mut self, enabled: bool) {
        self.0.leds_enabled.set(enabled);
    }

    fn feed_watchdog(&mut self) {
        self.0.fed.set(self.0.fed.get() + 1);
    }

    fn restart(&mut self, _into: RebootInto) -> ! {
        panic!("restarted")
    }
}

/// A fake FPGA: registers in memory, and a frame that is ready during every run.
struct Fpga {
    pins: Rc<Pins>,
    registers: [u32; 32],
}

impl HostPort for Fpga {
    fn write(&mut self, address: u16, value: u32) -> Result<(), BusError> {
        if address == Register::Control.address() {
            let bits = |bits: u32| value & bits != 0;
            self.pins
                .running
                .set(bits(control::START) || self.pins.running.get() && !bits(control::STOP));
            self.pins.sequence.set(self.pins.sequence.get() + u32::from(bits(control::RELEASE)));
        } else {
            self.registers[usize::from(address)] = value;
        }
        Ok(())
    }

    fn read(&mut self, address: u16) -> Result<u32, BusError> {
        let running = if self.pins.running.get() { status::RUNNING | status::LEDS_ON } else { 0 };
        Ok(match Register::at(address) {
            Some(Register::Identity) => IDENTITY,
            Some(Register::Status) => status::INTERLOCK_CLOSED | running,
            Some(Register::FramesMade) => self.pins.sequence.get(),
            _ => self.registers[usize::from(address)],
        })
    }

    fn frame_ready(&mut self) -> bool {
        self.pins.running.get()
    }

    fn raw_ready(&mut self) -> bool {
        false
    }
}

impl FpgaPort for Fpga {
    async fn read_bytes(&mut self, _opcode: u8, into: &mut [u8]) -> Result<(), BusError> {
        for _ in 0..self.pins.transfer_polls.get() {
            embassy_futures::yield_now().await;
        }
        let header = Header {
            patterns: PATTERNS,
            flags: FrameFlags::DIFFERENTIAL,
            sequence: self.pins.sequence.get(),
            sweeps: 1,
            over_range: 0,
            lost: 0,
            clock: 0,
        };
        let mut bytes = header.to_bytes().to_vec();
        for k in 0..u64::from(PATTERNS) {
            bytes.extend(Sums { positive: 100 + k, negative: 7 }.to_bytes());
        }
        bytes.extend(nirspi_wire::crc32(&bytes).to_le_bytes());
        into.copy_from_slice(&bytes);
        Ok(())
    }

    async fn ready(&mut self) {
        if !self.frame_ready() {
            core::future::pending::<()>().await;
        }
    }
}

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
            board: Fake(Rc::clone(&pins)),
            port: Fpga { pins: Rc::clone(&pins), registers: [0; 32] },
            frame: Box::leak(Box::new([0; MAX_FRAME_BYTES])),
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

fn packet(id: u16, command: Command<'_>) -> Vec<u8> {
    let mut room = [0; MAX_HOST_PACKET + 1];
    encode(&Request { id, command }, &mut room).unwrap().to_vec()
}

fn hello(id: u16) -> Vec<u8> {
    packet(id, Command::Hello { protocol: version::CURRENT })
}

const TWO_PATTERNS: Configuration<'static> = Configuration {
    order: PatternOrder::Natural,
    patterns: PATTERNS,
    differential: true,
    clocks_per_pattern: 5,
    blanked: 2,
    adc_latency: 3,
    sweeps: 1,
    source: SampleSource::Detector,
    over_range_trip: 0,
};

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
    bench.send(&packet(2, Command::Configure(TWO_PATTERNS)));
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
        (2, Command::Configure(TWO_PATTERNS)),
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
    for (id, command) in
        [(1, Command::Hello { protocol: version::CURRENT }), (2, Command::Configure(TWO_PATTERNS))]
    {
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
