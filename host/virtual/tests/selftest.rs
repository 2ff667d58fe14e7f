//! The self-test on virtual cameras: a sound one passes, and each deliberate fault is seen by its own check.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use nirspi::check::{Check, Verdict};
use nirspi::link::{Link, Received};
use nirspi::selftest::{LinkDemands, STAGES, SelfTest, run};
use nirspi::session::Session;
use nirspi_hdl_model::Lines;
use nirspi_mcu::{BusError, FpgaBus};
use nirspi_optics::{CameraModel, LedArray, Scene};
use nirspi_virtual::{
    MemoryLink, OpticalFpga, SimulatedFpga, StuckEnable, VirtualCamera, VirtualOptics,
};
use nirspi_wire::register::{Register, mode};
use nirspi_wire::{Answer, DeviceMessage, Reply, Status, encode, open};
use std::collections::{HashMap, HashSet};
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// A white sheet across the whole field.
fn optics() -> VirtualOptics {
    VirtualOptics::new(Scene::new(vec![0.9; 64 * 64], 64, 60.0).unwrap(), 300.0).unwrap()
}

fn test(link: impl Link + 'static) -> SelfTest {
    test_for(Duration::from_millis(300), link)
}

fn test_for(duration: Duration, link: impl Link + 'static) -> SelfTest {
    let mut session = Session::open(Box::new(link)).unwrap();
    let demands = LinkDemands { min_frames_per_s: 0.0, duration };
    run(&mut session, demands, &mut |_| {}).unwrap()
}

fn plugged<F: SimulatedFpga>(fpga: F) -> MemoryLink<F> {
    MemoryLink::new(VirtualCamera::new(fpga, optics().depth(1).unwrap(), "under-test"))
}

fn wired(wiring: impl FnMut(&mut LedArray, Lines) -> f32 + Send + 'static) -> SelfTest {
    test(plugged(optics().fpga(1).unwrap().wired(wiring)))
}

fn failures(found: &SelfTest) -> Vec<&Check> {
    found.checks.iter().filter(|check| check.verdict() == Verdict::Failed).collect()
}

/// Exactly this check has failed, and says all of these words.
#[track_caller]
fn only(found: &SelfTest, name: &str, words: &[&str]) {
    let failed = failures(found);
    let names: Vec<&str> = failed.iter().map(|check| check.name()).collect();
    assert_eq!(names, [name], "{failed:#?}");
    for word in words {
        assert!(failed[0].note().contains(word), "nothing of {word:?} in {:?}", failed[0]);
    }
}

#[test]
fn a_sound_camera_passes_and_gives_its_calibration() {
    let found = test(MemoryLink::new(optics().camera(1).unwrap()));
    assert!(found.passed(), "{:#?}", failures(&found));
    assert_eq!(found.settling.unwrap().adc_latency, optics().chain().adc_latency_clocks);
    let skipped = found.checks.iter().filter(|check| check.verdict() == Verdict::Skipped);
    // The virtual camera has no memory of its own that frames pass through, and samples without a phase.
    let names: Vec<&str> = skipped.map(Check::name).collect();
    assert_eq!(names, ["device: frame memory", "ADC sampling phase"], "{:#?}", found.checks);
}

fn note<'f>(found: &'f SelfTest, name: &str) -> &'f str {
    found.checks.iter().find(|check| check.name() == name).unwrap().note()
}

#[test]
fn two_boards_without_adc_pass_with_the_bring_up_design() {
    let found = test(plugged(optics().fpga(1).unwrap().bring_up()));
    assert!(found.passed(), "{:#?}", failures(&found));
    assert_eq!(found.settling.as_ref().unwrap().adc_latency, 7);
    assert!(note(&found, "device: FPGA identity").contains("0x4e535049"), "{:#?}", found.checks);
    assert!(note(&found, "device: gateware").contains("bring-up"), "{:#?}", found.checks);
    assert!(note(&found, "device: ADC clock").contains("124.80 MHz"), "{:#?}", found.checks);
    assert!(note(&found, "LED lines").contains("64 lines"), "{:#?}", found.checks);
}

#[test]
fn a_missing_adc_clock_is_the_one_failure_and_says_what_to_check() {
    let found = test(plugged(optics().fpga(1).unwrap().adc_clock(None)));
    only(&found, "device: ADC clock", &["0.00 MHz", "xpected 125 MHz", "supply"]);
    let slow = test(plugged(optics().fpga(1).unwrap().adc_clock(Some(62_500_000))));
    only(&slow, "device: ADC clock", &["62.50 MHz", "sample clock"]);
}

/// The camera works on with the other enable, so nothing else shows it. What needs light is refused afterwards.
#[test]
fn a_stuck_led_enable_is_named_and_forbids_light() {
    for (stuck, name, words) in [
        (StuckEnable::Board, "device: board's LED enable", "while the board's LED enable is low"),
        (StuckEnable::Fpga, "device: FPGA's LED enable", "while the FPGA's LED enable is low"),
    ] {
        let found = test(plugged(optics().fpga(1).unwrap().stuck(stuck)));
        let failed = failures(&found);
        assert_eq!(failed[0].name(), name, "{failed:#?}");
        assert!(failed.iter().all(|check| check.note().contains(words)), "{failed:#?}");
        assert!(failed.len() > 1 && found.settling.is_none(), "{failed:#?}");
    }
    let found = test(MemoryLink::new(optics().camera(1).unwrap()));
    for name in ["device: board's LED enable", "device: FPGA's LED enable"] {
        assert_eq!(note(&found, name), "dark while it alone is low");
    }
}

/// The light of an ordinary target is enough to judge by, noise and daylight too, and so is a twentieth of a sheet's.
#[test]
fn the_enables_are_judged_by_a_dim_light_too_and_not_without_light() {
    let names = ["device: board's LED enable", "device: FPGA's LED enable"];
    let verdicts = |share: f32| {
        let found =
            wired(move |array, lines| share * array.light(lines.rows, lines.columns, lines.enable));
        names.map(|name| found.checks.iter().find(|check| check.name() == name).unwrap().verdict())
    };
    assert_eq!(verdicts(0.05), [Verdict::Passed; 2]);
    assert_eq!(verdicts(0.0), [Verdict::Skipped; 2]);
}

/// A camera with a stuck enable measures as any other until its self-test: that is what makes the fault latent.
#[test]
fn a_stuck_led_enable_shows_nowhere_else() {
    let sound = optics().fpga(1).unwrap();
    let stuck = optics().fpga(1).unwrap().stuck(StuckEnable::Board);
    let [sound, stuck] = [sound, stuck].map(|fpga| {
        let mut session = Session::open(Box::new(plugged(fpga))).unwrap();
        nirspi::calibration::calibrate(&mut session, &mut nirspi::session::IgnorePackets).unwrap()
    });
    assert_eq!((sound.adc_latency, sound.step_counts), (stuck.adc_latency, stuck.step_counts));
}

#[test]
fn a_stuck_line_is_named() {
    let row = |stuck: u32| {
        wired(move |array, lines| {
            array.light(lines.rows & !(1 << 7) | stuck << 7, lines.columns, lines.enable)
        })
    };
    only(&row(0), "LED lines", &["row line 7:"]);
    only(&row(1), "LED lines", &["row line 7:"]);
    let column = |lines: Lines| Lines { columns: lines.columns & !(1 << 31), ..lines };
    let found = wired(move |array, lines| {
        let lines = column(lines);
        array.light(lines.rows, lines.columns, lines.enable)
    });
    only(&found, "LED lines", &["column line 31:"]);
}

#[test]
fn a_supply_that_gives_way_when_more_leds_are_lit_is_seen() {
    let found = wired(|array, lines| {
        let all = array.light(0, 0, true);
        let light = array.light(lines.rows, lines.columns, lines.enable);
        light * (1.0 - 0.1 * light / all)
    });
    only(&found, "LED supply", &["supply gives way"]);
    // Halves droop by 5 %, all by 10 %.
    let expected = (0.95 / 0.90 - 1.0) * 100.0;
    assert!((failures(&found)[0].value().unwrap() - expected).abs() < 2.0, "{found:#?}");
}

#[test]
fn leds_that_hardly_light_are_seen_and_nothing_is_concluded_from_them() {
    let weak = |array: &mut LedArray, lines: Lines| {
        0.01 * array.light(lines.rows, lines.columns, lines.enable)
    };
    let found = wired(weak);
    only(&found, "light of all LEDs", &[]);
    let skipped = found.checks.iter().filter(|check| check.note() == "too little light").count();
    assert_eq!(skipped, 4, "{:#?}", found.checks);
}

#[test]
fn a_step_that_drowns_in_noise_is_not_stepped_and_no_calibration_is_kept() {
    let dim = |array: &mut LedArray, lines: Lines| {
        0.03 * array.light(lines.rows, lines.columns, lines.enable)
    };
    let found = wired(dim);
    assert!(found.passed() && found.settling.is_none(), "{:#?}", failures(&found));
    let stepping = found.checks.iter().find(|check| check.name().contains("stepping")).unwrap();
    assert!(stepping.note().contains("too little light for a noise of"), "{stepping:?}");
}

#[test]
fn darkness_is_no_calibration() {
    let found = wired(|_, _| 0.0);
    only(&found, "light of all LEDs", &["too dim"]);
    assert!(found.settling.is_none());
}

/// The light of all lines of 0.1 pF to the amplifier, beside LEDs that rise unlike they fall.
const CIRCUIT: &str = "[leds]\npower_mw = 40\nrise_ns = 12.76\nfall_ns = 16.36\nturn_on_delay_ns = 1.22\n\
                       tile_sag = 0.0165\nline_crosstalk_ff = 1.6";

fn circuit() -> VirtualOptics {
    let sheet = Scene::new(vec![0.9; 64 * 64], 64, 60.0).unwrap();
    VirtualOptics::of(&CameraModel::parse(CIRCUIT).unwrap(), sheet, 300.0).unwrap()
}

#[test]
fn the_faults_of_a_circuits_leds_and_lines_cancel() {
    let found = test(MemoryLink::new(circuit().camera(1).unwrap()));
    assert!(found.passed(), "{:#?}", failures(&found));
    assert_eq!(found.settling.unwrap().adc_latency, circuit().chain().adc_latency_clocks);
}

#[test]
fn lines_that_no_sweep_inverts_are_seen_in_the_first_pixel() {
    let inner = circuit().fpga(1).unwrap();
    // Of runs after one of all patterns only: the calibration would show it first.
    let mut patterns = 0;
    let write = move |register, value: u32| match register {
        Register::Patterns => {
            patterns = value;
            value
        }
        Register::Mode if patterns == 1024 && value & mode::TEST_SOURCE == 0 => {
            value & !mode::ALTERNATING
        }
        _ => value,
    };
    let found = test(plugged(Tampered::new(inner, write)));
    only(&found, "first pixel at 25 MHz", &["pixel (0, 0) -"]);
}

/// An FPGA whose settings do not do what they say, though they read back as written.
struct Tampered<W> {
    inner: OpticalFpga,
    told: HashMap<u16, u32>,
    write: W,
    /// Whether the simulation takes much longer than the time that it simulates.
    is_busy: Arc<AtomicBool>,
}

impl<W> Tampered<W> {
    fn new(inner: OpticalFpga, write: W) -> Self {
        Self { inner, told: HashMap::new(), write, is_busy: Arc::default() }
    }
}

fn tampered(write: impl FnMut(Register, u32) -> u32 + Send + 'static) -> SelfTest {
    test(plugged(Tampered::new(optics().fpga(1).unwrap(), write)))
}

impl<W: FnMut(Register, u32) -> u32 + Send> FpgaBus for Tampered<W> {
    fn read(&mut self, address: u16) -> Result<u32, BusError> {
        let value = self.inner.read(address)?;
        Ok(self.told.get(&address).copied().unwrap_or(value))
    }
    fn write(&mut self, address: u16, value: u32) -> Result<(), BusError> {
        let done = Register::at(address).map_or(value, |register| (self.write)(register, value));
        if done == value {
            self.told.remove(&address);
        } else {
            self.told.insert(address, value);
        }
        self.inner.write(address, done)
    }
    fn frame_ready(&mut self) -> bool {
        self.inner.frame_ready()
    }
    fn raw_ready(&mut self) -> bool {
        self.inner.raw_ready()
    }
    fn frame(&mut self) -> Result<Option<&[u8]>, BusError> {
        self.inner.frame()
    }
    fn raw(&mut self) -> Result<Option<&[u8]>, BusError> {
        self.inner.raw()
    }
}

impl<W: FnMut(Register, u32) -> u32 + Send> SimulatedFpga for Tampered<W> {
    fn advance(&mut self, clocks: u32) {
        if self.is_busy.load(Ordering::Relaxed) {
            // 25 ms for a sweep of 0.08 ms.
            std::thread::sleep(Duration::from_micros(u64::from(clocks) * 5 / 2));
        }
        self.inner.advance(clocks);
    }
    fn clock(&self) -> u64 {
        self.inner.clock()
    }
    fn running(&self) -> bool {
        self.inner.running()
    }
    fn set_interlock(&mut self, closed: bool) {
        self.inner.set_interlock(closed);
    }
    fn set_board_enable(&mut self, high: bool) {
        self.inner.set_board_enable(high);
    }
}

#[test]
fn a_latency_setting_that_is_off_is_seen_and_its_calibration_is_not_kept() {
    let mut test_source = false;
    let write = move |register, value: u32| match register {
        Register::Mode => {
            test_source = value & mode::TEST_SOURCE != 0;
            value
        }
        // Of the detector only: the generator's frames would show it first.
        Register::Latency if !test_source => (value + 2).min(63),
        _ => value,
    };
    let found = tampered(write);
    only(&found, "ADC latency by stepping", &["latency setting is off"]);
    let check = failures(&found)[0];
    assert_eq!(check.value(), Some(f64::from(optics().chain().adc_latency_clocks - 2)));
    assert!(found.settling.is_none());
}

#[test]
fn a_test_frame_of_another_length_of_window_is_seen() {
    // The device's own test frame has the same window; so only those of seven clocks are wrong.
    let write = |register, value: u32| match register {
        Register::Dwell if value == 7 => 6,
        _ => value,
    };
    let found = tampered(write);
    only(&found, "test frames through the whole chain", &["frame 0, sample 0: "]);
}

#[test]
fn an_open_interlock_fails_what_needs_light_and_names_the_reason() {
    let mut camera = optics().camera(1).unwrap();
    camera.set_interlock(false);
    let found = test(MemoryLink::new(camera));
    let interlock = found.checks.iter().find(|check| check.name() == "device: interlock").unwrap();
    assert_eq!(interlock.verdict(), Verdict::Failed);
    assert!(
        failures(&found).iter().skip(1).all(|check| check.note().contains("interlock is open"))
    );
    assert!(found.settling.is_none());
}

/// A link of which each packet becomes another one, or none.
struct PerPacket<L, F> {
    inner: L,
    changed: F,
    chunk: Vec<u8>,
    packet: Vec<u8>,
    ready: Vec<u8>,
}

impl<L: Link, F: FnMut(Vec<u8>) -> Vec<u8> + Send> PerPacket<L, F> {
    fn new(inner: L, changed: F) -> Self {
        Self { inner, changed, chunk: vec![0; 1 << 16], packet: Vec::new(), ready: Vec::new() }
    }
}

impl<L: Link, F: FnMut(Vec<u8>) -> Vec<u8> + Send> Link for PerPacket<L, F> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.inner.send(bytes)
    }
    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<Received> {
        if self.ready.is_empty() {
            match self.inner.receive(&mut self.chunk, timeout)? {
                Received::Bytes(length) => {
                    for &byte in &self.chunk[..length] {
                        self.packet.push(byte);
                        if byte == 0 {
                            self.ready.extend((self.changed)(std::mem::take(&mut self.packet)));
                        }
                    }
                }
                other => return Ok(other),
            }
        }
        let length = self.ready.len().min(buffer.len());
        buffer[..length].copy_from_slice(&self.ready[..length]);
        self.ready.drain(..length);
        Ok(if length == 0 { Received::Nothing } else { Received::Bytes(length) })
    }
}

#[test]
fn a_link_that_loses_frames_is_seen_and_the_camera_is_not_blamed() {
    let mut long = 0_usize;
    // Every third frame of 1024 patterns is lost; bursts come in shorter packets.
    let lossy = PerPacket::new(MemoryLink::new(optics().camera(1).unwrap()), move |packet| {
        long += usize::from(packet.len() > 3000);
        if packet.len() > 3000 && long.is_multiple_of(3) { Vec::new() } else { packet }
    });
    // Long enough for three frames on a busy machine.
    let found = test_for(Duration::from_secs(2), lossy);
    only(
        &found,
        "link losses",
        &[": 0 lost in the FPGA", "0 dropped by the firmware", "on the link"],
    );
}

/// Once the pace came from the clock of this computer: frames of the second run then took minutes, no frame
/// came, and a sound camera failed.
#[test]
fn a_busy_computer_is_no_fault_of_the_link() {
    let is_busy = Arc::new(AtomicBool::new(false));
    let mut fpga = Tampered::new(optics().fpga(1).unwrap(), |_, value| value);
    fpga.is_busy = Arc::clone(&is_busy);
    let mut session = Session::open(Box::new(plugged(fpga))).unwrap();
    let demands = LinkDemands { min_frames_per_s: 0.0, duration: Duration::from_millis(50) };
    let mut begin = |stage| is_busy.store(STAGES[stage] == "link throughput", Ordering::Relaxed);
    let found = run(&mut session, demands, &mut begin).unwrap();
    assert!(found.passed(), "{:#?}", failures(&found));
    // `of 8 at 6104 frames/s`: by the camera's clock, and enough frames to see a loss.
    let told = note(&found, "link losses");
    let mut numbers = told.split(' ').filter_map(|word| word.parse::<u64>().ok());
    let (frames, pace) = (numbers.next().unwrap(), numbers.next().unwrap());
    assert!(frames >= 8 && (3000..12_000).contains(&pace), "{told}");
}

/// A link that has no room for one frame of some of the link's runs, as if this computer stood still for a
/// moment. The camera says so in its status.
struct NoRoom {
    is_link: Arc<AtomicBool>,
    /// The runs of the check of the link, in order.
    runs: Vec<u16>,
    /// Whether the run of this place in their order has no room.
    has_none: fn(usize) -> bool,
    /// Counts the missing frame in the status.
    counted: fn(Status) -> Status,
    dropped: HashSet<u16>,
}

impl NoRoom {
    /// The packet as it comes out of the link; nothing if there was no room for it.
    fn changed(&mut self, packet: Vec<u8>) -> Vec<u8> {
        let mut bytes = packet.clone();
        bytes.pop();
        match open::<DeviceMessage<'_>>(&mut bytes) {
            Ok(DeviceMessage::Frame(frame)) if self.is_link.load(Ordering::Relaxed) => {
                if !self.runs.contains(&frame.run) {
                    self.runs.push(frame.run);
                }
                let is_dropped = (self.has_none)(self.runs.len() - 1)
                    && frame.sequence > 0
                    && self.dropped.insert(frame.run);
                if is_dropped { Vec::new() } else { packet }
            }
            Ok(DeviceMessage::Reply(Reply { id, outcome: Ok(Answer::Status(status)) }))
                if self.dropped.contains(&status.run) =>
            {
                let status = Answer::Status((self.counted)(status));
                let reply = DeviceMessage::Reply(Reply { id, outcome: Ok(status) });
                encode(&reply, &mut [0; 4096]).unwrap().to_vec()
            }
            _ => packet,
        }
    }
}

fn test_without_room(has_none: fn(usize) -> bool, counted: fn(Status) -> Status) -> SelfTest {
    let is_link = Arc::new(AtomicBool::new(false));
    let mut room = NoRoom {
        is_link: Arc::clone(&is_link),
        runs: Vec::new(),
        has_none,
        counted,
        dropped: HashSet::new(),
    };
    let camera = MemoryLink::new(optics().camera(1).unwrap());
    let link = PerPacket::new(camera, move |packet| room.changed(packet));
    let mut session = Session::open(Box::new(link)).unwrap();
    let demands = LinkDemands { min_frames_per_s: 0.0, duration: Duration::from_millis(50) };
    let mut begin = |stage| is_link.store(STAGES[stage] == "link throughput", Ordering::Relaxed);
    run(&mut session, demands, &mut begin).unwrap()
}

#[test]
fn frames_without_room_are_asked_for_again_at_a_slower_pace() {
    let dropped: fn(Status) -> Status = |status| Status { frames_dropped: 1, ..status };
    let lost: fn(Status) -> Status = |status| Status { fpga_frames_lost: 1, ..status };
    for (counted, words) in [(dropped, "1 dropped by the firmware"), (lost, "1 lost in the FPGA")] {
        let found = test_without_room(|run| run == 1, counted);
        assert!(found.passed(), "{:#?}", failures(&found));
        assert!(note(&found, "link losses").contains("came too late"), "{found:#?}");
        let found = test_without_room(|run| run > 0, counted);
        only(&found, "link losses", &[words, "0 on the link", "came too late"]);
    }
}

#[test]
fn a_link_that_is_too_slow_is_seen() {
    let mut session =
        Session::open(Box::new(MemoryLink::new(optics().camera(1).unwrap()))).unwrap();
    let demands = LinkDemands { min_frames_per_s: 1e9, duration: Duration::from_millis(100) };
    let found = run(&mut session, demands, &mut |_| {}).unwrap();
    only(&found, "link throughput", &["MB/s"]);
}
