//! This program in the provenance of what it writes.

use nirspi::identity::CameraIdentity;
use nirspi::provenance::{Made, Origin, Provenance, Taken};
use std::sync::LazyLock;

static MADE: LazyLock<Made> = LazyLock::new(|| {
    Made::now(
        concat!("nirspi ", env!("CARGO_PKG_VERSION")),
        option_env!("NIRSPI_COMMIT"),
        std::env::args_os().map(|argument| argument.to_string_lossy().into_owned()),
    )
});

/// This program, its command line and the time of its first question for them.
pub fn made() -> &'static Made {
    &MADE
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
