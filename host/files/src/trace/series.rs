//! The samples of a trace's file, field by field, a block at a time.
//!
//! # Invariant
//! Of a `.npy` or `.npz` file and of numbers without a heading, the memory holds one block, whatever the file claims
//! (`tests::a_claim_takes_no_memory`). Files of other formats are read whole, within the limits of
//! [`measurement::read`](crate::measurement::read).

use super::{FileError, Raw};
use crate::archive::Archive;
use crate::array::{ArrayError, Header, MAGIC, Take};
use crate::fields::{Fields, UNNAMED, stated_beside};
use crate::formats::{EXPECTED as MEASUREMENTS, EXPECTED_TRACE as EXPECTED};
use crate::npy;
use crate::plain::open_start;
use crate::provenance::Taken;
use std::fs::File;
use std::path::{Path, PathBuf};

/// An open file of samples.
pub(super) struct Series {
    path: PathBuf,
    form: Form,
}

enum Form {
    Raw(Header),
    Npy,
    Npz(Archive),
    /// In memory.
    Other(Fields),
}

/// The shape that samples must have.
#[derive(Clone, Copy)]
pub(super) struct Shape {
    /// Length of the last axis, if there may be others before it.
    pub(super) last: Option<usize>,
}

impl Shape {
    fn fits(self, shape: &[u64]) -> bool {
        let is_row = shape.iter().filter(|&&axis| axis != 1).count() <= 1;
        let of_readings = self.last.is_some_and(|last| shape.last() == Some(&(last as u64)));
        !shape.contains(&0) && (is_row || of_readings)
    }

    fn words(self) -> String {
        let several = "several columns need names (a heading, or .npz)";
        match self.last {
            Some(last) => format!("(N,) samples, or (M, {last}) of M readings; {several}"),
            None => format!("(N,) samples; {several}"),
        }
    }

    fn accept(self, shape: &[u64]) -> Result<(), String> {
        if self.fits(shape) { Ok(()) } else { Err(self.words()) }
    }
}

impl Series {
    pub(super) fn open(
        path: &Path,
        raw: Option<Raw>,
        decimal_comma: bool,
    ) -> Result<Self, FileError> {
        let (_, length, start) = open_start(path, EXPECTED, MAGIC.len())?;
        if let Some(raw) = raw {
            return Self::open_raw(path, raw, length);
        }
        let form = match &*start {
            _ if decimal_comma => Form::Other(open_fields(path, true)?),
            start if start == MAGIC => Form::Npy,
            start if start.starts_with(b"PK") => Form::Npz(Archive::open(path)?),
            _ => Form::Other(open_fields(path, false)?),
        };
        Ok(Self { path: path.to_owned(), form })
    }

    fn open_raw(path: &Path, raw: Raw, length: u64) -> Result<Self, FileError> {
        let expected = match raw {
            Raw::F32 => "32-bit floats, 4 bytes each",
            Raw::F64 => "64-bit floats, 8 bytes each",
            Raw::I16 => "16-bit integers, 2 bytes each",
            Raw::I32 => "32-bit integers, 4 bytes each",
        };
        let bytes = raw.bytes() as u64;
        let wrong = || FileError::kind(path, format!("{length} bytes"), expected);
        if !length.is_multiple_of(bytes) {
            return Err(wrong());
        }
        let header = Header::of_numbers(raw.descr(), length / bytes).map_err(|_| wrong())?;
        Ok(Self { path: path.to_owned(), form: Form::Raw(header) })
    }

    pub(super) fn names(&self) -> &[String] {
        match &self.form {
            Form::Raw(_) | Form::Npy => &[],
            Form::Npz(archive) => archive.names(),
            Form::Other(fields) => fields.names(),
        }
    }

    /// Whether the file is one array without a name.
    pub(super) fn is_unnamed(&self) -> bool {
        match &self.form {
            Form::Raw(_) | Form::Npy => true,
            Form::Npz(_) => false,
            Form::Other(fields) => fields.is_unnamed(),
        }
    }

    /// What a text has beside its table and is left out, in one line.
    pub(super) fn skipped(&self) -> Option<&str> {
        match &self.form {
            Form::Other(fields) => fields.skipped(),
            _ => None,
        }
    }

    /// Where the samples come from, by what the file says of it, without the name of the file.
    pub(super) fn taken(&mut self) -> Taken {
        let stated = match &mut self.form {
            Form::Other(fields) => Some(fields.taken()),
            // Opening an archive reads no array.
            Form::Npz(_) => Fields::open(&self.path, false).ok().map(|mut fields| fields.taken()),
            Form::Npy => stated_beside(&self.path),
            Form::Raw(_) => None,
        };
        stated.unwrap_or_else(|| Taken::simulated_or(None))
    }

    /// Number of samples of a field.
    pub(super) fn count(&mut self, field: &str, shape: Shape) -> Result<u64, FileError> {
        let shape = self.read(field, shape, None)?;
        shape.iter().try_fold(1_u64, |product, &axis| product.checked_mul(axis)).ok_or_else(|| {
            FileError::field(&self.path, field, "claims more samples than can be", "a trace")
        })
    }

    /// Hands out the samples of a field, a block at a time.
    pub(super) fn each_block(
        &mut self,
        field: &str,
        shape: Shape,
        take: &mut Take<'_>,
    ) -> Result<(), FileError> {
        self.read(field, shape, Some(take)).map(|_| ())
    }

    fn read(
        &mut self,
        field: &str,
        shape: Shape,
        take: Option<&mut Take<'_>>,
    ) -> Result<Vec<u64>, FileError> {
        let path = &self.path;
        let axes = |shape: Vec<usize>| shape.into_iter().map(|axis| axis as u64).collect();
        match &mut self.form {
            Form::Raw(header) => {
                let Some(take) = take else { return Ok(header.shape().to_vec()) };
                let mut file = File::open(path).map_err(|e| FileError::io(path, "read", e))?;
                let read = header.each_block(&mut file, u64::MAX, take);
                read.map_err(|error| match error {
                    ArrayError::Io(error) => FileError::io(path, "read", error),
                    _ => FileError::kind(path, "a file that changes", "one that stays as it is"),
                })?;
                Ok(Vec::new())
            }
            Form::Npy => npy::each_block(
                path,
                EXPECTED,
                |found: &[u64]| shape.fits(found),
                &shape.words(),
                take,
            ),
            Form::Npz(archive) => {
                archive.each_block(field, |found| shape.accept(found), take).map(axes)
            }
            Form::Other(fields) => {
                // Samples in memory are not copied.
                let read;
                let numbers = match fields.held(field) {
                    Some(held) if shape.fits(&axes(held.shape.clone())) => held,
                    _ => {
                        read = fields.read(field, |found| shape.accept(found))?;
                        &read
                    }
                };
                if numbers.imaginary.is_some() {
                    let name = if fields.is_unnamed() { UNNAMED } else { field };
                    let found = "has complex numbers";
                    return Err(FileError::field(path, name, found, "real numbers"));
                }
                if let Some(take) = take {
                    take(&numbers.real);
                }
                Ok(axes(numbers.shape.clone()))
            }
        }
    }
}

/// Opens a file of another format than NumPy's.
fn open_fields(path: &Path, decimal_comma: bool) -> Result<Fields, FileError> {
    Fields::open(path, decimal_comma).map_err(|error| match error {
        FileError::Kind { path, found, expected: MEASUREMENTS } => {
            FileError::Kind { path, found, expected: EXPECTED }
        }
        FileError::Damaged { path, found, expected: MEASUREMENTS } => {
            FileError::Damaged { path, found, expected: EXPECTED }
        }
        error => error,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Zip, file, line, npy, npy_f64, zip};

    const ROW: Shape = Shape { last: None };

    fn all(series: &mut Series, field: &str) -> Result<Vec<f64>, FileError> {
        let mut found = Vec::new();
        series.each_block(field, ROW, &mut |block| found.extend_from_slice(block))?;
        Ok(found)
    }

    #[test]
    fn every_format_gives_the_same_samples_in_blocks() {
        let numbers: Vec<f64> = (0..50_000).map(|k| f64::from(k % 977) - 400.0).collect();
        let text: String = numbers.iter().map(|v| format!("{v}\n")).collect();
        let array = npy_f64("(50000, 1)", &numbers);
        let i16s: Vec<u8> = numbers.iter().flat_map(|&v| (v as i16).to_le_bytes()).collect();
        let f32s: Vec<u8> = numbers.iter().flat_map(|&v| (v as f32).to_le_bytes()).collect();
        let f64s: Vec<u8> = numbers.iter().flat_map(|&v| v.to_le_bytes()).collect();
        let cases = [
            ("a.npy", array.clone(), None),
            ("a.npz", zip(Zip::Stored, &[("y.npy", array.clone())]), None),
            ("b.npz", zip(Zip::Deflated, &[("y.npy", array)]), None),
            ("fortran.npy", npy("'<i2'", true, "(1, 50000)", &i16s), None),
            ("a.txt", text.into_bytes(), None),
            ("a.i16", i16s, Some(Raw::I16)),
            ("a.f32", f32s, Some(Raw::F32)),
            ("a.f64", f64s, Some(Raw::F64)),
        ];
        for (name, bytes, raw) in cases {
            let (_guard, path) = file(name, &bytes);
            let mut series = Series::open(&path, raw, false).unwrap();
            assert_eq!(series.count("y", ROW).unwrap(), 50_000, "{name}");
            assert!(all(&mut series, "y").unwrap() == numbers, "{name}");
            // A cut file is refused.
            let (_guard, path) = file("cut", &bytes[..bytes.len() - 3]);
            let cut = Series::open(&path, raw, false).and_then(|mut series| {
                series.count("y", ROW)?;
                all(&mut series, "y")
            });
            match cut {
                Err(error) => assert!(line(&error, "cut").contains("expected"), "{name}"),
                Ok(found) => assert!(name == "a.txt" && found.len() >= 49_999, "{name}"),
            }
        }
    }

    #[test]
    fn a_claim_takes_no_memory() {
        let huge = npy("'<f8'", false, "(1000000000000,)", &[0; 64]);
        let (_guard, path) = file("huge.npz", &zip(Zip::Deflated, &[("y.npy", huge.clone())]));
        let mut series = Series::open(&path, None, false).unwrap();
        assert_eq!(series.count("y", ROW).unwrap(), 1_000_000_000_000);
        let told = line(&all(&mut series, "y").unwrap_err(), "huge.npz");
        assert!(told.contains("64 of 8000000000000 bytes of data"), "{told}");
        let (_guard, path) = file("huge.npy", &huge);
        let mut series = Series::open(&path, None, false).unwrap();
        let told = line(&series.count("y", ROW).unwrap_err(), "huge.npy");
        assert!(told.contains("damaged or cut short"), "{told}");
    }

    #[test]
    fn other_files_and_shapes_are_refused_in_one_line() {
        let told = |name: &str, bytes: &[u8], raw| {
            let (_guard, path) = file(name, bytes);
            let read = Series::open(&path, raw, false).and_then(|mut s| s.count("y", ROW));
            line(&read.unwrap_err(), name)
        };
        let found = told("a.npy", &npy_f64("(2, 2)", &[1.0, 2.0, 3.0, 4.0]), None);
        assert!(found.contains("has shape (2, 2), expected (N,) samples; several"), "{found}");
        assert!(told("a.png", b"\x89PNG\r\n\x1a\n", None).contains("found a PNG image"));
        assert!(told("a.png", b"\x89PNG\r\n\x1a\n", None).contains("expected a trace: "));
        assert!(told("a.dat", &[0; 7], Some(Raw::F32)).contains("7 bytes, expected 32-bit floats"));
        assert!(told("a.dat", b"", Some(Raw::F64)).contains("an empty file"));
        let (_guard, path) = file("c.npy", &npy("'<c16'", false, "(2,)", &[0; 32]));
        let complex = all(&mut Series::open(&path, None, false).unwrap(), "y").unwrap_err();
        assert!(line(&complex, "c.npy").contains("has complex numbers, expected real numbers"));
        let two = Shape { last: Some(2) };
        assert!(two.fits(&[5, 2]) && two.fits(&[7]) && !two.fits(&[2, 5]) && !two.fits(&[0, 2]));
    }
}
