//! Why an archive gives no table.

use crate::files::FileError;
use std::path::PathBuf;
use thiserror::Error;

/// Why an archive gives no table.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ArchiveError {
    /// A file or folder cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The folder has no measurements.
    #[error(
        "{}: no measurement files in the folder, expected at least one of {expected}",
        .folder.display()
    )]
    NoFiles {
        /// The folder.
        folder: PathBuf,
        /// The endings of measurement files.
        expected: String,
    },
    /// An earlier run was interrupted.
    #[error(
        "{}: an earlier run was interrupted: continue it with --resume, or remove this folder to begin anew",
        .0.display()
    )]
    Unfinished(PathBuf),
    /// An earlier run had other settings.
    #[error(
        "{}: made with other settings ({difference}): use the same settings, or another --out",
        .path.display()
    )]
    Settings {
        /// The table, or the folder of an interrupted run.
        path: PathBuf,
        /// The first setting that differs.
        difference: String,
    },
    /// A file that is no table of this program has the table's name.
    #[error("{}: no table of `nirspi reconstruct` that --resume could continue: choose another --out", .0.display())]
    NoTable(PathBuf),
    /// The list of an interrupted run cannot be read.
    #[error("{}: the list of the interrupted run is damaged: remove its folder to begin anew", .0.display())]
    Journal(PathBuf),
    /// Another process writes the same table.
    #[error("{}: another process writes this table", .0.display())]
    Busy(PathBuf),
    /// The run was stopped.
    #[error("{}: stopped after {done} of {items} files: continue with --resume", .out.display())]
    Stopped {
        /// The table.
        out: PathBuf,
        /// Files done.
        done: usize,
        /// Files of the table.
        items: usize,
    },
    /// There are fewer items.
    #[error("items {start} to {end}, expected a part of 0 to {count}")]
    Range {
        /// The first item.
        start: usize,
        /// The item after the last.
        end: usize,
        /// Number of items.
        count: usize,
    },
    /// The system gives no threads.
    #[error("no threads for the jobs: {0}")]
    Threads(String),
}
