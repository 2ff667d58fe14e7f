//! Reconstructs a whole archive of measurements into one table: many files, several jobs, one
//! writer, and a run that can be continued.
//!
//! ```text
//! files ──> jobs (a file each, in any order) ──> rows in the order of the files ──> groups ──> table
//! ```
//!
//! # Invariant
//! The table does not depend on the number of jobs, on the order in which files are done, or on
//! interruptions: the same files and settings give the same bytes
//! (`tests::jobs_and_interruptions_change_no_byte`). A run that is killed loses the group in hand
//! and no group that was written (`tests::a_killed_run_loses_the_group_in_hand_alone`). A file that
//! gives no image is listed with the reason and has no row
//! (`tests::bad_files_are_listed_and_the_others_are_there`).

mod error;
mod files;
#[cfg(feature = "virtual-camera")]
mod grid;
mod journal;
#[cfg(feature = "enhance")]
mod networks;
mod pipeline;
mod place;
mod report;
mod rows;
mod shelf;
#[cfg(test)]
mod tests;

use crate::dataset::{ARCHIVE, Row, Rows};
use crate::files::FileError;
use crate::parquet::Table;
pub use error::ArchiveError;
pub use files::{Shard, find};
#[cfg(feature = "virtual-camera")]
pub use grid::{Grid, GridAxes, GridError};
use journal::{About, Journal};
use place::{Opened, Place};
pub use report::{ArchiveReport, Skipped};
pub use rows::{ImageFiles, RowReader, RowsError};
use serde_json::{Map, Value};
use std::num::NonZeroUsize;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Most rows of a group. A killed run loses at most so many.
const GROUP_ROWS: usize = 256;
/// Bytes of values from which on a group is full.
const GROUP_BYTES: usize = 32 << 20;

/// Whether rows are enough for a group.
fn is_full(rows: &Rows) -> bool {
    rows.count() >= GROUP_ROWS || rows.bytes() >= GROUP_BYTES
}

/// What gives the rows of a table, item by item.
pub trait Work: Sync {
    /// The name of each item. A table has the items in this order.
    fn names(&self) -> &[String];

    /// What an item is called in reports, in the singular.
    fn noun(&self) -> &'static str {
        "file"
    }

    /// What the rows depend on. A run is continued only with the same settings.
    fn settings(&self) -> Map<String, Value>;

    /// The rows of an item. The error says in one line why an item has no rows.
    ///
    /// # Errors
    /// The reason in one line.
    fn rows(&self, item: usize) -> Result<Vec<Row>, String>;
}

/// How to make a table.
#[derive(Debug, Clone)]
pub struct ArchiveOptions {
    /// The table to write, a Parquet file: a path.
    pub out: PathBuf,
    /// Number of items to work on at a time; `None` means as many as the machine has cores.
    pub jobs: Option<NonZeroUsize>,
    /// Whether to continue a run that was interrupted.
    pub resume: bool,
    /// The share of the items that the table is to have.
    pub shard: Shard,
}

/// The progress of a run.
#[derive(Debug, Clone, Copy)]
pub struct Progress {
    /// Items done, those of earlier runs among them.
    pub done: usize,
    /// Items of this table.
    pub items: usize,
    /// Items without an image so far.
    pub skipped: usize,
}

/// Makes the table. `stop` ends the run after the items in hand; what is written stays, and a later
/// run continues there.
///
/// # Errors
/// [`ArchiveError`] if the table cannot be written, or an interrupted run does not fit. Items
/// without an image are no error: [`ArchiveReport::skipped`] lists them.
pub fn archive(
    work: &(impl Work + ?Sized),
    options: &ArchiveOptions,
    stop: &AtomicBool,
    watch: &mut dyn FnMut(Progress),
) -> Result<ArchiveReport, ArchiveError> {
    archive_to(&Place::of(&options.out), work, options, stop, watch)
}

fn archive_to(
    place: &Place,
    work: &(impl Work + ?Sized),
    options: &ArchiveOptions,
    stop: &AtomicBool,
    watch: &mut dyn FnMut(Progress),
) -> Result<ArchiveReport, ArchiveError> {
    let began = Instant::now();
    let ArchiveOptions { resume, shard, .. } = options;
    let out = place.shown();
    let jobs = options.jobs.or_else(|| std::thread::available_parallelism().ok());
    let jobs = jobs.map_or(1, NonZeroUsize::get);
    let mine: Vec<usize> = shard.of(work.names().len()).collect();
    let names: Vec<&str> = mine.iter().map(|&item| &*work.names()[item]).collect();
    let mut settings = work.settings();
    settings.insert("shard".to_owned(), shard.to_string().into());
    settings.insert("nirspi".to_owned(), env!("CARGO_PKG_VERSION").into());
    let shelf = place.shelf()?;
    if *resume
        && !shelf.is_begun()?
        && let Some(Opened { mut source, bytes }) = place.open()?
    {
        return report::of_whole_table(out, &mut source, bytes, &settings, work.noun());
    }
    let mut journal = Journal::open(place, shelf, *resume, &settings, &names)?;
    let before = journal.done();
    // The list of the first run counts: files that came later are not in this table.
    let names = journal.names().to_vec();
    let item_of = |name: &String| work.names().iter().position(|known| known == name);
    let items: Vec<Option<usize>> = match names.iter().eq(mine.iter().map(|&i| &work.names()[i])) {
        true => mine.into_iter().map(Some).collect(),
        false => names.iter().map(item_of).collect(),
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(jobs)
        .thread_name(|k| format!("archive-{k}"))
        .build()
        .map_err(|error| ArchiveError::Threads(error.to_string()))?;
    let mut rows = Rows::new(&ARCHIVE);
    let mut skipped = journal.skipped().len();
    let progress = |done, skipped| Progress { done, items: names.len(), skipped };
    watch(progress(before, skipped));
    let make = |at: usize| match items[at] {
        Some(item) => pool.install(|| work.rows(item)),
        None => Err("the file is no longer there".to_owned()),
    };
    pipeline::in_order(before..names.len(), jobs, make, |at, made| {
        if stop.load(Ordering::Relaxed) {
            return Err(ArchiveError::Stopped {
                out: out.to_owned(),
                done: at,
                items: names.len(),
            });
        }
        match made {
            Ok(made) => {
                for row in &made {
                    rows.add(row);
                    if is_full(&rows) {
                        journal.add_group(rows.take().map_err(|error| io_error(out, error))?);
                    }
                }
            }
            Err(reason) => {
                skipped += 1;
                journal.skip(Skipped { file: names[at].clone(), reason });
            }
        }
        // A part ends with an item, so that a later run begins with the next one.
        if journal.has_groups() {
            if rows.count() > 0 {
                journal.add_group(rows.take().map_err(|error| io_error(out, error))?);
            }
            journal.write_part(at + 1)?;
        }
        watch(progress(at + 1, skipped));
        Ok(())
    })?;
    if rows.count() > 0 {
        journal.add_group(rows.take().map_err(|error| io_error(out, error))?);
    }
    journal.write_part(names.len())?;
    let written = journal.join(&settings)?;
    Ok(ArchiveReport {
        out: out.to_owned(),
        files: names.len(),
        files_before: before,
        rows: written.rows,
        bytes: written.bytes,
        skipped: written.skipped,
        jobs,
        shard: *shard,
        noun: work.noun(),
        seconds: began.elapsed().as_secs_f64(),
    })
}

/// Writes the rows of some items as a table of their own, whole or not at all: the part of a larger
/// table that one worker of a cluster makes. The bytes follow from the items and the settings.
///
/// # Errors
/// [`ArchiveError`] if the table cannot be written or the run is stopped. Items without an image are
/// no error: [`ArchiveReport::skipped`] lists them.
pub fn archive_part(
    work: &(impl Work + ?Sized),
    items: Range<usize>,
    out: &Path,
    stop: &AtomicBool,
) -> Result<ArchiveReport, ArchiveError> {
    let began = Instant::now();
    let place = Place::of(out);
    let out = place.shown();
    let failed = |error| io_error(out, error);
    let count = work.names().len();
    let names = work.names().get(items.clone());
    let names = names.ok_or(ArchiveError::Range { start: items.start, end: items.end, count })?;
    let (mut total, mut skipped) = (0, Vec::new());
    let bytes = place.write_whole(|file| -> Result<(), ArchiveError> {
        let mut table = Table::begin(file, &ARCHIVE).map_err(failed)?;
        let mut rows = Rows::new(&ARCHIVE);
        for (done, (item, name)) in items.clone().zip(names).enumerate() {
            if stop.load(Ordering::Relaxed) {
                return Err(ArchiveError::Stopped {
                    out: out.to_owned(),
                    done,
                    items: names.len(),
                });
            }
            match work.rows(item) {
                Err(reason) => skipped.push(Skipped { file: name.clone(), reason }),
                Ok(made) => {
                    for row in &made {
                        rows.add(row);
                        total += 1;
                        if is_full(&rows) {
                            table.group(&rows.take().map_err(failed)?).map_err(failed)?;
                        }
                    }
                }
            }
        }
        if rows.count() > 0 {
            table.group(&rows.take().map_err(failed)?).map_err(failed)?;
        }
        let mut settings = work.settings();
        settings.insert("items".to_owned(), format!("{}..{}", items.start, items.end).into());
        let about = About::new(settings, names.len(), total, skipped.clone());
        table.end(&about.metadata()).map_err(failed)
    })?;
    Ok(ArchiveReport {
        out: out.to_owned(),
        files: names.len(),
        files_before: 0,
        rows: total,
        bytes,
        skipped,
        jobs: 1,
        shard: Shard::WHOLE,
        noun: work.noun(),
        seconds: began.elapsed().as_secs_f64(),
    })
}

fn io_error(out: &Path, error: std::io::Error) -> ArchiveError {
    FileError::io(out, "write", error).into()
}
