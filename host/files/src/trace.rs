//! Readings of a trace: a detector's samples while patterns were shown, and perhaps those of a
//! trigger.
//!
//! # Invariant
//! Each reading is the mean of the samples of one pattern and of no other one. A pattern whose
//! trigger is missing has NaN for a reading, and those behind it keep their places
//! (`windows::tests::lost_and_extra_edges_are_named_and_move_no_other_reading`).

mod windows;

use super::FileError;
use super::field::EXPECTED;
use super::fields::{Fields, UNNAMED};
use super::plain::{MAX_MEMORY_BYTES, open_file};
use std::io::Read;
use std::path::Path;
pub use windows::{Cut, Found, TraceError};

/// Numbers without a header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Raw {
    /// 32-bit floats.
    F32,
    /// 64-bit floats.
    F64,
    /// Signed 16-bit integers.
    I16,
}

impl Raw {
    /// Every kind.
    pub const ALL: [Self; 3] = [Self::F32, Self::F64, Self::I16];

    /// The word for the kind.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::F32 => "f32",
            Self::F64 => "f64",
            Self::I16 => "i16",
        }
    }

    fn bytes(self) -> usize {
        match self {
            Self::F32 => 4,
            Self::F64 => 8,
            Self::I16 => 2,
        }
    }

    fn number(self, bytes: &[u8]) -> f64 {
        match (self, bytes) {
            (Self::F32, &[a, b, c, d]) => f64::from(f32::from_le_bytes([a, b, c, d])),
            (Self::I16, &[a, b]) => f64::from(i16::from_le_bytes([a, b])),
            (Self::F64, &[a, b, c, d, e, f, g, h]) => f64::from_le_bytes([a, b, c, d, e, f, g, h]),
            _ => f64::NAN,
        }
    }
}

/// A detector's samples, and those of the trigger.
#[derive(Debug, Clone, PartialEq)]
pub struct Trace {
    /// The detector's samples, in the order of time.
    pub samples: Vec<f64>,
    /// The trigger's samples, as many.
    pub trigger: Option<Vec<f64>>,
    /// What the file has beside its numbers and was left out, in one line.
    pub note: Option<String>,
}

impl Trace {
    /// Reads the samples in the field `field` of a file of any format that
    /// [`measurement::read`](crate::measurement::read) knows, and the trigger in another field. A
    /// file of one array needs no name.
    ///
    /// # Errors
    /// [`FileError`], one line that names file, field, what was found and what was expected.
    pub fn read(
        path: &Path,
        field: Option<&str>,
        trigger: Option<&str>,
    ) -> Result<Self, FileError> {
        let mut fields = Fields::open(path, false)?;
        let list = fields.names().join(", ");
        let name = match (field, fields.names()) {
            (Some(field), _) => field.to_owned(),
            (None, []) => UNNAMED.to_owned(),
            (None, [only]) => only.clone(),
            (None, names) => {
                let rest = names.iter().filter(|name| Some(name.as_str()) != trigger);
                match rest.collect::<Vec<_>>()[..] {
                    [only] => only.clone(),
                    _ => {
                        let expected = format!("--field with one of {list}");
                        let found = "has several fields";
                        return Err(FileError::field(path, "--field", found, expected));
                    }
                }
            }
        };
        if fields.is_unnamed() && (field.is_some() || trigger.is_some()) {
            let expected = "no names of fields: a file with one array has none";
            return Err(FileError::field(path, UNNAMED, "is the only array", expected));
        }
        let mut series = |name: &str| {
            if !fields.is_unnamed() && !fields.holds(name) {
                let expected = format!("one of {list}");
                return Err(FileError::field(path, name, "is not in the file", expected));
            }
            fields.read_real(name, |shape| {
                match shape.iter().filter(|&&axis| axis != 1).count() <= 1 && !shape.contains(&0) {
                    true => Ok(()),
                    false => Err("(N,) samples".to_owned()),
                }
            })
        };
        let samples = series(&name)?;
        let trigger = trigger.map(|trigger| Ok((trigger, series(trigger)?))).transpose()?;
        if let Some((name, trigger)) = &trigger
            && trigger.len() != samples.len()
        {
            let found = format!("has {} samples", trigger.len());
            return Err(FileError::field(path, *name, found, format!("{}", samples.len())));
        }
        let note = fields.skipped().map(str::to_owned);
        Ok(Self { samples, trigger: trigger.map(|(_, trigger)| trigger), note })
    }

    /// Reads samples without a header, little-endian.
    ///
    /// # Errors
    /// [`FileError`] for a file that is empty, too large, or no whole number of samples.
    pub fn read_raw(path: &Path, raw: Raw) -> Result<Self, FileError> {
        let (file, length) = open_file(path, EXPECTED)?;
        let most = MAX_MEMORY_BYTES / size_of::<f64>() as u64 * raw.bytes() as u64;
        let each = raw.bytes() as u64;
        if length == 0 || length > most || !length.is_multiple_of(each) {
            let found = format!("{length} bytes");
            let expected = match raw {
                Raw::F32 => "32-bit floats, at most 256 MiB",
                Raw::F64 => "64-bit floats, at most 512 MiB",
                Raw::I16 => "16-bit numbers, at most 128 MiB",
            };
            return Err(FileError::kind(path, found, expected));
        }
        let mut bytes = Vec::new();
        file.take(length)
            .read_to_end(&mut bytes)
            .map_err(|error| FileError::io(path, "read", error))?;
        let samples = bytes.chunks_exact(raw.bytes()).map(|bytes| raw.number(bytes)).collect();
        Ok(Self { samples, trigger: None, note: None })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{file, line, npy_f64};

    #[test]
    fn samples_and_trigger_are_fields_of_any_file() {
        let rows = (0..9).map(|at| format!("{at},{},{}\n", at * 2, at % 3)).collect::<String>();
        let (_guard, path) = file("scope.csv", format!("time,CH1,TRIG\n{rows}").as_bytes());
        let trace = Trace::read(&path, Some("CH1"), Some("TRIG")).unwrap();
        assert_eq!((trace.samples[8], trace.trigger.unwrap()[5]), (16.0, 2.0));
        let told =
            |field, trigger| line(&Trace::read(&path, field, trigger).unwrap_err(), "scope.csv");
        assert!(told(None, Some("TRIG")).contains("expected --field with one of time, CH1, TRIG"));
        assert!(told(Some("CH1"), Some("T")).contains("`T` is not in the file, expected one of"));
        let (_guard, path) = file("one.npy", &npy_f64("(4, 1)", &[1.0, 2.0, 3.0, 4.0]));
        assert_eq!(Trace::read(&path, None, None).unwrap().samples, [1.0, 2.0, 3.0, 4.0]);
        let told = line(&Trace::read(&path, Some("y"), None).unwrap_err(), "one.npy");
        assert!(told.contains("no names of fields"), "{told}");
        let (_guard, path) = file("two.npy", &npy_f64("(2, 2)", &[1.0, 2.0, 3.0, 4.0]));
        let told = line(&Trace::read(&path, None, None).unwrap_err(), "two.npy");
        assert!(told.contains("has shape (2, 2), expected (N,) samples"), "{told}");
    }

    #[test]
    fn numbers_without_a_header_are_read_by_their_kind() {
        let numbers = [1.5, -2.0, 300.0];
        let bytes = |raw: Raw| -> Vec<u8> {
            let each = numbers.iter().map(|&v| match raw {
                Raw::F32 => (v as f32).to_le_bytes().to_vec(),
                Raw::F64 => f64::to_le_bytes(v).to_vec(),
                Raw::I16 => (v as i16).to_le_bytes().to_vec(),
            });
            each.flatten().collect()
        };
        for raw in Raw::ALL {
            let (_guard, path) = file("sample.dat", &bytes(raw));
            let found = Trace::read_raw(&path, raw).unwrap().samples;
            assert_eq!(found, numbers.map(|v| if raw == Raw::I16 { v.trunc() } else { v }));
            let (_guard, path) = file("cut.dat", &bytes(raw)[1..]);
            let told = line(&Trace::read_raw(&path, raw).unwrap_err(), "cut.dat");
            assert!(told.contains("bytes, expected "), "{told}");
        }
        let (_guard, path) = file("empty.dat", b"");
        assert!(Trace::read_raw(&path, Raw::F64).is_err());
    }
}
