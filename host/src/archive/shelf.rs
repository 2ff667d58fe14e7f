//! Where the parts of an unfinished table are kept: a folder beside the table, `TABLE.parts`.
//!
//! # Invariant
//! A part counts when its line can be read, and its line is written when its file is whole. So a
//! run that is killed at any moment can be continued from the last line
//! (`super::tests::a_killed_run_loses_the_group_in_hand_alone`).

use super::ArchiveError;
use crate::files::FileError;
use crate::files::output::{write_atomic, write_in_pieces};
use crate::parquet::Group;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// The file with the head of the list.
pub(super) const LIST: &str = "list.jsonl";

/// The parts of an unfinished table.
pub(super) trait Shelf {
    /// The folder, for messages.
    fn folder(&self) -> &Path;

    /// Whether a run is kept here.
    fn is_begun(&self) -> Result<bool, ArchiveError>;

    /// Begins a run with this head of its list. The head appears whole.
    ///
    /// # Errors
    /// [`ArchiveError::Unfinished`] if another process has begun one meanwhile.
    fn begin(&mut self, head: &str) -> Result<(), ArchiveError>;

    /// Takes the run for this process, and returns its list: the head, and the line of each part.
    /// The last line may be torn.
    ///
    /// # Errors
    /// [`ArchiveError::Busy`] if another process has the run.
    fn take(&mut self) -> Result<Vec<Vec<u8>>, ArchiveError>;

    /// Size of the file of a part in bytes; `None` if there is no such file.
    fn bytes_of(&self, part: usize) -> Option<u64>;

    /// Keeps the first `lines` lines of the list, which have `bytes` bytes together, and forgets the
    /// others.
    fn keep(&mut self, lines: usize, bytes: u64) -> Result<(), ArchiveError>;

    /// Adds a part: its file, then its line.
    ///
    /// # Errors
    /// [`ArchiveError::Busy`] if another process has added this part.
    fn add(&mut self, part: usize, groups: &[Group], line: &str) -> Result<(), ArchiveError>;

    /// Opens the file of a part.
    fn part(&self, part: usize) -> Result<Box<dyn Read + '_>, FileError>;

    /// Removes the parts, when the table is whole. If they cannot be removed, `--resume` makes the
    /// table again.
    fn clear(self: Box<Self>);
}

/// The folder of a run that makes the table `out`.
pub(super) fn folder_of(out: &Path) -> PathBuf {
    let mut name = out.as_os_str().to_owned();
    name.push(".parts");
    name.into()
}

/// The name of the file of a part.
pub(super) fn part_name(part: usize) -> String {
    format!("{part:06}.rows")
}

/// A folder of this computer. Its list is one file with a line for each part.
pub(super) struct LocalShelf {
    out: PathBuf,
    folder: PathBuf,
    list: Option<File>,
}

impl LocalShelf {
    /// The folder beside `out`.
    ///
    /// # Errors
    /// [`FileError`] if `out` is a folder, or the folder of `out` cannot be used.
    pub(super) fn of(out: &Path) -> Result<Self, FileError> {
        if out.is_dir() {
            return Err(FileError::kind(out, "a folder", "a file to write"));
        }
        let parent = out.parent().filter(|parent| !parent.as_os_str().is_empty());
        let parent = parent.unwrap_or(Path::new("."));
        std::fs::metadata(parent).map_err(|error| FileError::io(parent, "write to", error))?;
        Ok(Self { out: out.to_owned(), folder: folder_of(out), list: None })
    }

    fn path(&self) -> PathBuf {
        self.folder.join(LIST)
    }

    fn list(&mut self) -> Result<&mut File, ArchiveError> {
        let folder = &self.folder;
        self.list.as_mut().ok_or_else(|| ArchiveError::Journal(folder.clone()))
    }
}

impl Shelf for LocalShelf {
    fn folder(&self) -> &Path {
        &self.folder
    }

    fn is_begun(&self) -> Result<bool, ArchiveError> {
        Ok(self.path().exists())
    }

    fn begin(&mut self, head: &str) -> Result<(), ArchiveError> {
        // A list appears whole: a folder without one is of a run that was killed at once.
        std::fs::create_dir_all(&self.folder)
            .map_err(|error| FileError::io(&self.folder, "create", error))?;
        Ok(write_atomic(&self.path(), head.as_bytes())?)
    }

    fn take(&mut self) -> Result<Vec<Vec<u8>>, ArchiveError> {
        let path = self.path();
        let unread = |error| FileError::io(&path, "read", error);
        let mut list = OpenOptions::new().read(true).write(true).open(&path).map_err(unread)?;
        match list.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(ArchiveError::Busy(self.out.clone())),
            // A file system without locks.
            Err(TryLockError::Error(_)) => {}
        }
        let mut text = Vec::new();
        list.read_to_end(&mut text).map_err(unread)?;
        self.list = Some(list);
        Ok(text.split_inclusive(|&byte| byte == b'\n').map(<[u8]>::to_vec).collect())
    }

    fn bytes_of(&self, part: usize) -> Option<u64> {
        Some(std::fs::metadata(self.folder.join(part_name(part))).ok()?.len())
    }

    fn keep(&mut self, _lines: usize, bytes: u64) -> Result<(), ArchiveError> {
        let path = self.path();
        let list = self.list()?;
        list.set_len(bytes)
            .and_then(|()| list.seek(SeekFrom::End(0)))
            .map_err(|error| FileError::io(&path, "write", error))?;
        Ok(())
    }

    fn add(&mut self, part: usize, groups: &[Group], line: &str) -> Result<(), ArchiveError> {
        let path = self.folder.join(part_name(part));
        write_in_pieces(&path, |file| {
            let write = |group: &Group| file.write_all(&group.bytes);
            groups.iter().try_for_each(write).map_err(|error| FileError::io(&path, "write", error))
        })?;
        let path = self.path();
        let list = self.list()?;
        list.write_all(line.as_bytes())
            .and_then(|()| list.sync_data())
            .map_err(|error| FileError::io(&path, "write", error))?;
        Ok(())
    }

    fn part(&self, part: usize) -> Result<Box<dyn Read + '_>, FileError> {
        let path = self.folder.join(part_name(part));
        let file = File::open(&path).map_err(|error| FileError::io(&path, "read", error))?;
        Ok(Box::new(BufReader::new(file)))
    }

    fn clear(self: Box<Self>) {
        let Self { folder, list, .. } = *self;
        // The list is closed first: some systems keep a folder with an open file.
        drop(list);
        let _ = std::fs::remove_dir_all(folder);
    }
}
