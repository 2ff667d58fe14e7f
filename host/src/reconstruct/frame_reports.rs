//! The report of each image of a stack, on the disk: there may be millions.
//!
//! # Invariant
//! As JSON they are a list with one line for each image, whatever their number, and are never in memory together
//! (`tests::reports_come_back_in_their_order_with_what_was_added`).

use serde::Serialize;
use serde::ser::{Error, SerializeSeq, Serializer};
use serde_json::value::RawValue;
use std::fs::File;
use std::io::{self, BufRead, BufReader, BufWriter, Seek, Write};

/// Reports in the order of their images.
#[derive(Debug)]
pub struct FrameReports {
    file: File,
    count: usize,
}

/// Reports that are being written.
#[derive(Debug)]
pub(super) struct Writer {
    file: BufWriter<File>,
    count: usize,
}

impl Writer {
    /// None yet. They are kept in this file.
    pub(super) fn new(file: File) -> Self {
        Self { file: BufWriter::with_capacity(1 << 16, file), count: 0 }
    }

    /// Adds the report of the next image, a structure with at least one field.
    pub(super) fn push(&mut self, report: &impl Serialize) -> io::Result<()> {
        serde_json::to_writer(&mut self.file, report)?;
        self.line("")
    }

    fn line(&mut self, line: &str) -> io::Result<()> {
        self.count += 1;
        writeln!(self.file, "{line}")
    }

    /// Brings what there is to the disk.
    pub(super) fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }

    /// The reports that were flushed, without those behind them, which may not fit.
    pub(super) fn flushed(self, count: usize) -> io::Result<FrameReports> {
        let (file, _) = self.file.into_parts();
        FrameReports { file, count }.first(count)
    }

    pub(super) fn finish(self) -> io::Result<FrameReports> {
        let file = self.file.into_inner().map_err(io::IntoInnerError::into_error)?;
        Ok(FrameReports { file, count: self.count })
    }
}

impl FrameReports {
    /// Number of reports.
    #[must_use]
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether there is no report.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The first reports alone.
    pub(super) fn first(self, count: usize) -> io::Result<Self> {
        let mut bytes = 0;
        for line in self.lines()?.take(count) {
            bytes += line?.len() as u64 + 1;
        }
        self.file.set_len(bytes)?;
        Ok(Self { count, ..self })
    }

    /// Number of bytes of these reports.
    pub(super) fn bytes(&self) -> io::Result<u64> {
        Ok(self.file.metadata()?.len())
    }

    /// The same reports in another file. The first ones have a field of this name more, with these values.
    pub(super) fn with(&self, name: &str, values: &Self, to: File) -> io::Result<Self> {
        let (mut all, mut values) = (Writer::new(to), values.lines()?);
        for line in self.lines()? {
            let line = line?;
            // A line is a JSON object that is not empty.
            match (values.next().transpose()?, line.strip_suffix('}')) {
                (Some(value), Some(open)) => all.line(&format!("{open},\"{name}\":{value}}}"))?,
                _ => all.line(&line)?,
            }
        }
        all.finish()
    }

    /// The reports, each as a line of JSON.
    fn lines(&self) -> io::Result<impl Iterator<Item = io::Result<String>>> {
        let mut file = &self.file;
        file.rewind()?;
        Ok(BufReader::with_capacity(1 << 16, file).lines())
    }
}

impl Serialize for FrameReports {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut all = serializer.serialize_seq(Some(self.count))?;
        for line in self.lines().map_err(S::Error::custom)? {
            let line = line.map_err(S::Error::custom)?;
            let value: &RawValue = serde_json::from_str(&line).map_err(S::Error::custom)?;
            all.serialize_element(value)?;
        }
        all.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Serialize)]
    struct One {
        used: usize,
        notes: Vec<&'static str>,
    }

    #[test]
    fn reports_come_back_in_their_order_with_what_was_added() {
        let file = || tempfile::tempfile().unwrap();
        let mut reports = Writer::new(file());
        for used in 0..3 {
            reports.push(&One { used, notes: vec!["a \"}\" in it\n"] }).unwrap();
        }
        let reports = reports.finish().unwrap();
        let mut others = Writer::new(file());
        [2.5, 3.5].iter().for_each(|blur| others.push(blur).unwrap());
        let all = reports.with("blur", &others.finish().unwrap(), file()).unwrap();
        let notes = "\"notes\":[\"a \\\"}\\\" in it\\n\"]";
        let expected = format!(
            "[{{\"used\":0,{notes},\"blur\":2.5}},{{\"used\":1,{notes},\"blur\":3.5}},{{\"used\":2,{notes}}}]"
        );
        // Twice: reading does not use them up.
        for _ in 0..2 {
            assert_eq!((serde_json::to_string(&all).unwrap(), all.len()), (expected.clone(), 3));
        }
    }

    #[test]
    fn of_reports_that_no_longer_fit_those_before_remain() {
        let mut reports = Writer::new(tempfile::tempfile().unwrap());
        for used in 0..3 {
            reports.push(&used).unwrap();
        }
        reports.flush().unwrap();
        reports.push(&"half of a report").unwrap();
        let reports = reports.flushed(3).unwrap();
        assert_eq!(
            (serde_json::to_string(&reports).unwrap().as_str(), reports.bytes().unwrap()),
            ("[0,1,2]", 6)
        );
        let reports = reports.first(1).unwrap();
        assert_eq!((serde_json::to_string(&reports).unwrap().as_str(), reports.len()), ("[0]", 1));
    }
}
