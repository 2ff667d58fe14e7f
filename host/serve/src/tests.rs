use super::camera_log::Phase;
use super::light::Leds;
use super::look::{RunSetup, Seen};
use super::settings::Measuring;
use super::settings::tests::{offer, settings};
use super::state::Published;
use super::threads::{images, measure};
use super::*;
use nirspi::capture::{Calibration, CaptureError};
use nirspi::identity::CameraIdentity;
use nirspi::link::{Link, Received};
use nirspi::provenance::Made;
use nirspi::session::Session;
use nirspi::setup::MeasurementSetup;
use nirspi_mcu::{Limits, Micros};
use nirspi_optics::Scene;
use nirspi_recon::reconstruct::{
    Method, MethodSettings, Reconstruct, ReconstructError, Reconstruction,
};
use nirspi_recon::{Measurements, Order};
use nirspi_virtual::{OpticalFpga, VirtualCamera, VirtualOptics};
use nirspi_wire::{Command, Request, RunLength, State, encode, version};
use socket2::SockRef;
use std::io::{self, BufRead, BufReader, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tokio::sync::watch;

/// The longest wait of a test, enough for a busy machine.
const LIMIT: Duration = Duration::from_secs(30);

fn made() -> Made {
    Made::by("nirspi 0.1.0", Some("0123456789ab"), ["nirspi", "serve"], 1_764_059_400)
}

fn setup() -> MeasurementSetup {
    MeasurementSetup::new(&Order::CakeCutting, 0.125).unwrap()
}

fn shared(identity: &CameraIdentity, scene: Option<StagedScene>) -> Arc<Shared> {
    let measuring = Measuring::of(&setup());
    let settings =
        Settings { method: "hadamard", enhance: false, frames: 8, measuring, ..settings() };
    let offer = Offer { base: Some(setup()), ..offer() };
    let log = CameraLog::new("test", identity);
    Arc::new(Shared::new(log, offer, settings, Stage::of(scene)))
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
    let limits = Limits { host_silence: silence, ..Limits::SIMULATED };
    let mut camera = camera.with_limits(limits);
    // The firmware compares a packet of the FPGA first, and takes no command meanwhile.
    for _ in 0..50 {
        camera.step(1000);
    }
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
            std::thread::spawn(move || measure(&shared, source, first, made()))
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

/// A server whose states the test publishes.
struct Paper {
    shared: Arc<Shared>,
    publish: watch::Sender<Arc<Published>>,
    address: std::net::SocketAddr,
    serving: JoinHandle<io::Result<()>>,
}

impl Paper {
    fn new() -> Self {
        let shared = shared(enclosed(&Arc::default(), Before::Nothing).session.identity(), None);
        let (publish, published) = watch::channel(Arc::new(Published::default()));
        let server = Server::bind("127.0.0.1:0", Access::default(), &made()).unwrap();
        let address = server.address;
        let serving = {
            let shared = Arc::clone(&shared);
            std::thread::spawn(move || {
                let over = Arc::clone(&shared);
                http::run(server, shared, published, || over.is_over())
            })
        };
        Self { shared, publish, address, serving }
    }

    /// The numbers of the states that a browser gets.
    fn browser(&self) -> impl Iterator<Item = usize> + use<> {
        let mut stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(LIMIT)).unwrap();
        // Left alone, the system would let this buffer grow by its own measure, to another size each time.
        SockRef::from(&stream).set_recv_buffer_size(128 << 10).unwrap();
        write!(stream, "GET /events HTTP/1.1\r\nHost: {}\r\n\r\n", self.address).unwrap();
        let lines = BufReader::new(stream).lines().map(Result::unwrap);
        lines.filter_map(|line| line.strip_prefix("data: ")?.trim_end_matches('.').parse().ok())
    }

    /// Publishes a state of this number and of so many bytes.
    fn publish(&self, number: usize, bytes: usize) {
        let message = format!("{number}{}", ".".repeat(bytes));
        let (number, made) = (number as u64, Some(Instant::now()));
        let published = Published { number, made, message, ..Published::default() };
        self.publish.send_replace(Arc::new(published));
    }

    fn end(self) {
        self.shared.over.store(true, Ordering::Relaxed);
        self.serving.join().unwrap().unwrap();
    }
}

#[test]
fn a_browser_that_does_not_read_delays_no_other_and_then_sees_the_newest() {
    const LAST: usize = 60;
    let paper = Paper::new();
    let (mut idle, mut keen) = (paper.browser(), paper.browser());
    until("seen by two", || paper.shared.viewers() == 2);
    // Numbered states, far larger than the socket buffers of common systems.
    for number in 1..=LAST {
        paper.publish(number, 1 << 20);
        assert_eq!(keen.next(), Some(number));
    }
    let seen: Vec<usize> = idle.by_ref().take_while(|&number| number < LAST).collect();
    assert!(seen.is_sorted() && seen.len() < LAST / 2, "{seen:?}");
    paper.end();
}

#[test]
fn a_page_that_asks_gets_each_state_once_with_its_age_and_waits_for_the_next() {
    let paper = Paper::new();
    let ask = |query: &str| {
        let mut stream = TcpStream::connect(paper.address).unwrap();
        stream.set_read_timeout(Some(LIMIT)).unwrap();
        let host = paper.address;
        write!(
            stream,
            "GET /api/next{query} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n"
        )
        .unwrap();
        let began = Instant::now();
        let answer = io::read_to_string(stream).unwrap();
        let (head, body) = answer.split_once("\r\n\r\n").unwrap();
        let age = head.lines().find_map(|line| line.strip_prefix("state-age-ms: ")?.parse().ok());
        (head[9..12].to_owned(), body.trim_end().to_owned(), age.unwrap_or(0u64), began.elapsed())
    };
    let second = Duration::from_secs(1);
    let (status, _, _, took) = ask("");
    assert!(status == "503" && took >= second, "there is no state yet");
    paper.publish(7, 0);
    std::thread::sleep(Duration::from_millis(300));
    let (_, body, age, took) = ask("?seen=6&page=1");
    assert!(body == "7" && age >= 300 && took < second, "{body}, {age} ms old, after {took:?}");
    // Only another state is an answer at once: what was seen comes after a second, with its age.
    let (_, body, age, took) = ask("?seen=7&page=2");
    assert!(body == "7" && age >= 1300 && took >= second, "{body}, {age} ms old, after {took:?}");
    std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(Duration::from_millis(200));
            paper.publish(8, 0);
        });
        let (_, body, age, took) = ask("?page=2&seen=7");
        assert!(body == "8" && age < 1000 && took < second, "{body}, {age} ms old, after {took:?}");
    });
    assert_eq!(paper.shared.viewers(), 2);
    paper.end();
}

#[test]
fn states_come_while_an_image_takes_long() {
    const TOOK: Duration = Duration::from_secs(4);
    let shared = shared(enclosed(&Arc::default(), Before::Nothing).session.identity(), None);
    lock(&shared.settings).method = "slow";
    let (publish, published) = watch::channel(Arc::new(Published::default()));
    let making = {
        let shared = Arc::clone(&shared);
        let imaging =
            Imaging::new(&nirspi_nets::prior::settings(), nirspi_nets::Device::cpu()).unwrap();
        let imaging = imaging.with_method("slow", Box::new(Slow(TOOK)));
        std::thread::spawn(move || images(&shared, imaging, &publish))
    };
    let run = Arc::new(RunSetup { setup: setup(), settling: None, flat_field: None });
    let frames = Box::new(nirspi::integrate::Newest::new(&run.setup));
    let look = Look {
        seen: Seen::Camera { frames, run, depth: None },
        arrived: Instant::now(),
        counters: Default::default(),
        newest: 1,
    };
    shared.slot.offer(look, Default::default(), Default::default());
    until("begun", || shared.slot.ledger().images.waiting == 1 && published.borrow().number > 0);
    let (began, before) = (Instant::now(), published.borrow().number);
    std::thread::sleep(TOOK / 2);
    let made = published.borrow().number - before;
    // Twice a second, on a busy machine too.
    assert!(began.elapsed() >= TOOK || made >= 3, "{made} states in {:?}", began.elapsed());
    assert!(published.borrow().made.unwrap().elapsed() < Duration::from_secs(1));
    shared.over.store(true, Ordering::Relaxed);
    making.join().unwrap();
}

/// After a fault the link used to be closed, and the page went on saying "LEDs off" whatever the camera did.
#[test]
fn a_camera_that_has_switched_its_leds_off_is_asked_and_its_word_does_not_last() {
    let lab = Lab::new(Before::Nothing);
    lab.hands.open.store(true, Ordering::Relaxed);
    until("off", || lab.phase() == Phase::Fault);
    let seen = || {
        let mut camera = lock(&lab.shared.camera).camera.clone();
        camera.age(Instant::now());
        camera.leds
    };
    std::thread::sleep(Duration::from_millis(2500));
    assert_eq!(seen(), Leds::Off, "the camera has been asked again");
    lab.hands.stuck.store(true, Ordering::Relaxed);
    let began = Instant::now();
    until("not known", || seen() == Leds::Unknown);
    assert!(began.elapsed() < Duration::from_millis(3500), "{:?}", began.elapsed());
    assert_eq!(lab.phase(), Phase::Fault);
    lab.hands.open.store(false, Ordering::Relaxed);
    lab.resumes();
    lab.end();
}

#[test]
fn a_slow_browser_has_few_old_images_before_it() {
    // States as large as those of a camera with depth.
    const BYTES: usize = 48 << 10;
    let paper = Paper::new();
    let (mut slow, mut keen) = (paper.browser(), paper.browser());
    until("seen by two", || paper.shared.viewers() == 2);
    let mut behind = Vec::new();
    // The slow browser takes one state of five.
    for number in 1..=600 {
        paper.publish(number, BYTES);
        assert_eq!(keen.next(), Some(number));
        if number % 5 == 0 {
            behind.push((number - slow.next().unwrap()) / 5);
        }
    }
    let most = behind.split_off(60).into_iter().max();
    assert!(most <= Some(16), "{most:?} states behind");
    paper.end();
}

#[test]
fn a_client_that_changes_settings_without_end_is_slowed_down_and_can_always_stop() {
    const MANY: u32 = 4 * change_rate::BURST;
    let paper = Paper::new();
    let mut stream = TcpStream::connect(paper.address).unwrap();
    stream.set_read_timeout(Some(LIMIT)).unwrap();
    let host = paper.address;
    let post = |path: &str, body: &str| {
        let length = body.len();
        format!("POST {path} HTTP/1.1\r\nHost: {host}\r\nContent-Length: {length}\r\n\r\n{body}")
    };
    let change = post("/api/settings", r#"{"frames": 4}"#);
    let stop = post("/api/stop", "");
    write!(stream, "{}{stop}", change.repeat(MANY as usize)).unwrap();
    let (mut done, mut refused) = (0, 0);
    let mut lines = BufReader::new(stream).lines().map(Result::unwrap);
    let mut status = || lines.find(|line| line.starts_with("HTTP/1.1")).unwrap();
    for _ in 0..MANY {
        match status().split(' ').nth(1) {
            Some("200") => done += 1,
            Some("429") => refused += 1,
            other => panic!("{other:?}"),
        }
    }
    assert!(done >= change_rate::BURST && refused > 0, "{done} done, {refused} refused");
    assert!(status().contains(" 200 "));
    assert!(!paper.shared.light.is_on());
    paper.end();
}

/// Found by `tests/fuzz`: the name of an unknown field came back as it was.
#[test]
fn what_a_client_sends_comes_back_in_one_plain_line() {
    let paper = Paper::new();
    let mut stream = TcpStream::connect(paper.address).unwrap();
    stream.set_read_timeout(Some(LIMIT)).unwrap();
    let (host, body) = (paper.address, r#"{"a\n\u001b[2Jb": 1}"#);
    let length = body.len();
    let head = format!("Host: {host}\r\nContent-Length: {length}\r\nConnection: close\r\n");
    write!(stream, "POST /api/settings HTTP/1.1\r\n{head}\r\n{body}").unwrap();
    let answer = io::read_to_string(stream).unwrap();
    let (head, refused) = answer.split_once("\r\n\r\n").unwrap();
    assert!(head.starts_with("HTTP/1.1 400 "), "{head}");
    let line = refused.strip_suffix('\n').unwrap();
    assert!(!line.contains(char::is_control), "{line:?}");
    paper.end();
}

/// A method that takes its time.
struct Slow(Duration);

impl Reconstruct for Slow {
    fn name(&self) -> &str {
        "slow"
    }

    fn reconstruct(&self, measured: &Measurements) -> Result<Reconstruction, ReconstructError> {
        std::thread::sleep(self.0);
        let hadamard = Method::HADAMARD.prepare(&MethodSettings::default())?;
        hadamard.reconstruct(measured)
    }
}

#[test]
fn images_that_are_given_up_are_counted_and_frames_are_not_waited_for() {
    const TOOK: Duration = Duration::from_millis(60);
    let shared = shared(enclosed(&Arc::default(), Before::Nothing).session.identity(), None);
    lock(&shared.settings).method = "slow";
    *lock(&shared.overload) = overload::tests::given_up(3);
    let making = {
        let shared = Arc::clone(&shared);
        let imaging =
            Imaging::new(&nirspi_nets::prior::settings(), nirspi_nets::Device::cpu()).unwrap();
        let imaging = imaging.with_method("slow", Box::new(Slow(TOOK)));
        let (publish, _) = watch::channel(Arc::new(Published::default()));
        std::thread::spawn(move || images(&shared, imaging, &publish))
    };
    let run = Arc::new(RunSetup { setup: setup(), settling: None, flat_field: None });
    let began = Instant::now();
    let mut offered = 0;
    while shared.slot.ledger().images.shown < 4 {
        let frames = Box::new(nirspi::integrate::Newest::new(&run.setup));
        offered += 1;
        let (run, arrived) = (Arc::clone(&run), Instant::now());
        let seen = Seen::Camera { frames, run, depth: None };
        let look = Look { seen, arrived, counters: Default::default(), newest: offered };
        shared.slot.offer(look, Default::default(), Default::default());
        std::thread::sleep(Duration::from_millis(2));
        assert!(began.elapsed() < LIMIT, "{:?}", shared.slot.ledger());
    }
    // The first image is made at once; each of the others after a rest of seven images.
    assert!(began.elapsed() >= 3 * 8 * TOOK, "{:?}", began.elapsed());
    let images = shared.slot.ledger().images;
    assert_eq!(images.shown + images.passed_over + images.failed + images.waiting, offered);
    assert!(images.passed_over > 10 && images.failed == 0, "{images:?}");
    shared.over.store(true, Ordering::Relaxed);
    making.join().unwrap();
}
