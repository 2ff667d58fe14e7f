//! Readings of patterns of a user's own, for `--matrix`.

use super::axes::joined;
use super::called::called;
use super::layout::Layout;
use super::named::{NamedPatterns, read_fourier};
use super::opened::{is_reading, read_simulated, stated_form};
use super::patterns::{PatternArray, PatternSelection, Patterns};
use super::readings::{Hint, NamedReadings, check_infinite, expected_of, readings_field};
use super::sides::{make_pairs, two_fields};
use super::weighed::{Plain, Which};
use super::{FileError, Form, Selection};
use crate::fields::Fields;
use std::path::Path;
use std::sync::Arc;

/// Reads patterns from `matrix`, a file, a folder of pictures, or [`NamedPatterns`], and one number for each pattern
/// from the file `readings`: a reading, from `y` or else from `d`, or the difference of pattern and
/// complement.
///
/// # Errors
/// As [`super::read`].
pub fn read_plain(
    matrix: &Path,
    of_patterns: &PatternSelection,
    readings: &Path,
    want: &Selection,
) -> Result<Plain, FileError> {
    Ok(read_which(matrix, of_patterns, readings, want, Which::One)?.remove(0))
}

/// As [`read_plain`], every measurement of the file: at least one.
///
/// # Errors
/// As [`super::read`].
pub fn read_plain_all(
    matrix: &Path,
    of_patterns: &PatternSelection,
    readings: &Path,
    want: &Selection,
) -> Result<Vec<Plain>, FileError> {
    read_which(matrix, of_patterns, readings, want, Which::All)
}

fn read_which(
    matrix: &Path,
    of_patterns: &PatternSelection,
    readings: &Path,
    want: &Selection,
    which: Which,
) -> Result<Vec<Plain>, FileError> {
    match NamedPatterns::instead_of(matrix) {
        Some(Ok(NamedPatterns::Fourier { steps })) => {
            return read_fourier(steps, of_patterns, readings, want, which);
        }
        Some(Ok(set)) => {
            let refused = |(found, expected)| FileError::field(matrix, "--size", found, expected);
            let patterns = set.patterns(of_patterns.size).map_err(refused)?;
            return Ok(read_numbers(readings, want, which, patterns.count)?.plain(patterns));
        }
        Some(Err(expected)) => {
            return Err(FileError::field(matrix, "--matrix", "is no file and no set", expected));
        }
        None => {}
    }
    let array = PatternArray::open(matrix, of_patterns)?;
    let arrangements = array.arrangements(of_patterns.size)?;
    let mut refused = None;
    for arrangement in arrangements {
        match read_numbers(readings, want, which, arrangement.count) {
            Ok(mut numbers) => {
                numbers.notes.extend(array.note(arrangement));
                return Ok(numbers.plain(array.patterns(arrangement)));
            }
            Err(error) => refused = refused.or(Some(error)),
        }
    }
    Err(refused.unwrap_or_else(|| FileError::kind(matrix, "no patterns", "patterns")))
}

/// A number for each pattern, NaN where none was read.
struct Numbers {
    /// Of each measurement: at least one.
    all: Vec<Vec<f64>>,
    form: Form,
    simulated: Option<bool>,
    notes: Vec<String>,
}

impl Numbers {
    fn plain(self, patterns: Patterns) -> Vec<Plain> {
        let Self { all, form, simulated, notes } = self;
        let patterns = Arc::new(match form {
            Form::Single => patterns,
            _ => patterns.differences(),
        });
        let plain = |all: Vec<f64>| {
            let (places, not_read): (Vec<usize>, Vec<usize>) =
                (0..all.len()).partition(|&k| is_reading(all[k]));
            let values = places.iter().map(|&k| all[k]).collect();
            let (patterns, notes) = (Arc::clone(&patterns), notes.clone());
            Plain { patterns, values, places, not_read, simulated, notes, dark: true }
        };
        all.into_iter().map(plain).collect()
    }
}

fn read_numbers(
    path: &Path,
    want: &Selection,
    which: Which,
    patterns: usize,
) -> Result<Numbers, FileError> {
    let mut fields = Fields::open(path, want.decimal_comma)?;
    let want = &*called(&mut fields, want)?;
    let name = readings_field(&fields, want)?;
    let mut notes: Vec<String> = fields.skipped().map(str::to_owned).into_iter().collect();
    let paired = make_pairs(&mut fields, &name, want)?;
    let is_paired = paired.is_some() || two_fields(&fields, &name).is_some();
    notes.extend(paired);
    let form = match want.form {
        Some(form) => form,
        None if is_paired => Form::Pairs,
        None if name == "d" => Form::Differences,
        None => match stated_form(&mut fields).filter(|_| name == "y") {
            Some(form) => form,
            None => form_of(&mut fields, &name, want, patterns)?,
        },
    };
    let mut expected = expected_of(form, patterns, vec![patterns as u64]);
    if form == Form::Single {
        expected.meaning = "one reading a pattern";
        expected.hint = Hint {
            length: 2 * patterns,
            words: "; pairs of pattern and complement are read with --readings pairs or halves",
        };
    }
    let mut readings = NamedReadings::open(&mut fields, name, want, &expected)?;
    let layout = readings.layout;
    let numbers = readings.numbers(&mut fields)?;
    let refused =
        |found: &str, expected| FileError::field(path, readings.name.clone(), found, expected);
    if numbers.imaginary.is_some() {
        return Err(refused("has complex numbers", "real ones for patterns of one's own"));
    }
    let indices = match which {
        Which::One => {
            let index = layout.choose(path, &readings.name, want.index)?;
            index..index + 1
        }
        Which::All => 0..layout.count,
    };
    let difference =
        |pattern: f64, complement: f64| match is_reading(pattern) && is_reading(complement) {
            true => pattern - complement,
            false => f64::NAN,
        };
    let mut all = Vec::with_capacity(indices.len());
    for index in indices {
        let values = layout.series(&numbers.real, index);
        check_infinite(path, &readings.name, &values)?;
        let values: Vec<f64> = match form {
            Form::Single | Form::Differences => values,
            Form::Pairs => {
                values.as_chunks().0.iter().map(|&[on, off]| difference(on, off)).collect()
            }
            Form::Halves => {
                (0..patterns).map(|k| difference(values[k], values[patterns + k])).collect()
            }
        };
        if !values.iter().copied().any(is_reading) {
            let place =
                if layout.count > 1 { format!(" in measurement {index}") } else { String::new() };
            return Err(refused(&format!("is NaN everywhere{place}"), "a pattern that was read"));
        }
        all.push(values);
    }
    if form.readings() == 2 {
        notes.push("the image is that of pattern minus complement".to_owned());
    }
    Ok(Numbers { all, form, simulated: read_simulated(&mut fields), notes })
}

/// Pairs if pattern and complement are on a last axis of two, else one reading a pattern.
fn form_of(
    fields: &mut Fields,
    name: &str,
    want: &Selection,
    patterns: usize,
) -> Result<Form, FileError> {
    let (shape, _) = fields.open_field(name, |_| Ok(()))?;
    let is_single = Layout::of(&shape, patterns, want.patterns_first).is_some();
    let pairs = joined(&shape, Some(&[patterns as u64]), Form::Pairs);
    let is_pairs = pairs != shape && Layout::of(&pairs, 2 * patterns, false).is_some();
    Ok(if is_pairs && !is_single { Form::Pairs } else { Form::Single })
}
