//! What several tests need.

use nirspi_files::provenance::{Made, Origin, Provenance, Taken};

/// A provenance for tests of writers.
pub(crate) fn provenance() -> Provenance {
    let made = Made::by("nirspi 0.1.0", Some("0123456789ab"), ["nirspi", "demo"], 1_764_059_400);
    Taken::without_camera(Origin::Simulated).made(&made)
}
