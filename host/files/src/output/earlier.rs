//! What earlier runs wrote into a folder of results, so that a new run replaces that and nothing else.
//!
//! The folder has a hidden file with the names and checksums of each run's files. A file of another
//! checksum was changed by somebody and is no result any more.

use super::keep;
use crate::{FileError, read_small};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Read};
use std::path::Path;

/// The name of the hidden file.
const LIST: &str = ".nirspi.json";

/// The results in a folder, and those of the run under way.
#[derive(Debug, Default)]
pub(super) struct Earlier {
    runs: Vec<Run>,
    new: Run,
}

/// The files of a run, by name.
type Run = BTreeMap<String, Content>;

/// What tells whether a file was changed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Content {
    bytes: u64,
    crc32: u32,
}

impl Content {
    pub(super) fn of(bytes: &[u8]) -> Self {
        Self { bytes: bytes.len() as u64, crc32: crc32fast::hash(bytes) }
    }

    /// Of a file whose checksum was made while it was written.
    pub(super) fn new(bytes: u64, crc32: u32) -> Self {
        Self { bytes, crc32 }
    }

    fn of_file(path: &Path) -> io::Result<Self> {
        let (mut file, mut hasher) = (fs::File::open(path)?, crc32fast::Hasher::new());
        let mut piece = vec![0; 1 << 16];
        let mut bytes = 0;
        loop {
            match file.read(&mut piece)? {
                0 => return Ok(Self { bytes, crc32: hasher.finalize() }),
                read => {
                    bytes += read as u64;
                    hasher.update(&piece[..read]);
                }
            }
        }
    }
}

impl Earlier {
    /// Reads the list of a folder. A folder without a list, or with a damaged one, has no results.
    pub(super) fn of(folder: &Path) -> Self {
        let list = read_small(&folder.join(LIST)).ok();
        let runs = list.and_then(|text| serde_json::from_slice(&text).ok()).unwrap_or_default();
        Self { runs, new: Run::new() }
    }

    /// Whether the file of this name is a result of an earlier run, and as that run wrote it.
    pub(super) fn wrote(&self, path: &Path, name: &str) -> bool {
        let mut known = self.runs.iter().filter_map(|run| run.get(name)).peekable();
        known.peek().is_some()
            && fs::symlink_metadata(path).is_ok_and(|found| found.is_file())
            && Content::of_file(path).is_ok_and(|found| known.any(|content| *content == found))
    }

    /// Notes a file of the new run.
    pub(super) fn written(&mut self, name: &str, content: Content) {
        self.new.insert(name.to_owned(), content);
    }

    /// Removes what is left of the runs that the new one replaces, which are those with a file name
    /// in common, and writes the list.
    pub(super) fn replace(self, folder: &Path) -> Result<(), FileError> {
        let Self { runs, new } = self;
        if new.is_empty() {
            return Ok(());
        }
        let (replaced, mut runs): (Vec<Run>, Vec<Run>) =
            runs.into_iter().partition(|run| run.keys().any(|name| new.contains_key(name)));
        for (name, content) in replaced.iter().flatten() {
            let path = folder.join(name);
            let is_plain = Path::new(name).file_name().is_some_and(|plain| plain == &**name);
            if is_plain
                && !new.contains_key(name)
                && Content::of_file(&path).is_ok_and(|found| found == *content)
            {
                fs::remove_file(&path).map_err(|error| FileError::io(&path, "remove", error))?;
            }
        }
        runs.push(new);
        let list = serde_json::to_vec(&runs).unwrap_or_default();
        keep(&folder.join(LIST), &list)
    }
}
