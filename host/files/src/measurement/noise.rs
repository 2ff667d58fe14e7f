//! What a file says of the noise of its differences, and what its pairs say.

use super::readings::is_reading;
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

/// Fewest sums that tell a noise.
const LEAST_PAIRS: usize = 16;

/// Share of the changes of sums that are smaller than the one that tells the noise, and that change for noise of 1: a lamp that
/// steps changes few sums.
const QUANTILE: (f64, f64) = (0.75, 1.150_35);

/// What the noise of a difference is at most, by the sums of pairs: these see the light of the whole scene, with the same
/// noise. `None` for too few pairs.
pub(super) fn noise_of_pairs(pairs: &[[f64; 2]]) -> Option<f64> {
    let sums: Vec<f64> =
        pairs.iter().map(|[on, off]| on + off).filter(|&sum| is_reading(sum)).collect();
    let mut changes: Vec<f64> = sums.windows(2).map(|two| (two[1] - two[0]).abs()).collect();
    if sums.len() < LEAST_PAIRS {
        return None;
    }
    let (share, expected) = QUANTILE;
    let at = (share * changes.len() as f64) as usize;
    let change = *changes.select_nth_unstable_by(at, f64::total_cmp).1;
    Some(change / expected / std::f64::consts::SQRT_2)
}
