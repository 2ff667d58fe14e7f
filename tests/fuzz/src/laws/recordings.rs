//! Recordings, read and recovered.

use crate::{Law, MIB, place, read, seeds};
use nirspi::recording::tally_recording;
use nirspi::recording::{Recording, RecordingInfo, recover};
use nirspi::source::{Source, SourceOptions};
use std::path::Path;

pub const LAWS: &[Law] = &[
    Law {
        name: "recordings",
        reads: "a recording (MCAP), whole, cut or damaged",
        readers: &[
            "host/record/src/recording/reader.rs",
            "host/record/src/recording/scan.rs",
            "host/record/src/recording/info.rs",
            "host/record/src/recording/hear.rs",
            "host/camera/src/tally.rs",
            "host/src/source/recording.rs",
        ],
        holds: recordings,
        seeds: recording_seeds,
        longest: 32_768,
        most_memory: MEMORY,
    },
    Law {
        name: "recover",
        reads: "a damaged recording, whose packets are copied into a whole one",
        readers: &["host/record/src/recording/recover.rs", "host/record/src/recording/scan.rs"],
        holds: recovered,
        seeds: recording_seeds,
        longest: 32_768,
        most_memory: MEMORY,
    },
];

/// The longest record, and what is kept beside it. The writer's queue and its chunks of 1 MiB are among them.
const MEMORY: usize = 192 * MIB;

fn recording_seeds() -> Vec<Vec<u8>> {
    let whole = seeds::recording();
    // Most of a whole file are schemas; the rest is read alike without its end.
    let cut = whole[..whole.len() * 3 / 5].to_vec();
    vec![whole, cut]
}

/// The packets of a file that opens.
fn packets(path: &Path) -> Option<(Vec<nirspi::recording::Packet>, nirspi::recording::End)> {
    let mut recording = read(Recording::open(path))?;
    let all: Vec<_> = recording.by_ref().map_while(read).collect();
    assert!(recording.next().is_none(), "a packet after the end");
    Some((all, recording.end().clone()))
}

fn recordings(bytes: &[u8]) {
    let path = place::file("input.mcap", bytes);
    if let Some(info) = read(RecordingInfo::read(&path)) {
        info.to_string().lines().for_each(crate::is_one_line);
        assert!(serde_json::to_string(&info).is_ok());
    }
    let Some((all, end)) = packets(&path) else { return };
    let length: usize = all.iter().map(|packet| packet.bytes.len()).sum();
    assert!(length <= bytes.len(), "{length} bytes of packets in a file of {}", bytes.len());
    assert_eq!(end.packets, all.len() as u64);
    assert!(end.damage.bytes <= bytes.len() as u64, "{:?}", end.damage);
    if let Some(cut) = &end.cut_short {
        crate::is_one_line(cut);
    }
    let mut recording = Recording::open(&path).expect("it opened");
    if let Some(tally) = read(tally_recording(&mut recording)) {
        let counters = tally.account().counters();
        assert!(counters.received <= all.len() as u64, "{counters:?} of {} packets", all.len());
    }
    for keep_leak in [false, true] {
        let options = SourceOptions { keep_leak, ..SourceOptions::default() };
        for source in read(Source::read_all(&path, &options)).unwrap_or_default() {
            let image = nirspi_recon::reconstruct::hadamard(&source.measurements);
            assert!(image.pixels().iter().all(|pixel| pixel.is_finite()), "an image with gaps");
        }
    }
}

fn recovered(bytes: &[u8]) {
    let path = place::file("damaged.mcap", bytes);
    let (once, twice) = (place::path("once.mcap"), place::path("twice.mcap"));
    for old in [&once, &twice] {
        let _ = std::fs::remove_file(old);
    }
    let before = packets(&path);
    let Some(made) = read(recover(&path, &once, false)) else {
        assert!(!once.exists(), "a file of nothing stays");
        return;
    };
    let (before, _) = before.expect("it was recovered");
    made.to_string().lines().for_each(crate::is_one_line);
    // What was read of the damaged file is in the new one, and nothing else.
    let (after, end) = packets(&once).expect("the new file opens");
    assert_eq!(after, before, "other packets");
    assert_eq!(made.packets, after.len() as u64);
    assert!(made.frames.received <= made.packets);
    assert_eq!((end.cut_short, end.damage.bytes), (None, 0), "the new file is damaged");
    let account = end.account.expect("the new file has an account");
    assert_eq!(account.counters, made.frames);
    // Recovering a whole file changes nothing.
    let again = recover(&once, &twice, false).expect("a whole file");
    assert_eq!((again.packets, again.damage, again.frames), (made.packets, None, made.frames));
    let (last, end) = packets(&twice).expect("the second file opens");
    assert_eq!(last, after);
    assert_eq!(end.account, Some(account));
}
