//! Trains a network on a user's characters and stores the run in a folder, in builds with the
//! feature `train`.

mod data;
#[cfg(feature = "train")]
mod folder;
#[cfg(feature = "train")]
mod run;

pub use data::{Data, Found};
#[cfg(feature = "train")]
pub use folder::RunFolder;
#[cfg(feature = "train")]
pub use run::{Report, Request, Watch, run};
