//! The parts of an unfinished table in an object store: `TABLE.parts/list.jsonl` with the head of the
//! list, and for each part `000000.rows` and its line, `000000.json`.
//!
//! # Invariant
//! Of two processes that make one table, one ends with [`ArchiveError::Busy`] and the table is that
//! of one process, where the store can refuse to write over an object
//! (`super::tests::of_two_processes_one_is_told`).

use super::Stored;
use crate::archive::ArchiveError;
use crate::archive::shelf::{LIST, Shelf, part_name};
use crate::files::FileError;
use crate::parquet::Group;
use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;
use std::time::SystemTime;

/// The parts beside a table in a store.
pub(in crate::archive) struct StoreShelf<'o> {
    out: &'o Stored,
    folder: Stored,
    /// Objects of the folder with their sizes, when the run was taken.
    there: BTreeMap<String, u64>,
    begun: bool,
    /// A word that no other process has, so that a line says who has written it.
    own: String,
}

fn line_name(part: usize) -> String {
    format!("{part:06}.json")
}

impl<'o> StoreShelf<'o> {
    /// The parts beside `out`.
    pub(in crate::archive) fn of(out: &'o Stored) -> Result<Self, FileError> {
        let folder = out.with_ending(".parts");
        let there: BTreeMap<String, u64> = folder.names()?.into_iter().collect();
        let begun = there.contains_key(LIST);
        let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let own = format!("{}-{}\n", std::process::id(), since.as_nanos());
        Ok(Self { out, folder, there, begun, own })
    }

    fn busy(&self) -> ArchiveError {
        ArchiveError::Busy(self.out.shown().to_owned())
    }
}

impl Shelf for StoreShelf<'_> {
    fn folder(&self) -> &Path {
        self.folder.shown()
    }

    fn is_begun(&self) -> Result<bool, ArchiveError> {
        Ok(self.begun)
    }

    fn begin(&mut self, head: &str) -> Result<(), ArchiveError> {
        let written = self.folder.join(LIST).create(format!("{head}{}", self.own).as_bytes())?;
        if !written {
            return Err(ArchiveError::Unfinished(self.folder().to_owned()));
        }
        // Parts without a head: their table was whole when their removal was interrupted.
        Ok(self.folder.remove(std::mem::take(&mut self.there).into_keys())?)
    }

    fn take(&mut self) -> Result<Vec<Vec<u8>>, ArchiveError> {
        // What stands after the first line is the word of its writer.
        let line_of = |name: &str| -> Result<Option<Vec<u8>>, FileError> {
            let text = self.folder.join(name).get()?;
            let line = |text: Vec<u8>| {
                text.split_inclusive(|&b| b == b'\n').next().unwrap_or_default().to_vec()
            };
            Ok(text.map(line))
        };
        let mut lines: Vec<Vec<u8>> = line_of(LIST)?.into_iter().collect();
        for part in 0.. {
            let name = line_name(part);
            let line = if self.there.contains_key(&name) { line_of(&name)? } else { None };
            match line {
                Some(line) => lines.push(line),
                None => break,
            }
        }
        Ok(lines)
    }

    fn bytes_of(&self, part: usize) -> Option<u64> {
        self.there.get(&part_name(part)).copied()
    }

    fn keep(&mut self, lines: usize, _bytes: u64) -> Result<(), ArchiveError> {
        let kept = lines.saturating_sub(1);
        let is_line_after = |name: &&String| {
            let part = name.strip_suffix(".json").and_then(|part| part.parse::<usize>().ok());
            part.is_some_and(|part| part >= kept)
        };
        let gone: Vec<String> = self.there.keys().filter(is_line_after).cloned().collect();
        Ok(self.folder.remove(gone)?)
    }

    fn add(&mut self, part: usize, groups: &[Group], line: &str) -> Result<(), ArchiveError> {
        let bytes = groups.iter().flat_map(|group| &group.bytes).copied().collect();
        self.folder.join(&part_name(part)).put(bytes)?;
        let line = format!("{line}{}", self.own);
        match self.folder.join(&line_name(part)).create(line.as_bytes())? {
            true => Ok(()),
            false => Err(self.busy()),
        }
    }

    fn part(&self, part: usize) -> Result<Box<dyn Read + '_>, FileError> {
        let object = self.folder.join(&part_name(part));
        let bytes = object.get()?.ok_or_else(|| {
            FileError::io(object.shown(), "read", std::io::ErrorKind::NotFound.into())
        })?;
        Ok(Box::new(std::io::Cursor::new(bytes)))
    }

    fn clear(self: Box<Self>) {
        // The head goes first: parts without a head belong to no run.
        if self.folder.remove([LIST.to_owned()]).is_ok()
            && let Ok(names) = self.folder.names()
        {
            let _ = self.folder.remove(names.into_iter().map(|(name, _)| name));
        }
    }
}
