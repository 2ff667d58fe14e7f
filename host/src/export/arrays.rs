//! Arrays for NumPy, and a table for spreadsheets.

use super::{ExportError, Whole};
use crate::files::FileError;
use crate::files::archive::write_members;
use crate::files::measurement::noise_of;
use crate::files::npy::{Element, encode, encode_text, header};
use crate::files::output::{Existing, write_in_pieces, write_result};
use crate::files::provenance::FIELD;
use crate::provenance::{Provenance, beside_array};
use crate::source::Stamp;
use std::io::{self, Write};
use std::path::Path;

/// Writes a `.npz` file.
pub(super) fn npz(
    whole: &Whole<'_>,
    out: &Path,
    existing: Existing<'_>,
    provenance: &Provenance,
) -> Result<(), ExportError> {
    write_members(out, existing, |zip| {
        let rows = whole.source.measurements.rows();
        let h_row: Vec<i64> = rows.iter().map(|&row| row.into()).collect();
        let m = h_row.len();
        zip.add("n", &encode(&[], &[rows.side().pixels() as i64]))?;
        zip.add("h_row", &encode(&[m], &h_row))?;
        zip.add("d", &encode(&[m], whole.source.measurements.values()))?;
        for (name, sigma) in noise_of(&whole.source.measurements) {
            zip.add(name, &encode(&[], &[sigma]))?;
        }
        zip.add("simulated", &encode(&[], &[i64::from(whole.is_simulated())]))?;
        zip.add(FIELD, &encode_text(&provenance.json()))?;
        zip.begin("frames")?;
        let stamps = frames(whole, |bytes| zip.write(bytes))?;
        let mut add = |name: &str, of: fn(&Stamp) -> i64| {
            let all: Vec<i64> = stamps.iter().map(of).collect();
            zip.add(name, &encode(&[all.len()], &all))
        };
        add("sequence", |stamp| stamp.sequence)?;
        add("device_time_us", |stamp| stamp.device_time_us as i64)?;
        add("time_ns", |stamp| stamp.time_ns as i64)?;
        Ok(())
    })
}

/// Writes the readings of each frame as one array (F, M), and the provenance into a file beside it.
pub(super) fn npy(
    whole: &Whole<'_>,
    out: &Path,
    existing: Existing<'_>,
    provenance: &Provenance,
) -> Result<(), ExportError> {
    let beside = beside_array(out);
    existing.check(&beside)?;
    write_in_pieces(out, existing, |file| {
        frames(whole, |bytes| {
            file.write_all(bytes).map_err(|error| FileError::io(out, "write", error))
        })
        .map(|_| ())
    })?;
    let text = provenance.sign(&serde_json::json!({})).unwrap_or_default();
    Ok(write_result(&beside, existing, text.as_bytes())?)
}

/// Hands out the bytes of a `.npy` file of all frames, piece by piece. Returns their numbers and times.
fn frames(
    whole: &Whole<'_>,
    mut write: impl FnMut(&[u8]) -> Result<(), FileError>,
) -> Result<Vec<Stamp>, ExportError> {
    let shape = [whole.frames.len(), whole.source.measurements.rows().len()];
    write(&header::<f64>(&shape))?;
    let (mut bytes, mut stamps) = (Vec::new(), Vec::new());
    whole.each(|stamp, measurements| {
        stamps.push(stamp);
        bytes.clear();
        measurements.values().iter().for_each(|value| value.append(&mut bytes));
        write(&bytes)
    })?;
    Ok(stamps)
}

/// Writes the mean of all frames, one pattern a line, under the heading `n,h_row,d,noise`, without
/// `noise` if that is not known. The numbers read back as they were. Comments before the heading have the provenance.
pub(super) fn csv(
    whole: &Whole<'_>,
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
            writeln!(file, "# mean of {} frames, ADC counts{what}", whole.frames.len())?;
            writeln!(file, "# {FIELD}: {}", provenance.json())?;
            // Such as that the mean is one of the newest frames alone.
            whole.source.notes.iter().try_for_each(|note| writeln!(file, "# note: {note}"))?;
            // The noise of `d` is the same for all.
            let (mut heading, mut noise) = ("n,h_row,d".to_owned(), String::new());
            for (name, sigma) in noise_of(measurements) {
                heading += &format!(",{name}");
                noise += &format!(",{sigma:?}");
            }
            writeln!(file, "{heading}")?;
            // A point shows that commas separate numbers.
            lines.into_iter().try_for_each(|(row, d)| writeln!(file, "{n},{row},{d:?}{noise}"))
        };
        Ok(write().map_err(|error| FileError::io(out, "write", error))?)
    })
}
