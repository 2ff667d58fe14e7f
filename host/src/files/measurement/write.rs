//! Writes measurements of nirspi as a file for other programs: NumPy `.npz`.

use super::FileError;
use crate::files::{archive, npy};
use nirspi_recon::Measurements;
use std::path::Path;

/// The bytes of a `.npz` file with `n`, `h_row` and `d`. `simulated` is 1 if no real light was
/// measured.
///
/// # Errors
/// [`FileError`] naming `path`, if the archive cannot be written.
pub fn encode(
    path: &Path,
    measurements: &Measurements,
    simulated: bool,
) -> Result<Vec<u8>, FileError> {
    let rows: Vec<i64> = measurements.rows().iter().map(|&row| row.into()).collect();
    let count = [rows.len()];
    archive::encode(
        path,
        &[
            ("n", npy::encode(&[], &[measurements.side().pixels() as i64])),
            ("h_row", npy::encode(&count, &rows)),
            ("d", npy::encode(&count, measurements.values())),
            ("simulated", npy::encode(&[], &[i64::from(simulated)])),
        ],
    )
}
