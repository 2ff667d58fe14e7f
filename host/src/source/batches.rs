//! The measurements of a file or a recording, some at a time: a recording may have more frames than fit into memory.
//!
//! # Invariant
//! Batches hold all measurements in their order. Those before one that cannot be used are handed out before the
//! error (`host/tests/stacks.rs`).

use super::recording::{Frames, Reading};
use super::{Several, Source, SourceError, SourceOptions};
use std::path::Path;

/// All measurements of a file, or all frames of a recording.
pub enum Sources<'a> {
    /// A recording.
    Frames(Box<Frames<'a>>),
    /// A file of measurements, which is in memory as a whole.
    File(Box<Several<'a>>),
}

impl<'a> Sources<'a> {
    /// Opens a file. A recording is read once, to count its frames and their noise.
    ///
    /// # Errors
    /// [`SourceError`], which names the file and the problem.
    pub fn open(path: &'a Path, options: &'a SourceOptions) -> Result<Self, SourceError> {
        Ok(match options.fits_recording(path)? {
            true => Self::Frames(Box::new(Frames::open(path, options)?)),
            false => Self::File(Box::new(Several::open(path, options)?)),
        })
    }

    /// Number of measurements.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::Frames(frames) => frames.len(),
            Self::File(several) => several.len(),
        }
    }

    /// Whether there is no measurement.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Checks that all measurements and their images fit into memory together.
    ///
    /// # Errors
    /// [`SourceError::TooMany`].
    pub fn fit_together(&self) -> Result<(), SourceError> {
        match self {
            Self::Frames(frames) => frames.fit_together(),
            // Was checked when the file was opened.
            Self::File(_) => Ok(()),
        }
    }

    /// The measurements, `most` at a time, at least one.
    ///
    /// # Errors
    /// [`SourceError`] if a recording cannot be read again.
    pub fn batches(&mut self, most: usize) -> Result<Batches<'_, 'a>, SourceError> {
        let from = match self {
            Self::Frames(frames) => {
                let reading = frames.read(most)?;
                From::Frames { frames, reading }
            }
            Self::File(several) => From::File { several, next: 0 },
        };
        Ok(Batches { from, most, refused: None })
    }
}

/// Measurements in their order, some at a time.
pub struct Batches<'s, 'a> {
    from: From<'s, 'a>,
    most: usize,
    /// Why there are no more, once those before it are handed out.
    refused: Option<SourceError>,
}

enum From<'s, 'a> {
    Frames { frames: &'s Frames<'a>, reading: Reading },
    File { several: &'s mut Several<'a>, next: usize },
}

impl Iterator for Batches<'_, '_> {
    type Item = Result<Vec<Source>, SourceError>;

    fn next(&mut self) -> Option<Self::Item> {
        if let Some(refused) = self.refused.take() {
            self.most = 0;
            return Some(Err(refused));
        }
        if self.most == 0 {
            return None;
        }
        let read = match &mut self.from {
            From::Frames { frames, reading } => match reading.next()? {
                Ok(batch) => frames.sources(batch),
                Err(error) => vec![Err(error)],
            },
            From::File { several, next } => {
                let to = next.saturating_add(self.most).min(several.len());
                if *next == to {
                    return None;
                }
                let read = several.some(*next..to);
                *next = to;
                read.unwrap_or_else(|error| vec![Err(error)])
            }
        };
        let mut batch = Vec::with_capacity(read.len());
        for source in read {
            match source {
                Ok(source) => batch.push(source),
                Err(error) => {
                    self.refused = Some(error);
                    break;
                }
            }
        }
        match batch.is_empty() {
            true => self.next(),
            false => Some(Ok(batch)),
        }
    }
}
