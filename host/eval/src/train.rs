//! Training of a network on a user's characters, kept in a folder as it learns.

mod data;
mod folder;
mod run;

pub use data::{Data, Found};
pub use folder::RunFolder;
pub use run::{Report, Request, Watch, run};
