//! The folder of a run that is not finished: groups of rows as they will stand in the table, and a
//! list that says which are whole.
//!
//! # Invariant
//! A part counts when its line is in the list, and its line is written when its file is whole and
//! synced. So a run that is killed at any moment can be continued from the last line
//! (`super::tests::a_killed_run_loses_the_group_in_hand_alone`).

use super::{ArchiveError, Skipped};
use crate::dataset::{ARCHIVE, DATASET_VERSION};
use crate::files::FileError;
use crate::files::output::{write_atomic, write_in_pieces};
use crate::parquet::{Group, GroupShape, Table};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Version of the list and of the table's metadata.
const VERSION: u32 = 1;
const LIST: &str = "list.jsonl";

/// The first line of the list.
#[derive(Debug, Serialize, Deserialize)]
struct Head {
    version: u32,
    settings: Map<String, Value>,
    names: Vec<String>,
}

/// A further line: a part of the table.
#[derive(Debug, Serialize, Deserialize)]
struct Part {
    /// Items that are done with this part.
    done: usize,
    groups: Vec<GroupShape>,
    skipped: Vec<Skipped>,
}

impl Part {
    fn bytes(&self) -> u64 {
        self.groups.iter().map(GroupShape::bytes).sum()
    }
}

/// What a table says about itself, as JSON under [`ABOUT`] in its metadata.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct About {
    pub(super) version: u32,
    pub(super) settings: Map<String, Value>,
    pub(super) files: usize,
    pub(super) rows: u64,
    pub(super) skipped: Vec<Skipped>,
}

impl About {
    pub(super) fn new(
        settings: Map<String, Value>,
        files: usize,
        rows: u64,
        skipped: Vec<Skipped>,
    ) -> Self {
        Self { version: VERSION, settings, files, rows, skipped }
    }

    /// The table's own metadata.
    pub(super) fn metadata(&self) -> Vec<(&'static str, String)> {
        let about = serde_json::to_string(self).unwrap_or_default();
        vec![("nirspi.dataset", DATASET_VERSION.to_owned()), (ABOUT, about)]
    }
}

/// The key of [`About`] in a table's metadata.
pub(super) const ABOUT: &str = "nirspi.archive";

/// The table as it was written.
pub(super) struct Written {
    pub(super) rows: u64,
    pub(super) bytes: u64,
    pub(super) skipped: Vec<Skipped>,
}

/// An open run.
pub(super) struct Journal {
    out: PathBuf,
    folder: PathBuf,
    list: File,
    head: Head,
    parts: Vec<Part>,
    /// Groups and skipped items of the part in hand.
    groups: Vec<Group>,
    skipped: Vec<Skipped>,
}

/// The folder of a run that makes the table `out`.
pub(super) fn folder_of(out: &Path) -> PathBuf {
    let mut name = out.as_os_str().to_owned();
    name.push(".parts");
    name.into()
}

impl Journal {
    /// Begins a run, or continues one.
    pub(super) fn open(
        out: &Path,
        resume: bool,
        settings: &Map<String, Value>,
        names: &[&str],
    ) -> Result<Self, ArchiveError> {
        let folder = folder_of(out);
        let path = folder.join(LIST);
        if path.exists() && !resume {
            return Err(ArchiveError::Unfinished(folder));
        }
        if out.is_dir() {
            return Err(FileError::kind(out, "a folder", "a file to write").into());
        }
        let parent = out.parent().filter(|parent| !parent.as_os_str().is_empty());
        if let Err(error) = std::fs::metadata(parent.unwrap_or(Path::new("."))) {
            let parent = parent.unwrap_or(Path::new("."));
            return Err(FileError::io(parent, "write to", error).into());
        }
        if !path.exists() {
            // A list appears whole: a folder without one is of a run that was killed at once.
            std::fs::create_dir_all(&folder)
                .map_err(|error| FileError::io(&folder, "create", error))?;
            let names = names.iter().map(|&name| name.to_owned()).collect();
            let head = Head { version: VERSION, settings: settings.clone(), names };
            write_atomic(&path, line_of(&head).as_bytes())?;
        }
        let io_error = |error| FileError::io(&path, "read", error);
        let mut list = OpenOptions::new().read(true).write(true).open(&path).map_err(io_error)?;
        match list.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(ArchiveError::Busy(out.to_owned())),
            // A file system without locks.
            Err(TryLockError::Error(_)) => {}
        }
        let mut text = Vec::new();
        list.read_to_end(&mut text).map_err(io_error)?;
        let mut lines = text.split_inclusive(|&byte| byte == b'\n');
        let first = lines.next().unwrap_or_default();
        let head: Head = serde_json::from_slice(first)
            .ok()
            .filter(|head: &Head| head.version == VERSION)
            .ok_or_else(|| ArchiveError::Journal(folder.clone()))?;
        if let Some(difference) = difference(&head.settings, settings) {
            return Err(ArchiveError::Settings { path: folder, difference });
        }
        let (mut parts, mut end): (Vec<Part>, usize) = (Vec::new(), first.len());
        for line in lines {
            // The last line may be torn, and a disk may have lost a part.
            let part = serde_json::from_slice::<Part>(line).ok().filter(|part| {
                let file = std::fs::metadata(part_path(&folder, parts.len()));
                line.ends_with(b"\n") && file.is_ok_and(|file| file.len() == part.bytes())
            });
            let Some(part) = part else { break };
            end += line.len();
            parts.push(part);
        }
        list.set_len(end as u64)
            .and_then(|()| list.seek(SeekFrom::End(0)))
            .map_err(|error| FileError::io(&path, "write", error))?;
        let (groups, skipped) = (Vec::new(), Vec::new());
        Ok(Self { out: out.to_owned(), folder, list, head, parts, groups, skipped })
    }

    /// The items of the table.
    pub(super) fn names(&self) -> &[String] {
        &self.head.names
    }

    /// Items that earlier parts hold.
    pub(super) fn done(&self) -> usize {
        self.parts.last().map_or(0, |part| part.done)
    }

    /// Items without rows so far.
    pub(super) fn skipped(&self) -> Vec<Skipped> {
        let before = self.parts.iter().flat_map(|part| &part.skipped);
        before.chain(&self.skipped).cloned().collect()
    }

    pub(super) fn add_group(&mut self, group: Group) {
        self.groups.push(group);
    }

    pub(super) fn has_groups(&self) -> bool {
        !self.groups.is_empty()
    }

    pub(super) fn skip(&mut self, skipped: Skipped) {
        self.skipped.push(skipped);
    }

    /// Writes the groups in hand. With them, `done` items are done.
    pub(super) fn write_part(&mut self, done: usize) -> Result<(), ArchiveError> {
        if done == self.done() {
            return Ok(());
        }
        let groups = std::mem::take(&mut self.groups);
        let path = part_path(&self.folder, self.parts.len());
        write_in_pieces(&path, |file| {
            let write = |group: &Group| file.write_all(&group.bytes);
            groups.iter().try_for_each(write).map_err(|error| FileError::io(&path, "write", error))
        })?;
        let shapes = groups.into_iter().map(|group| group.shape).collect();
        let part = Part { done, groups: shapes, skipped: std::mem::take(&mut self.skipped) };
        self.list
            .write_all(line_of(&part).as_bytes())
            .and_then(|()| self.list.sync_data())
            .map_err(|error| FileError::io(&self.folder.join(LIST), "write", error))?;
        self.parts.push(part);
        Ok(())
    }

    /// Puts the parts together to the table, and removes their folder.
    pub(super) fn join(self, settings: &Map<String, Value>) -> Result<Written, ArchiveError> {
        let Self { out, folder, parts, head, .. } = &self;
        let skipped = self.skipped();
        let rows = parts.iter().flat_map(|part| &part.groups).map(GroupShape::rows).sum();
        let about = About::new(settings.clone(), head.names.len(), rows, skipped.clone());
        write_in_pieces(out, |file| -> Result<(), FileError> {
            let failed = |error| FileError::io(out, "write", error);
            let mut table = Table::begin(file, &ARCHIVE).map_err(failed)?;
            for (k, part) in parts.iter().enumerate() {
                let path = part_path(folder, k);
                let unread = |error| FileError::io(&path, "read", error);
                let mut bytes = BufReader::new(File::open(&path).map_err(unread)?);
                for group in &part.groups {
                    table.kept(group, &mut bytes).map_err(failed)?;
                }
            }
            table.end(&about.metadata()).map_err(failed)
        })?;
        let bytes = std::fs::metadata(out).map_or(0, |file| file.len());
        // The table is whole. If the folder cannot be removed, --resume joins it again.
        let folder = folder.clone();
        drop(self);
        let _ = std::fs::remove_dir_all(folder);
        Ok(Written { rows, bytes, skipped })
    }
}

fn part_path(folder: &Path, part: usize) -> PathBuf {
    folder.join(format!("{part:06}.rows"))
}

fn line_of(value: &impl Serialize) -> String {
    format!("{}\n", serde_json::to_string(value).unwrap_or_default())
}

/// The first setting that differs, in words.
pub(super) fn difference(
    found: &Map<String, Value>,
    expected: &Map<String, Value>,
) -> Option<String> {
    let keys = expected.keys().chain(found.keys());
    let show = |value: Option<&Value>| value.map_or_else(|| "nothing".to_owned(), Value::to_string);
    let differs = keys.into_iter().find(|&key| found.get(key) != expected.get(key));
    differs.map(|key| {
        let (found, expected) = (show(found.get(key)), show(expected.get(key)));
        format!("{key}: found {found}, expected {expected}")
    })
}
