//! The RTL against the golden model.
#![expect(clippy::unwrap_used, reason = "a failed unwrap in a helper fails its test")]

mod bench;
mod equivalence;
mod host;
mod map;
mod modules;
mod mutation;
mod parallel;
mod rig;
mod scenario;
mod stale;

use nirspi_hdl_sim::{pins, project};
