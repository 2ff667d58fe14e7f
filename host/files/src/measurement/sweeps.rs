//! Sweeps of the same patterns that come one after another, without a file.

use super::opened::{Loaded, Opened};
use super::{FileError, Form, MeasurementFile, Selection};
use crate::field::Field;
use crate::fields::Fields;
use nirspi_recon::Side;
use std::path::Path;

/// The most memory for the measurements and images of a whole file.
const MOST_BYTES: u64 = 4 << 30;

/// How many measurements of one file fit into memory together, with their images: for each pattern a row and its
/// reading, for each pixel the image as it is computed and as it is written.
#[must_use]
pub fn most_together(patterns: usize, pixels: usize) -> u64 {
    let each = 512 + 24 * patterns as u64 + 12 * pixels as u64;
    MOST_BYTES / each
}

/// Sweeps of the same patterns, each of which becomes what a file with its readings gives.
///
/// # Invariant
/// [`read`](Self::read) gives what [`read`](super::read) makes of a file with the same `n`, `h_row` and readings
/// (`tests::a_sweep_is_read_as_a_file_with_its_readings_is`).
pub struct Sweeps(Opened);

impl Sweeps {
    /// Sweeps of these rows, in this form. Messages name `origin`.
    ///
    /// # Errors
    /// [`FileError`] if there are no rows, or if the rows do not fit the side.
    pub fn new(
        origin: &Path,
        side: Side,
        rows: &[u32],
        form: Form,
        simulated: Option<bool>,
    ) -> Result<Self, FileError> {
        let one = |value: f64| Field { shape: Vec::new(), real: vec![value], imaginary: None };
        let list = |real: Vec<f64>| Field { shape: vec![real.len()], real, imaginary: None };
        let readings = if form == Form::Differences { "d" } else { "y" };
        let mut fields = vec![
            ("n".to_owned(), one(side.pixels() as f64)),
            ("h_row".to_owned(), list(rows.iter().map(|&row| row.into()).collect())),
            (readings.to_owned(), list(vec![0.0; rows.len() * form.readings()])),
        ];
        let simulated = simulated.map(|simulated| one(f64::from(u8::from(simulated))));
        fields.extend(simulated.map(|field| ("simulated".to_owned(), field)));
        let want = Selection { form: Some(form), ..Selection::default() };
        Opened::of(Fields::of_fields(origin, fields), &want).map(Self)
    }

    /// The measurement of one sweep. NaN: the pattern was not read.
    ///
    /// # Errors
    /// As [`read`](super::read).
    ///
    /// # Panics
    /// If these are not the readings of a whole sweep.
    pub fn read(&self, readings: Vec<f64>) -> Result<MeasurementFile, FileError> {
        let expected = self.0.patterns() * self.0.form.readings();
        assert_eq!(readings.len(), expected, "readings of a sweep");
        let numbers = Field { shape: vec![expected], real: readings, imaginary: None };
        Loaded { opened: &self.0, numbers }.measurement(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::read;
    use crate::testing::{Zip, file, npy_f64, npy_i32, zip};

    #[test]
    fn a_sweep_is_read_as_a_file_with_its_readings_is() {
        let side = Side::new(2).unwrap();
        let rows = [0, 3, 3, 1];
        for form in Form::ALL {
            let count = rows.len() * form.readings();
            let mut readings: Vec<f64> = (1..=count as u32).map(f64::from).collect();
            readings[2] = f64::NAN;
            let field = if form == Form::Differences { "d.npy" } else { "y.npy" };
            let members = [
                ("n.npy", npy_i32("()", &[2])),
                ("h_row.npy", npy_i32("(4,)", &rows.map(|row| row as i32))),
                (field, npy_f64(&format!("({count},)"), &readings)),
            ];
            let (_folder, path) = file("lab.npz", &zip(Zip::Stored, &members));
            let want = Selection { form: Some(form), ..Selection::default() };
            let sweeps = Sweeps::new(Path::new("feed"), side, &rows, form, None).unwrap();
            assert_eq!(sweeps.read(readings).unwrap(), read(&path, &want).unwrap(), "{form:?}");
        }
        let refused = Sweeps::new(Path::new("feed"), side, &[4], Form::Single, None);
        let line = refused.err().unwrap().to_string();
        assert!(line.starts_with("feed: `h_row` is 4 at [0]"), "{line}");
    }
}
