//! Reads arrays of MATLAB `.mat` files of level 4, which PicoScope and older programs write.
//!
//! Format: MathWorks, *MAT-File Format*, R2023a, "Level 4 MAT-Files": for each variable five words,
//! the name, and the numbers column by column.

use super::FileError;
use super::array::{Dtype, Kind, has_shape, within_memory};
use super::field::Field;
use std::path::{Path, PathBuf};

const EXPECTED: &str = "a MATLAB level 4 file";
const HEADER_BYTES: usize = 20;

/// An open file, with the position of each variable.
pub(super) struct Mat4 {
    path: PathBuf,
    bytes: Vec<u8>,
    variables: Vec<Variable>,
}

struct Variable {
    name: String,
    shape: [u64; 2],
    dtype: Dtype,
    is_complex: bool,
    is_numbers: bool,
    /// Start of the numbers.
    start: usize,
}

/// Types of numbers, by MathWorks' digit P.
const KINDS: [(Kind, usize); 6] = [
    (Kind::Float, 8),
    (Kind::Float, 4),
    (Kind::Signed, 4),
    (Kind::Signed, 2),
    (Kind::Unsigned, 2),
    (Kind::Unsigned, 1),
];

impl Mat4 {
    pub(super) fn open(path: &Path, bytes: Vec<u8>) -> Result<Self, FileError> {
        let mut mat = Self { path: path.to_owned(), bytes, variables: Vec::new() };
        let mut start = 0;
        while start < mat.bytes.len() {
            let found = mat.variable_at(start);
            let (variable, end) =
                found.ok_or_else(|| mat.damaged(format!("no whole variable at byte {start}")))?;
            mat.variables.push(variable);
            start = end;
        }
        Ok(mat)
    }

    pub(super) fn names(&self) -> Vec<String> {
        self.variables.iter().map(|variable| variable.name.clone()).collect()
    }

    /// The variable that starts at this byte, and where it ends.
    fn variable_at(&self, start: usize) -> Option<(Variable, usize)> {
        let header = self.bytes.get(start..)?.get(..HEADER_BYTES)?;
        let (words, _) = header.as_chunks::<4>();
        // The form of the numbers in digits MOPT, of which a swapped one is too large.
        let is_big_endian = u32::from_le_bytes(words[0]) > 9999;
        let word = |at: usize| match is_big_endian {
            true => u32::from_be_bytes(words[at]),
            false => u32::from_le_bytes(words[at]),
        };
        let (form, complex, name_bytes) = (word(0), word(3), word(4) as usize);
        let digits = [form / 1000, form / 100 % 10, form / 10 % 10, form % 10];
        let [machine, 0, precision @ 0..=5, kind] = digits else { return None };
        if machine != u32::from(is_big_endian) || complex > 1 {
            return None;
        }
        let name = self.bytes.get(start + HEADER_BYTES..)?.get(..name_bytes)?;
        let name = name.strip_suffix(b"\0")?;
        let shape = [u64::from(word(1)), u64::from(word(2))];
        let (number, size) = KINDS[precision as usize];
        let count = usize::try_from(shape[0].checked_mul(shape[1])?).ok()?;
        let bytes = count.checked_mul(size)?.checked_mul(1 + complex as usize)?;
        let start = start + HEADER_BYTES + name_bytes;
        let end = start.checked_add(bytes).filter(|&end| end <= self.bytes.len())?;
        let variable = Variable {
            name: String::from_utf8_lossy(name).into_owned(),
            shape,
            dtype: Dtype { kind: number, size, big_endian: is_big_endian },
            is_complex: complex == 1,
            is_numbers: kind == 0,
            start,
        };
        Some((variable, end))
    }

    pub(super) fn read(
        &self,
        field: &str,
        accept: impl Fn(&[u64]) -> Result<(), String>,
    ) -> Result<Field, FileError> {
        let refuse =
            |found: String, expected: &str| FileError::field(&self.path, field, found, expected);
        let variable = self.variables.iter().find(|variable| variable.name == field);
        let Some(Variable { shape, dtype, is_complex, is_numbers, start, .. }) = variable else {
            return Err(refuse("is not there".to_owned(), "a variable of the file"));
        };
        if !is_numbers {
            return Err(refuse("is text or a sparse matrix".to_owned(), "an array of numbers"));
        }
        accept(shape).map_err(|expected| refuse(has_shape(shape), &expected))?;
        within_memory(&self.path, field, shape, *is_complex)?;
        // Both axes are within the file: it was measured when it was opened.
        let axes = shape.map(|axis| axis as usize);
        let count = axes[0] * axes[1];
        let part = |part: usize| -> Vec<f64> {
            let bytes = count * dtype.size;
            dtype.decode(&self.bytes[start + part * bytes..][..bytes])
        };
        let imaginary = is_complex.then(|| part(1));
        Ok(Field::from_column_major(axes.to_vec(), &part(0), imaginary.as_deref()))
    }

    fn damaged(&self, found: String) -> FileError {
        FileError::damaged(&self.path, found, EXPECTED)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::line;

    /// A variable as MATLAB's manual lays it out.
    fn variable(form: u32, shape: [u32; 2], complex: u32, name: &str, numbers: &[u8]) -> Vec<u8> {
        let words = [form, shape[0], shape[1], complex, name.len() as u32 + 1];
        let words = words.map(|word| match form >= 1000 {
            true => word.to_be_bytes(),
            false => word.to_le_bytes(),
        });
        [&words.concat()[..], name.as_bytes(), b"\0", numbers].concat()
    }

    fn open(bytes: &[u8]) -> Result<Mat4, FileError> {
        Mat4::open(Path::new("old.mat"), bytes.to_vec())
    }

    fn any(_: &[u64]) -> Result<(), String> {
        Ok(())
    }

    #[test]
    fn numbers_of_every_kind_are_read_column_by_column() {
        let doubles: Vec<u8> =
            [1.5, 2.0, -3.0, 4.0].into_iter().flat_map(f64::to_le_bytes).collect();
        let big: Vec<u8> = [7_i16, -8].into_iter().flat_map(i16::to_be_bytes).collect();
        let complex: Vec<u8> = [1_f32, 2.0].into_iter().flat_map(f32::to_le_bytes).collect();
        let bytes = [
            variable(0, [2, 2], 0, "y", &doubles),
            variable(1030, [1, 2], 0, "counts", &big),
            variable(10, [1, 1], 1, "z", &complex),
            variable(50, [3, 1], 0, "bytes", &[1, 255, 0]),
            variable(51, [1, 2], 0, "word", b"ab"),
        ]
        .concat();
        let mat = open(&bytes).unwrap();
        assert_eq!(mat.names(), ["y", "counts", "z", "bytes", "word"]);
        let y = mat.read("y", any).unwrap();
        assert_eq!((y.shape, y.real), (vec![2, 2], vec![1.5, -3.0, 2.0, 4.0]));
        assert_eq!(mat.read("counts", any).unwrap().real, [7.0, -8.0]);
        let z = mat.read("z", any).unwrap();
        assert_eq!((z.real, z.imaginary), (vec![1.0], Some(vec![2.0])));
        assert_eq!(mat.read("bytes", any).unwrap().real, [1.0, 255.0, 0.0]);
        let found = line(&mat.read("word", any).unwrap_err(), "old.mat");
        assert!(found.contains("`word` is text or a sparse matrix"), "{found}");
    }

    #[test]
    fn a_file_cut_anywhere_or_with_any_byte_changed_is_harmless_or_refused() {
        let numbers: Vec<u8> = (0..4).flat_map(|v| f64::from(v).to_le_bytes()).collect();
        let bytes = variable(0, [4, 1], 0, "y", &numbers);
        for end in 1..bytes.len() {
            let found = line(&open(&bytes[..end]).err().unwrap(), "old.mat");
            assert!(found.contains("no whole variable at byte 0"), "{found}");
        }
        for (at, bit) in (0..bytes.len()).flat_map(|at| (0..8).map(move |bit| (at, bit))) {
            let mut changed = bytes.clone();
            changed[at] ^= 1 << bit;
            if let Ok(mat) = open(&changed) {
                for name in mat.names() {
                    let _ = mat.read(&name, any);
                }
            }
        }
    }
}
