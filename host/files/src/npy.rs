//! Reads and writes images as NumPy `.npy` files. The reader accepts a stack `(N, H, W)`; the
//! writer accepts any shape of numbers.
//!
//! # Invariant
//! [`read_stack`] returns the bits that [`encode`] wrote
//! (`tests::what_is_written_reads_back_bit_for_bit`).

use super::FileError;
use super::array::{ArrayError, Header, MAGIC, MAX_AXES, NUMBERS, Sample, Take, shape_text};
use super::field::Field;
use super::plain::{kind_by_start, open_start};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

const EXPECTED: &str = "a NumPy array (.npy) of images, (N, H, W) or (H, W)";
const EXPECTED_LIST: &str = "a NumPy array (.npy) of shape (N,)";
const FIELD: &str = "array";

/// Images of one size, row-major, one after another.
#[derive(Debug, Clone, PartialEq)]
pub struct Stack {
    /// Number of images in the stack, at least 1.
    pub count: usize,
    /// Number of rows of an image, at least 1.
    pub height: usize,
    /// Number of columns of an image, at least 1.
    pub width: usize,
    /// `count * height * width` values, all finite unless the stack was read by [`read_with_gaps`].
    pub values: Vec<f32>,
}

/// Reads a `.npy` file of shape `(N, H, W)`, or `(H, W)` as a stack of one; any real dtype,
/// converted to float32.
///
/// # Errors
/// [`FileError`], one line that names file, what was found and what was expected.
pub fn read_stack(path: &Path) -> Result<Stack, FileError> {
    let (_, stack) = read(path)?;
    finite(path, stack)
}

/// Reads pictures as [`read_stack`] does. An 8-bit grey level v becomes v / 255, as in a PNG.
///
/// # Errors
/// As [`read_stack`].
pub fn read_pictures(path: &Path) -> Result<Pictures, FileError> {
    let (header, stack) = read(path)?;
    let mut stack = finite(path, stack)?;
    if header.is_bytes() {
        stack.values.iter_mut().for_each(|value| *value /= 255.0);
    }
    Ok(Pictures { is_single: header.shape().len() == 2, stack })
}

/// Reads numbers as [`read_stack`] does, but numbers may be missing: NaN or infinite.
///
/// # Errors
/// As [`read_stack`], except for missing numbers.
pub fn read_with_gaps(path: &Path) -> Result<Stack, FileError> {
    Ok(read(path)?.1)
}

/// The pictures of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Pictures {
    /// Whether the file is one picture (H, W) instead of a stack.
    pub is_single: bool,
    /// The pictures.
    pub stack: Stack,
}

fn refuse(path: &Path, found: String, expected: &str) -> FileError {
    FileError::field(path, FIELD, found, expected)
}

fn finite(path: &Path, stack: Stack) -> Result<Stack, FileError> {
    let Stack { height, width, ref values, .. } = stack;
    if let Some(flat) = values.iter().position(|value| !value.is_finite()) {
        let (image, pixel) = (flat / (height * width), flat % (height * width));
        let found =
            format!("is {} at [{image}, {}, {}]", values[flat], pixel / width, pixel % width);
        return Err(refuse(path, found, "finite numbers"));
    }
    Ok(stack)
}

/// Reads a `.npy` file of shape `(N,)`, one number for each image of a stack; any real dtype.
///
/// # Errors
/// [`FileError`], one line that names file, what was found and what was expected.
pub fn read_list(path: &Path) -> Result<Vec<f64>, FileError> {
    let fits = |shape: &[u64]| matches!(shape, [count] if *count > 0);
    Ok(read_numbers(path, EXPECTED_LIST, fits, "(N,)")?.1)
}

fn read(path: &Path) -> Result<(Header, Stack), FileError> {
    let fits = |shape: &[u64]| matches!(shape.len(), 2 | 3) && !shape.contains(&0);
    let (header, values) = read_numbers::<f32>(path, EXPECTED, fits, "(N, H, W) or (H, W)")?;
    // Each axis fits into `usize`: the product of all axes is the length of `values`.
    let axis = |from_last: usize| {
        let shape = header.shape();
        shape.len().checked_sub(from_last).map_or(1, |at| shape[at] as usize)
    };
    let stack = Stack { count: axis(3), height: axis(2), width: axis(1), values };
    Ok((header, stack))
}

/// Reads a `.npy` file of any shape, of real or complex numbers.
pub(super) fn read_field(path: &Path) -> Result<Field, FileError> {
    let expected = "a NumPy array (.npy) of readings";
    let fits = |shape: &[u64]| shape.len() <= MAX_AXES;
    let decode =
        |header: &Header, stream: &mut BufReader<File>, limit| header.read_parts(stream, limit);
    let (header, (real, imaginary)) = read_array(path, expected, fits, "at most 32 axes", decode)?;
    let shape = header.shape().iter().map(|&axis| axis as usize).collect();
    Ok(Field { shape, real, imaginary })
}

/// The shape of a `.npy` file of any shape that `fits`, and what `take` makes of its numbers, a block of them at a time; the
/// numbers are not read without it.
pub(super) fn each_block(
    path: &Path,
    expected: &'static str,
    fits: impl Fn(&[u64]) -> bool,
    shapes: &str,
    take: Option<&mut Take<'_>>,
) -> Result<Vec<u64>, FileError> {
    let decode = |header: &Header, stream: &mut BufReader<File>, limit| match take {
        Some(take) => header.each_block(stream, limit, take),
        None => header.data_bytes(limit).map(|_| ()),
    };
    Ok(read_array(path, expected, fits, shapes, decode)?.0.shape().to_vec())
}

/// The type of the numbers of a `.npy` file, as NumPy calls it; `None` if they are no numbers.
pub(super) fn kind(path: &Path) -> Option<String> {
    let decode = |header: &Header, _: &mut BufReader<File>, _| Ok(header.type_name());
    read_array(path, EXPECTED, |_| true, "", decode).ok().map(|(_, kind)| kind)
}

/// Reads the header and the numbers of a `.npy` file whose shape fits.
fn read_numbers<T: Sample>(
    path: &Path,
    expected: &'static str,
    fits: impl Fn(&[u64]) -> bool,
    shapes: &str,
) -> Result<(Header, Vec<T>), FileError> {
    let decode =
        |header: &Header, stream: &mut BufReader<File>, limit| header.read_data(stream, limit);
    read_array(path, expected, fits, shapes, decode)
}

fn read_array<D>(
    path: &Path,
    expected: &'static str,
    fits: impl Fn(&[u64]) -> bool,
    shapes: &str,
    decode: impl FnOnce(&Header, &mut BufReader<File>, u64) -> Result<D, ArrayError>,
) -> Result<(Header, D), FileError> {
    let (file, file_bytes, start) = open_start(path, expected, MAGIC.len())?;
    let mut stream = BufReader::new(file);
    if !MAGIC.starts_with(&start) {
        return Err(FileError::kind(path, kind_by_start(&start), expected));
    }

    let damaged = |found| FileError::damaged(path, found, expected);
    let explain = |error| match error {
        ArrayError::Damaged(found) => damaged(found),
        ArrayError::Dtype(found) => refuse(path, found, NUMBERS),
        ArrayError::Io(error) => FileError::io(path, "read", error),
        ArrayError::TooLarge { shape, limit_bytes } => {
            damaged(format!("shape {} with {limit_bytes} bytes of data", shape_text(&shape)))
        }
    };
    let header = Header::read(&mut stream).map_err(explain)?;
    if !fits(header.shape()) {
        return Err(refuse(path, format!("has shape {}", shape_text(header.shape())), shapes));
    }
    // The file cannot hold more than its own length, so its length limits the memory.
    let limit_bytes = file_bytes.saturating_sub(header.header_bytes);
    let values = decode(&header, &mut stream, limit_bytes).map_err(explain)?;
    Ok((header, values))
}

/// A number type that the writer accepts.
pub trait Element: Copy + private::Sealed {
    /// The type's name in a header.
    #[doc(hidden)]
    const DESCR: &'static str;
    /// Appends the number's little-endian bytes.
    #[doc(hidden)]
    fn append(self, bytes: &mut Vec<u8>);
}

mod private {
    pub trait Sealed {}
}

macro_rules! element {
    ($type:ty, $descr:literal) => {
        impl private::Sealed for $type {}
        impl Element for $type {
            const DESCR: &'static str = $descr;

            fn append(self, bytes: &mut Vec<u8>) {
                bytes.extend_from_slice(&self.to_le_bytes());
            }
        }
    };
}

element!(f32, "<f4");
element!(f64, "<f8");
element!(i64, "<i8");
element!(u8, "|u1");

/// The bytes of a `.npy` file (format 1.0, little-endian, C order) for an array of this shape.
///
/// # Panics
/// If the product of `shape` is not the number of values, or there are more than a hundred axes.
#[must_use]
pub fn encode<T: Element>(shape: &[usize], values: &[T]) -> Vec<u8> {
    assert_eq!(
        shape.iter().product::<usize>(),
        values.len(),
        "values of an array of shape {shape:?}"
    );
    let mut bytes = header::<T>(shape);
    bytes.reserve(size_of_val(values));
    values.iter().for_each(|value| value.append(&mut bytes));
    bytes
}

/// The bytes of a `.npy` file before its numbers, which follow in C order.
///
/// # Panics
/// If there are more than a hundred axes.
pub fn header<T: Element>(shape: &[usize]) -> Vec<u8> {
    header_of(T::DESCR, shape)
}

/// The bytes of a `.npy` file with one text, which NumPy reads as `str`.
#[must_use]
pub fn encode_text(text: &str) -> Vec<u8> {
    let letters = text.chars().count().max(1);
    let mut bytes = header_of(&format!("<U{letters}"), &[]);
    text.chars().for_each(|letter| bytes.extend_from_slice(&u32::from(letter).to_le_bytes()));
    if text.is_empty() {
        bytes.extend_from_slice(&[0; 4]);
    }
    bytes
}

/// The most bytes of a text that is read.
const MAX_TEXT_BYTES: u64 = 4096;

/// The text that [`encode_text`] wrote; `None` for anything else.
pub(super) fn read_text(stream: &mut impl Read) -> Option<String> {
    let mut bytes = Vec::new();
    stream.take(MAX_TEXT_BYTES).read_to_end(&mut bytes).ok()?;
    let after = bytes.strip_prefix(&MAGIC[..])?;
    let length = usize::from(u16::from_le_bytes([*after.get(2)?, *after.get(3)?]));
    let header = std::str::from_utf8(after.get(4..4 + length)?).ok()?;
    let (letters, _) = header.split_once("'<U")?.1.split_once('\'')?;
    let text = after.get(4 + length..)?;
    let letters = letters.parse::<usize>().ok()?;
    let read = || {
        let letter = |bytes: &[u8; 4]| char::from_u32(u32::from_le_bytes(*bytes));
        let text: Option<String> = text.as_chunks().0.iter().map(letter).collect();
        Some(text?.trim_end_matches('\0').to_owned())
    };
    if letters.checked_mul(4) == Some(text.len()) { read() } else { None }
}

/// The heading of a `.npy` file of numbers of this type (as NumPy writes it: `<f8`) in C order. The numbers follow.
///
/// # Panics
/// If the shape has a hundred axes or more.
#[must_use]
pub fn header_of(descr: &str, shape: &[usize]) -> Vec<u8> {
    /// The data start at a multiple of this number of bytes, so that NumPy can map the file.
    const ALIGNMENT: usize = 64;
    let axes: Vec<u64> = shape.iter().map(|&axis| axis as u64).collect();
    let mut header =
        format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {}, }}", shape_text(&axes))
            .into_bytes();
    let before = MAGIC.len() + 4;
    let end = (before + header.len() + 1).next_multiple_of(ALIGNMENT);
    header.resize(end - before - 1, b' ');
    header.push(b'\n');
    let length = u16::try_from(header.len()).expect("a header of fewer than a hundred axes");

    let mut bytes = Vec::with_capacity(end);
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&[1, 0]);
    bytes.extend_from_slice(&length.to_le_bytes());
    bytes.extend_from_slice(&header);
    bytes
}

#[cfg(test)]
mod tests;
