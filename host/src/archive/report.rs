//! The report of an archive.

use super::journal::{ABOUT, About, difference};
use super::{ArchiveError, Shard};
use crate::files::FileError;
use crate::parquet;
use nirspi_recon::words::count;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::fmt;
use std::io::{Read, Seek};
use std::path::{Path, PathBuf};

/// An item without rows.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Skipped {
    /// The file, relative to the archive's folder.
    pub file: String,
    /// Why it gives no image.
    pub reason: String,
}

/// What was made of an archive.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ArchiveReport {
    /// The table, a path or an address without its password.
    pub out: PathBuf,
    /// Number of files, or of other items.
    pub files: usize,
    /// Files that earlier runs had done.
    pub files_before: usize,
    /// Rows of the table.
    pub rows: u64,
    /// Size of the table.
    pub bytes: u64,
    /// Files without an image.
    pub skipped: Vec<Skipped>,
    /// Files worked on at a time; 0 if the table was whole before.
    pub jobs: usize,
    /// The share of the files.
    pub shard: Shard,
    /// What a file is called here.
    #[serde(skip)]
    pub noun: &'static str,
    /// Time of this run.
    pub seconds: f64,
}

impl ArchiveReport {
    /// Whether every file gave an image.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.skipped.is_empty()
    }

    /// What is missing, in one line; `None` if nothing is.
    #[must_use]
    pub fn complaint(&self) -> Option<String> {
        let files = count(self.files as u64, self.noun);
        (!self.is_whole())
            .then(|| format!("{} of {files} gave no image and have no row", self.skipped.len()))
    }
}

impl fmt::Display for ArchiveReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { out, files, files_before, rows, bytes, jobs, seconds, .. } = self;
        let (rows, megabytes) = (count(*rows, "image"), *bytes as f64 / 1e6);
        let of = count(*files as u64, self.noun);
        write!(f, "{}: {rows} of {of}, {megabytes:.1} MB", out.display())?;
        if self.shard != Shard::WHOLE {
            write!(f, ", share {}", self.shard)?;
        }
        match (files_before, files - files_before) {
            (_, 0) => write!(f, ", made by an earlier run"),
            (0, _) => write!(f, ", {jobs} at a time, {seconds:.1} s"),
            (before, new) => {
                write!(f, ", {before} by earlier runs, {new} in {seconds:.1} s, {jobs} at a time")
            }
        }
    }
}

/// The report of a table that an earlier run made.
pub(super) fn of_whole_table(
    out: &Path,
    mut table: impl Read + Seek,
    bytes: u64,
    settings: &Map<String, Value>,
    noun: &'static str,
) -> Result<ArchiveReport, ArchiveError> {
    let about = parquet::about(&mut table, ABOUT);
    let about = about.map_err(|error| FileError::io(out, "read", error))?;
    let about: Option<About> = about.and_then(|text| serde_json::from_slice(&text).ok());
    let about = about.ok_or_else(|| ArchiveError::NoTable(out.to_owned()))?;
    if let Some(difference) = difference(&about.settings, settings) {
        return Err(ArchiveError::Settings { path: out.to_owned(), difference });
    }
    let shard = settings.get("shard").and_then(Value::as_str).and_then(|s| s.parse().ok());
    Ok(ArchiveReport {
        out: out.to_owned(),
        files: about.files,
        files_before: about.files,
        rows: about.rows,
        bytes,
        skipped: about.skipped,
        jobs: 0,
        shard: shard.unwrap_or(Shard::WHOLE),
        noun,
        seconds: 0.0,
    })
}
