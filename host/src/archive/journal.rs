//! A run that is not finished: groups of rows as they will stand in the table, and a list that says
//! which are whole.

use super::place::Place;
use super::shelf::Shelf;
use super::{ArchiveError, Skipped};
use crate::dataset::{ARCHIVE, DATASET_VERSION};
use crate::files::FileError;
use crate::parquet::{Group, GroupShape, Table};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// Version of the list and of the table's metadata.
const VERSION: u32 = 1;

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
pub(super) struct Journal<'p> {
    out: &'p Place,
    shelf: Box<dyn Shelf + 'p>,
    head: Head,
    parts: Vec<Part>,
    /// Groups and skipped items of the part in hand.
    groups: Vec<Group>,
    skipped: Vec<Skipped>,
}

impl<'p> Journal<'p> {
    /// Begins a run, or continues one.
    pub(super) fn open(
        out: &'p Place,
        mut shelf: Box<dyn Shelf + 'p>,
        resume: bool,
        settings: &Map<String, Value>,
        names: &[&str],
    ) -> Result<Self, ArchiveError> {
        match shelf.is_begun()? {
            true if !resume => return Err(ArchiveError::Unfinished(shelf.folder().to_owned())),
            true => {}
            false => {
                let names = names.iter().map(|&name| name.to_owned()).collect();
                let head = Head { version: VERSION, settings: settings.clone(), names };
                shelf.begin(&line_of(&head))?;
            }
        }
        let list = shelf.take()?;
        let mut lines = list.iter();
        let first = lines.next().map_or(&[][..], Vec::as_slice);
        let head: Head = serde_json::from_slice(first)
            .ok()
            .filter(|head: &Head| head.version == VERSION)
            .ok_or_else(|| ArchiveError::Journal(shelf.folder().to_owned()))?;
        if let Some(difference) = difference(&head.settings, settings) {
            return Err(ArchiveError::Settings { path: shelf.folder().to_owned(), difference });
        }
        let (mut parts, mut end): (Vec<Part>, usize) = (Vec::new(), first.len());
        for line in lines {
            // The last line may be torn, and a disk may have lost a part.
            let part = serde_json::from_slice::<Part>(line).ok().filter(|part| {
                line.ends_with(b"\n") && shelf.bytes_of(parts.len()) == Some(part.bytes())
            });
            let Some(part) = part else { break };
            end += line.len();
            parts.push(part);
        }
        shelf.keep(1 + parts.len(), end as u64)?;
        Ok(Self { out, shelf, head, parts, groups: Vec::new(), skipped: Vec::new() })
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
        let shapes = groups.iter().map(|group| group.shape.clone()).collect();
        let part = Part { done, groups: shapes, skipped: std::mem::take(&mut self.skipped) };
        self.shelf.add(self.parts.len(), &groups, &line_of(&part))?;
        self.parts.push(part);
        Ok(())
    }

    /// Puts the parts together to the table, and removes them.
    pub(super) fn join(self, settings: &Map<String, Value>) -> Result<Written, ArchiveError> {
        let skipped = self.skipped();
        let Self { out, shelf, parts, head, .. } = self;
        let rows = parts.iter().flat_map(|part| &part.groups).map(GroupShape::rows).sum();
        let about = About::new(settings.clone(), head.names.len(), rows, skipped.clone());
        let failed = |error| FileError::io(out.shown(), "write", error);
        let bytes = out.write_whole(|file| -> Result<(), ArchiveError> {
            let mut table = Table::begin(file, &ARCHIVE).map_err(failed)?;
            for (k, part) in parts.iter().enumerate() {
                let mut bytes = shelf.part(k)?;
                for group in &part.groups {
                    table.kept(group, &mut bytes).map_err(failed)?;
                }
            }
            Ok(table.end(&about.metadata()).map_err(failed)?)
        })?;
        shelf.clear();
        Ok(Written { rows, bytes, skipped })
    }
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
