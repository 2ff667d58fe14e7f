//! What is in a file of readings: its arrays, with what their numbers look like. The same open file is
//! then read as a measurement in several ways.
//!
//! # Invariant
//! [`Contents::measurement`] reads as [`measurement::read`] reads the file
//! (`tests::a_measurement_is_the_one_that_the_file_gives`).

use super::FileError;
use super::fields::Fields;
use crate::field::{Field, is_counter};
use crate::measurement::{self, MeasurementFile, Selection};
use crate::provenance::Taken;
use std::path::Path;

/// Most different values of an array that are kept.
const LEVELS: usize = 3;

/// An open file.
pub struct Contents {
    fields: Fields,
    arrays: Vec<Array>,
    decimal_comma: bool,
}

/// An array of a file, or a column of a text.
#[derive(Debug, Clone, PartialEq)]
pub struct Array {
    /// The name; empty for the only array of a file without names.
    pub name: String,
    /// Length of each axis.
    pub shape: Vec<usize>,
    /// What kind of numbers it holds: `float64`, or `complex`; `text` in a text.
    pub kind: String,
    /// What its numbers look like; `None` if they cannot be read.
    pub numbers: Option<Look>,
    /// Why its numbers cannot be read.
    pub problem: Option<String>,
}

/// What numbers look like.
#[derive(Debug, Clone, PartialEq)]
pub struct Look {
    /// Number of numbers.
    pub count: usize,
    /// The least and the greatest of the numbers; `None` for an array without a finite one.
    pub range: Option<[f64; 2]>,
    /// Number of NaN.
    pub missing: usize,
    /// The different values, if they are few.
    pub levels: Option<Vec<f64>>,
    /// Whether the numbers grow in even steps, as times and counters do.
    pub is_counter: bool,
    /// Whether the numbers look like rows of patterns: different whole numbers from 0 on, enough of them for
    /// part of a sweep.
    pub is_rows: bool,
    /// Whether the numbers are complex.
    pub is_complex: bool,
}

impl Look {
    fn of(field: &Field) -> Self {
        let numbers = &field.real;
        let finite = numbers.iter().copied().filter(|number| number.is_finite());
        let range = finite.fold(None, |range: Option<[f64; 2]>, number| {
            let [least, most] = range.unwrap_or([number; 2]);
            Some([least.min(number), most.max(number)])
        });
        let mut levels: Vec<f64> = Vec::new();
        for &number in numbers.iter().filter(|number| !number.is_nan()) {
            if levels.len() <= LEVELS && !levels.contains(&number) {
                levels.push(number);
            }
        }
        levels.sort_unstable_by(f64::total_cmp);
        Self {
            count: numbers.len(),
            range,
            missing: numbers.iter().filter(|number| number.is_nan()).count(),
            levels: (levels.len() <= LEVELS && !levels.is_empty()).then_some(levels),
            is_counter: is_counter(numbers),
            is_rows: is_rows(numbers),
            is_complex: field.imaginary.is_some(),
        }
    }
}

/// Least share of the rows of a sweep that a list of rows has.
const LEAST_SHARE: usize = 8;

fn is_rows(numbers: &[f64]) -> bool {
    let most = numbers.iter().copied().fold(0.0, f64::max);
    let whole = |number: &f64| number.fract() == 0.0 && *number >= 0.0;
    if numbers.len() < 4 || most > f64::from(1 << 16) || !numbers.iter().all(whole) {
        return false;
    }
    let mut seen = vec![false; most as usize + 1];
    let different = numbers.iter().all(|&row| !std::mem::replace(&mut seen[row as usize], true));
    different && seen[0] && LEAST_SHARE * numbers.len() >= seen.len()
}

impl Array {
    /// The axes that are longer than 1.
    #[must_use]
    pub fn axes(&self) -> Vec<usize> {
        self.shape.iter().copied().filter(|&axis| axis != 1).collect()
    }
}

impl Contents {
    /// Opens a file of any format of measurements and looks at its arrays. With `decimal_comma`, every
    /// comma of a text is a decimal comma.
    ///
    /// # Errors
    /// [`FileError`], one line that names file, what was found and what was expected.
    pub fn open(path: &Path, decimal_comma: bool) -> Result<Self, FileError> {
        Self::of_fields(Fields::open(path, decimal_comma)?, decimal_comma)
    }

    /// Readings that are in no file; `origin` names where they come from.
    #[must_use]
    pub fn of_readings(origin: &Path, readings: Vec<f64>) -> Self {
        let field = Field { shape: vec![readings.len()], real: readings, imaginary: None };
        let array = Array {
            name: String::new(),
            shape: field.shape.clone(),
            kind: "numbers".to_owned(),
            numbers: Some(Look::of(&field)),
            problem: None,
        };
        let fields = Fields::of_array(origin, field);
        Self { fields, arrays: vec![array], decimal_comma: false }
    }

    fn of_fields(mut fields: Fields, decimal_comma: bool) -> Result<Self, FileError> {
        let names = match fields.is_unnamed() {
            true => vec![String::new()],
            false => fields.names().to_vec(),
        };
        let array = |name: String| {
            let mut array = Array {
                kind: fields.kind(&name).unwrap_or_default(),
                name,
                shape: Vec::new(),
                numbers: None,
                problem: None,
            };
            match fields.read(&array.name, |_| Ok(())) {
                Ok(field) => {
                    array.numbers = Some(Look::of(&field));
                    if array.kind.is_empty() {
                        let is_complex = field.imaginary.is_some();
                        array.kind = if is_complex { "complex numbers" } else { "numbers" }.into();
                    }
                    array.shape = field.shape;
                }
                Err(FileError::Field { found, .. }) => array.problem = Some(found),
                Err(error) => return Err(error),
            }
            Ok(array)
        };
        let arrays: Vec<Array> = names.into_iter().map(array).collect::<Result<_, _>>()?;
        Ok(Self { fields, arrays, decimal_comma })
    }

    /// The format of the file, in a few words.
    #[must_use]
    pub fn format(&self) -> &'static str {
        self.fields.format()
    }

    /// The arrays.
    #[must_use]
    pub fn arrays(&self) -> &[Array] {
        &self.arrays
    }

    /// Whether the file is one array without a name.
    #[must_use]
    pub fn is_unnamed(&self) -> bool {
        self.fields.is_unnamed()
    }

    /// Whether the file is a text.
    #[must_use]
    pub fn is_text(&self) -> bool {
        self.fields.is_text()
    }

    /// Whether every comma of a text counts as a decimal comma.
    #[must_use]
    pub fn decimal_comma(&self) -> bool {
        self.decimal_comma
    }

    /// What a text has beside its table and is left out, in one line.
    #[must_use]
    pub fn skipped(&self) -> Option<&str> {
        self.fields.skipped()
    }

    /// The real numbers of an array in C order; `None` if they cannot be read.
    pub fn numbers(&mut self, array: &str) -> Option<Vec<f64>> {
        self.fields.read(array, |_| Ok(())).ok().map(|field| field.real)
    }

    /// Where the numbers come from, by what the file says of it.
    pub fn taken(&mut self) -> Taken {
        let taken = self.fields.taken();
        taken.from_file(self.fields.path())
    }

    /// The measurement of this file that a user asks for.
    ///
    /// # Errors
    /// As [`measurement::read`].
    pub fn measurement(&self, want: &Selection) -> Result<MeasurementFile, FileError> {
        measurement::read_fields(self.fields.again()?, want)
    }
}

/// The measurement of readings that were made of the file `path` before, such as those of a trace.
///
/// # Errors
/// As [`measurement::read`].
pub fn of_readings(
    path: &Path,
    readings: Vec<f64>,
    want: &Selection,
) -> Result<MeasurementFile, FileError> {
    let field = Field { shape: vec![readings.len()], real: readings, imaginary: None };
    measurement::read_fields(Fields::of_array(path, field), want)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::file;
    use nirspi_recon::Order;

    fn array<'c>(contents: &'c Contents, name: &str) -> &'c Array {
        contents.arrays().iter().find(|array| array.name == name).unwrap()
    }

    #[test]
    fn arrays_are_told_by_what_their_numbers_look_like() {
        let mut text = "an export\ntime,CH1,TRIG,word\n".to_owned();
        for k in 0..20 {
            let y = if k == 3 { "NaN".to_owned() } else { format!("{}.5", (k * 7) % 11) };
            text += &format!("{:.3},{y},{},ok\n", f64::from(k) * 1e-3, 5 * u8::from(k % 4 == 0));
        }
        let (_folder, path) = file("scope.csv", text.as_bytes());
        let contents = Contents::open(&path, false).unwrap();
        assert_eq!(contents.format(), "a text table");
        assert!(contents.skipped().unwrap().contains("1 line before the table"));
        assert_eq!(contents.arrays().len(), 3);
        let look = |name| array(&contents, name).numbers.clone().unwrap();
        assert!(look("time").is_counter && !look("CH1").is_counter && !look("TRIG").is_counter);
        assert!(!look("CH1").is_rows && !look("TRIG").is_rows && !look("time").is_rows);
        assert!(is_rows(&[3.0, 0.0, 1.0, 2.0]) && is_rows(&[0.0, 30.0, 2.0, 9.0]));
        for other in [
            [3.0, 0.0, 1.0, 3.0],
            [3.0, 0.5, 1.0, 0.0],
            [3.0, 4.0, 1.0, 2.0],
            [0.0, 1.0, 2.0, 40.0],
        ] {
            assert!(!is_rows(&other), "{other:?}");
        }
        assert_eq!((look("CH1").count, look("CH1").missing), (20, 1));
        assert_eq!(look("CH1").range, Some([0.5, 10.5]));
        assert_eq!((look("TRIG").levels, look("CH1").levels), (Some(vec![0.0, 5.0]), None));
    }

    #[test]
    fn a_measurement_is_the_one_that_the_file_gives() {
        let numbers: Vec<f64> = (0..32).map(|k| f64::from((k * 13) % 29)).collect();
        let bytes = crate::npy::encode(&[32], &numbers);
        let (_folder, path) = file("y.npy", &bytes);
        let contents = Contents::open(&path, false).unwrap();
        assert_eq!((contents.format(), &*contents.arrays()[0].kind), ("a NumPy array", "float64"));
        for want in [
            Selection { shown: Some(Order::Natural), ..Selection::default() },
            Selection { shown: Some(Order::ZigZag), transpose: true, ..Selection::default() },
        ] {
            let read = measurement::read(&path, &want).unwrap();
            assert_eq!(contents.measurement(&want).unwrap(), read);
            assert_eq!(contents.measurement(&want).unwrap(), read, "a second time");
            assert_eq!(of_readings(&path, numbers.clone(), &want).unwrap(), read);
        }
    }

    #[test]
    fn what_is_no_array_of_numbers_is_named_with_the_reason() {
        let members = [
            ("y", crate::npy::encode(&[2], &[1.0_f32, 2.0])),
            ("provenance", crate::npy::encode_text("{}")),
        ];
        let (_folder, path) = file("in.npz", b"");
        std::fs::write(&path, crate::archive::encode(&path, &members).unwrap()).unwrap();
        let contents = Contents::open(&path, false).unwrap();
        assert_eq!(array(&contents, "y").kind, "float32");
        let text = array(&contents, "provenance");
        assert!(text.numbers.is_none() && text.problem.is_some(), "{text:?}");
    }
}
