//! This program in the provenance of what it writes.

use nirspi::identity::CameraIdentity;
use nirspi::provenance::{Made, Origin, Provenance, Taken};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

static MADE: OnceLock<Made> = OnceLock::new();
static PROGRAM: OnceLock<PathBuf> = OnceLock::new();

/// Keeps the command line, and the time of everything that this run writes.
pub fn begin(arguments: &[OsString]) {
    let program = concat!("nirspi ", env!("CARGO_PKG_VERSION"));
    let first = arguments.first();
    let arguments = arguments.iter().map(|argument| argument.to_string_lossy());
    let _ = MADE.set(Made::now(program, crate::COMMIT, arguments));
    // In Python, the executable is the interpreter.
    let own = std::env::current_exe().ok();
    let own = own.filter(|path| path.file_stem().is_some_and(|name| name == "nirspi"));
    let _ = PROGRAM.set(own.unwrap_or_else(|| first.map_or("nirspi".into(), PathBuf::from)));
}

/// Where the program is.
pub fn program() -> &'static Path {
    PROGRAM.get().map_or(Path::new("nirspi"), PathBuf::as_path)
}

/// This program, its command line and the time at which it began.
#[expect(clippy::expect_used, reason = "the program begins with it")]
pub fn made() -> &'static Made {
    MADE.get().expect("begun")
}

/// What this program makes of a camera's readings.
pub fn of_camera(camera: &CameraIdentity) -> Provenance {
    Taken::by(camera).made(made())
}

/// What this program makes with models of light and camera.
pub fn simulated() -> Provenance {
    Taken::without_camera(Origin::Simulated).made(made())
}

/// What this program makes without readings: times, comparisons.
pub fn computed() -> Provenance {
    Taken::without_camera(Origin::Computed).made(made())
}
