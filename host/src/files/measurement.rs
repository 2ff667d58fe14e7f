//! Single-pixel measurements from a file, ours or another lab's: `.npz`, `.npy`, `.mat`, HDF5, `.csv` or `.txt`.
//!
//! The law: what [`read`] returns is consistent (every row known, within range and shown once, one finite reading or pair for
//! each), so nothing after it has to look again; and nothing is guessed: an order, a side or a form of readings that does not fit
//! the numbers is refused.
//!
//! | field | content |
//! |---|---|
//! | `n` | side of the image, a power of two from 2 to 256; or [`Selection::side`], or a full sweep's |
//! | `h_row` | `(M,)`: row of the natural-order Hadamard matrix of order n^2 that was shown k-th; negative or NaN: not read; or [`Selection::shown`] |
//! | `y` | `(..., 2 M)` raw readings in time order +, -, +, -; other forms by [`Selection::form`]; NaN: not read |
//! | `d` | `(..., M)` differential readings; NaN: not read |
//! | `recon` | optional `(n, n)`, or one for each measurement: someone's reconstruction, to compare with |
//!
//! `...` are any leading axes, whose measurements are counted through; axes of length 1 do not count. Readings may be complex,
//! of any real type, byte order and memory order; other fields are not looked at. A file that is one array, with any name or
//! none, holds readings alone.

mod form;
mod images;
mod layout;
mod opened;
mod plain;
mod readings;
mod reference;
mod rows;
mod write;

use super::FileError;
pub use form::Form;
pub use images::read_images_of;
use nirspi_recon::{Image, Order, Rows, Side};
use opened::Opened;
pub use plain::{Plain, read_plain};
use std::path::Path;
pub use write::encode;

/// What of a file is wanted, and what it does not say itself.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Selection {
    /// Which measurement of a file that holds several.
    pub index: Option<usize>,
    /// How readings belong to patterns; without it, `y` holds pairs and `d` differences.
    pub form: Option<Form>,
    /// The field of the readings; without it, `y`, or else `d`.
    pub field: Option<String>,
    /// Patterns are along the first axis, not the last.
    pub patterns_first: bool,
    /// Side of the image, where the file does not say it.
    pub side: Option<Side>,
    /// The order in which patterns were shown, where the file has no `h_row`.
    pub shown: Option<Order>,
    /// The image's pixels were numbered down the columns, as MATLAB does: patterns are transposed.
    pub transpose: bool,
    /// Every comma of a text file is a decimal one.
    pub decimal_comma: bool,
}

/// The numbers that a detector gave, in volts, counts or whatever it was logged in.
#[derive(Debug, Clone, PartialEq)]
pub enum Readings {
    /// `2 M` readings: pattern, complement, pattern, complement.
    Pairs(Vec<f64>),
    /// `M` differences, pattern minus complement.
    Differential(Vec<f64>),
    /// `M` readings of patterns alone.
    Single(Vec<f64>),
}

/// One measurement, checked: `h_row` has 1 to n^2 different rows of the n^2, readings are finite
/// and fit it.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasurementFile {
    /// Hadamard rows in the order shown, of the patterns that were read; their side is that of the image.
    pub h_row: Rows,
    /// What the detector saw.
    pub readings: Readings,
    /// The imaginary part of complex readings.
    pub imaginary: Option<Readings>,
    /// Places in the order shown of the patterns that were read, one for each of [`h_row`](Self::h_row).
    pub places: Vec<usize>,
    /// Places of patterns that were not read: NaN, or a negative row.
    pub not_read: Vec<usize>,
    /// The file's own reconstruction, if it holds one.
    pub reference: Option<Reference>,
    /// What was odd about the file without making it useless, a line each.
    pub notes: Vec<String>,
}

/// Somebody's image of the same scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Reference {
    /// The image, or its real part.
    pub real: Image,
    /// The imaginary part of a complex image.
    pub imaginary: Option<Image>,
}

/// Reads and checks a measurement file. `y` is taken before `d`.
///
/// # Errors
/// [`FileError`], one line that names file, field, what was found and what was expected.
pub fn read(path: &Path, want: &Selection) -> Result<MeasurementFile, FileError> {
    let mut file = Opened::open(path, want)?;
    let index = file.readings.layout.choose(path, &file.readings.name, want.index)?;
    file.measurement(index)
}

/// Reads and checks every measurement of a file, in their order: a video.
///
/// # Errors
/// As [`read`].
pub fn read_all(path: &Path, want: &Selection) -> Result<Vec<MeasurementFile>, FileError> {
    let mut file = Opened::open(path, want)?;
    (0..file.readings.layout.count).map(|index| file.measurement(index)).collect()
}

#[cfg(test)]
mod tests;
