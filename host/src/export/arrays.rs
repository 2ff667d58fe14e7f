//! Arrays for NumPy, and a table for spreadsheets.

use super::{ExportError, Whole};
use crate::files::FileError;
use crate::files::measurement::{NOISE, PROVENANCE};
use crate::files::npy::{Element, encode, encode_text, header};
use crate::files::output::{Existing, write_in_pieces, write_result};
use crate::provenance::Provenance;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Writes a `.npz` file. Its members are not compressed, because readings are noise for a
/// compressor.
pub(super) fn npz(
    whole: &Whole,
    out: &Path,
    existing: Existing<'_>,
    provenance: &Provenance,
) -> Result<(), ExportError> {
    write_in_pieces(out, existing, |file| {
        let mut file = Until { file, at: 0, ended: false };
        let mut zip = Members { zip: ZipWriter::new(&mut file), out };
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
        frames(whole, out, &mut zip.zip)?;
        let wrong = |error: zip::result::ZipError| FileError::io(out, "write", error.into());
        zip.zip.finish().map_err(wrong)?;
        Ok(())
    })
}

/// A file that takes bytes until its first error, and lets what follows go by. A `ZipWriter` that is dropped after an
/// error tries to write its index all the same, and prints why it cannot; the first error is ours to tell.
struct Until<W> {
    file: W,
    /// Where the next bytes go, or would go.
    at: u64,
    ended: bool,
}

impl<W: Write> Write for Until<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let taken = if self.ended { Ok(bytes.len()) } else { self.file.write(bytes) };
        self.ended |= taken.is_err();
        self.at += *taken.as_ref().unwrap_or(&0) as u64;
        taken
    }

    fn flush(&mut self) -> io::Result<()> {
        let flushed = if self.ended { Ok(()) } else { self.file.flush() };
        self.ended |= flushed.is_err();
        flushed
    }
}

impl<W: Seek> Seek for Until<W> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let at = match to {
            _ if !self.ended => self.file.seek(to),
            SeekFrom::Start(at) => Ok(at),
            SeekFrom::Current(by) | SeekFrom::End(by) => Ok(self.at.saturating_add_signed(by)),
        };
        self.ended |= at.is_err();
        self.at = *at.as_ref().unwrap_or(&self.at);
        at
    }
}

struct Members<'o, W: Write + Seek> {
    zip: ZipWriter<W>,
    out: &'o Path,
}

impl<W: Write + Seek> Members<'_, W> {
    fn begin(&mut self, field: &str) -> Result<(), FileError> {
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Stored)
            .large_file(true);
        self.zip
            .start_file(format!("{field}.npy"), options)
            .map_err(|error| FileError::io(self.out, "write", error.into()))
    }

    fn add(&mut self, field: &str, bytes: &[u8]) -> Result<(), FileError> {
        self.begin(field)?;
        self.zip.write_all(bytes).map_err(|error| FileError::io(self.out, "write", error))
    }
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
    write_in_pieces(out, existing, |file| frames(whole, out, file))?;
    let text = provenance.sign(&serde_json::json!({})).unwrap_or_default();
    Ok(write_result(&beside, existing, text.as_bytes())?)
}

/// The file with the provenance of an `.npy` file: the same name with `.json` after it.
fn beside(out: &Path) -> PathBuf {
    let mut name = out.as_os_str().to_owned();
    name.push(".json");
    name.into()
}

fn frames(whole: &Whole, out: &Path, to: &mut impl Write) -> Result<(), ExportError> {
    let write = |to: &mut dyn Write, bytes: &[u8]| {
        to.write_all(bytes).map_err(|error| FileError::io(out, "write", error))
    };
    let shape = [whole.frames(), whole.source.measurements.rows().len()];
    write(to, &header::<f64>(&shape))?;
    let mut bytes = Vec::new();
    whole.each(|_, measurements| {
        bytes.clear();
        measurements.values().iter().for_each(|value| value.append(&mut bytes));
        Ok(write(to, &bytes)?)
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
