//! Readings of patterns of a user's own, for `--matrix`.

use super::axes::joined;
use super::called::called;
use super::layout::Layout;
use super::named::{NamedPatterns, read_fourier};
use super::noise::{Deviations, MOST_NOISE, NOISE, noise_of_pairs};
use super::opened::stated_form;
use super::patterns::{PatternArray, PatternSelection, Patterns};
use super::readings::is_reading;
use super::readings::{Hint, NamedReadings, check_infinite, expected_of, readings_field};
use super::sides::{make_pairs, two_fields};
use super::weighed::{Plain, Which};
use super::{FileError, Form, Selection};
use crate::array::has_shape;
use crate::field::Field;
use crate::fields::Fields;
use crate::provenance::Taken;
use nirspi_recon::Size;
use std::path::{Path, PathBuf};
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
            let numbers = read_numbers(readings, want, which, patterns.count)?;
            let patterns = weighing(patterns, numbers.form);
            return Ok(numbers.plain(&patterns));
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
                let patterns = weighing(array.patterns(arrangement), numbers.form);
                return Ok(numbers.plain(&patterns));
            }
            Err(error) => refused = refused.or(Some(error)),
        }
    }
    Err(refused.unwrap_or_else(|| FileError::kind(matrix, "no patterns", "patterns")))
}

/// Sweeps of patterns of a user's own that come one after another, without a file.
///
/// # Invariant
/// [`read`](Self::read) gives what [`read_plain`] makes of a file with the same readings
/// (`tests::a_sweep_of_own_patterns_is_read_as_a_file_with_its_readings_is`).
pub struct PlainSweeps {
    origin: PathBuf,
    patterns: Arc<Patterns>,
    form: Form,
    taken: Taken,
}

impl PlainSweeps {
    /// Sweeps of the patterns of `matrix`, a file, a folder of pictures, or [`NamedPatterns`], of which there must be
    /// `count` of this size. Messages name `origin` for the readings.
    ///
    /// # Errors
    /// [`FileError`] if there are other patterns.
    pub fn new(
        matrix: &Path,
        (count, size): (usize, Size),
        origin: &Path,
        form: Form,
        simulated: Option<bool>,
    ) -> Result<Self, FileError> {
        let expected = format!("{count} patterns of {size} pixels, as the header of the feed says");
        let patterns = match NamedPatterns::instead_of(matrix) {
            Some(set) => {
                let found = set.and_then(|set| set.patterns(Some(size)).map_err(|(_, why)| why));
                let refused =
                    |why| FileError::field(matrix, "--matrix", "does not fit the feed", why);
                let found = found.map_err(refused)?;
                if (found.count, found.size) != (count, size) {
                    let has = format!("is {} patterns of {} pixels", found.count, found.size);
                    return Err(FileError::field(matrix, "--matrix", has, expected));
                }
                found
            }
            None => {
                let array = PatternArray::open(matrix, &PatternSelection::default())?;
                let mut all = array.arrangements(Some(size))?.into_iter();
                match all.find(|arrangement| arrangement.count == count) {
                    Some(arrangement) => array.patterns(arrangement),
                    None => return Err(array.refused(has_shape(&array.axes()), expected)),
                }
            }
        };
        let patterns = weighing(patterns, form);
        let taken = Taken::simulated_or(simulated);
        Ok(Self { origin: origin.to_owned(), patterns, form, taken })
    }

    /// The readings of one sweep. NaN: the pattern was not read.
    ///
    /// # Errors
    /// As [`read_plain`].
    pub fn read(&self, readings: Vec<f64>) -> Result<Plain, FileError> {
        let name = if self.form == Form::Differences { "d" } else { "y" };
        let readings = Field { shape: vec![readings.len()], real: readings, imaginary: None };
        let fields = Fields::of_fields(&self.origin, vec![(name.to_owned(), readings)]);
        let want = Selection { form: Some(self.form), ..Selection::default() };
        let numbers = numbers_of(fields, &want, Which::One, self.patterns.count)?;
        let numbers = Numbers { taken: self.taken.clone(), ..numbers };
        Ok(numbers.plain(&self.patterns).remove(0))
    }
}

/// A number for each pattern, NaN where none was read.
struct Numbers {
    /// Of each measurement: at least one.
    all: Vec<Vec<f64>>,
    /// What the file says of the noise of each, and what that noise is at most.
    noise: Vec<[Option<f64>; 2]>,
    form: Form,
    taken: Taken,
    notes: Vec<String>,
}

/// What readings of this form weigh the light with.
fn weighing(patterns: Patterns, form: Form) -> Arc<Patterns> {
    Arc::new(match form {
        Form::Single => patterns,
        _ => patterns.differences(),
    })
}

impl Numbers {
    fn plain(self, patterns: &Arc<Patterns>) -> Vec<Plain> {
        let Self { all, noise, taken, notes, .. } = self;
        let plain = |(all, [noise, most_noise]): (Vec<f64>, [Option<f64>; 2])| {
            let (places, not_read): (Vec<usize>, Vec<usize>) =
                (0..all.len()).partition(|&k| is_reading(all[k]));
            let values = places.iter().map(|&k| all[k]).collect();
            let (patterns, taken, notes) = (Arc::clone(patterns), taken.clone(), notes.clone());
            let dark = true;
            Plain { patterns, values, places, not_read, taken, noise, most_noise, notes, dark }
        };
        all.into_iter().zip(noise).map(plain).collect()
    }
}

fn read_numbers(
    path: &Path,
    want: &Selection,
    which: Which,
    patterns: usize,
) -> Result<Numbers, FileError> {
    numbers_of(Fields::open(path, want.decimal_comma)?, want, which, patterns)
}

fn numbers_of(
    mut fields: Fields,
    want: &Selection,
    which: Which,
    patterns: usize,
) -> Result<Numbers, FileError> {
    let path = &fields.path().to_owned();
    let want = &*called(&mut fields, want)?;
    let name = readings_field(&mut fields, want)?;
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
    let is_d = readings.name == "d";
    let mut said = |name| match is_d {
        true => Deviations::read(&mut fields, name, layout.count),
        false => Deviations::default(),
    };
    let said = [said(NOISE), said(MOST_NOISE)];
    let numbers = readings.numbers(&mut fields)?;
    let refused =
        |found: &str, expected| FileError::field(path, readings.name.clone(), found, expected);
    if numbers.imaginary.is_some() {
        return Err(refused("has complex numbers", "real ones for patterns of one's own"));
    }
    let indices = match which {
        Which::One => {
            let index = layout.choose(path, &readings.name, want.index, false)?;
            index..index + 1
        }
        Which::All => 0..layout.count,
    };
    let difference =
        |pattern: f64, complement: f64| match is_reading(pattern) && is_reading(complement) {
            true => pattern - complement,
            false => f64::NAN,
        };
    let mut noise: Vec<[Option<f64>; 2]> = Vec::with_capacity(indices.len());
    let mut all = Vec::with_capacity(indices.len());
    for index in indices {
        let values = layout.series(&numbers.real, index);
        check_infinite(path, &readings.name, &values)?;
        let pairs: Vec<[f64; 2]> = match form {
            Form::Single | Form::Differences => Vec::new(),
            Form::Pairs => values.as_chunks().0.to_vec(),
            Form::Halves => (0..patterns).map(|k| [values[k], values[patterns + k]]).collect(),
        };
        let [stated, most] = said.each_ref().map(|said| said.of(index));
        noise.push([stated, most.or_else(|| noise_of_pairs(&pairs))]);
        let values: Vec<f64> = match form {
            Form::Single | Form::Differences => values,
            _ => pairs.iter().map(|&[on, off]| difference(on, off)).collect(),
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
    Ok(Numbers { all, noise, form, taken: fields.taken(), notes })
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Zip, file, noise, npy_f64, zip};

    /// Pairs of pattern and complement see the same light, so their sums tell what the noise is at most.
    #[test]
    fn sums_of_pairs_say_what_the_noise_is_at_most() {
        let weights: Vec<f64> = (0..200 * 4).map(|at| f64::from(at % 3)).collect();
        let (_kept, matrix) = file("matrix.npy", &npy_f64("(200, 4)", &weights));
        // A lamp that steps once.
        let light = |at: usize| if at < 150 { 9.0 } else { 8.0 };
        let on = |at: usize| 3.0 + (at % 7) as f64 / 4.0;
        let pairs = |size: f64| -> Vec<f64> {
            let of = |at| [on(at) + size * noise(at), light(at) - on(at)];
            (0..200).flat_map(of).collect()
        };
        let most = |form: Form, y: &[f64]| {
            let shape = format!("({},)", y.len());
            let (_folder, path) = file("y.npy", &npy_f64(&shape, y));
            let want = Selection { form: Some(form), ..Selection::default() };
            read_plain(&matrix, &PatternSelection::default(), &path, &want).unwrap().most_noise
        };
        for size in [0.0, 0.1] {
            let (y, expected) = (pairs(size), size / 12.0_f64.sqrt());
            let parts = [0, 1].map(|which| y.iter().skip(which).step_by(2).copied());
            let halves: Vec<f64> = parts.into_iter().flatten().collect();
            for found in [most(Form::Pairs, &y), most(Form::Halves, &halves)] {
                let off = found.unwrap() - expected;
                assert!(off.abs() < 1e-9 + 0.3 * expected, "{size}: {found:?}");
            }
        }
        assert_eq!(most(Form::Single, &vec![1.0; 200]), None);
    }

    #[test]
    fn a_sweep_of_own_patterns_is_read_as_a_file_with_its_readings_is() {
        let (size, count) = (Size::new(1, 3).unwrap(), 4);
        let weights: Vec<f64> = (0..12).map(|at| f64::from(at % 5)).collect();
        let (_kept, matrix) = file("matrix.npy", &npy_f64("(4, 3)", &weights));
        let (_also, turned) = file("turned.npy", &npy_f64("(3, 4)", &weights));
        for form in Form::ALL {
            let readings: Vec<f64> = (0..count * form.readings())
                .map(|at| if at == 2 { f64::NAN } else { at as f64 })
                .collect();
            let field = if form == Form::Differences { "d.npy" } else { "y.npy" };
            let shape = format!("({},)", readings.len());
            let members = [(field, npy_f64(&shape, &readings))];
            let (_folder, path) = file("lab.npz", &zip(Zip::Stored, &members));
            let want = Selection { form: Some(form), ..Selection::default() };
            for patterns in [&matrix, &turned] {
                let of = PatternSelection { size: Some(size), ..PatternSelection::default() };
                let mut expected = read_plain(patterns, &of, &path, &want).unwrap();
                expected.notes.retain(|note| !note.contains("along the last axis"));
                let sweeps =
                    PlainSweeps::new(patterns, (count, size), Path::new("feed"), form, None)
                        .unwrap();
                assert_eq!(sweeps.read(readings.clone()).unwrap(), expected, "{form:?}");
            }
        }
        let refused = |matrix: &str, count| {
            let feed = Path::new("feed");
            let other =
                PlainSweeps::new(Path::new(matrix), (count, size), feed, Form::Single, None);
            other.err().unwrap().to_string()
        };
        let others = refused(matrix.to_str().unwrap(), 5);
        assert!(
            others.contains("has shape (4, 3), expected 5 patterns of 1 x 3 pixels"),
            "{others}"
        );
        let others = refused("s-matrix:7", 7);
        assert!(others.starts_with("s-matrix:7: "), "{others}");
        assert!(refused("s-matrix:8", 7).contains("expected an order"), "no such set");
    }
}
