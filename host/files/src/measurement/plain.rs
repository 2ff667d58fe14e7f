//! Readings of patterns that the file does not name, for `--matrix`.

use super::opened::is_reading;
use super::readings::{Expected, Hint, NamedReadings, check_infinite, readings_field};
use super::{FileError, Form, Selection};
use crate::fields::Fields;
use std::path::Path;

/// Readings of patterns that the file does not name.
#[derive(Debug, Clone, PartialEq)]
pub struct Plain {
    /// The readings, all finite.
    pub values: Vec<f64>,
    /// The pattern of each reading.
    pub patterns: Vec<usize>,
    /// Patterns that were not read: the file has NaN, or an instrument's word for overload.
    pub not_read: Vec<usize>,
}

/// Reads one number for each of `patterns` patterns, from `y` or else from `d`.
///
/// # Errors
/// As [`super::read`].
pub fn read_plain(path: &Path, want: &Selection, patterns: usize) -> Result<Plain, FileError> {
    let mut fields = Fields::open(path, want.decimal_comma)?;
    let name = readings_field(&fields, want)?;
    let hint = Hint { length: 2 * patterns, words: "; of +, - pairs give the differences" };
    let expected = Expected {
        form: Form::Single,
        rows: vec![patterns as u64],
        length: patterns,
        meaning: "one reading a pattern",
        hint,
    };
    let mut readings = NamedReadings::open(&mut fields, name, want, &expected)?;
    let layout = readings.layout;
    let numbers = readings.numbers(&mut fields)?;
    if numbers.imaginary.is_some() {
        return Err(FileError::field(
            path,
            readings.name,
            "has complex numbers",
            "real ones for patterns of one's own",
        ));
    }
    let index = layout.choose(path, &readings.name, want.index)?;
    let all = layout.series(&numbers.real, index);
    check_infinite(path, &readings.name, &all)?;
    let (patterns, not_read): (Vec<usize>, Vec<usize>) =
        (0..all.len()).partition(|&k| is_reading(all[k]));
    if patterns.is_empty() {
        return Err(FileError::field(
            path,
            readings.name,
            "is NaN everywhere",
            "a pattern that was read",
        ));
    }
    Ok(Plain { values: patterns.iter().map(|&k| all[k]).collect(), patterns, not_read })
}
