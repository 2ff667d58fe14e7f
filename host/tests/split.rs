//! A run that is recorded into several files has every packet once, and each file is a whole recording.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use super::made;
use nirspi::account::LossCounters;
use nirspi::address::CameraAddress;
use nirspi::capture::{
    Calibration, Capture, CaptureError, CaptureOptions, Ended, Observer, Progress, Record,
    StopCause, observe,
};
use nirspi::identity::CameraIdentity;
use nirspi::provenance::Made;
use nirspi::recording::{
    Opening, Part, Recorder, Recording, RecordingInfo, RunAccount, Split, Target, recover,
    tally_recording,
};
use nirspi::setup::MeasurementSetup;
use nirspi_recon::Order;
use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Duration;

const RUN: u16 = 7;

fn writer() -> Made {
    Made::by(
        "nirspi 0.1.0",
        Some("0123456789ab"),
        ["nirspi", "capture", "--frames", "9"],
        1_764_059_400,
    )
}

/// About 5 MB.
const FRAMES: u32 = 5000;
const FRAME_US: u64 = 10_000;
const MEGABYTE: Split = Split::Size(1_000_000);

/// A recording of a run. With damage, one frame of three is whole, so that most changes of file would be in
/// a gap; every 97th frame is lost, and every 83rd is followed by a damaged packet that is no frame.
fn recorded(path: &Path, frames: u32, is_damaged: bool) {
    let identity = CameraIdentity::current("nucleo-u5a5zj-q", "A-17");
    let setup = MeasurementSetup::new(&Order::CakeCutting, 0.25).unwrap();
    let patterns = setup.rows.len();
    let target = Target::New(path.to_owned());
    let opening = Opening::of(&identity, &setup, RUN);
    let mut recorder = Recorder::create(&target, &opening).unwrap();
    for sequence in 0..frames {
        let values = (0..patterns as i64).map(|k| i64::from(sequence) * 1000 - 7 * k).collect();
        let time = 5_000_000 + u64::from(sequence) * FRAME_US;
        let mut bytes = made::frame(RUN, sequence, time, values);
        if is_damaged && sequence % 97 == 50 {
            continue;
        }
        if is_damaged && sequence % 3 > 0 {
            bytes[100] ^= 0x55;
        }
        recorder.packet(&bytes).unwrap();
        if is_damaged && sequence % 83 == 30 {
            recorder.packet(&[1, 2, 3, 0]).unwrap();
        }
    }
    let time = 5_000_000 + u64::from(frames) * FRAME_US;
    recorder.packet(&made::ended(RUN, frames, time)).unwrap();
    recorder.finish(&RunAccount::default()).unwrap();
}

/// Stops a run after a number of frames, and takes a file's name once the first file is there.
#[derive(Default)]
struct Disturbing {
    stop_after: Option<u64>,
    takes: Option<PathBuf>,
}

impl Observer for Disturbing {
    fn begins(
        &mut self,
        _: &MeasurementSetup,
        _: Option<&nirspi::response::Settling>,
        _: Option<&nirspi::calibration::CalibrationError>,
    ) {
        self.takes.iter().for_each(|path| fs::write(path, b"precious").unwrap());
    }

    fn watch(&mut self, progress: &Progress) -> ControlFlow<StopCause> {
        match self.stop_after {
            Some(most) if progress.counters.total() >= most => ControlFlow::Break(StopCause::User),
            _ => ControlFlow::Continue(()),
        }
    }
}

fn capture_of(
    camera: &str,
    frames: Option<u32>,
    record: Option<Target>,
    mut disturbing: Disturbing,
) -> Result<Capture, CaptureError> {
    let address: CameraAddress = format!("replay:{camera}").parse().unwrap();
    let mut session = address.open(|| Err("no virtual camera here")).unwrap();
    let setup = MeasurementSetup::new(&Order::Natural, 1.0).unwrap();
    let options = CaptureOptions {
        setup,
        frames,
        calibration: Calibration::None,
        record: record.map(|target| Record { target, made: writer() }),
    };
    observe(&mut session, &options, &mut disturbing)
}

fn names(folder: &Path) -> Vec<String> {
    let names = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
    let mut names: Vec<String> = names.map(|name| name.into_string().unwrap()).collect();
    names.sort();
    names
}

/// Checks what holds for the files of every run. Returns the account of each.
fn check_files(files: &[PathBuf], captured: &Capture) -> Vec<RunAccount> {
    let mut accounts: Vec<RunAccount> = Vec::new();
    let (mut next, mut newest) = (0, 0);
    let name = |path: &PathBuf| path.file_name().unwrap().to_str().unwrap().to_owned();
    for (at, path) in files.iter().enumerate() {
        let mut recording = Recording::open(path).unwrap();
        assert_eq!(recording.identity.serial, "A-17");
        assert_eq!(recording.setup, captured.setup);
        let follows = at.checked_sub(1).map(|before| name(&files[before]));
        let place = Part { number: at as u32 + 1, first_frame: next, follows };
        assert_eq!(recording.part.as_ref(), Some(&place));
        let tally = tally_recording(&mut recording).unwrap();
        let end = recording.end().clone();
        assert_eq!(end.cut_short, None, "{at}");
        let account = end.account.unwrap();
        // The reader finds in the file alone what the capture counted for the file.
        assert_eq!(account.counters, tally.account().counters(), "{at}");
        assert_eq!(account.continues, files.get(at + 1).map(name), "{at}");
        next = tally.account().accounted();
        for (_, time) in made::packets(path) {
            assert!(time >= newest, "the clock of file {at} is another one");
            newest = time;
        }
        accounts.push(account);
    }
    let sum = accounts.iter().fold(LossCounters::default(), |sum, account| sum + account.counters);
    assert_eq!(sum, captured.counters);
    accounts
}

#[test]
fn the_files_of_a_run_have_each_packet_once_and_each_is_a_whole_recording() {
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole.mcap");
    recorded(&whole, FRAMES, true);
    let parts = folder.path().join("parts");
    fs::create_dir(&parts).unwrap();
    let record = Target::Parts(parts.join("rec.mcap"), MEGABYTE);
    let camera = format!("{},max", whole.display());
    let captured = capture_of(&camera, None, Some(record), Disturbing::default()).unwrap();
    assert!(matches!(captured.ended, Ended::Complete), "{:?}", captured.ended);
    let files = &captured.files;
    assert!(files.len() > 3, "{files:?}");
    let expected: Vec<String> = (1..=files.len()).map(|n| format!("rec-{n:04}.mcap")).collect();
    assert_eq!(names(&parts), expected);
    assert_eq!(captured.recording.as_ref(), files.first());

    let accounts = check_files(files, &captured);
    let sent = made::bytes(&whole);
    let found: Vec<Vec<u8>> = files.iter().flat_map(|path| made::bytes(path)).collect();
    assert!(found == sent, "{} packets of {}", found.len(), sent.len());
    // Each file says who wrote it.
    for path in files {
        assert_eq!(RecordingInfo::read(path).unwrap().written_by, Some(writer()));
    }
    // Each file says what it lacks itself, and the last one how the run ended.
    for account in &accounts {
        assert!(account.missing.as_ref().unwrap().contains("corrupt"), "{account:?}");
    }
    let last = accounts.last().unwrap();
    assert_eq!((last.asked, last.made), (None, Some(u64::from(FRAMES))));

    // A file in the middle is a camera, a recording that is copied, and a recording with a description.
    let middle = &files[1];
    let tally = tally_recording(&mut Recording::open(middle).unwrap()).unwrap();
    let copy = folder.path().join("copy.mcap");
    let camera = format!("{},max", middle.display());
    let again = capture_of(&camera, None, Some(Target::New(copy)), Disturbing::default()).unwrap();
    assert!(matches!(again.ended, Ended::Complete), "{:?}", again.ended);
    assert_eq!(
        (again.counters, again.made),
        (tally.account().counters(), Some(again.counters.total()))
    );
    let few = capture_of(&camera, Some(10), None, Disturbing::default()).unwrap();
    assert_eq!((few.counters.total(), few.made), (10, Some(10)), "{:?}", few.ended);
    let recovered = folder.path().join("recovered.mcap");
    assert_eq!(recover(middle, &recovered, false).unwrap().frames, tally.account().counters());
    let info = RecordingInfo::read(&recovered).unwrap();
    assert_eq!(info.written_by, Some(writer()));
    assert_eq!(info.part.as_ref().unwrap().number, 2);
    let info = info.to_string();
    let written = "written by nirspi 0.1.0, 2025-11-25T08:30:00Z: nirspi capture --frames 9";
    assert!(info.contains(written), "{info}");
    let first = tally.account().first();
    let place = format!(
        "file 2 of its run, from frame {first} on, after rec-0001.mcap, goes on in rec-0003.mcap"
    );
    assert!(info.contains(&place), "{info}");
    assert!(!info.contains("the capture counted"), "{info}");
}

/// The disk takes a file of a size that the user named; the estimate of the size is close and not too low.
#[test]
fn a_file_is_not_larger_than_asked_for_and_not_much_smaller() {
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole.mcap");
    recorded(&whole, 1200, false);
    let record = Target::Parts(folder.path().join("rec.mcap"), MEGABYTE);
    // 1.2 MB in half a second, slower than any disk.
    let camera = format!("{},24", whole.display());
    let captured = capture_of(&camera, None, Some(record), Disturbing::default()).unwrap();
    assert_eq!(captured.missing(), None);
    let sizes: Vec<u64> = captured.files.iter().map(|p| fs::metadata(p).unwrap().len()).collect();
    assert!(sizes.len() == 2 && (800_000..=1_000_000).contains(&sizes[0]), "{sizes:?}");
    check_files(&captured.files, &captured);
}

#[test]
fn a_file_ends_when_its_time_is_over() {
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole.mcap");
    recorded(&whole, 100, false);
    let camera = format!("{}", whole.display());
    let split = Split::Time(Duration::from_millis(300));
    let record = Target::FirstFreeParts(folder.path().to_owned(), split);
    fs::write(folder.path().join("capture-1-0003.mcap"), b"of another run").unwrap();
    let captured = capture_of(&camera, None, Some(record), Disturbing::default()).unwrap();
    assert_eq!(captured.missing(), None);
    let count = captured.files.len();
    assert!((2..=4).contains(&count), "{count}");
    assert_eq!(captured.files[1], folder.path().join("capture-2-0002.mcap"));
    for account in check_files(&captured.files, &captured) {
        assert!(account.counters.received > 0 && account.missing.is_none(), "{account:?}");
    }
    for path in &captured.files[..count - 1] {
        let info = RecordingInfo::read(path).unwrap();
        assert!(info.host_seconds > 0.2, "{} s", info.host_seconds);
    }
}

#[test]
fn a_run_that_is_stopped_says_so_in_its_last_file() {
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole.mcap");
    recorded(&whole, 1000, false);
    let split = Split::Time(Duration::from_millis(100));
    let record = Some(Target::Parts(folder.path().join("rec.mcap"), split));
    let stop = Disturbing { stop_after: Some(50), ..Disturbing::default() };
    let camera = whole.display().to_string();
    let captured = capture_of(&camera, Some(500), record, stop).unwrap();
    let count = captured.files.len();
    assert!(count > 1);
    let accounts = check_files(&captured.files, &captured);
    assert!(accounts[..count - 1].iter().all(|a| a.missing.is_none() && a.asked.is_none()));
    let last = accounts.last().unwrap();
    let missing = last.missing.as_ref().unwrap();
    assert!(missing.contains("stopped by the user after") && missing.contains("of 500 frames"));
    // A next file that is not needed any more does not stay.
    assert_eq!(names(folder.path()).len(), count + 1);
}

#[test]
fn a_name_that_is_taken_ends_the_run_with_every_frame_kept() {
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole.mcap");
    recorded(&whole, FRAMES, false);
    let (path, third) = (folder.path().join("rec.mcap"), folder.path().join("rec-0003.mcap"));
    let camera = format!("{},max", whole.display());
    let record = || Target::Parts(path.clone(), MEGABYTE);
    let disturbing = Disturbing { takes: Some(third.clone()), ..Disturbing::default() };
    let error = capture_of(&camera, None, Some(record()), disturbing).unwrap_err();
    let CaptureError::RecordingCut { path: failed, held, captured, .. } = &error else {
        panic!("{error}");
    };
    assert_eq!((failed, *held), (&third, captured.counters.received));
    assert_eq!(fs::read(&third).unwrap(), b"precious");
    assert_eq!(captured.files.len(), 2);
    let accounts = check_files(&captured.files, captured);
    assert_eq!(accounts[0].missing, None);
    let missing = accounts[1].missing.as_ref().unwrap();
    assert!(missing.contains("rec-0003.mcap could not be recorded"), "{missing}");

    // Before the run begins, each name is looked at.
    assert_eq!(record().taken(), Some(folder.path().join("rec-0001.mcap")));
    fs::remove_file(folder.path().join("rec-0001.mcap")).unwrap();
    fs::remove_file(folder.path().join("rec-0002.mcap")).unwrap();
    assert_eq!(record().taken(), Some(third));
    let refused = capture_of(&camera, None, Some(record()), Disturbing::default());
    assert!(matches!(refused, Err(CaptureError::Recording { .. })));
    assert_eq!(names(folder.path()), ["rec-0003.mcap", "whole.mcap"]);
}
