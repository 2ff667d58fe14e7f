//! Where an archive's files are and where its table goes.

use super::shelf::{LocalShelf, Shelf};
use super::{ArchiveError, files};
use crate::files::FileError;
use crate::files::output::write_in_pieces;
use std::fs::File;
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};

/// A file that is read at any position.
pub(super) trait Source: Read + Seek {}
impl<T: Read + Seek> Source for T {}

/// An open file.
pub(super) struct Opened<'p> {
    pub source: Box<dyn Source + 'p>,
    /// Size of the file.
    pub bytes: u64,
}

/// A folder or a file.
#[derive(Debug)]
pub(super) struct Place(PathBuf);

impl Place {
    /// The place that a path names.
    pub(super) fn of(path: &Path) -> Self {
        Self(path.to_owned())
    }

    /// The path.
    pub(super) fn shown(&self) -> &Path {
        &self.0
    }

    /// The measurement files of this folder and the folders below (see [`files::find`]).
    pub(super) fn find(&self) -> Result<Vec<String>, ArchiveError> {
        files::find(&self.0)
    }

    /// Calls `read` with the path of a file of this folder.
    pub(super) fn with_file<T>(
        &self,
        name: &str,
        read: impl FnOnce(&Path) -> Result<T, String>,
    ) -> Result<T, String> {
        read(&files::path_of(&self.0, name))
    }

    /// Where the parts of this table are kept while it is made.
    pub(super) fn shelf(&self) -> Result<Box<dyn Shelf + '_>, ArchiveError> {
        Ok(Box::new(LocalShelf::of(&self.0)?))
    }

    /// Writes this file, whole or not at all. Returns its size in bytes.
    pub(super) fn write_whole<E: From<FileError>>(
        &self,
        write: impl FnOnce(&mut dyn Write) -> Result<(), E>,
    ) -> Result<u64, E> {
        write_in_pieces(&self.0, |file| write(file))?;
        Ok(std::fs::metadata(&self.0).map_or(0, |file| file.len()))
    }

    /// Opens this file; `None` if no such file exists.
    pub(super) fn open(&self) -> Result<Option<Opened<'_>>, FileError> {
        let path = &self.0;
        if !path.exists() {
            return Ok(None);
        }
        let unread = |error| FileError::io(path, "read", error);
        let file = File::open(path).map_err(unread)?;
        let bytes = file.metadata().map_err(unread)?.len();
        Ok(Some(Opened { source: Box::new(file), bytes }))
    }
}
