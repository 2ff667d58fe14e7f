//! A hidden file for numbers on their way into a result.

use super::{Staged, hidden};
use crate::error::FileError;
use std::fs;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;

/// A hidden file beside a result, with numbers that become part of the result later. It is removed when it is dropped.
#[derive(Debug)]
pub struct Spool {
    file: fs::File,
    _staged: Staged,
}

impl Spool {
    /// A new, empty one, beside this result.
    ///
    /// # Errors
    /// [`FileError`] if the folder is missing, or the system refuses.
    pub fn beside(target: &Path) -> Result<Self, FileError> {
        hidden(target).map(|(file, _staged)| Self { file, _staged })
    }
}

impl Write for Spool {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Read for Spool {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.file.read(bytes)
    }
}

impl Seek for Spool {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}
