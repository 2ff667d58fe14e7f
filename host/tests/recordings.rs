//! Recordings of every released protocol version open and give what they gave when they were made.
//!
//! If a test in this file fails, do not change the test or the recordings: somebody's measurements have become unreadable.

use nirspi::recording::{Recording, tally_recording};
use std::path::{Path, PathBuf};

fn recording(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/recordings").join(name)
}

/// Made by version 0.1.0: `nirspi capture --camera virtual --frames 12 --sampling 0.25 --out v1.mcap`.
#[test]
fn a_recording_of_version_1_opens_and_loses_nothing() {
    let mut opened = Recording::open(&recording("v1.mcap")).unwrap();
    assert_eq!(opened.identity.protocol, 1);
    let tally = tally_recording(&mut opened).unwrap();
    let (integrated, counters) = (tally.integrated(), tally.account().counters());
    assert_eq!((counters.received, counters.total()), (12, 12));
    assert_eq!(integrated.frames(), 12);
    let means = integrated.means(&opened.setup);
    assert_eq!(means.len(), 256);
    let rounded: Vec<i64> = means[..4].iter().map(|mean| (mean * 1e6).round() as i64).collect();
    assert_eq!(rounded, V1_FIRST_MEANS_MILLIONTHS);
}

/// Mean ADC counts a sample of the first four patterns, in millionths.
const V1_FIRST_MEANS_MILLIONTHS: [i64; 4] =
    [2_227_222_222, 189_222_222, 48_250_000, -1_497_722_222];

#[test]
fn a_recording_of_a_newer_version_says_to_update_the_program() {
    let bytes = std::fs::read(recording("v1.mcap")).unwrap();
    let at = bytes.windows(14).position(|part| part == b"nirspi-wire-v1").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("v9.mcap");
    let mut newer = bytes;
    newer[at + 13] = b'9';
    std::fs::write(&path, newer).unwrap();
    let error = Recording::open(&path).err().unwrap().to_string();
    assert!(error.contains("nirspi-wire-v9") && error.contains("update this program"), "{error}");
}
