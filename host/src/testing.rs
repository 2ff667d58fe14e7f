//! What several tests need.

use crate::provenance::{Camera, Made, Origin, Provenance, Taken};

/// A provenance for tests of writers.
pub fn provenance() -> Provenance {
    let made = Made::by("nirspi 0.1.0", Some("0123456789ab"), ["nirspi", "demo"], 1_764_059_400);
    let camera = Camera {
        board: "virtual".into(),
        serial: "virtual-1".into(),
        firmware: "0.1.0".into(),
        gateware: "0.4.0".into(),
        protocol: 1,
    };
    Taken { origin: Origin::Simulated, camera: Some(camera), file: None }.made(&made)
}
