//! Damage in a recording costs what it hits, and is reported.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use super::made;
use nirspi::account::LossCounters;
use nirspi::causes::in_one_line;
use nirspi::identity::CameraIdentity;
use nirspi::recording::{
    Opening, Recorder, Recording, RunAccount, Target, recover, tally_recording,
};
use nirspi::setup::MeasurementSetup;
use nirspi_recon::Order;
use std::path::{Path, PathBuf};

const RUN: u16 = 3;
const FRAMES: u32 = 150;

/// A whole recording of 150 frames of 51 patterns.
fn recorded(folder: &Path) -> PathBuf {
    let path = folder.join("rec.mcap");
    let identity = CameraIdentity {
        capabilities: vec!["depth".into()],
        ..CameraIdentity::current("virtual", "A-17")
    };
    let setup = MeasurementSetup::new(&Order::CakeCutting, 0.05).unwrap();
    let target = Target::New(path.clone());
    let opening = Opening::of(&identity, &setup, RUN);
    let mut recorder = Recorder::create(&target, &opening).unwrap();
    for sequence in 0..FRAMES {
        let values = (0..setup.rows.len() as i64).map(|k| k * 77 - i64::from(sequence) * 13);
        let frame = made::frame(RUN, sequence, u64::from(sequence) * 82, values.collect());
        recorder.packet(&frame).unwrap();
    }
    recorder.packet(&made::ended(RUN, FRAMES, 12_300)).unwrap();
    let counters = LossCounters { received: FRAMES.into(), ..Default::default() };
    let made = Some(FRAMES.into());
    let account = RunAccount { counters, asked: Some(FRAMES), made, ..RunAccount::default() };
    recorder.finish(&account).unwrap();
    path
}

/// The packets of a recording, and what is wrong with the file.
fn read(path: &Path) -> (Vec<Vec<u8>>, Option<String>) {
    let mut recording = Recording::open(path).unwrap();
    let packets = recording.by_ref().map(|packet| packet.unwrap().bytes).collect();
    (packets, recording.end().cut_short.clone())
}

/// The times of the packets of a recording.
fn times(path: &Path) -> Vec<u64> {
    Recording::open(path).unwrap().map(|packet| packet.unwrap().time_ns).collect()
}

/// Number of the found packets that are packets of the recording, in their order.
fn in_order(found: &[Vec<u8>], of: &[Vec<u8>]) -> usize {
    let (mut rest, mut count) = (of, 0);
    for packet in found {
        if let Some(at) = rest.iter().position(|other| other == packet) {
            rest = &rest[at + 1..];
            count += 1;
        }
    }
    count
}

/// Bytes of a chunk without compression before its records: kind, length, times, sizes, checksum.
const CHUNK_HEAD: usize = 49;

/// Places of the chunks: their lengths decide how everything in them is read.
fn chunk_heads(bytes: &[u8]) -> Vec<usize> {
    let number = |at: usize| u64::from_le_bytes(*bytes[at..].first_chunk().unwrap());
    let is_head =
        |&at: &usize| bytes[at] == 6 && number(at + 1) == number(at + 41).wrapping_add(40);
    (0..bytes.len() - CHUNK_HEAD).filter(is_head).collect()
}

#[test]
fn one_damaged_byte_costs_no_more_than_two_packets() {
    let folder = tempfile::tempdir().unwrap();
    let path = recorded(folder.path());
    let (packets, cut_short) = read(&path);
    assert_eq!((packets.len(), cut_short), (FRAMES as usize + 1, None));
    let whole = std::fs::read(&path).unwrap();
    let head = [15, 4, 0, 0, 0, 0, 0, 0, 0];
    let data_end = whole.windows(9).rposition(|bytes| bytes == head).unwrap();
    let damaged = folder.path().join("damaged.mcap");
    let heads = chunk_heads(&whole);
    assert!(!heads.is_empty());
    let heads = heads.into_iter().flat_map(|head| head..head + CHUNK_HEAD);
    for at in (0..whole.len()).step_by(97).chain(0..400).chain(heads) {
        for flip in [0x01, 0x80] {
            let mut bytes = whole.clone();
            bytes[at] ^= flip;
            std::fs::write(&damaged, &bytes).unwrap();
            let (found, told) = read(&damaged);
            let sound = in_order(&found, &packets);
            assert!(
                sound + 2 >= packets.len(),
                "{sound} packets with byte {at} ^ {flip}: {told:?}"
            );
            assert!(told.is_some() || at > data_end, "byte {at} ^ {flip} went unnoticed");
        }
    }
}

#[test]
fn many_damaged_places_cost_what_they_hit() {
    let folder = tempfile::tempdir().unwrap();
    let path = recorded(folder.path());
    let (packets, _) = read(&path);
    let mut bytes = std::fs::read(&path).unwrap();
    let length = bytes.len();
    // A block of a disk that is gone, and scattered bits.
    bytes[length / 2..length / 2 + 512].fill(0);
    for at in (length / 8..length / 4).step_by(997) {
        bytes[at] ^= 0x10;
    }
    let scattered = (length / 8).div_ceil(997) + 1;
    std::fs::write(&path, &bytes).unwrap();
    let (found, told) = read(&path);
    let sound = in_order(&found, &packets);
    // A packet with its record is 250 bytes.
    assert!(sound + 2 * scattered + 5 >= packets.len(), "{sound} of {}", packets.len());
    assert!(told.as_ref().is_some_and(|told| told.contains("bytes lost at")), "{told:?}");

    let whole = folder.path().join("whole.mcap");
    let recovered = recover(&path, &whole, false).unwrap();
    assert!(recovered.bytes_lost > 0 && recovered.frames_lost.unwrap() > 0, "{recovered}");
    let (again, told) = read(&whole);
    assert_eq!((again, told), (found, None));
    let before = times(&path);
    assert!(before.is_sorted() && before[0] < before[before.len() - 1]);
    assert_eq!(times(&whole), before);
    let mut recording = Recording::open(&whole).unwrap();
    let counters = tally_recording(&mut recording).unwrap().account().counters();
    let account = recording.end().account.clone().unwrap();
    assert_eq!((account.counters, counters), (recovered.frames, recovered.frames));
    assert_eq!(counters.total(), u64::from(FRAMES));
    assert!(account.missing.unwrap().contains("recovered, "));
}

#[test]
fn a_recording_cut_at_any_place_keeps_what_is_before() {
    let folder = tempfile::tempdir().unwrap();
    let v1 = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/recordings/v1.mcap");
    for path in [recorded(folder.path()), v1] {
        let (packets, _) = read(&path);
        let whole = std::fs::read(&path).unwrap();
        let cut = folder.path().join("cut.mcap");
        let mut most = 0;
        for at in (0..whole.len()).step_by(997).chain(whole.len() - 60..whole.len()) {
            std::fs::write(&cut, &whole[..at]).unwrap();
            match Recording::open(&cut) {
                Ok(_) => {
                    let (found, told) = read(&cut);
                    assert!(told.is_some(), "cut at {at} went unnoticed");
                    assert_eq!(found, packets[..found.len()], "cut at {at}");
                    assert!(found.len() >= most);
                    most = found.len();
                }
                Err(error) => assert_eq!(in_one_line(&error).lines().count(), 1, "{error}"),
            }
        }
        assert_eq!(most, packets.len());
    }
}

#[test]
fn what_stands_before_the_packets_stands_at_the_end_too() {
    let folder = tempfile::tempdir().unwrap();
    let path = recorded(folder.path());
    let mut bytes = std::fs::read(&path).unwrap();
    let setup = Recording::open(&path).unwrap().setup;
    let rows = bytes.windows(8).position(|part| part == b"\"rows\":[").unwrap();
    // Another row, which the setup's own checks do not notice.
    let digit = rows + 8 + bytes[rows + 8..].iter().position(|byte| *byte == b'3').unwrap();
    bytes[digit] = b'5';
    std::fs::write(&path, &bytes).unwrap();
    let opened = Recording::open(&path).unwrap();
    assert_eq!(opened.setup, setup);
    // Without its end, the recording says that the setup is damaged.
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    let error = Recording::open(&path).err().unwrap().to_string();
    assert!(
        error.contains("the recording's setup does not read: its checksum is wrong"),
        "{error}"
    );
}

#[test]
fn a_file_of_another_program_is_refused_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other.mcap");
    for use_chunks in [false, true] {
        let file = std::io::BufWriter::new(std::fs::File::create(&path).unwrap());
        let options = mcap::WriteOptions::new().profile("ros2").use_chunks(use_chunks);
        let mut writer = options.create(file).unwrap();
        let channel = writer.add_channel(0, "/image", "cdr", &Default::default()).unwrap();
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence: 0,
            log_time: 1,
            publish_time: 1,
        };
        writer.write_to_known_channel(&header, b"abc\0").unwrap();
        writer.finish().unwrap();
        let error = Recording::open(&path).err().unwrap().to_string();
        assert!(error.contains("other.mcap: an MCAP file of profile \"ros2\""), "{error}");
        assert_eq!(error.lines().count(), 1);
    }
}
