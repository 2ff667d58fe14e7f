//! All measurements of a file in one block of numbers, read into memory of the caller.
//!
//! # Invariant
//! The block has the numbers that the measurements have one by one, and is refused in the same words
//! (`tests::stack`).

use super::opened::Opened;
use super::readings::check_infinite;
use super::readings::is_reading;
use super::{FileError, Form, Remedy};
use crate::provenance::Taken;
use crate::stored::Stored;
use nirspi_recon::law::keeps_the_law;
use nirspi_recon::{Rows, Side};
use rayon::prelude::*;

/// Differences of several measurements of the same patterns.
pub struct Stack<'o> {
    opened: &'o Opened,
    rows: Rows,
    numbers: Numbers,
}

/// Where the numbers are.
enum Numbers {
    File(Stored),
    Memory(Vec<f64>),
}

impl<'o> Stack<'o> {
    pub(super) fn of(opened: &'o mut Opened) -> Result<Option<Self>, FileError> {
        let Some(rows) = opened.every_row.clone() else {
            return Ok(None);
        };
        if opened.form != Form::Differences
            || opened.remedy != Remedy::default()
            || !opened.readings.layout.is_adjacent()
        {
            return Ok(None);
        }
        let numbers = match opened.readings.stored(&mut opened.fields)? {
            Some(stored) => Numbers::File(stored),
            None => {
                let field = opened.readings.numbers(&mut opened.fields)?;
                if field.imaginary.is_some() {
                    return Ok(None);
                }
                Numbers::Memory(field.real)
            }
        };
        Ok(Some(Self { opened, rows, numbers }))
    }

    /// Number of measurements, at least 1.
    #[must_use]
    pub fn count(&self) -> usize {
        self.opened.readings.layout.count
    }

    /// The rows that were shown, one for each difference of a measurement.
    #[must_use]
    pub fn rows(&self) -> &Rows {
        &self.rows
    }

    /// Side of the images.
    #[must_use]
    pub fn side(&self) -> Side {
        self.rows.side()
    }

    /// The file's own reconstructions, one image after another, if it holds any.
    #[must_use]
    pub fn references(&self) -> Option<Vec<f32>> {
        let images = (0..self.count()).map(|index| self.opened.reference(index));
        images
            .map(|image| Some(image?.real.pixels().to_vec()))
            .collect::<Option<Vec<_>>>()
            .map(|i| i.concat())
    }

    /// Where the numbers come from, without the name of the file.
    #[must_use]
    pub fn taken(&self) -> &Taken {
        &self.opened.taken
    }

    /// Standard deviation of the noise of a difference of the measurement of this index, and what it is at most, if the
    /// file says so.
    #[must_use]
    pub fn noise(&self, index: usize) -> [Option<f64>; 2] {
        [&self.opened.noise, &self.opened.most_noise].map(|said| said.of(index))
    }

    /// Oddities of the file that do not make it unusable, one line each.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.opened.notes
    }

    /// Reads the differences, those of one measurement after another. NaN: the pattern was not read
    /// in this measurement. Says whether the block is the measurements: each pattern was read in at
    /// least one of them, since a pattern that was read in none does not belong to them, and each of
    /// them surely [keeps the law of readings](keeps_the_law). If not, the measurements are read one by
    /// one.
    ///
    /// # Errors
    /// As [`read`](super::read).
    ///
    /// # Panics
    /// If `out` has not [`count`](Self::count) times as many places as there are rows.
    pub fn read_into(&self, out: &mut [f64]) -> Result<bool, FileError> {
        let patterns = self.rows.len();
        assert_eq!(out.len(), self.count() * patterns, "places for the differences");
        let finite = match &self.numbers {
            Numbers::File(stored) => stored.read_into(out)?,
            Numbers::Memory(numbers) => {
                let copy = |(out, values): (&mut [f64], &[f64])| {
                    out.copy_from_slice(values);
                    values.iter().fold(true, |finite, value| finite & value.is_finite())
                };
                let parts = out.par_chunks_mut(patterns).zip(numbers.par_chunks(patterns));
                parts.map(copy).reduce(|| true, |a, b| a & b)
            }
        };
        let sound = out.par_chunks(patterns).all(|one| keeps_the_law(&self.rows, one));
        if finite && sound {
            return Ok(true);
        }
        let mut read = vec![false; patterns];
        for one in out.chunks_exact(patterns) {
            check_infinite(self.opened.fields.path(), &self.opened.readings.name, one)?;
            if !one.iter().any(|&value| is_reading(value)) {
                return Err(self.opened.no_pattern());
            }
            read.iter_mut().zip(one).for_each(|(read, &value)| *read |= is_reading(value));
        }
        Ok(sound && read.into_iter().all(|read| read))
    }

    /// Makes something of each measurement, on all threads: `make` gets the differences of a measurement and the places
    /// of `out` that belong to this measurement. Numbers that the file stores without compression are read piece by piece, so
    /// that the memory never holds them all. `None` if a difference is not finite, if a measurement may break the
    /// [law of readings](keeps_the_law), or if `make` gives nothing.
    ///
    /// # Errors
    /// As [`read`](super::read).
    ///
    /// # Panics
    /// If the measurements do not share `out` evenly.
    pub fn map_into<T: Send, R: Send>(
        &self,
        out: &mut [T],
        make: impl Fn(&[f64], &mut [T]) -> Option<R> + Sync,
    ) -> Result<Option<Vec<R>>, FileError> {
        let (count, patterns) = (self.count(), self.rows.len());
        assert!(out.len().is_multiple_of(count), "places for the measurements");
        let make = |values: &[f64], places: &mut [T]| match keeps_the_law(&self.rows, values) {
            true => make(values, places),
            false => None,
        };
        match &self.numbers {
            Numbers::File(stored) => stored.map_groups(patterns, out, make),
            Numbers::Memory(numbers) => {
                let each = numbers
                    .par_chunks_exact(patterns)
                    .zip(out.par_chunks_exact_mut(out.len() / count));
                Ok(each
                    .map(|(values, places)| match values.iter().all(|value| value.is_finite()) {
                        true => make(values, places),
                        false => None,
                    })
                    .collect())
            }
        }
    }
}
