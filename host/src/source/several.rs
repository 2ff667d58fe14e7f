//! All measurements of a measurement file, one by one or as one block of numbers.

use super::{Source, SourceError, SourceOptions, from_file};
use crate::files::measurement::{self, Stack};
use nirspi_recon::Side;
use std::ops::Range;
use std::path::Path;

/// An open file of measurements, whose measurements fit into memory together.
pub struct Several<'a> {
    path: &'a Path,
    options: &'a SourceOptions,
    file: measurement::Several,
}

impl<'a> Several<'a> {
    /// Opens a file, unless it is a recording.
    ///
    /// # Errors
    /// [`SourceError`], which names the file and the problem.
    pub fn of(path: &'a Path, options: &'a SourceOptions) -> Result<Option<Self>, SourceError> {
        match options.fits_recording(path)? {
            true => Ok(None),
            false => Self::open(path, options).map(Some),
        }
    }

    pub(super) fn open(path: &'a Path, options: &'a SourceOptions) -> Result<Self, SourceError> {
        let file = measurement::Several::open(path, &options.file)?;
        fits_together(path, file.len(), file.patterns(), file.side())?;
        Ok(Self { path, options, file })
    }

    /// All measurements as one block of numbers, if they are differences of the same patterns and
    /// lie one after another in the file; `None` for any other file.
    ///
    /// # Errors
    /// As [`of`](Self::of).
    pub fn stack(&mut self) -> Result<Option<Stack<'_>>, SourceError> {
        Ok(self.file.stack()?)
    }

    /// Number of measurements.
    pub(super) fn len(&self) -> usize {
        self.file.len()
    }

    /// All measurements, one by one.
    ///
    /// # Errors
    /// As [`of`](Self::of).
    pub fn each(&mut self) -> Result<Vec<Source>, SourceError> {
        self.some(0..self.len())?.into_iter().collect()
    }

    /// These measurements, or why one of them cannot be used.
    pub(super) fn some(
        &mut self,
        which: Range<usize>,
    ) -> Result<Vec<Result<Source, SourceError>>, SourceError> {
        Ok(self.file.some(which, |file| from_file(self.path, file, self.options.part))?)
    }
}

/// Checks that all measurements and their images fit into memory together.
pub(super) fn fits_together(
    path: &Path,
    count: usize,
    patterns: usize,
    side: Side,
) -> Result<(), SourceError> {
    let most = measurement::most_together(patterns, side.area());
    match count as u64 <= most {
        true => Ok(()),
        false => Err(SourceError::TooMany { path: path.to_owned(), count, most }),
    }
}
