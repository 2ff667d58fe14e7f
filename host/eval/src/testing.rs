//! What several tests need.

use nirspi::provenance::{Made, Origin, Provenance, Taken};

/// Where the files of tests come from.
pub fn provenance() -> Provenance {
    let made = Made::by("nirspi 0.1.0", Some("0123456789ab"), ["nirspi", "pairs"], 1_764_059_400);
    Taken::without_camera(Origin::Simulated).made(&made)
}
