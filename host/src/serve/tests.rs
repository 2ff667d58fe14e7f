use super::camera_log::Phase;
use super::*;
use crate::capture::Calibration;
use crate::link::{Link, Received};
use crate::session::{CameraIdentity, Session};
use crate::setup::MeasurementSetup;
use crate::virtual_camera::{OpticalFpga, VirtualCamera, VirtualOptics};
use nirspi_optics::Scene;
use nirspi_recon::Order;
use std::io::{BufRead, BufReader, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// No wait takes longer, on a busy machine either.
const LIMIT: Duration = Duration::from_secs(30);

const SETTINGS: Settings = Settings { method: "hadamard", enhance: false, frames: 8 };

fn shared(identity: &CameraIdentity) -> Arc<Shared> {
    Arc::new(Shared::new(CameraLog::new("test", identity), vec!["hadamard"], SETTINGS))
}

/// Waits until something is so.
#[track_caller]
fn until(what: &str, is_so: impl Fn() -> bool) {
    let deadline = Instant::now() + LIMIT;
    while !is_so() {
        assert!(Instant::now() < deadline, "not {what} within {LIMIT:?}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// A virtual camera whose enclosure can be opened.
struct Enclosed {
    camera: VirtualCamera<OpticalFpga>,
    closed: Arc<AtomicBool>,
}

impl Link for Enclosed {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.camera.receive(bytes);
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], _: Duration) -> io::Result<Received> {
        self.camera.set_interlock(self.closed.load(Ordering::Relaxed));
        for _ in 0..100 {
            self.camera.step(1000);
        }
        let outbox = self.camera.outbox();
        let length = outbox.waiting().len().min(buffer.len());
        buffer[..length].copy_from_slice(&outbox.waiting()[..length]);
        outbox.sent(length);
        Ok(if length == 0 { Received::Nothing } else { Received::Bytes(length) })
    }
}

fn enclosed(closed: &Arc<AtomicBool>) -> Connected {
    let scene = Scene::new(vec![1.0; 16], 4, 40.0).unwrap();
    let camera = VirtualOptics::new(scene, 300.0).unwrap().camera(1).unwrap();
    let link = Enclosed { camera, closed: Arc::clone(closed) };
    let session = Session::open(Box::new(link)).unwrap();
    Connected { session, calibration: Calibration::None, note: None }
}

#[test]
fn after_a_fault_leds_go_on_again_only_when_a_person_says_so() {
    let closed = Arc::new(AtomicBool::new(true));
    let first = enclosed(&closed);
    let shared = shared(first.session.identity());
    let measuring = {
        let (shared, closed) = (Arc::clone(&shared), Arc::clone(&closed));
        let setup = MeasurementSetup::new(&Order::CakeCutting, 0.125).unwrap();
        let connect: Connect = Box::new(move || Ok(enclosed(&closed)));
        let source = CameraSource { address: "test".to_owned(), setup, connect };
        std::thread::spawn(move || camera::run(&shared, source, first))
    };
    let phase = || lock(&shared.camera).camera.phase;
    let received = || shared.slot.ledger().frames.received;
    until("measuring", || received() > 10);
    closed.store(false, Ordering::Relaxed);
    until("off", || phase() == Phase::Fault);
    let before = received();

    // The cause still stands: asked to go on, it stays off.
    shared.resume.store(true, Ordering::Relaxed);
    until("asked", || !shared.resume.load(Ordering::Relaxed));
    until("off", || phase() == Phase::Fault);
    // The cause is gone: nobody has asked.
    closed.store(true, Ordering::Relaxed);
    std::thread::sleep(Duration::from_millis(1500));
    assert_eq!((phase(), received()), (Phase::Fault, before));

    shared.resume.store(true, Ordering::Relaxed);
    until("on again", || received() > before + 10);
    assert_eq!(phase(), Phase::Measuring);
    shared.over.store(true, Ordering::Relaxed);
    measuring.join().unwrap().unwrap();
    let told: Vec<String> = lock(&shared.camera).events().iter().map(|e| e.text.clone()).collect();
    assert!(told.iter().any(|text| text.contains("LEDs off: Interlock")), "{told:?}");
}

#[test]
fn a_browser_that_does_not_read_costs_nobody_and_then_sees_the_newest() {
    const LAST: usize = 60;
    let closed = Arc::new(AtomicBool::new(true));
    let shared = shared(enclosed(&closed).session.identity());
    let (publish, published) = watch::channel(Arc::new(Published::default()));
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let serving = {
        let shared = Arc::clone(&shared);
        std::thread::spawn(move || {
            let over = Arc::clone(&shared);
            http::run(listener, shared, published, || over.is_over())
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
    // Numbered moments, far larger than what systems keep for a connection.
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
