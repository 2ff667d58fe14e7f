//! A camera over Zenoh: a router, a program at the camera, and a host, each a process.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use nirspi::account::LossCounters;
use nirspi::capture::{Calibration, Capture, CaptureOptions, Observer, Progress, capture};
use nirspi::link::CameraAddress;
use nirspi::relay::Publishing;
use nirspi::relay::zenoh::ZenohAddress;
use nirspi::session::CameraIdentity;
use nirspi::setup::MeasurementSetup;
use nirspi_recon::Order;
use nirspi_wire::samples::Samples;
use nirspi_wire::{Frame, FrameFlags};
use std::net::TcpListener;
use std::ops::ControlFlow;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use zenoh::Wait;

/// The variable that makes another process of this test: `router PORT` or `camera PORT`.
const ROLE: &str = "NIRSPI_ZENOH_ROLE";
const LIMIT: Duration = Duration::from_secs(60);

struct Process(Child);

impl Process {
    fn start(role: &str, port: u16) -> Self {
        let child = Command::new(std::env::current_exe().unwrap())
            .args(["--ignored", "--exact", "another_process", "--nocapture"])
            .env(ROLE, format!("{role} {port}"))
            .stdout(Stdio::null())
            .spawn();
        Self(child.unwrap())
    }

    fn end(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.end();
    }
}

#[test]
#[ignore = "a process of the other tests"]
fn another_process() {
    let Ok(role) = std::env::var(ROLE) else { return };
    match role.split_once(' ').unwrap() {
        ("router", port) => router(port),
        (_, port) => camera(port),
    }
}

fn router(port: &str) {
    let mut config = zenoh::Config::default();
    config.insert_json5("mode", "\"router\"").unwrap();
    config.insert_json5("listen/endpoints", &format!("[\"tcp/127.0.0.1:{port}\"]")).unwrap();
    config.insert_json5("scouting/multicast/enabled", "false").unwrap();
    let _session = zenoh::open(config).wait().unwrap();
    std::thread::sleep(2 * LIMIT);
}

struct Nothing;

impl Observer for Nothing {
    fn watch(&mut self, _: &Progress) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

fn setup() -> MeasurementSetup {
    MeasurementSetup::new(&Order::Natural, 0.01).unwrap()
}

/// Publishes 500 frames a second.
fn camera(port: &str) {
    let address: ZenohAddress = format!("lab/left@tcp/127.0.0.1:{port}").parse().unwrap();
    let identity = CameraIdentity {
        protocol: 2,
        firmware: "0.3.1".into(),
        gateware: "1.2.0".into(),
        board: "virtual".into(),
        serial: "A-17".into(),
        adc_hz: 125_000_000,
        adc_bits: 14,
        wavelength_nm: 1550,
        capabilities: Vec::new(),
        detectors: 1,
    };
    let mut beside = Nothing;
    let mut publishing = Publishing::new(&identity, address.publish().unwrap(), &mut beside);
    publishing.begins(&setup(), None, None);
    let (began, mut room) = (Instant::now(), [0; 64]);
    for sequence in 0_u32.. {
        let samples = (0..10_i32).map(|k| i64::from(sequence % 1000) * 10 + i64::from(k));
        let frame = Frame {
            run: 3,
            sequence,
            device_time_us: u64::from(sequence) * 2000,
            sweeps: 1,
            flags: FrameFlags::DIFFERENTIAL,
            samples: Samples::pack(samples, &mut room).unwrap(),
        };
        publishing.frame(&frame, &LossCounters::default());
        let due = began + Duration::from_millis(2) * sequence;
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
    }
}

fn joined(port: u16, frames: Option<u32>, watch: &mut dyn FnMut(&Progress) -> bool) -> Capture {
    let address: CameraAddress = format!("zenoh:lab/left@tcp/127.0.0.1:{port}").parse().unwrap();
    let mut session = address.open(|| Err("no virtual camera here")).unwrap();
    assert_eq!(session.identity().serial, "A-17");
    let options =
        CaptureOptions { setup: setup(), frames, calibration: Calibration::None, record: None };
    let began = Instant::now();
    capture(&mut session, &options, &mut |progress| {
        assert!(began.elapsed() < LIMIT, "{progress:?}");
        if watch(progress) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })
    .unwrap()
}

#[test]
fn a_late_host_takes_a_camera_over_a_router_that_restarts_and_counts_what_is_lost() {
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let mut router = Process::start("router", port);
    // The router listens when another program can connect.
    let began = Instant::now();
    while std::net::TcpStream::connect(("127.0.0.1", port)).is_err() {
        assert!(began.elapsed() < LIMIT);
        std::thread::sleep(Duration::from_millis(50));
    }
    let _camera = Process::start("camera", port);
    std::thread::sleep(Duration::from_secs(1));

    let first = joined(port, Some(300), &mut |_| false);
    assert_eq!((first.made, first.counters.total()), (Some(300), 300));
    assert!(first.counters.received > 250, "{}", first.counters);
    assert_eq!(first.setup, setup());

    let mut restarted = None;
    let second = joined(port, None, &mut |progress| {
        let counters = progress.counters;
        match restarted {
            None if counters.received > 200 => {
                router.end();
                std::thread::sleep(Duration::from_millis(500));
                router = Process::start("router", port);
                restarted = Some(counters);
                false
            }
            None => false,
            // The frames of the time without a router are lost, and counted.
            Some(before) => {
                counters.lost > before.lost && counters.received > before.received + 200
            }
        }
    });
    let counters = second.counters;
    assert!(counters.lost > 100 && counters.received > 400, "{counters}");
    assert_eq!(counters.total(), second.made.unwrap());
}

#[test]
fn where_no_camera_is_published_one_line_says_so() {
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let _router = Process::start("router", port);
    let address: ZenohAddress = format!("lab/none@tcp/127.0.0.1:{port}").parse().unwrap();
    let began = Instant::now();
    while std::net::TcpStream::connect(("127.0.0.1", port)).is_err() {
        assert!(began.elapsed() < LIMIT);
        std::thread::sleep(Duration::from_millis(50));
    }
    let error = address.join().err().unwrap();
    let said = nirspi::causes::in_one_line(&error);
    assert!(
        said.contains("zenoh:lab/none@tcp/") && said.contains("no camera is published"),
        "{said}"
    );
}
