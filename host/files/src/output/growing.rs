//! A result that grows piece by piece, can be read while it grows, and whose first bytes are written last.

use super::earlier::Content;
use super::{Staged, hidden};
use crate::error::FileError;
use std::fs;
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::Path;

/// A file of a folder of results under its hidden name, such as an array whose length is not known yet. It is removed
/// when it is dropped.
#[derive(Debug)]
pub struct Growing {
    name: String,
    /// Number of the first bytes, which are written last.
    beginning: usize,
    file: BufWriter<fs::File>,
    staged: Staged,
    /// The checksum and the number of the bytes after the beginning.
    hasher: crc32fast::Hasher,
    bytes: u64,
}

impl Growing {
    pub(super) fn new(target: &Path, name: &str, beginning: usize) -> Result<Self, FileError> {
        let (file, staged) = hidden(target)?;
        let mut file = BufWriter::with_capacity(1 << 16, file);
        file.write_all(&vec![0; beginning])
            .map_err(|error| FileError::io(target, "write", error))?;
        let hasher = crc32fast::Hasher::new();
        Ok(Self { name: name.to_owned(), beginning, file, staged, hasher, bytes: 0 })
    }

    /// Reads again what was written: bytes after the beginning, from `from` on.
    ///
    /// # Errors
    /// The system's, and that of a place beyond the end.
    pub fn read_at(&mut self, from: u64, bytes: &mut [u8]) -> io::Result<()> {
        self.file.flush()?;
        let file = self.file.get_mut();
        file.seek(SeekFrom::Start(self.beginning as u64 + from))?;
        let read = file.read_exact(bytes);
        file.seek(SeekFrom::End(0))?;
        read
    }

    /// Keeps this number of bytes after the beginning, and drops those behind them. Bytes that the disk has not taken are
    /// among these.
    ///
    /// # Errors
    /// The system's, and that of a file that is not as long.
    pub fn cut(self, bytes: u64) -> io::Result<Self> {
        // What waits in the memory is not written: it may not fit.
        let (mut file, _) = self.file.into_parts();
        let end = self.beginning as u64 + bytes;
        file.set_len(file.metadata()?.len().min(end))?;
        file.seek(SeekFrom::Start(self.beginning as u64))?;
        let mut hasher = crc32fast::Hasher::new();
        let mut some = vec![0; 1 << 16];
        let mut left = bytes;
        while left > 0 {
            let part = &mut some[..left.min(1 << 16) as usize];
            file.read_exact(part)?;
            hasher.update(part);
            left -= part.len() as u64;
        }
        let file = BufWriter::with_capacity(1 << 16, file);
        Ok(Self { file, hasher, bytes, ..self })
    }

    pub(super) fn finish(
        self,
        folder: &Path,
        beginning: &[u8],
    ) -> Result<(String, Content, Staged), FileError> {
        assert_eq!(beginning.len(), self.beginning, "length of the beginning of {}", self.name);
        let Self { name, file, staged, hasher, bytes, .. } = self;
        let written = || -> io::Result<()> {
            let mut file = file.into_inner().map_err(io::IntoInnerError::into_error)?;
            file.seek(SeekFrom::Start(0))?;
            file.write_all(beginning)?;
            file.sync_all()
        };
        written().map_err(|error| FileError::io(&folder.join(&name), "write", error))?;
        let mut all = crc32fast::Hasher::new();
        all.update(beginning);
        all.combine(&hasher);
        let content = Content::new(beginning.len() as u64 + bytes, all.finalize());
        Ok((name, content, staged))
    }
}

impl Write for Growing {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.file.write(bytes)?;
        self.hasher.update(&bytes[..written]);
        self.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}
