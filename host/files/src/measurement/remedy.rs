//! What must be done with the readings of a file before they are those of its form.

use super::{FileError, Form};
use nirspi_recon::law::LampReadings;
use nirspi_recon::words::count_of;
use std::path::Path;

/// What must be done with the readings of a file, because the user says so. The default is nothing.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Remedy {
    /// Each complement comes before its pattern.
    pub complements_first: bool,
    /// All readings have the other sign: more light gives a lower reading.
    pub inverted: bool,
    /// Number of first readings of the sweep that the file lacks; if negative, number of readings in the file that
    /// were taken before the sweep.
    pub shift: i32,
    /// Number of sweeps in the file, one after another; 0 is one sweep.
    pub sweeps: u32,
    /// Readings are divided by the lamp's level: the sum of their pair, or the all-on readings among them.
    pub divide_by_lamp: bool,
}

impl Remedy {
    /// Number of sweeps, at least 1.
    #[must_use]
    pub fn sweeps(self) -> usize {
        self.sweeps.max(1) as usize
    }

    /// Refuses what the form of the readings leaves no room for. `rows` are those shown.
    pub(super) fn check(
        self,
        path: &Path,
        field: &str,
        form: Form,
        rows: &[Option<u32>],
    ) -> Result<(), FileError> {
        if form.readings() == 2 {
            return Ok(());
        }
        let found = format!("holds no complements ({})", form.name());
        let refused = |found: String, expected: &str| {
            let expected = format!("--readings pairs or halves{expected}");
            Err(FileError::field(path, field, found, expected))
        };
        match self {
            Self { complements_first: true, .. } => refused(found, " with --complements-first"),
            Self { divide_by_lamp: true, .. }
                if !LampReadings::are_enough(&all_on(rows), rows.len()) =>
            {
                let shown = count_of(all_on(rows).len(), "all-on reading");
                let expected = ", or the all-on pattern at least 4 times over the sweep, with --divide-by-lamp";
                refused(format!("{found} and {shown}"), expected)
            }
            _ => Ok(()),
        }
    }

    /// The place among the readings of the file of the reading at `at`; `None` for a reading that is missing.
    pub(super) fn place(self, form: Form, patterns: usize, at: usize) -> Option<usize> {
        let at = match form {
            Form::Pairs if self.complements_first => at ^ 1,
            Form::Halves if self.complements_first => (at + patterns) % (2 * patterns),
            _ => at,
        };
        usize::try_from(at as i64 - i64::from(self.shift)).ok()
    }

    /// The readings of the form; NaN for one that is missing.
    pub(super) fn applied(self, form: Form, patterns: usize, readings: Vec<f64>) -> Vec<f64> {
        if self == Self::default() {
            return readings;
        }
        let sign = if self.inverted { -1.0 } else { 1.0 };
        let of = |at| self.place(form, patterns, at).and_then(|place| readings.get(place));
        (0..readings.len()).map(|at| of(at).map_or(f64::NAN, |reading| sign * reading)).collect()
    }
}

/// The places of the all-on pattern among the rows shown.
pub(super) fn all_on(rows: &[Option<u32>]) -> Vec<usize> {
    (0..rows.len()).filter(|&at| rows[at] == Some(0)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_come_to_their_places_and_keep_the_number_of_the_file() {
        let is = |remedy: Remedy, form, expected: [f64; 6]| {
            let found = remedy.applied(form, 3, vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
            for (at, (found, expected)) in found.iter().zip(expected).enumerate() {
                assert!(found == &expected || found.is_nan() && expected.is_nan(), "{remedy:?}");
                if !found.is_nan() {
                    let place = remedy.place(form, 3, at).unwrap();
                    assert_eq!(found.abs(), place as f64 + 1.0, "{remedy:?}");
                }
            }
        };
        let none = Remedy::default();
        let first = Remedy { complements_first: true, ..none };
        is(none, Form::Pairs, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        is(first, Form::Pairs, [2.0, 1.0, 4.0, 3.0, 6.0, 5.0]);
        is(first, Form::Halves, [4.0, 5.0, 6.0, 1.0, 2.0, 3.0]);
        let inverted = Remedy { inverted: true, ..none };
        is(inverted, Form::Single, [-1.0, -2.0, -3.0, -4.0, -5.0, -6.0]);
        let nan = f64::NAN;
        is(Remedy { shift: 2, ..none }, Form::Single, [nan, nan, 1.0, 2.0, 3.0, 4.0]);
        is(Remedy { shift: -1, ..none }, Form::Single, [2.0, 3.0, 4.0, 5.0, 6.0, nan]);
        is(Remedy { shift: 1, ..first }, Form::Pairs, [1.0, nan, 3.0, 2.0, 5.0, 4.0]);
        assert_eq!((none.sweeps(), Remedy { sweeps: 4, ..none }.sweeps()), (1, 4));
    }
}
