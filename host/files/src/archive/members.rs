//! Writes a NumPy `.npz` archive member by member: arrays that are larger than the memory.

use crate::FileError;
use crate::output::{Existing, write_in_pieces};
use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::Path;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// An archive that is being written. Its members are not compressed, because readings are noise for a compressor.
pub struct Members<'m> {
    zip: ZipWriter<Until<'m>>,
    path: &'m Path,
}

/// Writes an archive, whole or not at all. `fill` writes its members.
///
/// # Errors
/// As [`write_in_pieces`], and the errors of `fill`.
pub fn write_members<E: From<FileError>>(
    path: &Path,
    existing: Existing<'_>,
    fill: impl FnOnce(&mut Members<'_>) -> Result<(), E>,
) -> Result<(), E> {
    write_in_pieces(path, existing, |file| {
        let mut members =
            Members { zip: ZipWriter::new(Until { file, at: 0, ended: false }), path };
        fill(&mut members)?;
        members.zip.finish().map_err(|error| FileError::io(path, "write", error.into()))?;
        Ok(())
    })
}

impl Members<'_> {
    /// Begins the member of a field. The bytes of its `.npy` file follow by [`write`](Self::write).
    ///
    /// # Errors
    /// [`FileError`] names the archive.
    pub fn begin(&mut self, field: &str) -> Result<(), FileError> {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .large_file(true);
        self.zip
            .start_file(format!("{field}{}", super::MEMBER_SUFFIX), options)
            .map_err(|error| FileError::io(self.path, "write", error.into()))
    }

    /// Writes bytes of the member that was begun.
    ///
    /// # Errors
    /// [`FileError`] names the archive.
    pub fn write(&mut self, bytes: &[u8]) -> Result<(), FileError> {
        self.zip.write_all(bytes).map_err(|error| FileError::io(self.path, "write", error))
    }

    /// Writes a whole member.
    ///
    /// # Errors
    /// [`FileError`] names the archive.
    pub fn add(&mut self, field: &str, bytes: &[u8]) -> Result<(), FileError> {
        self.begin(field)?;
        self.write(bytes)
    }
}

/// A file that takes bytes until its first error, and lets what follows go by. A `ZipWriter` that is dropped after an
/// error tries to write its index all the same, and prints why it cannot; the first error is ours to tell.
struct Until<'m> {
    file: &'m mut BufWriter<File>,
    /// Where the next bytes go, or would go.
    at: u64,
    ended: bool,
}

impl Write for Until<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let taken = if self.ended { Ok(bytes.len()) } else { self.file.write(bytes) };
        self.ended |= taken.is_err();
        self.at += *taken.as_ref().unwrap_or(&0) as u64;
        taken
    }

    fn flush(&mut self) -> io::Result<()> {
        let flushed = if self.ended { Ok(()) } else { self.file.flush() };
        self.ended |= flushed.is_err();
        flushed
    }
}

impl Seek for Until<'_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let at = match to {
            _ if !self.ended => self.file.seek(to),
            SeekFrom::Start(at) => Ok(at),
            SeekFrom::Current(by) | SeekFrom::End(by) => Ok(self.at.saturating_add_signed(by)),
        };
        self.ended |= at.is_err();
        self.at = *at.as_ref().unwrap_or(&self.at);
        at
    }
}
