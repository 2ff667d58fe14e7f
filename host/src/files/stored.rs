//! Reads the numbers of an uncompressed member of an archive on all threads, into memory of the
//! caller.
//!
//! # Invariant
//! The member's checksum covers all its bytes, whatever thread read them
//! (`measurement::tests::stack::a_changed_byte_of_a_stack_is_caught_by_the_checksum`).

use super::FileError;
use super::archive::damaged;
use super::array::Header;
use crc32fast::Hasher;
use rayon::prelude::*;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::PathBuf;

/// Numbers that one thread reads before it looks for more. Checksums of parts are joined one by
/// one, so parts are not small.
const PART: usize = 1 << 19;
/// Numbers that are decoded while a processor's cache still holds their bytes.
const PIECE: usize = 1 << 14;

/// Real numbers in C order that lie in a file as they are.
pub(super) struct Stored {
    pub(super) path: PathBuf,
    /// Name of the field.
    pub(super) field: String,
    pub(super) header: Header,
    /// Place of the member's first byte in the file.
    pub(super) start: u64,
    /// The member's checksum in the archive's directory.
    pub(super) crc32: u32,
    /// Number of the numbers.
    pub(super) count: usize,
}

impl Stored {
    /// Reads all numbers and says whether each is finite.
    ///
    /// # Errors
    /// [`FileError::Damaged`] if the system refuses the file, or the checksum is wrong.
    ///
    /// # Panics
    /// If `out` has not [`count`](Self::count) places.
    pub(super) fn read_into(&self, out: &mut [f64]) -> Result<bool, FileError> {
        assert_eq!(out.len(), self.count, "places for the numbers");
        let wrong = |what: String| damaged(&self.path, format!("`{}`: {what}", self.field));
        let (mut whole, finite) = self.parts(out).map_err(|error| wrong(error.to_string()))?;
        whole.0.combine(&whole.1);
        match whole.0.finalize() == self.crc32 {
            true => Ok(finite),
            false => Err(wrong("Invalid checksum".to_owned())),
        }
    }

    /// The checksums of the header and of the numbers, and whether each number is finite.
    fn parts(&self, out: &mut [f64]) -> io::Result<((Hasher, Hasher), bool)> {
        let mut header = Vec::new();
        let mut file = self.at(0)?;
        file.by_ref().take(self.header.header_bytes).read_to_end(&mut header)?;
        let mut before = Hasher::new();
        before.update(&header);
        let size = self.header.number_bytes();
        let read = |(part, out): (usize, &mut [f64])| -> io::Result<(Hasher, bool)> {
            let mut file = self.at(self.header.header_bytes + (part * PART * size) as u64)?;
            let (mut sum, mut finite) = (Hasher::new(), true);
            let mut bytes = vec![0; PIECE.min(out.len()) * size];
            for out in out.chunks_mut(PIECE) {
                let bytes = &mut bytes[..out.len() * size];
                file.read_exact(bytes)?;
                sum.update(bytes);
                self.header.decode_into(bytes, out);
                // Without an early end, so that the compiler uses vectors.
                finite &= out.iter().fold(true, |finite, value| finite & value.is_finite());
            }
            Ok((sum, finite))
        };
        let parts: Vec<_> = out.par_chunks_mut(PART).enumerate().map(read).collect();
        let (mut after, mut finite) = (Hasher::new(), true);
        for part in parts {
            let (sum, is_finite) = part?;
            after.combine(&sum);
            finite &= is_finite;
        }
        Ok(((before, after), finite))
    }

    /// The file, at this byte of the member.
    fn at(&self, byte: u64) -> io::Result<File> {
        let mut file = File::open(&self.path)?;
        file.seek(SeekFrom::Start(self.start + byte))?;
        Ok(file)
    }
}
