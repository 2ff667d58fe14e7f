//! Tests of a camera with several detectors, from light to files.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use nirspi::account::LossCounters;
use nirspi::capture::{Calibration, Capture, CaptureOptions, capture};
use nirspi::export::{ExportOptions, Format, export};
use nirspi::files::measurement::{Form, Selection};
use nirspi::link::{Link, Received};
use nirspi::recording::{Recording, RecordingInfo, Target, recover};
use nirspi::replay::ReplayLink;
use nirspi::session::Session;
use nirspi::setup::MeasurementSetup;
use nirspi::source::{Index, Source, SourceOptions};
use nirspi::tally::tally_recording;
use nirspi::virtual_camera::{CameraModel, MemoryLink, VirtualCamera, VirtualOptics};
use nirspi_optics::{Chain, LedArray, Scene};
use nirspi_recon::{Order, reconstruct};
use nirspi_tests::tamper::{Fate, Tampered, only_frames};
use nirspi_wire::packet::MAX_HOST_PACKET;
use nirspi_wire::{
    Answer, Command, Configuration, DeviceMessage, EventKind, Fault, PatternOrder, Reply, Request,
    RunLength, SampleSource, Tail, encode, open,
};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

const FRAMES: u32 = 4;
const DETECTORS: usize = 3;

/// A camera of three detectors before a target with a step along each axis.
fn optics(further_mm: &str) -> VirtualOptics {
    let toml = format!("[detector]\nfurther_mm = {further_mm}");
    let camera = CameraModel::parse(&toml).unwrap();
    let scene = Scene::new(vec![0.9, 0.5, 0.3, 0.7], 2, 48.0).unwrap();
    VirtualOptics::of(&camera, scene, 300.0).unwrap()
}

fn three() -> VirtualOptics {
    optics("[[150, 0], [0, -250]]").ideal()
}

fn link(optics: &VirtualOptics) -> Box<dyn Link> {
    Box::new(MemoryLink::new(optics.camera(1).unwrap()))
}

fn run(link: Box<dyn Link>, record: Option<&Path>) -> Capture {
    let options = CaptureOptions {
        setup: MeasurementSetup::new(&Order::Natural, 1.0).unwrap(),
        frames: Some(FRAMES),
        calibration: Calibration::None,
        record: record.map(|path| Target::New(path.to_owned())),
    };
    let mut session = Session::open(link).unwrap();
    capture(&mut session, &options, &mut |_| ControlFlow::Continue(())).unwrap()
}

fn received(frames: u64) -> LossCounters {
    LossCounters { received: frames, ..Default::default() }
}

/// A capture of which the link loses or damages the packet with this number among all frames.
fn with_one(number: usize, fate: Fate) -> Capture {
    let judge = only_frames(move |frame| if frame == number { fate } else { Fate::Pass });
    run(Box::new(Tampered::new(link(&three()), judge)), None)
}

#[test]
fn each_detector_sees_the_scene_from_its_place() {
    let optics = three();
    let captured = run(link(&optics), None);
    assert_eq!(captured.missing(), None);
    assert_eq!(captured.further_counters(), [received(FRAMES.into()); 2]);
    let counts = (optics.budget().electrons_per_led / optics.chain().electrons_per_count) as f32;
    let sums = captured.further.iter().map(|detector| &detector.integrated);
    for (detector, sum) in std::iter::once(&captured.integrated).chain(sums).enumerate() {
        let image = reconstruct::hadamard(&sum.measurements(&captured.setup, None, true).unwrap());
        let gains = optics.camera_model().detector_gains(detector, 300.0);
        let gains = gains.unwrap_or_else(|| vec![1.0; 1024]);
        let light = optics.footprint().weights().iter().zip(&gains);
        for ((seen, gain), pixel) in light.zip(image.pixels()) {
            // Each of the 2048 readings is rounded to a whole count.
            let expected = seen * gain * counts;
            assert!((pixel - expected).abs() < 0.2, "detector {detector}: {pixel}, not {expected}");
        }
    }
}

#[test]
fn detectors_at_one_place_have_the_same_light_and_noise_of_their_own() {
    let noisy = run(link(&optics("[[0, 0]]")), None);
    let ideal = run(link(&optics("[[0, 0]]").ideal()), None);
    let both = |captured: &Capture| {
        let means = |sum: &nirspi::integrate::Integrated| sum.means(&captured.setup);
        (means(&captured.integrated), means(&captured.further[0].integrated))
    };
    let (first, second) = both(&ideal);
    assert_eq!(first, second);
    let (first, second) = both(&noisy);
    let differ = first.iter().zip(&second).filter(|(first, second)| first != second).count();
    assert!(differ > 1000, "{differ} of 1024 readings differ");
}

#[test]
fn what_is_lost_or_damaged_is_counted_at_its_detector_exactly_once() {
    let (whole, short) = (received(FRAMES.into()), received(u64::from(FRAMES) - 1));
    for detector in 0..DETECTORS {
        for frame in [1, FRAMES as usize - 1] {
            let number = DETECTORS * frame + detector;
            let counted = |captured: &Capture| {
                [vec![captured.counters], captured.further_counters()].concat()
            };
            let mut expected = vec![whole; DETECTORS];
            expected[detector] = LossCounters { lost: 1, ..short };
            let captured = with_one(number, Fate::Drop);
            assert_eq!(counted(&captured), expected, "frame {frame} of detector {detector}");
            let words = captured.missing().unwrap();
            let at = if detector == 0 { String::new() } else { format!("detector {detector}: ") };
            assert_eq!(
                words,
                format!("{at}of 4 frames made: 3 received, 1 lost, 0 corrupt, 0 late")
            );
            expected[detector] = LossCounters { corrupt: 1, ..short };
            let captured = with_one(number, Fate::Flip(100));
            assert_eq!(counted(&captured), expected, "frame {frame} of detector {detector}");
        }
    }
}

/// What a camera says to a host of this protocol version in a run.
#[derive(Default)]
struct Said {
    detectors: Option<u8>,
    /// Detector and sequence number.
    frames: Vec<(u8, u32)>,
    faults: Vec<Fault>,
}

fn said(mut link: Box<dyn Link>, protocol: u16, over_range_trip: u32) -> Said {
    let configuration = Configuration {
        order: PatternOrder::Natural,
        patterns: 1024,
        differential: true,
        clocks_per_pattern: 5,
        blanked: 2,
        adc_latency: 0,
        sweeps: 1,
        source: SampleSource::Detector,
        over_range_trip,
        narrow: Tail(None),
    };
    let commands = [
        Command::Hello { protocol },
        Command::Configure(configuration),
        Command::Start(RunLength::Frames(FRAMES)),
    ];
    for (id, command) in (1..).zip(commands) {
        let mut packet = vec![0; MAX_HOST_PACKET];
        link.send(encode(&Request { id, command }, &mut packet).unwrap()).unwrap();
    }
    let (mut said, mut bytes, mut chunk) = (Said::default(), Vec::new(), vec![0; 1 << 16]);
    loop {
        let Received::Bytes(length) = link.receive(&mut chunk, Duration::ZERO).unwrap() else {
            continue;
        };
        bytes.extend_from_slice(&chunk[..length]);
        while let Some(end) = bytes.iter().position(|&byte| byte == 0) {
            let mut packet: Vec<u8> = bytes.drain(..=end).collect();
            packet.pop();
            let message = open::<DeviceMessage<'_>>(&mut packet).unwrap();
            said.frames.extend(message.frame().map(|(at, frame)| (at, frame.sequence)));
            match message {
                DeviceMessage::Reply(Reply { outcome: Ok(Answer::Hello(identity)), .. }) => {
                    assert_eq!(identity.protocol, protocol);
                    said.detectors = identity.detectors.0;
                }
                DeviceMessage::Event(event) => match event.kind {
                    EventKind::Fault(fault) => said.faults.push(fault),
                    EventKind::RunEnded { .. } => return said,
                    other => panic!("{other:?}"),
                },
                _ => {}
            }
        }
    }
}

#[test]
fn a_host_of_version_2_gets_detector_0_alone() {
    let of_two = said(link(&three()), 2, 0);
    assert_eq!(of_two.detectors, None);
    assert_eq!(of_two.frames, Vec::from_iter((0..FRAMES).map(|frame| (0, frame))));
    let of_three = said(link(&three()), 3, 0);
    assert_eq!(of_three.detectors, Some(3));
    let all = (0..FRAMES).flat_map(|frame| (0..3).map(move |detector| (detector, frame)));
    assert_eq!(of_three.frames, Vec::from_iter(all));
}

#[test]
fn too_much_light_at_a_further_detector_switches_the_leds_off() {
    let optics = optics("[]").ideal();
    let camera = |times: f64| -> Box<dyn Link> {
        let array = LedArray::new(optics.footprint(), times * optics.budget().electrons_per_led);
        let chain = Chain::new(*optics.chain(), 9).unwrap();
        let fpga = optics.fpga(1).unwrap().with_detector(array, chain);
        Box::new(MemoryLink::new(VirtualCamera::new(fpga, optics.depth(1).unwrap(), "bright")))
    };
    assert_eq!(said(camera(1.0), 3, 1).faults, []);
    assert_eq!(said(camera(100.0), 3, 1).faults, [Fault::OverRange]);
}

/// Values of each source.
fn values(sources: Vec<Source>) -> Vec<Vec<f64>> {
    sources.iter().map(|source| source.measurements.values().to_vec()).collect()
}

fn of_detector(detector: Index) -> SourceOptions {
    SourceOptions { detector: Some(detector), ..SourceOptions::default() }
}

#[test]
fn a_recording_its_replay_and_its_arrays_keep_every_detector() {
    let folder = tempfile::tempdir().unwrap();
    let [path, again, out, whole] = ["three.mcap", "again.mcap", "three.npz", "whole.mcap"]
        .map(|name| folder.path().join(name));
    // Of detector 2, frame 1 is lost.
    let judge = only_frames(|frame| if frame == 5 { Fate::Drop } else { Fate::Pass });
    let captured = run(Box::new(Tampered::new(link(&three()), judge)), Some(&path));

    let tally = tally_recording(&mut Recording::open(&path).unwrap()).unwrap();
    let lost = LossCounters { lost: 1, ..received(3) };
    let counted: Vec<_> = tally.further().iter().map(|found| found.account.counters()).collect();
    assert_eq!(counted, [received(4), lost]);
    assert_eq!(counted, captured.further_counters());
    let info = RecordingInfo::read(&path).unwrap();
    assert_eq!((info.camera.detectors, &info.further), (3, &counted));
    assert!(info.to_string().contains("detector 2: 3 received, 1 lost"), "{info}");
    assert_eq!(info.account.unwrap().further, counted);

    let address = format!("{},max", path.display()).parse().unwrap();
    let replay = ReplayLink::open(&address).unwrap();
    let recorded = replay.recorded().clone();
    let mut session = Session::open(Box::new(replay)).unwrap().with_recorded(recorded);
    let options = CaptureOptions {
        setup: captured.setup.clone(),
        frames: None,
        calibration: Calibration::None,
        record: Some(Target::New(again.clone())),
    };
    let replayed = capture(&mut session, &options, &mut |_| ControlFlow::Continue(())).unwrap();
    assert_eq!(replayed.further_counters(), counted);

    recover(&path, &Target::New(whole.clone())).unwrap();
    let read = |path: &Path| values(Source::read_all(path, &of_detector(Index::All)).unwrap());
    let each = read(&path);
    assert_eq!(each.len(), DETECTORS);
    assert!(each[0] != each[1] && each[1] != each[2]);
    assert_eq!(each, read(&again));
    assert_eq!(each, read(&whole));
    for (detector, values) in each.iter().enumerate() {
        let one = Source::read(&path, &of_detector(Index::One(detector))).unwrap();
        assert_eq!(one.measurements.values(), values);
    }

    export(&path, &out, Format::Npz, &ExportOptions::default(), &made()).unwrap();
    let exported = Source::read_all(&out, &SourceOptions::default()).unwrap();
    assert_eq!(values(exported), each, "d is (detectors, patterns)");
    // frames is (frames, detectors, patterns); readings of a frame that was lost are NaN, so it has no reading.
    let of_frame = |frame: usize, detector: usize| {
        let file = Selection { field: Some("frames".to_owned()), ..Selection::default() };
        let file = Selection { form: Some(Form::Differences), ..file };
        let index = Some(Index::One(frame * DETECTORS + detector));
        Source::read(&out, &SourceOptions { index, file, ..SourceOptions::default() })
    };
    assert!(of_frame(1, 2).unwrap_err().to_string().contains("frames"));
    for detector in 0..DETECTORS {
        let all = SourceOptions { index: Some(Index::All), ..of_detector(Index::One(detector)) };
        let mut frames = values(Source::read_all(&path, &all).unwrap()).into_iter();
        for frame in (0..4).filter(|&frame| (frame, detector) != (1, 2)) {
            let read = of_frame(frame, detector).unwrap();
            assert_eq!(Some(read.measurements.values().to_vec()), frames.next());
        }
    }
    let second = ExportOptions { detector: Some(1), ..ExportOptions::default() };
    let out = folder.path().join("second.npz");
    export(&path, &out, Format::Npz, &second, &made()).unwrap();
    let exported = Source::read(&out, &SourceOptions::default()).unwrap();
    assert_eq!(exported.measurements.values(), each[1]);
}

#[test]
fn a_choice_of_detectors_that_does_not_fit_is_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("three.mcap");
    run(link(&three()), Some(&path));
    let first = Source::read(&path, &SourceOptions::default()).unwrap();
    assert!(
        first.notes.iter().any(|note| note.starts_with("detector 0 of 3")),
        "{:?}",
        first.notes
    );
    let error = Source::read(&path, &of_detector(Index::One(3))).unwrap_err().to_string();
    assert!(error.ends_with("detector 3, expected 0 to 2 of the recorded camera"), "{error}");
    let all = SourceOptions { index: Some(Index::All), ..of_detector(Index::All) };
    let error = Source::read_all(&path, &all).unwrap_err().to_string();
    assert!(error.starts_with("--index all and --detector all"), "{error}");
    let frames = SourceOptions { index: Some(Index::All), ..of_detector(Index::One(2)) };
    assert_eq!(Source::read_all(&path, &frames).unwrap().len(), FRAMES as usize);
    let npz = folder.path().join("three.npz");
    export(&path, &npz, Format::Npz, &ExportOptions::default(), &made()).unwrap();
    let error = Source::read(&npz, &of_detector(Index::One(1))).unwrap_err().to_string();
    assert!(error.starts_with("--detector belongs to recordings"), "{error}");
}

fn made() -> nirspi::provenance::Made {
    nirspi::provenance::Made::by("test", None, ["test"], 0)
}
