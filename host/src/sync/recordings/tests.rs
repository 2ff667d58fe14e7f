use super::*;
use crate::recording::{Recorder, RunAccount, Target};
use crate::session::CameraIdentity;
use crate::setup::MeasurementSetup;
use nirspi_wire::packet::MAX_DEVICE_PACKET;
use nirspi_wire::samples::Samples;
use nirspi_wire::{FrameFlags, encode};

/// A moment of 2026 in ns since 1970.
const NOW: u64 = 1_790_000_000_000_000_000;
const PERIOD_US: u64 = 10_000;

/// A camera whose clock has this error, and was 0 at this time after `NOW`.
#[derive(Clone, Copy)]
struct Camera {
    name: &'static str,
    error_ppm: f64,
    zero_us: i64,
}

impl Camera {
    fn host_ns(&self, device_us: u64) -> u64 {
        let passed = device_us as f64 * 1e3 / (1.0 + self.error_ppm * 1e-6);
        (NOW as i64 + self.zero_us * 1000) as u64 + passed.round() as u64
    }

    /// Records these frames. One packet in 50 is lost, and delays are up to 4 ms.
    fn record(&self, folder: &Path, frames: std::ops::Range<u32>, begin_us: u64) -> PathBuf {
        let path = folder.join(format!("{}.mcap", self.name));
        let identity = CameraIdentity {
            protocol: 2,
            firmware: "0.3.1".into(),
            gateware: "1.2.0".into(),
            board: "virtual".into(),
            serial: self.name.into(),
            adc_hz: 125_000_000,
            adc_bits: 14,
            wavelength_nm: 1550,
            capabilities: Vec::new(),
            detectors: 1,
        };
        let mut setup = MeasurementSetup::new(&nirspi_recon::Order::Natural, 0.01).unwrap();
        setup.sweeps = 1000;
        let target = Target::New(path.clone());
        let mut recorder = Recorder::create(&target, &identity, &setup, None, Some(3)).unwrap();
        let (mut room, mut buffer) = ([0; 64], vec![0; MAX_DEVICE_PACKET + 1]);
        let made = frames.len();
        for sequence in frames.filter(|n| n % 50 != 7) {
            let device_time_us = begin_us + u64::from(sequence) * PERIOD_US;
            let frame = Frame {
                run: 3,
                sequence,
                device_time_us,
                sweeps: 1000,
                flags: FrameFlags::DIFFERENTIAL,
                samples: Samples::pack((0..10_i32).map(|k| i64::from(5 * k)), &mut room).unwrap(),
            };
            let raw = encode(&DeviceMessage::Frame(frame), &mut buffer).unwrap();
            let delay_ns = u64::from(sequence) * 7919 % 401 * 10_000;
            let arrival = self.host_ns(device_time_us) + setup.frame_ns() as u64 + delay_ns;
            recorder.packet_of(arrival, raw).unwrap();
        }
        assert!(made > 0);
        recorder.finish(&RunAccount::default()).unwrap();
        path
    }
}

const LEFT: Camera = Camera { name: "left", error_ppm: 30.0, zero_us: -50_000_000 };
const RIGHT: Camera = Camera { name: "right", error_ppm: -45.0, zero_us: -7_000_000 };

/// The rows of a table as numbers, without its serial numbers.
fn rows(path: &Path) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some(COLUMNS));
    lines
        .map(|line| {
            let cells = line.split(',').enumerate().filter(|(at, _)| *at != 2);
            cells.map(|(_, cell)| cell.parse().unwrap()).collect()
        })
        .collect()
}

#[test]
fn two_recordings_give_offset_drift_and_a_table_in_common_time() {
    let folder = tempfile::tempdir().unwrap();
    let paths = [
        LEFT.record(folder.path(), 0..3000, 50_000_000),
        RIGHT.record(folder.path(), 0..2500, 8_000_000),
    ];
    let out = folder.path().join("frames.csv");
    let synced = recordings(&paths, Some(&out)).unwrap();
    assert_eq!(synced.notes, Vec::<String>::new());
    for (camera, found) in [LEFT, RIGHT].iter().zip(&synced.cameras) {
        let (ppm, within) =
            (found.clock.drift_ppm.unwrap(), found.clock.drift_uncertainty_ppm.unwrap());
        assert!((ppm - camera.error_ppm).abs() < within && within < 8.0, "{ppm} +-{within}");
        assert_eq!(found.serial, camera.name);
    }
    let pair = synced.pairs[0];
    assert!((pair.drift_ppm.unwrap() + 75.0).abs() < pair.drift_uncertainty_ppm.unwrap());
    // At the first common moment: the right camera's first frame.
    let passed_us = (RIGHT.host_ns(8_000_000) - NOW) as f64 * 1e-3 + 50e6;
    let truth = 8e6 - passed_us * (1.0 + 30e-6);
    let off_us = (pair.offset_us - truth).abs();
    assert!(off_us < pair.offset_uncertainty_us.unwrap(), "{pair:?}, {truth}");
    assert!((synced.common_s - 24.99).abs() < 0.005, "{}", synced.common_s);

    let rows = rows(&out);
    assert_eq!((rows.len() as u64, rows.len()), (synced.rows, 5500 - 60 - 50));
    assert!(rows.windows(2).all(|two| two[0][0] <= two[1][0]));
    let text = std::fs::read_to_string(&out).unwrap();
    for line in text.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |at: usize| cells[at].parse::<u64>().unwrap();
        let camera = [LEFT, RIGHT][number(1) as usize - 1];
        assert_eq!((cells[2], number(3)), (camera.name, 3));
        let off_us = number(0).abs_diff(camera.host_ns(number(5))) as f64 * 1e-3;
        assert!(off_us < cells[7].parse::<f64>().unwrap(), "{line}: {off_us} us");
        assert!(number(0) < number(6), "{line}");
    }
    let told = synced.to_string();
    assert!(told.contains("left, 2940 frames, clock +") && told.contains("5390 frames"), "{told}");
}

#[test]
fn a_recording_longer_than_the_window_follows_its_oscillator() {
    let folder = tempfile::tempdir().unwrap();
    // 40 minutes, in which two lines of the clock meet.
    let slow = Camera { name: "slow", error_ppm: 0.0, zero_us: 0 };
    let path = slow.record(folder.path(), 0..1, 0);
    let course = Course::of(&path).unwrap();
    let fit = |device_time_us: u64, host_us: u64| Fit {
        device_time_us,
        host_ns: NOW + host_us * 1000,
        ..course.fits[0]
    };
    let course = Course {
        fits: vec![fit(100_000_000, 100_000_100), fit(500_000_000, 500_000_500)],
        ..course
    };
    for (device_us, ahead_us) in
        [(0, 100), (100_000_000, 100), (300_000_000, 300), (500_000_000, 500), (900_000_000, 500)]
    {
        let expected = NOW + (device_us + ahead_us) * 1000;
        assert_eq!(course.host_ns(device_us).0, expected, "{device_us}");
    }
}

#[test]
fn what_cannot_be_synced_is_refused_in_one_line_and_writes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let left = LEFT.record(folder.path(), 0..300, 0);
    let fast = Camera { name: "fast", error_ppm: 2e6, zero_us: 0 }.record(folder.path(), 0..300, 0);
    let out = folder.path().join("frames.csv");
    let refused = |paths: &[&PathBuf], out: &Path| {
        let paths: Vec<PathBuf> = paths.iter().map(|&path| path.clone()).collect();
        let error = recordings(&paths, Some(out)).unwrap_err();
        crate::causes::in_one_line(&error)
    };
    for (said, words) in [
        (refused(&[&left, &left], &out), "named twice"),
        (refused(&[&left, &fast], &out), "3.000 times the computer's"),
        (refused(&[&left], &left), "one of the recordings"),
        (refused(&[&left], &folder.path().join("frames.parquet")), "ends in .csv"),
        (refused(&[&left, &folder.path().join("none.mcap")], &out), "cannot read the recording"),
    ] {
        assert!(said.contains(words) && !said.contains('\n'), "{said}");
    }
    assert!(!out.exists());
}

#[test]
fn short_recordings_and_recordings_apart_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let paths = [
        LEFT.record(folder.path(), 0..5, 50_000_000),
        RIGHT.record(folder.path(), 0..2500, 58_000_000),
    ];
    let synced = recordings(&paths, None).unwrap();
    assert_eq!(synced.common_s, 0.0);
    assert_eq!(synced.notes.len(), 2, "{:?}", synced.notes);
    assert!(synced.notes[0].contains("no time in common"), "{:?}", synced.notes);
    assert!(synced.notes[1].contains("left.mcap: too short"), "{:?}", synced.notes);
    assert_eq!((synced.pairs[0].drift_ppm, synced.rows), (None, 0));
    assert!(synced.to_string().contains("of unknown drift"), "{synced}");
}

#[test]
fn a_serial_number_with_a_comma_stays_one_field() {
    assert_eq!(field("virtual-1"), "virtual-1");
    assert_eq!(field("a,\"b\""), "\"a,\"\"b\"\"\"");
}
