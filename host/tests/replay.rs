//! A recording that is played back is the camera that was recorded.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use super::made;
use nirspi::address::CameraAddress;
use nirspi::capture::{Calibration, Capture, CaptureOptions, Ended, Record, StopCause, capture};
use nirspi::identity::CameraIdentity;
use nirspi::provenance::Made;
use nirspi::recording::{Opening, Recorder, Recording, RunAccount, Target, tally_recording};
use nirspi::session::Session;
use nirspi::setup::MeasurementSetup;
use nirspi_recon::Order;
use nirspi_wire::samples::Words;
use nirspi_wire::{Depth, DeviceMessage};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

const RUN: u16 = 7;
const FRAMES: u32 = 20;
/// Time of the camera between two frames.
const FRAME_US: u64 = 10_000;

fn frame(sequence: u32, patterns: usize) -> Vec<u8> {
    let values = (0..patterns as i64).map(|k| i64::from(sequence) * 1000 - 7 * k);
    made::frame(RUN, sequence, 5_000_000 + u64::from(sequence) * FRAME_US, values.collect())
}

/// A recording of 20 frames with a depth map, a frame that came damaged, a packet that was too
/// long, and a frame of an earlier run.
fn recorded(folder: &Path, is_whole: bool) -> PathBuf {
    let path = folder.join("rec.mcap");
    let identity = CameraIdentity {
        capabilities: vec!["depth".into(), "boot loader".into()],
        ..CameraIdentity::current("nucleo-u5a5zj-q", "A-17")
    };
    let mut setup = MeasurementSetup::new(&Order::CakeCutting, 0.25).unwrap();
    setup.adc_latency = 6;
    let patterns = setup.rows.len();
    let target = Target::New(path.clone());
    let opening = Opening::of(&identity, &setup, RUN);
    let mut recorder = Recorder::create(&target, &opening).unwrap();
    for sequence in 0..FRAMES {
        let mut bytes = frame(sequence, patterns);
        match sequence {
            3 => bytes[100] ^= 0x55,
            5 => {
                let mut buffer = [0; 128];
                let zones = Words::pack((0..64u16).map(|zone| 300 + zone), &mut buffer).unwrap();
                let depth = Depth { device_time_us: 5_051_000, side: 8, distances_mm: zones };
                recorder.packet(&made::packet(&DeviceMessage::Depth(depth))).unwrap();
            }
            8 => recorder.packet(&[0]).unwrap(),
            _ => {}
        }
        recorder.packet(&bytes).unwrap();
    }
    if is_whole {
        recorder.packet(&made::ended(RUN, FRAMES, 5_200_000)).unwrap();
    }
    recorder.finish(&RunAccount::default()).unwrap();
    path
}

fn replay(path: &Path, speed: &str, frames: Option<u32>, record: Option<&Path>) -> Capture {
    let address: CameraAddress = format!("replay:{}{speed}", path.display()).parse().unwrap();
    let link = || Err("no virtual camera here");
    let mut session: Session = address.open(link).unwrap();
    let options = CaptureOptions {
        // A replay has the setup and the settling of its recording, not these.
        setup: MeasurementSetup::new(&Order::Natural, 1.0).unwrap(),
        frames,
        calibration: Calibration::Measure,
        record: record.map(|path| Record {
            target: Target::New(path.to_owned()),
            made: Made::by("a test", None, ["a test"], 0),
        }),
    };
    capture(&mut session, &options, &mut |_| ControlFlow::Continue(())).unwrap()
}

/// Another reader of MCAP finds each channel's messages numbered from 0 on, and in the order of their times.
#[test]
fn the_messages_of_each_channel_are_numbered() {
    let folder = tempfile::tempdir().unwrap();
    let file = std::fs::read(recorded(folder.path(), true)).unwrap();
    let mut seen = std::collections::BTreeMap::<String, (u32, u64)>::new();
    for message in mcap::MessageStream::new(&file).unwrap() {
        let message = message.unwrap();
        let (next, time) = seen.entry(message.channel.topic.clone()).or_default();
        assert_eq!(message.sequence, *next, "{}", message.channel.topic);
        assert!(message.log_time >= *time, "{}", message.channel.topic);
        (*next, *time) = (*next + 1, message.log_time);
    }
    assert!(seen.values().any(|(messages, _)| *messages > FRAMES), "{seen:?}");
}

#[test]
fn a_capture_of_a_replay_has_the_packets_of_the_recording() {
    let folder = tempfile::tempdir().unwrap();
    let v1 = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/recordings/v1.mcap");
    let made = recorded(folder.path(), true);
    for (name, path, frames) in [("a", made, FRAMES), ("b", v1, 12)] {
        for (at, asked) in [None, Some(frames)].into_iter().enumerate() {
            let copy = folder.path().join(format!("{name}{at}.mcap"));
            let captured = replay(&path, ",max", asked, Some(&copy));
            assert!(matches!(captured.ended, Ended::Complete), "{:?}", captured.ended);
            assert!(made::bytes(&copy) == made::bytes(&path), "{name}: other packets");
            let (mut copy, mut first) =
                (Recording::open(&copy).unwrap(), Recording::open(&path).unwrap());
            assert_eq!(
                (&copy.identity, &copy.setup, &copy.settling),
                (&first.identity, &first.setup, &first.settling)
            );
            let [copy, first] = [&mut copy, &mut first].map(|rec| tally_recording(rec).unwrap());
            assert_eq!(copy.account().counters(), first.account().counters());
            assert_eq!(copy.account().failed_checks(), first.account().failed_checks());
            assert_eq!(captured.setup.rows.len(), 256);
        }
    }
}

#[test]
fn a_replay_takes_the_time_that_the_camera_took_or_a_share_of_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = recorded(folder.path(), true);
    let took = |speed| {
        let began = Instant::now();
        let captured = replay(&path, speed, None, None);
        assert!(matches!(captured.ended, Ended::Complete), "{:?}", captured.ended);
        began.elapsed()
    };
    // From the first frame to the end of the run.
    let camera = Duration::from_micros(u64::from(FRAMES) * FRAME_US);
    assert!(took("") >= camera);
    assert!(took(",0.5") >= 2 * camera);
    assert!(took(",max") < camera, "a replay at full speed waits for nothing");
}

#[test]
fn a_shorter_run_ends_where_it_should_and_a_longer_one_says_what_was_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let path = recorded(folder.path(), true);
    let short = replay(&path, ",max", Some(2), None);
    assert!(matches!(short.ended, Ended::Complete), "{:?}", short.ended);
    assert_eq!((short.counters.received, short.made), (2, Some(2)));
    let long = replay(&path, ",max", Some(99), None);
    let missing = long.missing().unwrap();
    assert!(missing.contains("made 20 frames, 99 were asked for"), "{missing}");
}

#[test]
fn a_recording_without_its_end_is_a_camera_that_goes_away() {
    let folder = tempfile::tempdir().unwrap();
    let path = recorded(folder.path(), false);
    let captured = replay(&path, ",max", None, None);
    assert!(matches!(captured.ended, Ended::LinkLost(_)), "{:?}", captured.ended);
    assert_eq!(captured.counters.received, 19);
}

#[test]
fn a_replay_that_is_stopped_loses_no_frame() {
    let folder = tempfile::tempdir().unwrap();
    let path = recorded(folder.path(), true);
    let address: CameraAddress = format!("replay:{}", path.display()).parse().unwrap();
    let mut session = address.open(|| Err("no virtual camera here")).unwrap();
    let options = CaptureOptions {
        setup: MeasurementSetup::new(&Order::Natural, 1.0).unwrap(),
        frames: None,
        calibration: Calibration::None,
        record: None,
    };
    let captured =
        capture(&mut session, &options, &mut |progress| match progress.counters.received {
            0..2 => ControlFlow::Continue(()),
            _ => ControlFlow::Break(StopCause::User),
        })
        .unwrap();
    assert!(matches!(captured.ended, Ended::Stopped(StopCause::User)), "{:?}", captured.ended);
    assert_eq!(captured.counters.lost, 0, "{}", captured.counters);
}
