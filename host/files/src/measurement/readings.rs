//! Finds the field of a file that holds the readings, and checks the field's shape.

use super::axes::joined;
use super::form::meaning;
use super::layout::Layout;
use super::sides::two_fields;
use super::{FileError, Form, Selection};
use crate::array::has_shape;
use crate::field::Field;
use crate::fields::{Fields, UNNAMED};
use crate::stored::Stored;
use nirspi_recon::law::OVERLOAD;
use std::path::Path;

/// Whether a number of a file is a reading. NaN and the numbers by which instruments report an overload are none.
#[must_use]
pub fn is_reading(value: f64) -> bool {
    value.abs() < OVERLOAD
}

/// A field of readings, and the layout of its measurements.
pub(super) struct NamedReadings {
    /// The field's name for messages.
    pub(super) name: String,
    /// The numbers, if opening the field has read them.
    numbers: Option<Field>,
    pub(super) layout: Layout,
}

/// The expected shape of a field of readings.
pub(super) struct Expected<'w> {
    pub(super) form: Form,
    /// The shape of the rows.
    pub(super) rows: Vec<u64>,
    pub(super) length: usize,
    pub(super) meaning: &'w str,
    pub(super) hint: Hint<'w>,
}

/// Another length that the field may have, and the hint that an error gives for it.
pub(super) struct Hint<'w> {
    pub(super) length: usize,
    pub(super) words: &'w str,
}

impl NamedReadings {
    pub(super) fn new(name: String, layout: Layout, numbers: Option<Field>) -> Self {
        Self { name, numbers, layout }
    }

    /// The numbers of these readings, all of them.
    pub(super) fn numbers(&mut self, fields: &mut Fields) -> Result<Field, FileError> {
        match self.numbers.take() {
            Some(numbers) => Ok(numbers),
            // The shape fits: it was checked when the field was opened.
            None => fields.read(&self.name, |_| Ok(())),
        }
    }

    /// The numbers in the file, if opening the field has not read them and they lie there as they
    /// are.
    pub(super) fn stored(&self, fields: &mut Fields) -> Result<Option<Stored>, FileError> {
        match self.numbers {
            Some(_) => Ok(None),
            None => fields.stored(&self.name),
        }
    }

    pub(super) fn open(
        fields: &mut Fields,
        name: String,
        want: &Selection,
        expected: &Expected<'_>,
    ) -> Result<Self, FileError> {
        let Expected { form, rows, length, meaning, hint } = expected;
        let joined = |shape: &[u64]| match want.patterns_first {
            true => shape.to_vec(),
            false => joined(shape, Some(rows), *form),
        };
        let fits = |shape: &[u64], length| {
            Layout::of(&joined(shape), length, want.patterns_first).is_some()
        };
        let (shape, numbers) = fields.open_field(&name, |shape| {
            if fits(shape, *length) {
                return Ok(());
            }
            let hint = match () {
                () if Layout::of(shape, *length, !want.patterns_first).is_some() => {
                    match want.patterns_first {
                        true => "; patterns are along its last axis: leave out --patterns-first",
                        false => "; patterns are along its first axis: add --patterns-first",
                    }
                }
                () if fits(shape, hint.length) => hint.words,
                () => "",
            };
            let axes = match want.patterns_first {
                true => format!("({length}, ...)"),
                false => format!("({length},) or (..., {length})"),
            };
            Err(format!("{axes}: {meaning}{hint}"))
        })?;
        let name = if fields.is_unnamed() { UNNAMED.to_owned() } else { name };
        let layout =
            Layout::of(&joined(&shape), *length, want.patterns_first).ok_or_else(|| {
                FileError::field(
                    fields.path(),
                    name.clone(),
                    has_shape(&shape),
                    "the shape of its header",
                )
            })?;
        Ok(Self { name, numbers, layout })
    }
}

/// The names of the file's fields, for an error message.
pub(super) fn found_names(fields: &Fields) -> Vec<String> {
    match fields.is_unnamed() {
        true => vec!["one array without a name".to_owned()],
        false => fields.names().to_vec(),
    }
}

/// Finds the field of the readings.
pub(super) fn readings_field(fields: &mut Fields, want: &Selection) -> Result<String, FileError> {
    let (path, found) = (fields.path().to_owned(), found_names(fields));
    let missing = |field, expected| Err(FileError::missing(&path, field, &found, expected));
    if fields.is_unnamed() {
        return match &want.field {
            None => {
                fields.column_beside_counters();
                Ok("y".to_owned())
            }
            Some(_) => missing("--field", "no --field for an array without a name"),
        };
    }
    if let Some(field) = &want.field {
        if let Some(both) = twice(fields, field) {
            return Ok(both);
        }
        return match fields.holds(field) || two_fields(fields, field).is_some() {
            true => Ok(field.clone()),
            false => {
                let expected = format!("--field with one of {}", fields.names().join(", "));
                Err(FileError::field(fields.path(), field.clone(), "is not in the file", expected))
            }
        };
    }
    // If a file without rows has one field only, the field must be the readings.
    if let [only] = fields.names()
        && only != "d"
    {
        if fields.is_counter_of_words() {
            let found = "counts in even steps, as times and numbers of lines do";
            let expected = "a column of readings: numbers without units";
            return Err(FileError::field(fields.path(), only.clone(), found, expected));
        }
        return Ok(only.clone());
    }
    match ["y", "d"].into_iter().find(|name| fields.holds(name)) {
        Some("d") if matches!(want.form, Some(Form::Single | Form::Pairs | Form::Halves)) => {
            missing("y", "y, the readings; `d` holds differences")
        }
        Some(name) if matches!(want.form, None | Some(Form::Pairs)) => {
            let both = twice(fields, &format!("{name},{name}"));
            if both.is_some() {
                fields.note(format!("the columns `{name}` are pattern and complement"));
            }
            Ok(both.unwrap_or_else(|| name.to_owned()))
        }
        Some(name) => Ok(name.to_owned()),
        None if !["h_row", "n", "sign"].iter().any(|name| fields.holds(name))
            && let Some(only) = fields.column_beside_counters() =>
        {
            Ok(only)
        }
        None => missing("d", "y (raw readings) or d (differential), or --field NAME"),
    }
}

/// The two columns of a text that are called by one name, which stands twice in `field`.
fn twice(fields: &Fields, field: &str) -> Option<String> {
    let (first, second) = field.split_once(',')?;
    let other = format!("{}.1", second.trim());
    let is_twice = first.trim() == second.trim() && fields.is_columns() && fields.holds(&other);
    is_twice.then(|| format!("{},{other}", first.trim()))
}

/// The shape that readings of this form must have for so many rows, for an error message.
pub(super) fn expected_of(form: Form, rows: usize, shape: Vec<u64>) -> Expected<'static> {
    let hint = match form {
        Form::Pairs | Form::Halves => Hint {
            length: rows,
            words: "; one reading a row is read with --readings single, one difference a row with --readings differences",
        },
        Form::Single => Hint {
            length: 2 * rows,
            words: "; these look like +, - pairs: leave out --readings single (--non-differential)",
        },
        Form::Differences => {
            Hint { length: 2 * rows, words: "; +, - pairs are read with --readings pairs" }
        }
    };
    Expected { form, rows: shape, length: rows * form.readings(), meaning: meaning(form), hint }
}

/// Refuses infinite readings. NaN marks a pattern that was not read; an infinite reading is a
/// mistake.
pub(super) fn check_infinite(path: &Path, field: &str, values: &[f64]) -> Result<(), FileError> {
    match values.iter().position(|value| value.is_infinite()) {
        None => Ok(()),
        Some(at) => {
            let found = format!("is {} at [{at}]", values[at]);
            Err(FileError::field(
                path,
                field,
                found,
                "finite numbers, or NaN for a pattern that was not read",
            ))
        }
    }
}
