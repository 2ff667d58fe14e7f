use super::camera_log::Phase;
use super::light::Leds;
use super::settings::Measuring;
use super::settings::tests::{offer, settings};
use super::state::Published;
use super::threads::measure;
use super::*;
use crate::capture::{Calibration, CaptureError};
use crate::link::{Link, Received};
use crate::session::{CameraIdentity, Session};
use crate::setup::MeasurementSetup;
use crate::virtual_camera::{OpticalFpga, VirtualCamera, VirtualOptics};
use nirspi_mcu::{Limits, Micros};
use nirspi_optics::Scene;
use nirspi_recon::Order;
use nirspi_wire::{Command, Request, RunLength, State, encode, version};
use std::io::{self, BufRead, BufReader, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tokio::sync::watch;

/// The longest wait of a test, enough for a busy machine.
const LIMIT: Duration = Duration::from_secs(30);

fn setup() -> MeasurementSetup {
    MeasurementSetup::new(&Order::CakeCutting, 0.125).unwrap()
}

fn shared(identity: &CameraIdentity, scene: Option<StagedScene>) -> Arc<Shared> {
    let measuring = Measuring::of(&setup());
    let settings =
        Settings { method: "hadamard", enhance: false, frames: 8, measuring, ..settings() };
    let offer = Offer { base: Some(setup()), ..offer() };
    Arc::new(Shared::new(CameraLog::new("test", identity), offer, settings, Stage::of(scene)))
}

/// Waits until `is_so` returns true.
#[track_caller]
fn until(what: &str, is_so: impl Fn() -> bool) {
    let deadline = Instant::now() + LIMIT;
    while !is_so() {
        assert!(Instant::now() < deadline, "not {what} within {LIMIT:?}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// A virtual camera whose enclosure can be opened and whose cable can be pulled.
struct Enclosed {
    camera: VirtualCamera<OpticalFpga>,
    hands: Arc<Hands>,
}

/// What the test does to the camera by hand.
#[derive(Default)]
struct Hands {
    open: AtomicBool,
    pulled: AtomicBool,
    /// No byte arrives, in either direction.
    stuck: AtomicBool,
}

impl Link for Enclosed {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        if !self.hands.stuck.load(Ordering::Relaxed) {
            self.camera.receive(bytes);
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<Received> {
        if self.hands.stuck.load(Ordering::Relaxed) {
            std::thread::sleep(timeout);
            return Ok(Received::Nothing);
        }
        if self.hands.pulled.load(Ordering::Relaxed) {
            return Ok(Received::Closed);
        }
        self.camera.set_interlock(!self.hands.open.load(Ordering::Relaxed));
        for _ in 0..100 {
            self.camera.step(1000);
        }
        let packets = self.camera.packets_out();
        let length = packets.waiting().len().min(buffer.len());
        buffer[..length].copy_from_slice(&packets.waiting()[..length]);
        packets.sent(length);
        Ok(if length == 0 { Received::Nothing } else { Received::Bytes(length) })
    }
}

/// What has happened to a camera before a host connects to it.
#[derive(Clone, Copy, PartialEq)]
enum Before {
    Nothing,
    WasOpen,
    /// Its host went silent with the LEDs on.
    WasSilent,
    Crashed,
}

/// Connects a virtual camera.
fn enclosed(hands: &Arc<Hands>, before: Before) -> Connected {
    let scene = Scene::new(vec![1.0; 16], 4, 40.0).unwrap();
    let mut camera = VirtualOptics::new(scene, 300.0).unwrap().camera(1).unwrap();
    camera.set_interlock(before != Before::WasOpen);
    camera.step(1000);
    if before == Before::WasSilent {
        camera = silenced(camera);
    }
    if before == Before::Crashed {
        camera.crash("main.rs:7");
    }
    let link = Enclosed { camera, hands: Arc::clone(hands) };
    let session = Session::open(Box::new(link)).unwrap();
    Connected { session, calibration: Calibration::None, note: None, flat_field: None }
}

/// A camera whose host has asked for light and then for nothing.
fn silenced(camera: VirtualCamera<OpticalFpga>) -> VirtualCamera<OpticalFpga> {
    let silence = Micros(1_000);
    let limits = Limits { host_silence: silence, ..Limits::default() };
    let mut camera = camera.with_limits(limits);
    let mut send = |id, command: Command<'_>| {
        let mut room = [0; 4096];
        camera.receive(encode(&Request { id, command }, &mut room).unwrap());
        camera.step(1000);
    };
    send(0, Command::Hello { protocol: version::CURRENT });
    setup().with_configuration(|configuration| send(1, Command::Configure(configuration)));
    send(2, Command::Start(RunLength::Continuous));
    assert_eq!(camera.state(), State::Running);
    while camera.state() == State::Running {
        camera.step(1000);
    }
    camera.link_closed();
    camera
}

/// A camera's thread under test.
struct Lab {
    hands: Arc<Hands>,
    shared: Arc<Shared>,
    measuring: JoinHandle<Result<(), CaptureError>>,
}

impl Lab {
    /// Starts the thread and waits for frames. `unplugged`: what happens while the camera is
    /// unplugged.
    fn new(unplugged: Before) -> Self {
        let hands = Arc::<Hands>::default();
        let first = enclosed(&hands, Before::Nothing);
        let shared = shared(first.session.identity(), None);
        let measuring = {
            let (shared, hands) = (Arc::clone(&shared), Arc::clone(&hands));
            let connect: Connect = Box::new(move |_| {
                hands.pulled.store(false, Ordering::Relaxed);
                hands.stuck.store(false, Ordering::Relaxed);
                Ok(enclosed(&hands, unplugged))
            });
            let model = nirspi_optics::CameraModel::default();
            let source = CameraSource {
                address: "test".to_owned(),
                setup: setup(),
                model,
                scene: None,
                record_to: None,
                connect,
            };
            std::thread::spawn(move || measure(&shared, source, first))
        };
        let lab = Self { hands, shared, measuring };
        until("measuring", || lab.received() > 10);
        lab
    }

    fn phase(&self) -> Phase {
        lock(&self.shared.camera).camera.phase
    }

    fn leds(&self) -> Leds {
        lock(&self.shared.camera).camera.leds
    }

    fn received(&self) -> u64 {
        self.shared.slot.ledger().frames.received
    }

    /// Asserts that no frame arrives, for longer than a reconnection takes.
    #[track_caller]
    fn stays_dark(&self) {
        let before = self.received();
        std::thread::sleep(Duration::from_millis(1500));
        assert_eq!((self.phase(), self.received()), (Phase::Fault, before));
    }

    #[track_caller]
    fn resumes(&self) {
        let before = self.received();
        self.shared.light.set(true);
        until("on again", || self.received() > before + 10);
        assert_eq!(self.phase(), Phase::Measuring);
    }

    /// Stops the thread and returns the events.
    fn end(self) -> Vec<String> {
        self.shared.over.store(true, Ordering::Relaxed);
        self.measuring.join().unwrap().unwrap();
        lock(&self.shared.camera).events().iter().map(|event| event.text.clone()).collect()
    }
}

#[test]
fn after_a_fault_leds_go_on_again_only_when_a_person_says_so() {
    let lab = Lab::new(Before::Nothing);
    lab.hands.open.store(true, Ordering::Relaxed);
    until("off", || lab.phase() == Phase::Fault);
    // The cause of the fault persists: when asked to go on, the thread reconnects and the LEDs stay
    // off.
    let connections = || {
        let log = lock(&lab.shared.camera);
        log.events().iter().filter(|event| event.text.starts_with("connected to")).count()
    };
    let before = connections();
    lab.shared.light.set(true);
    until("tried again", || connections() > before && lab.phase() == Phase::Fault);
    // The cause is gone, but a person has not asked.
    lab.hands.open.store(false, Ordering::Relaxed);
    lab.stays_dark();
    lab.resumes();
    let told = lab.end();
    assert!(told.iter().any(|text| text.contains("LEDs off: the enclosure")), "{told:?}");
}

#[test]
fn after_host_silence_or_a_crash_only_a_person_switches_the_leds_on_again() {
    for (unplugged, words) in [
        (Before::WasSilent, "the camera switched its LEDs off: the host"),
        (Before::Crashed, "the firmware crashed"),
    ] {
        let lab = Lab::new(unplugged);
        lab.hands.pulled.store(true, Ordering::Relaxed);
        until("back and dark", || lab.phase() == Phase::Fault);
        lab.stays_dark();
        let told = lab.end();
        assert!(told.iter().any(|text| text.starts_with(words)), "{told:?}");
    }
}

#[test]
fn a_person_stops_a_camera_and_only_a_person_starts_it_again() {
    let lab = Lab::new(Before::Nothing);
    lab.shared.light.set(false);
    until("stopped", || lab.phase() == Phase::Stopped && lab.leds() == Leds::Off);
    let before = lab.received();
    // A camera that was lost meanwhile comes back dark.
    lab.hands.pulled.store(true, Ordering::Relaxed);
    until("lost", || lab.phase() == Phase::Lost && lab.leds() == Leds::Unknown);
    until("back", || lab.phase() == Phase::Stopped && lab.leds() == Leds::Off);
    std::thread::sleep(Duration::from_millis(1500));
    assert_eq!((lab.phase(), lab.received()), (Phase::Stopped, before));
    lab.resumes();
    assert_eq!(lab.leds(), Leds::On);
    // A stop and a start at once: the later one counts.
    lab.shared.light.set(false);
    lab.resumes();
    lab.end();
}

#[test]
fn a_stop_counts_although_the_stream_is_stuck() {
    let lab = Lab::new(Before::Nothing);
    lab.hands.stuck.store(true, Ordering::Relaxed);
    lab.shared.light.set(false);
    // The camera does not answer the stop: what its LEDs do is not known, and the session is closed.
    until("given up", || lab.phase() == Phase::Lost && lab.leds() == Leds::Unknown);
    until("dark", || lab.phase() == Phase::Stopped && lab.leds() == Leds::Off);
    lab.resumes();
    lab.end();
}

#[test]
fn a_camera_that_comes_back_measures_on_unless_it_was_opened_meanwhile() {
    let lab = Lab::new(Before::Nothing);
    let before = lab.received();
    lab.hands.pulled.store(true, Ordering::Relaxed);
    until("measuring again", || lab.received() > before + 100 && lab.phase() == Phase::Measuring);
    lab.end();

    let lab = Lab::new(Before::WasOpen);
    lab.hands.pulled.store(true, Ordering::Relaxed);
    until("off", || lab.phase() == Phase::Fault);
    lab.stays_dark();
    lab.resumes();
    lab.end();
}

#[test]
fn a_browser_that_does_not_read_costs_nobody_and_then_sees_the_newest() {
    const LAST: usize = 60;
    let shared = shared(enclosed(&Arc::default(), Before::Nothing).session.identity(), None);
    let (publish, published) = watch::channel(Arc::new(Published::default()));
    let server = Server::bind("127.0.0.1:0", None).unwrap();
    let address = server.address;
    let serving = {
        let shared = Arc::clone(&shared);
        std::thread::spawn(move || {
            let over = Arc::clone(&shared);
            http::run(server, shared, published, || over.is_over())
        })
    };
    let browser = || {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(LIMIT)).unwrap();
        write!(stream, "GET /events HTTP/1.1\r\nHost: {address}\r\n\r\n").unwrap();
        let lines = BufReader::new(stream).lines().map(Result::unwrap);
        lines.filter_map(|line| line.strip_prefix("data: ")?.trim_end_matches('.').parse().ok())
    };
    let mut idle = browser();
    let mut keen = browser();
    until("seen by two", || shared.viewers() == 2);
    // Numbered states, far larger than the socket buffers of common systems.
    for number in 1..=LAST {
        let message = format!("{number}{}", ".".repeat(1 << 20));
        publish.send_replace(Arc::new(Published { message, ..Published::default() }));
        assert_eq!(keen.next(), Some(number));
    }
    let seen: Vec<usize> = idle.by_ref().take_while(|&number| number < LAST).collect();
    assert!(seen.is_sorted() && seen.len() < LAST / 2, "{seen:?}");
    shared.over.store(true, Ordering::Relaxed);
    serving.join().unwrap().unwrap();
}
