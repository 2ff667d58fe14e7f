//! Training of a network on a user's characters, kept in a folder as it learns: in builds with the feature `train`.

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
