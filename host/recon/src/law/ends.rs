//! Readings that are equal to the greatest or the least one, as those beyond a converter's ends are.

use super::{Doubt, Extreme};

/// Least share of the readings that are equal where they are clipped, least number, and how many times
/// more often than the next value.
const CLIPPED_SHARE: f64 = 0.01;
const CLIPPED_LEAST: usize = 4;
const PILED_UP: usize = 2;

/// The least or the greatest reading.
pub(super) struct End {
    pub(super) value: f64,
    /// Number of readings that are equal.
    pub(super) equal: usize,
    /// Whether they are as many as where readings are clipped.
    pub(super) is_pile: bool,
}

impl End {
    pub(super) fn clipped(&self, readings: usize, extreme: Extreme) -> Doubt {
        Doubt::Clipped { readings, equal: self.equal, value: self.value, extreme }
    }
}

/// The least and the greatest of at least one reading.
pub(super) fn ends(readings: &[f64]) -> [End; 2] {
    let run = |value: f64| readings.iter().filter(|&&y| y == value).count();
    let end = |further: fn(&f64, &f64) -> bool| {
        let farthest = |all: &mut dyn Iterator<Item = f64>| {
            all.reduce(|a, b| if further(&b, &a) { b } else { a })
        };
        let value = farthest(&mut readings.iter().copied()).unwrap_or(f64::NAN);
        let next = farthest(&mut readings.iter().copied().filter(|&y| y != value)).map_or(0, run);
        let equal = run(value);
        let enough = ((CLIPPED_SHARE * readings.len() as f64) as usize).max(CLIPPED_LEAST);
        End { value, equal, is_pile: equal >= enough && equal > PILED_UP * next }
    };
    [end(|a, b| a < b), end(|a, b| a > b)]
}
