//! Each frame of an export keeps its own times.

use nirspi::export::{ExportOptions, Format, export};
use nirspi::recording::Recording;
use nirspi::tally::hear_recording;
use std::io::Read;
use std::path::{Path, PathBuf};

fn v1() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/recordings/v1.mcap")
}

#[test]
fn the_dataset_has_the_cameras_time_and_the_computers_of_each_frame() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("rec.parquet");
    let made = nirspi::provenance::Made::by("test", None, ["test"], 0);
    export(&v1(), &out, Format::Parquet, &ExportOptions::default(), &made).unwrap();
    let (mut device_us, mut host_ns) = (Vec::new(), Vec::new());
    hear_recording(&mut Recording::open(&v1()).unwrap(), |heard, _| {
        if let Some(frame) = heard.frame() {
            device_us.extend(frame.device_time_us.to_le_bytes());
            host_ns.extend(heard.time_ns.to_le_bytes());
        }
        Ok::<(), nirspi::recording::RecordingError>(())
    })
    .unwrap();
    assert_eq!(device_us.len(), 12 * 8);
    // Numbers stand one after another in a page, which is a gzip stream.
    let file = std::fs::read(&out).unwrap();
    let starts = file.windows(3).enumerate().filter(|(_, bytes)| bytes == b"\x1F\x8B\x08");
    let pages: Vec<Vec<u8>> = starts
        .map(|(at, _)| {
            let mut page = Vec::new();
            let _ = flate2::read::GzDecoder::new(&file[at..]).read_to_end(&mut page);
            page
        })
        .collect();
    let holds = |numbers: &[u8]| pages.iter().filter(|page| page.ends_with(numbers)).count();
    assert_eq!((holds(&device_us), holds(&host_ns)), (1, 1));
}
