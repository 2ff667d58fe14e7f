//! Arrays for NumPy, and a table for spreadsheets.

use super::{ExportError, Whole};
use crate::files::FileError;
use crate::files::archive::write_members;
use crate::files::measurement::{NOISE, PROVENANCE};
use crate::files::npy::{Element, encode, encode_text, header};
use crate::files::output::{Existing, write_in_pieces, write_result};
use crate::provenance::Provenance;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Writes a `.npz` file.
pub(super) fn npz(
    whole: &Whole,
    out: &Path,
    existing: Existing<'_>,
    provenance: &Provenance,
) -> Result<(), ExportError> {
    write_members(out, existing, |zip| {
        let rows = whole.source.measurements.rows();
        let h_row: Vec<i64> = rows.iter().map(|&row| row.into()).collect();
        let [m, count] = [h_row.len(), whole.frames()];
        zip.add("n", &encode(&[], &[rows.side().pixels() as i64]))?;
        zip.add("h_row", &encode(&[m], &h_row))?;
        zip.add("d", &encode(&[m], whole.source.measurements.values()))?;
        if let Some(noise) = whole.source.measurements.noise() {
            zip.add(NOISE, &encode(&[], &[noise]))?;
        }
        zip.add("sequence", &encode(&[count], &whole.sequence))?;
        zip.add("device_time_us", &encode(&[count], &whole.device_time_us))?;
        zip.add("time_ns", &encode(&[count], &whole.time_ns))?;
        zip.add("simulated", &encode(&[], &[i64::from(whole.is_simulated())]))?;
        zip.add(PROVENANCE, &encode_text(&provenance.json()))?;
        zip.begin("frames")?;
        frames(whole, |bytes| zip.write(bytes))
    })
}

/// Writes the readings of each frame as one array (F, M), and the provenance into a file beside it.
pub(super) fn npy(
    whole: &Whole,
    out: &Path,
    existing: Existing<'_>,
    provenance: &Provenance,
) -> Result<(), ExportError> {
    let beside = beside(out);
    existing.check(&beside)?;
    write_in_pieces(out, existing, |file| {
        frames(whole, |bytes| {
            file.write_all(bytes).map_err(|error| FileError::io(out, "write", error))
        })
    })?;
    let text = provenance.sign(&serde_json::json!({})).unwrap_or_default();
    Ok(write_result(&beside, existing, text.as_bytes())?)
}

/// The file with the provenance of an `.npy` file: the same name with `.json` after it.
fn beside(out: &Path) -> PathBuf {
    let mut name = out.as_os_str().to_owned();
    name.push(".json");
    name.into()
}

/// Hands out the bytes of a `.npy` file of all frames, piece by piece.
fn frames(
    whole: &Whole,
    mut write: impl FnMut(&[u8]) -> Result<(), FileError>,
) -> Result<(), ExportError> {
    let shape = [whole.frames(), whole.source.measurements.rows().len()];
    write(&header::<f64>(&shape))?;
    let mut bytes = Vec::new();
    whole.each(|_, measurements| {
        bytes.clear();
        measurements.values().iter().for_each(|value| value.append(&mut bytes));
        Ok(write(&bytes)?)
    })
}

/// Writes the mean of all frames, one pattern a line, under the heading `n,h_row,d,noise`, without
/// `noise` if that is not known. The numbers
/// read back as they were. Comments before the heading have the provenance.
pub(super) fn csv(
    whole: &Whole,
    out: &Path,
    existing: Existing<'_>,
    provenance: &Provenance,
) -> Result<(), ExportError> {
    let measurements = &whole.source.measurements;
    let n = measurements.side().pixels();
    write_in_pieces(out, existing, |file| {
        let lines = measurements.rows().iter().zip(measurements.values());
        let write = || -> io::Result<()> {
            let what = if whole.is_simulated() { ", simulated" } else { "" };
            writeln!(file, "# mean of {} frames, ADC counts{what}", whole.frames())?;
            writeln!(file, "# {PROVENANCE}: {}", provenance.json())?;
            // The noise of `d` is the same for all.
            let noise = measurements.noise().map(|noise| format!(",{noise:?}"));
            let (heading, noise) = match &noise {
                Some(noise) => ("n,h_row,d,noise", noise.as_str()),
                None => ("n,h_row,d", ""),
            };
            writeln!(file, "{heading}")?;
            // A point shows that commas separate numbers.
            lines.into_iter().try_for_each(|(row, d)| writeln!(file, "{n},{row},{d:?}{noise}"))
        };
        Ok(write().map_err(|error| FileError::io(out, "write", error))?)
    })
}
