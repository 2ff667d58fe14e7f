//! What a file says of the noise of its differences.

use crate::fields::Fields;

/// The field with the standard deviation of the noise of `d`, if it is known.
pub const NOISE: &str = "noise";

/// The field with what that noise is at most, if more than the differences says so.
pub const MOST_NOISE: &str = "most_noise";

/// A standard deviation for all measurements of a file, or one for each of them. NaN: unknown.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Deviations(Vec<f64>);

impl Deviations {
    /// What the field says of `count` measurements. A field of another kind says nothing.
    pub(super) fn read(fields: &mut Fields, name: &str, count: usize) -> Self {
        if fields.is_unnamed() || !fields.holds(name) {
            return Self::default();
        }
        let Ok(field) = fields.read(name, |_| Ok(())) else { return Self::default() };
        let mut values = field.real;
        if values.len() != count {
            // A column of a table repeats the number in every line.
            values.truncate(1);
        }
        Self(values)
    }

    /// That of the measurement of this index.
    pub(super) fn of(&self, index: usize) -> Option<f64> {
        let value = *self.0.get(index).or(self.0.first())?;
        (value.is_finite() && value >= 0.0).then_some(value)
    }
}
