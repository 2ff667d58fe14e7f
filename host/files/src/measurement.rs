//! Reads single-pixel measurements from a file of nirspi or of another lab: `.npz`, `.npy`, `.mat`,
//! HDF5, `.csv` or `.txt`.
//!
//! # Invariant
//! A measurement that [`read`] returns is consistent: every row is known, within range and there
//! once, and has one finite reading or pair. Later code need not check again. The reader never
//! guesses: an order, a side or a form of readings that does not fit the numbers is an error
//! (`tests::each_bad_field_gets_a_line_that_names_it`,
//! `tests::an_order_gives_the_rows_of_readings_alone_and_is_never_guessed`).
//!
//! # Fields
//!
//! | field | content |
//! |---|---|
//! | `n` | side of the image, a power of two from 2 to 256; or [`Selection::side`], or a full sweep's |
//! | `h_row` | `(M,)`: row of the natural-order Hadamard matrix of order n^2 that was shown k-th; negative or NaN: not read; or [`Selection::shown`] |
//! | `y` | `(..., 2 M)` or `(..., M, 2)` raw readings in time order +, -, +, -; other forms by [`Selection::form`]; NaN: not read |
//! | `d` | `(..., M)` differential readings; NaN: not read |
//! | `sign` | optional, as many as readings: 1 for a pattern, -1 or 0 for a complement, of the same row of `h_row` or else of the next one |
//! | `readings` | optional, with `y`, a text: its form, unless [`Selection::form`] is given |
//! | `simulated` | optional: 1 if no real light was measured |
//! | `provenance` | optional, a text: the JSON of a [`Provenance`](crate::provenance::Provenance), which says more |
//! | `noise` | optional, with `d`: standard deviation of the noise of a value of `d`, the same for all patterns; one number, or one for each measurement; NaN: not known |
//! | `most_noise` | optional, in the same form: what this noise is at most, where it is estimated |
//! | `recon` | optional `(n, n)`, or one for each measurement: someone's reconstruction, to compare with |
//!
//! A row that was shown several times has the mean of its readings. Rows and readings may both be
//! `(n, n)`. [`Selection::field`] may name two fields, `positive,negative`.
//!
//! `...` are any leading axes; the measurements in the leading axes are numbered in C order. Axes
//! of length 1 do not count. Readings may be complex, and of any real type, byte order and memory
//! order. The reader ignores other fields. If a file is one array, with any name or none, the array
//! holds the readings.

mod axes;
mod called;
mod form;
mod images;
mod layout;
mod named;
mod noise;
mod opened;
mod patterns;
mod plain;
mod readings;
mod reference;
mod remedy;
mod rows;
mod sides;
mod stack;
mod sweeps;
mod weighed;
mod write;

use super::FileError;
use super::fields::Fields;
use super::provenance::Taken;
pub use form::Form;
pub use images::read_images_of;
pub use named::NamedPatterns;
use nirspi_recon::law::{Claim, Lamp};
use nirspi_recon::{Image, Order, Rows, Side};
use opened::Opened;
pub use patterns::{PatternSelection, Patterns};
pub use plain::{PlainSweeps, read_plain, read_plain_all};
use rayon::prelude::*;
pub use readings::is_reading;
pub use remedy::Remedy;
pub use stack::Stack;
use std::ops::Range;
use std::path::Path;
pub use sweeps::{Sweeps, most_together};
pub use weighed::Plain;
pub use write::{READINGS, encode, noise_of, write_readings};

/// What to read from a file, and what the file itself does not say.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Selection {
    /// The index of the measurement, in a file that holds several.
    pub index: Option<usize>,
    /// How readings belong to patterns. By default, `y` holds pairs and `d` differences.
    pub form: Option<Form>,
    /// The field of the readings, or the two fields of patterns and of complements:
    /// `positive,negative`. By default `y`, or else `d`. `h_row=NAME`, `n=NAME` and `sign=NAME` beside them are
    /// fields that the file calls something else.
    pub field: Option<String>,
    /// Whether patterns are along the first axis instead of the last.
    pub patterns_first: bool,
    /// Side of the image, if the file does not state it.
    pub side: Option<Side>,
    /// The order in which patterns were shown, if the file has no `h_row`.
    pub shown: Option<Order>,
    /// Whether the image's pixels are numbered down the columns, as in MATLAB. Patterns are then
    /// transposed.
    pub transpose: bool,
    /// Whether every comma of a text file is a decimal comma.
    pub decimal_comma: bool,
    /// What must be done with the readings.
    pub remedy: Remedy,
}

/// The detector's readings, in volts, counts or any other logged unit.
#[derive(Debug, Clone, PartialEq)]
pub enum Readings {
    /// `2 M` readings: pattern, complement, pattern, complement.
    Pairs(Vec<f64>),
    /// `M` differences, pattern minus complement.
    Differential(Vec<f64>),
    /// `M` readings of patterns without complements.
    Single(Vec<f64>),
}

impl Readings {
    /// The numbers, in the order of the patterns.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        let (Self::Pairs(values) | Self::Differential(values) | Self::Single(values)) = self;
        values
    }
}

/// One checked measurement: `h_row` has 1 to n^2 different rows of the n^2, and one finite reading
/// or pair for each row.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasurementFile {
    /// Hadamard rows of the patterns that were read, in the order first shown. The side of `h_row`
    /// is that of the image.
    pub h_row: Rows,
    /// The detector's readings.
    pub readings: Readings,
    /// The imaginary parts of complex readings.
    pub imaginary: Option<Readings>,
    /// Positions in the order shown of the patterns that were read, one for each of
    /// [`h_row`](Self::h_row): the first, if a pattern was shown several times.
    pub places: Vec<usize>,
    /// Positions of patterns that were not read: the reading is NaN or an instrument's word for
    /// overload, or the row is negative.
    pub not_read: Vec<usize>,
    /// The readings that are an instrument's word for overload, as the file numbers readings.
    pub overloads: Vec<usize>,
    /// How steady the light was, by readings of the all-on pattern among readings without complements.
    pub lamp: Option<Lamp>,
    /// What the readings are said to be.
    pub claim: Claim,
    /// What was done with the readings of the file.
    pub remedy: Remedy,
    /// Number of patterns, those that were not read included.
    pub patterns: usize,
    /// The file's own reconstruction, if it holds one.
    pub reference: Option<Reference>,
    /// Where the readings come from, by what the file says of it, without the name of the file.
    pub taken: Taken,
    /// Standard deviation of the noise of a value of `d`, if the file says so and `d` was read.
    pub noise: Option<f64>,
    /// What this noise is at most, in the same case.
    pub most_noise: Option<f64>,
    /// Oddities of the file that do not make it unusable, one line each.
    pub notes: Vec<String>,
}

/// An image of the same scene that the file holds.
#[derive(Debug, Clone, PartialEq)]
pub struct Reference {
    /// The image, or its real part.
    pub real: Image,
    /// The imaginary part of a complex image.
    pub imaginary: Option<Image>,
}

impl MeasurementFile {
    /// The place in the file of a reading of [`readings`](Self::readings).
    #[must_use]
    pub fn place(&self, reading: usize) -> usize {
        let at = match self.claim.form {
            Form::Pairs => 2 * self.places[reading / 2] + reading % 2,
            Form::Halves => self.places[reading / 2] + (reading % 2) * self.patterns,
            Form::Single | Form::Differences => self.places[reading],
        };
        self.remedy.place(self.claim.form, self.patterns, at).unwrap_or(at)
    }
}

/// Reads and checks a measurement file. If the file has both, `y` is read and not `d`.
///
/// # Errors
/// [`FileError`], one line that names file, field, what was found and what was expected.
pub fn read(path: &Path, want: &Selection) -> Result<MeasurementFile, FileError> {
    read_fields(Fields::open(path, want.decimal_comma)?, want)
}

/// Reads the measurement of an open file.
pub(crate) fn read_fields(fields: Fields, want: &Selection) -> Result<MeasurementFile, FileError> {
    let path = fields.path().to_owned();
    let mut file = Opened::of(fields, want)?;
    let layout = file.readings.layout;
    let is_square = file.side_guessed && layout.count == file.patterns();
    let index = layout.choose(&path, &file.readings.name, want.index, is_square)?;
    file.loaded()?.measurement(index)
}

/// A file of several measurements, such as the frames of a video.
pub struct Several(Opened);

impl Several {
    /// Opens the file and checks that its shapes fit together.
    ///
    /// # Errors
    /// As [`read`].
    pub fn open(path: &Path, want: &Selection) -> Result<Self, FileError> {
        Opened::open(path, want).map(Self)
    }

    /// Number of measurements.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.readings.layout.count
    }

    /// Whether there is no measurement.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of patterns of a measurement, those that were not read included.
    #[must_use]
    pub fn patterns(&self) -> usize {
        self.0.patterns()
    }

    /// Side of the images.
    #[must_use]
    pub fn side(&self) -> Side {
        self.0.side
    }

    /// Reads and checks these measurements, on all threads, and makes something of each, or says why not.
    ///
    /// # Errors
    /// [`FileError`] if the file cannot be read.
    pub fn some<T: Send, E: From<FileError> + Send>(
        &mut self,
        which: Range<usize>,
        make: impl Fn(MeasurementFile) -> Result<T, E> + Sync,
    ) -> Result<Vec<Result<T, E>>, FileError> {
        let file = self.0.loaded()?;
        let one = |index| make(file.measurement(index)?);
        Ok(which.into_par_iter().map(one).collect())
    }

    /// Every measurement, as it is read.
    ///
    /// # Errors
    /// As [`read`], of the first measurement that is refused.
    pub fn each(&mut self) -> Result<Vec<MeasurementFile>, FileError> {
        self.some(0..self.len(), Ok)?.into_iter().collect()
    }

    /// All measurements as one block of numbers, if they are real differences of the same patterns
    /// and lie one after another; `None` for any other file, which [`some`](Self::some) reads.
    ///
    /// # Errors
    /// As [`read`].
    pub fn stack(&mut self) -> Result<Option<Stack<'_>>, FileError> {
        Stack::of(&mut self.0)
    }
}

#[cfg(test)]
mod tests;
