//! Writes measurements of nirspi as a file for other programs: NumPy `.npz`.

use super::FileError;
use super::noise::{MOST_NOISE, NOISE};
use crate::npy::Element;
use crate::output::Existing;
use crate::provenance::{self, Provenance};
use crate::{archive, npy};
use nirspi_recon::Measurements;
use std::path::Path;

/// The field of an `.npz` file with the form of `y`, as text.
pub const READINGS: &str = "readings";

/// Readings that are encoded at a time.
const PIECE: usize = 1 << 13;

/// The bytes of a `.npz` file with `n`, `h_row`, `d`, its `noise` and what that is at most, if they are known, and the
/// provenance as JSON text. `simulated` is 1 if no real light was measured, and is left out if that is not known.
///
/// # Errors
/// [`FileError`] naming `path`, if the archive cannot be written.
pub fn encode(
    path: &Path,
    measurements: &Measurements,
    provenance: &Provenance,
) -> Result<Vec<u8>, FileError> {
    let rows: Vec<i64> = measurements.rows().iter().map(|&row| row.into()).collect();
    let count = [rows.len()];
    let mut members = vec![
        ("n", npy::encode(&[], &[measurements.side().pixels() as i64])),
        ("h_row", npy::encode(&count, &rows)),
        ("d", npy::encode(&count, measurements.values())),
        (provenance::FIELD, npy::encode_text(&provenance.json())),
    ];
    let simulated = provenance.taken.simulated();
    members.extend(noise_of(measurements).map(|(name, sigma)| (name, npy::encode(&[], &[sigma]))));
    members.extend(simulated.map(|s| ("simulated", npy::encode(&[], &[i64::from(s)]))));
    archive::encode(path, &members)
}

/// The fields with what is known of the noise of measurements.
pub fn noise_of(measurements: &Measurements) -> impl Iterator<Item = (&'static str, f64)> {
    let known = measurements.noise().map(|noise| (NOISE, noise));
    known.into_iter().chain(measurements.most_noise().map(|most| (MOST_NOISE, most)))
}

/// Writes readings of patterns that the file does not name to a `.npz` file, whole or not at all: `y`, and the provenance as
/// JSON text.
///
/// # Errors
/// [`FileError`], if the name is taken or the system refuses.
pub fn write_readings(
    path: &Path,
    existing: Existing<'_>,
    readings: &[f64],
    provenance: &Provenance,
) -> Result<(), FileError> {
    archive::write_members(path, existing, |zip| {
        zip.add(provenance::FIELD, &npy::encode_text(&provenance.json()))?;
        zip.begin("y")?;
        zip.write(&npy::header::<f64>(&[readings.len()]))?;
        // Millions of readings are not in memory twice.
        let mut bytes = Vec::new();
        for piece in readings.chunks(PIECE) {
            bytes.clear();
            piece.iter().for_each(|reading| reading.append(&mut bytes));
            zip.write(&bytes)?;
        }
        Ok(())
    })
}
