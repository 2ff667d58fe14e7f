//! What several tests need.

use crate::files::FileError;
use crate::provenance::{Made, Origin, Provenance, Taken};
use std::path::PathBuf;

/// A provenance for tests of writers.
pub fn provenance() -> Provenance {
    let made = Made::by("nirspi 0.1.0", Some("0123456789ab"), ["nirspi", "demo"], 1_764_059_400);
    Taken::without_camera(Origin::Simulated).made(&made)
}

/// A file with these bytes, and the folder that keeps it.
pub fn file(name: &str, bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

/// An error's message, which is one line that names the file.
pub fn line(error: &FileError, name: &str) -> String {
    let message = error.to_string();
    assert!(message.lines().count() == 1 && message.contains(name), "{message}");
    message
}
