//! Reads the numbers of an uncompressed member of an archive on all threads, into memory of the
//! caller or group by group.
//!
//! # Invariant
//! The member's checksum covers all its bytes, whatever thread read them
//! (`measurement::tests::stack::a_changed_byte_of_a_stack_is_caught_by_the_checksum`).

use super::FileError;
use super::array::Header;
use crc32fast::Hasher;
use rayon::prelude::*;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// The kind of file that a path should lead to, for error messages.
pub(super) const EXPECTED: &str = "a NumPy .npz archive";

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
        let read = |(part, mut out): (usize, &mut [f64])| {
            let first = part * PART;
            let mut finite = true;
            let sum = self.part(first..first + out.len(), PIECE, |bytes| {
                let (now, later) = std::mem::take(&mut out).split_at_mut(bytes.len() / self.size());
                self.header.decode_into(bytes, now);
                finite &= all_finite(now);
                out = later;
                true
            })?;
            Ok((sum, finite))
        };
        let parts = out.par_chunks_mut(PART).enumerate().map(read).collect();
        Ok(self.checked(parts)?.into_iter().all(|finite| finite))
    }

    /// Makes something of each group of so many numbers, on all threads: `make` gets the numbers of a group and the
    /// places of `out` that belong to this group. The memory holds a few groups of each thread. `None` if a number is
    /// not finite, or `make` gives nothing.
    ///
    /// # Errors
    /// As [`read_into`](Self::read_into).
    ///
    /// # Panics
    /// If the groups do not share the numbers, or `out`, evenly.
    pub(super) fn map_groups<T: Send, R: Send>(
        &self,
        group: usize,
        out: &mut [T],
        make: impl Fn(&[f64], &mut [T]) -> Option<R> + Sync,
    ) -> Result<Option<Vec<R>>, FileError> {
        let groups = self.count / group;
        let places = out.len() / groups;
        assert!(self.count == groups * group && out.len() == groups * places, "places for groups");
        let piece = (PIECE / group).max(1) * group;
        let part = PART.next_multiple_of(piece);
        let read = |(index, out): (usize, &mut [T])| {
            let first = index * part;
            let numbers = first..first + out.len() / places * group;
            let mut values = vec![0.0; piece.min(numbers.len())];
            let mut made = Vec::with_capacity(numbers.len() / group);
            let mut places = out.chunks_exact_mut(places);
            let all = numbers.len() / group;
            let sum = self.part(numbers, piece, |bytes| {
                let values = &mut values[..bytes.len() / self.size()];
                self.header.decode_into(bytes, values);
                if !all_finite(values) {
                    return false;
                }
                let each = values.chunks_exact(group).zip(&mut places);
                let before = made.len();
                made.extend(each.map_while(|(values, places)| make(values, places)));
                made.len() - before == values.len() / group
            })?;
            Ok((sum, (made.len() == all).then_some(made)))
        };
        let parts: Vec<io::Result<_>> =
            out.par_chunks_mut(part / group * places).enumerate().map(read).collect();
        if parts.iter().any(|part| matches!(part, Ok((_, None)))) {
            return Ok(None);
        }
        let parts = self.checked(parts)?;
        Ok(parts
            .into_iter()
            .collect::<Option<Vec<_>>>()
            .map(|parts| parts.into_iter().flatten().collect()))
    }

    /// What was made of the parts of all numbers, if the checksum of their bytes is right.
    fn checked<R>(&self, parts: Vec<io::Result<(Hasher, R)>>) -> Result<Vec<R>, FileError> {
        let wrong = |what: String| damaged(&self.path, format!("`{}`: {what}", self.field));
        let whole = || -> io::Result<(u32, Vec<R>)> {
            let mut header = Vec::new();
            self.at(0)?.take(self.header.header_bytes).read_to_end(&mut header)?;
            let mut whole = Hasher::new();
            whole.update(&header);
            let mut made = Vec::with_capacity(parts.len());
            for part in parts {
                let (sum, one) = part?;
                whole.combine(&sum);
                made.push(one);
            }
            Ok((whole.finalize(), made))
        };
        let (sum, made) = whole().map_err(|error| wrong(error.to_string()))?;
        match sum == self.crc32 {
            true => Ok(made),
            false => Err(wrong("Invalid checksum".to_owned())),
        }
    }

    /// Reads these numbers, and hands the bytes of a `piece` of them at a time to `take`, until `take` says no. The
    /// checksum of the bytes that were read.
    fn part(
        &self,
        numbers: Range<usize>,
        piece: usize,
        mut take: impl FnMut(&[u8]) -> bool,
    ) -> io::Result<Hasher> {
        let mut file = self.at(self.header.header_bytes + (numbers.start * self.size()) as u64)?;
        let mut sum = Hasher::new();
        let mut left = numbers.len();
        let mut bytes = vec![0; piece.min(left) * self.size()];
        while left > 0 {
            let count = piece.min(left);
            let bytes = &mut bytes[..count * self.size()];
            file.read_exact(bytes)?;
            sum.update(bytes);
            if !take(bytes) {
                break;
            }
            left -= count;
        }
        Ok(sum)
    }

    /// Bytes of a number in the file.
    fn size(&self) -> usize {
        self.header.number_bytes()
    }

    /// The file, at this byte of the member.
    fn at(&self, byte: u64) -> io::Result<File> {
        let mut file = File::open(&self.path)?;
        file.seek(SeekFrom::Start(self.start + byte))?;
        Ok(file)
    }
}

/// Whether each of these numbers is finite, without an early end, so that the compiler uses vectors.
fn all_finite(values: &[f64]) -> bool {
    values.iter().fold(true, |finite, value| finite & value.is_finite())
}

pub(super) fn damaged(path: &Path, found: String) -> FileError {
    FileError::damaged(path, found, EXPECTED)
}
