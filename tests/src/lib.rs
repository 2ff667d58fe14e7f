//! Shared parts of the end-to-end tests.

pub mod debugger;
pub mod elf;
pub mod emulated;
pub mod figures;
pub mod firmware;
pub mod pages;
pub mod tamper;
pub mod tapped;
pub mod throughput;

use std::path::{Path, PathBuf};

/// Root of the repository.
#[must_use]
pub fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

/// Folder of real measurements, `$NIRSPI_DATA`; `None`, with a printed message, if it does not exist.
#[must_use]
pub fn data() -> Option<PathBuf> {
    let given = std::env::var_os("NIRSPI_DATA").map(PathBuf::from);
    if let Some(folder) = given.filter(|folder| folder.is_dir()) {
        return Some(folder);
    }
    // Prints past the test harness's capture, so that a skipped test is visible.
    use std::io::Write;
    let _ = writeln!(std::io::stderr(), "skipped: no data (NIRSPI_DATA)");
    None
}
