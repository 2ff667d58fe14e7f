//! The whole firmware as ARM machine code, on an emulated Cortex-M33: host, wire protocol, executor, drivers, firmware
//! logic, and behind the board's second UART the gateware's golden model, or its RTL.
//!
//! The one law: the virtual camera in this process gets the same scene and the same commands, and gives the same
//! frames, bit for bit. Device times differ: the two have different clocks.
#![allow(clippy::unwrap_used, reason = "a failed unwrap in a helper fails its test")]

mod emulated;
mod firmware;
mod simulator;

use emulated::Emulated;
use nirspi::capture::{Capture, CaptureOptions, Ended, capture};
use nirspi::link::{Link, Received};
use nirspi::session::Session;
use nirspi::setup::MeasurementSetup;
use nirspi::virtual_camera::{MemoryLink, VirtualOptics};
use nirspi_optics::Scene;
use nirspi_recon::{Order, Side, metrics, reconstruct};
use nirspi_tests::tamper::{Fate, Tampered};
use nirspi_wire::packet::MAX_DEVICE_PACKET;
use nirspi_wire::{Deframed, Deframer, DeviceMessage, FrameFlags, open};
use std::io;
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex};
use std::time::Duration;

const PX: usize = 64;
const SEED: u64 = 7;

/// A bar across rough ground.
fn scene() -> Scene {
    let reflectance = (0..PX * PX).map(|p| {
        let (r, c) = (p / PX, p % PX);
        let rough = (r / 2 * 29 + c / 2 * 71 + r * c * 5) % 89;
        0.003 * rough as f32 + if (r + 2 * c) % 64 < 16 { 0.6 } else { 0.1 }
    });
    Scene::new(reflectance.collect(), PX, 48.0).unwrap()
}

/// With all its noise, settling and latency.
fn optics() -> VirtualOptics {
    VirtualOptics::new(scene(), 300.0).unwrap()
}

/// A frame, but for its time.
#[derive(Debug, Clone, PartialEq)]
struct Shot {
    run: u16,
    sequence: u32,
    sweeps: u32,
    flags: FrameFlags,
    samples: Vec<i64>,
}

/// A link that keeps what came from the camera.
struct Tapped {
    inner: Box<dyn Link>,
    came: Arc<Mutex<Vec<u8>>>,
}

impl Link for Tapped {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.inner.send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<Received> {
        let received = self.inner.receive(buffer, timeout)?;
        if let Received::Bytes(length) = received {
            self.came.lock().unwrap().extend_from_slice(&buffer[..length]);
        }
        Ok(received)
    }
}

fn shots(bytes: &[u8]) -> Vec<Shot> {
    let mut deframer: Box<Deframer<MAX_DEVICE_PACKET>> = Box::default();
    let mut rest = bytes;
    let mut shots = Vec::new();
    while let Some(found) = deframer.next(&mut rest) {
        let Deframed::Packet(packet) = found else { continue };
        if let Ok(DeviceMessage::Frame(frame)) = open::<DeviceMessage<'_>>(packet) {
            shots.push(Shot {
                run: frame.run,
                sequence: frame.sequence,
                sweeps: frame.sweeps,
                flags: frame.flags,
                samples: frame.samples.iter().collect(),
            });
        }
    }
    shots
}

fn run(link: Box<dyn Link>, setup: &MeasurementSetup, frames: u32) -> (Capture, Vec<Shot>) {
    let came = Arc::new(Mutex::new(Vec::new()));
    let mut session =
        Session::open(Box::new(Tapped { inner: link, came: Arc::clone(&came) })).unwrap();
    let setup = setup.clone();
    let options = CaptureOptions { setup, frames: Some(frames), calibrate: false, record: None };
    let captured =
        capture(&mut session, &options, &mut |_| ControlFlow::Continue(())).unwrap();
    let came = came.lock().unwrap();
    (captured, shots(&came))
}

fn in_process() -> Box<dyn Link> {
    Box::new(MemoryLink::new(optics().camera(SEED).unwrap()))
}

fn natural() -> MeasurementSetup {
    MeasurementSetup::new(&Order::Natural, 1.0).unwrap()
}

#[test]
fn frames_from_the_emulated_board_are_those_of_the_virtual_camera_bit_for_bit() {
    let frames = 6;
    let Some(board) = Emulated::start(optics().fpga(SEED).unwrap()) else { return };
    let (captured, shots) = run(board.link(), &natural(), frames);
    assert!(matches!(captured.ended, Ended::Complete), "{:?}", captured.ended);
    assert!(captured.counters.is_complete(), "{}", captured.counters);
    assert_eq!(shots.len(), frames as usize);

    let (reference, expected) = run(in_process(), &natural(), frames);
    assert!(shots == expected, "the frames differ");

    let image = |captured: &Capture| {
        let measurements = captured.integrated.measurements(&captured.setup, None, true).unwrap();
        reconstruct::hadamard(&measurements)
    };
    assert_eq!(image(&captured).pixels(), image(&reference).pixels());
    let side = Side::INSTRUMENT.pixels();
    let footprint = optics();
    let seen = image(&captured);
    let correlation =
        metrics::correlation(footprint.footprint().weights(), seen.pixels(), side, side).unwrap();
    println!("correlation with the scene: {correlation:.4}");
    assert!(correlation > 0.9, "correlation {correlation}");
}
