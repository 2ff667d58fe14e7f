//! What several laws begin with: the virtual camera, its answers and its recordings, made by the
//! program's own writers.

use nirspi::capture::{Calibration, CaptureOptions, Record, capture};
use nirspi::identity::CameraIdentity;
use nirspi::info::info;
use nirspi::link::{Link, Received};
use nirspi::provenance::Made;
use nirspi::recording::Target;
use nirspi::session::Session;
use nirspi::setup::MeasurementSetup;
use nirspi_optics::Scene;
use nirspi_recon::Order;
use nirspi_virtual::{MemoryLink, OpticalFpga, VirtualCamera, VirtualOptics};
use nirspi_wire::{Command, Request, RunLength, encode, version};
use std::io;
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, OnceLock};
use std::time::Duration;

/// The virtual camera's optics before a grey sheet, without noise.
pub fn optics() -> &'static VirtualOptics {
    static OPTICS: OnceLock<VirtualOptics> = OnceLock::new();
    OPTICS.get_or_init(|| {
        let scene = Scene::new(vec![0.5; 4], 2, 48.0).expect("a scene");
        VirtualOptics::new(scene, 300.0).expect("optics").ideal()
    })
}

/// A virtual camera after power-up.
pub fn camera() -> VirtualCamera<OpticalFpga> {
    optics().camera(1).expect("a camera")
}

/// Eight patterns, so that a frame is short.
pub fn setup() -> MeasurementSetup {
    MeasurementSetup::new(&Order::Sequency, 8.0 / 1024.0).expect("a setup")
}

/// The identity of the virtual camera.
pub fn identity() -> &'static CameraIdentity {
    static IDENTITY: OnceLock<CameraIdentity> = OnceLock::new();
    IDENTITY.get_or_init(|| {
        let session = Session::open(Box::new(MemoryLink::new(camera()))).expect("a session");
        session.identity().clone()
    })
}

/// A link that keeps a copy of what the camera sends.
struct Tapped {
    inner: MemoryLink<OpticalFpga>,
    said: Arc<Mutex<Vec<u8>>>,
}

impl Link for Tapped {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.inner.send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<Received> {
        let received = self.inner.receive(buffer, timeout)?;
        if let Received::Bytes(length) = received {
            self.said.lock().expect("one thread").extend(&buffer[..length]);
        }
        Ok(received)
    }
}

/// What [`talk`] asks for.
pub fn capture_options(record: Option<Target>) -> CaptureOptions {
    CaptureOptions {
        setup: setup(),
        frames: Some(3),
        calibration: Calibration::None,
        record: record
            .map(|target| Record { target, made: Made::by("a test", None, ["a test"], 0) }),
    }
}

/// The bytes of a camera during a greeting, questions about its state, and a capture of three frames.
pub fn camera_says() -> Vec<u8> {
    let said = Arc::default();
    let link = Tapped { inner: MemoryLink::new(camera()), said: Arc::clone(&said) };
    let mut session = Session::open(Box::new(link)).expect("a session");
    info(&mut session).expect("its state");
    capture(&mut session, &capture_options(None), &mut |_| ControlFlow::Continue(()))
        .expect("a capture");
    drop(session);
    let bytes = said.lock().expect("one thread").clone();
    bytes
}

/// The bytes of a recording of three frames.
pub fn recording() -> Vec<u8> {
    let path = crate::place::path("seed.mcap");
    let mut session = Session::open(Box::new(MemoryLink::new(camera()))).expect("a session");
    let options = capture_options(Some(Target::New(path.clone())));
    capture(&mut session, &options, &mut |_| ControlFlow::Continue(())).expect("a recording");
    let bytes = std::fs::read(&path).expect("its bytes");
    std::fs::remove_file(path).expect("its end");
    bytes
}

/// The packet of a command.
pub fn packet(id: u16, command: Command<'_>) -> Vec<u8> {
    let mut room = [0; 8192];
    encode(&Request { id, command }, &mut room).expect("room").to_vec()
}

/// The packets of a whole measurement of so many frames, the greeting first.
pub fn commands(frames: u32) -> Vec<Vec<u8>> {
    vec![
        packet(0, Command::Hello { protocol: version::CURRENT }),
        setup().with_configuration(|setup| packet(1, Command::Configure(setup))),
        packet(2, Command::Start(RunLength::Frames(frames))),
        packet(3, Command::Status),
        packet(4, Command::Stop),
    ]
}

/// The bytes of a message's packet without framing and checksum.
pub fn payload(packet: &[u8]) -> Vec<u8> {
    let mut packet = packet.to_vec();
    packet.pop_if(|last| *last == 0);
    nirspi_wire::packet::unseal(&mut packet).expect("a sound packet").to_vec()
}

/// The packets in a stream.
pub fn packets(stream: &[u8]) -> Vec<Vec<u8>> {
    let parts = stream.split(|byte| *byte == 0).filter(|part| !part.is_empty());
    parts.map(|part| [part, &[0]].concat()).collect()
}
