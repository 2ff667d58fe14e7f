//! Each frame of an export keeps its own times.

use nirspi::export::{ExportOptions, Format, export};
use nirspi::recording::{Recording, hear_recording};
use std::io::Read;
use std::path::{Path, PathBuf};

fn v1() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/recordings/v1.mcap")
}

#[test]
fn an_npz_has_the_cameras_time_and_the_computers_of_each_frame() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("rec.npz");
    let made = nirspi::provenance::Made::by("test", None, ["test"], 0);
    export(&v1(), &out, Format::Npz, &ExportOptions::default(), &made).unwrap();
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
    let mut npz = zip::ZipArchive::new(std::fs::File::open(&out).unwrap()).unwrap();
    for (field, numbers) in [("device_time_us", device_us), ("time_ns", host_ns)] {
        let mut bytes = Vec::new();
        npz.by_name(&format!("{field}.npy")).unwrap().read_to_end(&mut bytes).unwrap();
        assert!(bytes.ends_with(&numbers), "{field}");
    }
}
