//! Reads one NumPy array (`.npy` format 1.0 to 3.0) from a stream of bytes, as numbers in C order.
//!
//! The header is a Python dictionary literal with three known keys. A scanner without recursion
//! reads the header, because nested brackets can overflow the stack of a general literal parser.
//! Format: <https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html>.
//!
//! # Invariant
//! Every claim of a header is checked before it is used, and memory grows with the bytes that
//! arrived (`tests::a_claim_beyond_the_limit_takes_no_memory`).

use super::FileError;
use super::error::Shown;
use std::io::{self, Read};
use std::path::Path;

/// The first bytes of every `.npy` file.
pub(super) use super::plain::NUMPY as MAGIC;
/// The most axes that NumPy allows.
pub(super) const MAX_AXES: usize = 32;
/// NumPy refuses headers over 10 000 characters; the larger limit here leaves room for other
/// writers.
const MAX_HEADER_BYTES: u32 = 65_536;

/// What takes the numbers of an array, a block of them at a time.
pub(super) type Take<'t> = dyn FnMut(&[f64]) + 't;

/// Numbers that are decoded at a time while their bytes are in a processor's cache.
const BLOCK: usize = 1 << 14;

/// The numeric types that the reader accepts, for error messages.
pub(super) const NUMBERS: &str = "real numbers of up to 8 bytes";

/// Why an array could not be read; [`super::FileError`] adds file and field.
#[derive(Debug)]
pub(super) enum ArrayError {
    /// The bytes are not a whole array.
    Damaged(String),
    /// The array holds elements of a type that the reader does not support.
    Dtype(String),
    /// The array's header claims more data than the reader allows.
    TooLarge { shape: Vec<u64>, limit_bytes: u64 },
    /// Reading the stream failed.
    Io(io::Error),
}

/// A numeric type of NumPy: `|b1`, `i1..i8`, `u1..u8`, `f2..f8`, `c8`, `c16`, in either byte order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Dtype {
    pub(super) kind: Kind,
    pub(super) size: usize,
    pub(super) big_endian: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Bool,
    Signed,
    Unsigned,
    Float,
    /// Two floats: the real and the imaginary part.
    Complex,
}

/// A number type into which array elements are converted.
pub trait Sample: Copy {
    /// The nearest number of this type.
    fn from_f64(value: f64) -> Self;
}

impl Sample for f64 {
    fn from_f64(value: f64) -> Self {
        value
    }
}

impl Sample for f32 {
    fn from_f64(value: f64) -> Self {
        value as f32
    }
}

/// The header of an array. The header is enough to refuse an array before its data are read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Header {
    dtype: Dtype,
    fortran_order: bool,
    shape: Vec<u64>,
    /// Length of the header in bytes. The data start after the header.
    pub(super) header_bytes: u64,
}

impl Header {
    /// Reads magic, version and dictionary. The stream is then at the first element.
    pub(super) fn read(stream: &mut impl Read) -> Result<Self, ArrayError> {
        let mut start = [0; 8];
        fill(stream, &mut start, "its header")?;
        if start[..6] != *MAGIC {
            return Err(ArrayError::Damaged("it does not start as a NumPy array does".to_owned()));
        }
        let (length_bytes, length) = match start[6] {
            1 => {
                let mut bytes = [0; 2];
                fill(stream, &mut bytes, "its header")?;
                (2, u32::from(u16::from_le_bytes(bytes)))
            }
            2 | 3 => {
                let mut bytes = [0; 4];
                fill(stream, &mut bytes, "its header")?;
                (4, u32::from_le_bytes(bytes))
            }
            major => {
                return Err(ArrayError::Damaged(format!(
                    "NumPy format {major}.{}, known are 1 to 3",
                    start[7]
                )));
            }
        };
        if length > MAX_HEADER_BYTES {
            return Err(ArrayError::Damaged(format!("a header of {length} bytes")));
        }
        let mut text = vec![0; length as usize];
        fill(stream, &mut text, "its header")?;
        let (dtype, fortran_order, shape) = parse_dictionary(&String::from_utf8_lossy(&text))?;
        Ok(Self { dtype, fortran_order, shape, header_bytes: 8 + length_bytes + u64::from(length) })
    }

    /// The header of `count` numbers that have none in their file; `descr` is their type as NumPy writes it.
    pub(super) fn of_numbers(descr: &str, count: u64) -> Result<Self, ArrayError> {
        let dtype = Dtype::parse(&format!("'{descr}'"))?;
        Ok(Self { dtype, fortran_order: false, shape: vec![count], header_bytes: 0 })
    }

    /// Sizes of the axes as the header claims them; empty for a single number.
    pub(super) fn shape(&self) -> &[u64] {
        &self.shape
    }

    /// The type of the numbers, as NumPy calls it.
    pub(super) fn type_name(&self) -> String {
        let kind = match self.dtype.kind {
            Kind::Bool => return "bool".to_owned(),
            Kind::Signed => "int",
            Kind::Unsigned => "uint",
            Kind::Float => "float",
            Kind::Complex => "complex",
        };
        format!("{kind}{}", 8 * self.dtype.size)
    }

    /// Whether the array's numbers are single bytes, 0 to 255.
    pub(super) fn is_bytes(&self) -> bool {
        self.dtype.kind == Kind::Unsigned && self.dtype.size == 1
    }

    /// Number of data bytes that the header announces, if the number is at most `limit_bytes`.
    pub(super) fn data_bytes(&self, limit_bytes: u64) -> Result<u64, ArrayError> {
        self.shape
            .iter()
            // An axis of length 0 makes the array empty, however large the other axes are.
            .try_fold(self.dtype.size as u64, |product, &axis| product.checked_mul(axis))
            .or_else(|| self.shape.contains(&0).then_some(0))
            .filter(|&bytes| bytes <= limit_bytes)
            .ok_or_else(|| ArrayError::TooLarge { shape: self.shape.clone(), limit_bytes })
    }

    /// Reads the elements in C order. The stream must end after the last element: the checksum of
    /// an archive's member is verified only at the end.
    pub(super) fn read_data<T: Sample>(
        &self,
        stream: &mut impl Read,
        limit_bytes: u64,
    ) -> Result<Vec<T>, ArrayError> {
        if self.dtype.kind == Kind::Complex {
            return Err(ArrayError::Dtype("has complex numbers".to_owned()));
        }
        let bytes = self.read_bytes(stream, limit_bytes)?;
        Ok(self.in_c_order(self.dtype.decode(&bytes)))
    }

    /// Whether the data are real numbers in C order: each number is decoded by itself.
    pub(super) fn is_plain(&self) -> bool {
        let in_order =
            !self.fortran_order || self.shape.iter().filter(|&&axis| axis != 1).count() < 2;
        self.dtype.kind != Kind::Complex && in_order
    }

    /// Bytes of one number.
    pub(super) fn number_bytes(&self) -> usize {
        self.dtype.size
    }

    /// Converts the bytes of as many numbers as there are places.
    pub(super) fn decode_into<T: Sample>(&self, bytes: &[u8], out: &mut [T]) {
        self.dtype.decode_into(bytes, out);
    }

    /// Refuses an array whose elements, as `T`, take more than `limit_bytes` of memory. A byte of a packed
    /// file can become a thousand numbers of eight bytes.
    pub(super) fn fits<T>(&self, limit_bytes: u64) -> Result<(), ArrayError> {
        let elements = self.data_bytes(u64::MAX)? / self.dtype.size.max(1) as u64;
        match elements.checked_mul(size_of::<T>() as u64) {
            Some(bytes) if bytes <= limit_bytes => Ok(()),
            _ => Err(ArrayError::TooLarge { shape: self.shape.clone(), limit_bytes }),
        }
    }

    /// Reads the elements as [`read_data`](Self::read_data) does, and hands out a block of them at a time: the memory holds one
    /// block, unless the elements must be reordered.
    pub(super) fn each_block(
        &self,
        stream: &mut impl Read,
        limit_bytes: u64,
        mut take: impl FnMut(&[f64]),
    ) -> Result<(), ArrayError> {
        if !self.is_plain() {
            self.fits::<f64>(MAX_MEMORY_BYTES)?;
            take(&self.read_data::<f64>(stream, limit_bytes)?);
            return Ok(());
        }
        let expected = self.data_bytes(limit_bytes)?;
        let most = (BLOCK * self.dtype.size) as u64;
        let mut bytes = vec![0; expected.min(most) as usize];
        let mut numbers = vec![0.0; bytes.len() / self.dtype.size];
        let mut read = 0;
        while read < expected {
            let now = (expected - read).min(most) as usize;
            fill_data(stream, &mut bytes[..now], read, expected)?;
            let numbers = &mut numbers[..now / self.dtype.size];
            self.dtype.decode_into(&bytes[..now], numbers);
            take(numbers);
            read += now as u64;
        }
        ends(stream, expected)
    }

    fn read_bytes(&self, stream: &mut impl Read, limit_bytes: u64) -> Result<Vec<u8>, ArrayError> {
        let expected = self.data_bytes(limit_bytes)?;
        let mut bytes = Vec::new();
        stream.by_ref().take(expected).read_to_end(&mut bytes).map_err(ArrayError::Io)?;
        if (bytes.len() as u64) < expected {
            return Err(ArrayError::Damaged(format!(
                "{} of {expected} bytes of data",
                bytes.len()
            )));
        }
        ends(stream, expected)?;
        Ok(bytes)
    }

    /// Reads real or complex elements as [`read_data`](Self::read_data) does: the real parts, and
    /// the imaginary parts of complex elements.
    pub(super) fn read_parts(
        &self,
        stream: &mut impl Read,
        limit_bytes: u64,
    ) -> Result<(Vec<f64>, Option<Vec<f64>>), ArrayError> {
        if self.dtype.kind != Kind::Complex {
            return Ok((self.read_data(stream, limit_bytes)?, None));
        }
        let bytes = self.read_bytes(stream, limit_bytes)?;
        let part = Dtype { kind: Kind::Float, size: self.dtype.size / 2, ..self.dtype };
        let parts: Vec<f64> = part.decode(&bytes);
        let of =
            |first: usize| -> Vec<f64> { parts.iter().skip(first).step_by(2).copied().collect() };
        Ok((self.in_c_order(of(0)), Some(self.in_c_order(of(1)))))
    }

    fn in_c_order<T: Sample>(&self, values: Vec<T>) -> Vec<T> {
        // Each axis fits into `usize`: the product of all axes was computed above and is the length
        // of `bytes`.
        let shape: Vec<usize> = self.shape.iter().map(|&axis| axis as usize).collect();
        let reorder = self.fortran_order && shape.len() > 1 && !values.is_empty();
        if reorder { to_c_order(&values, &shape) } else { values }
    }
}

/// A shape as Python writes it, such as `(4, 3)`, for error messages.
pub(super) fn shape_text(shape: &[u64]) -> String {
    match shape {
        [one] => format!("({one},)"),
        axes => format!("({})", axes.iter().map(u64::to_string).collect::<Vec<_>>().join(", ")),
    }
}

pub(super) use super::plain::MAX_MEMORY_BYTES;

/// Refuses a field of this shape before its numbers are read, if they take more than
/// [`MAX_MEMORY_BYTES`] as float64, twice as many where they are complex.
pub(super) fn within_memory(
    path: &Path,
    field: &str,
    shape: &[u64],
    is_complex: bool,
) -> Result<(), FileError> {
    let parts = if is_complex { 2 } else { 1 };
    let each = size_of::<f64>() as u64 * parts;
    match shape.iter().try_fold(each, |bytes, &axis| bytes.checked_mul(axis)) {
        Some(bytes) if bytes <= MAX_MEMORY_BYTES => Ok(()),
        _ => Err(claims(path, field, shape, MAX_MEMORY_BYTES)),
    }
}

/// A field that claims more than is read.
pub(super) fn claims(path: &Path, field: &str, shape: &[u64], limit_bytes: u64) -> FileError {
    let found = format!("claims shape {}", shape_text(shape));
    FileError::field(path, field, found, format!("at most {} MiB", limit_bytes >> 20))
}

/// The part of an error message that states an unexpected shape.
pub(super) fn has_shape(shape: &[u64]) -> String {
    format!("has shape {}", shape_text(shape))
}

fn fill(stream: &mut impl Read, buffer: &mut [u8], part: &str) -> Result<(), ArrayError> {
    stream.read_exact(buffer).map_err(|error| match error.kind() {
        io::ErrorKind::UnexpectedEof => ArrayError::Damaged(format!("it ends inside {part}")),
        _ => ArrayError::Io(error),
    })
}

/// Fills a buffer with data, of which `read` of `expected` bytes were read before.
fn fill_data(
    stream: &mut impl Read,
    buffer: &mut [u8],
    read: u64,
    expected: u64,
) -> Result<(), ArrayError> {
    let mut filled = 0;
    while filled < buffer.len() {
        match stream.read(&mut buffer[filled..]) {
            Ok(0) => {
                let found = read + filled as u64;
                return Err(ArrayError::Damaged(format!("{found} of {expected} bytes of data")));
            }
            Ok(count) => filled += count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(ArrayError::Io(error)),
        }
    }
    Ok(())
}

/// Refuses a stream that goes on after its data.
fn ends(stream: &mut impl Read, expected: u64) -> Result<(), ArrayError> {
    match stream.read(&mut [0]).map_err(ArrayError::Io)? {
        0 => Ok(()),
        _ => Err(ArrayError::Damaged(format!(
            "more than the {expected} bytes of data of its header"
        ))),
    }
}

/// Parses the three values of `{'descr': '<f8', 'fortran_order': False, 'shape': (3, 4), }`. The
/// keys may be in any order.
fn parse_dictionary(text: &str) -> Result<(Dtype, bool, Vec<u64>), ArrayError> {
    let damaged = |what: &str| ArrayError::Damaged(format!("{what} in its header"));
    let value = |key: &str| -> Result<&str, ArrayError> {
        [format!("'{key}'"), format!("\"{key}\"")]
            .iter()
            .find_map(|quoted| text.split_once(quoted.as_str()))
            .and_then(|(_, after)| after.trim_start().strip_prefix(':'))
            .map(str::trim_start)
            .ok_or_else(|| damaged(&format!("no '{key}'")))
    };

    let order = value("fortran_order")?;
    let fortran_order = match () {
        () if order.starts_with("True") => true,
        () if order.starts_with("False") => false,
        () => return Err(damaged("no truth value for 'fortran_order'")),
    };

    let axes = value("shape")?
        .strip_prefix('(')
        .and_then(|inside| inside.split_once(')'))
        .map(|(inside, _)| inside.trim())
        .ok_or_else(|| damaged("no tuple for 'shape'"))?;
    let shape = match axes.strip_suffix(',').unwrap_or(axes) {
        "" => Vec::new(),
        axes => axes
            .split(',')
            // Python 2 wrote long integers as `3L`.
            .map(|axis| {
                axis.trim()
                    .trim_end_matches('L')
                    .parse()
                    .map_err(|_| damaged("no sizes for 'shape'"))
            })
            .collect::<Result<_, _>>()?,
    };
    Ok((Dtype::parse(value("descr")?)?, fortran_order, shape))
}

impl Dtype {
    /// Parses a value that starts with a quoted type string such as `'<f8'`.
    fn parse(value: &str) -> Result<Self, ArrayError> {
        let Some(quote @ ('\'' | '"')) = value.chars().next() else {
            // A list of fields describes a structured array.
            return Err(ArrayError::Dtype("is a structured array".to_owned()));
        };
        let Some((descr, _)) = value[1..].split_once(quote) else {
            return Err(ArrayError::Damaged("no end of 'descr' in its header".to_owned()));
        };
        let unknown = || ArrayError::Dtype(format!("is of type '{}'", Shown::text(descr)));
        let mut chars = descr.chars();
        let big_endian = match chars.next() {
            Some('>') => true,
            Some('<' | '|') => false,
            Some('=') => cfg!(target_endian = "big"),
            _ => return Err(unknown()),
        };
        let kind = match chars.next() {
            Some('b') => Kind::Bool,
            Some('i') => Kind::Signed,
            Some('u') => Kind::Unsigned,
            Some('f') => Kind::Float,
            Some('c') => Kind::Complex,
            _ => return Err(unknown()),
        };
        let size = match (kind, chars.as_str()) {
            (Kind::Bool | Kind::Signed | Kind::Unsigned, "1") => 1,
            (Kind::Signed | Kind::Unsigned | Kind::Float, "2") => 2,
            (Kind::Signed | Kind::Unsigned | Kind::Float, "4") => 4,
            (Kind::Signed | Kind::Unsigned | Kind::Float | Kind::Complex, "8") => 8,
            (Kind::Complex, "16") => 16,
            _ => return Err(unknown()),
        };
        Ok(Self { kind, size, big_endian })
    }

    /// The numbers in these bytes.
    pub(super) fn decode<T: Sample>(self, bytes: &[u8]) -> Vec<T> {
        let mut values = vec![T::from_f64(0.0); bytes.len() / self.size];
        self.decode_into(bytes, &mut values);
        values
    }

    fn decode_into<T: Sample>(self, bytes: &[u8], out: &mut [T]) {
        match (self.kind, self.size) {
            (Kind::Bool, _) => self.each(bytes, out, |[b]| f64::from(u8::from(b != 0))),
            (Kind::Signed, 1) => self.each(bytes, out, |b| f64::from(i8::from_le_bytes(b))),
            (Kind::Signed, 2) => self.each(bytes, out, |b| f64::from(i16::from_le_bytes(b))),
            (Kind::Signed, 4) => self.each(bytes, out, |b| f64::from(i32::from_le_bytes(b))),
            (Kind::Signed, _) => self.each(bytes, out, |b| i64::from_le_bytes(b) as f64),
            (Kind::Unsigned, 1) => self.each(bytes, out, |b| f64::from(u8::from_le_bytes(b))),
            (Kind::Unsigned, 2) => self.each(bytes, out, |b| f64::from(u16::from_le_bytes(b))),
            (Kind::Unsigned, 4) => self.each(bytes, out, |b| f64::from(u32::from_le_bytes(b))),
            (Kind::Unsigned, _) => self.each(bytes, out, |b| u64::from_le_bytes(b) as f64),
            (Kind::Float, 2) => self.each(bytes, out, |b| half_to_f64(u16::from_le_bytes(b))),
            (Kind::Float, 4) => self.each(bytes, out, |b| f64::from(f32::from_le_bytes(b))),
            // Complex numbers are decoded part by part.
            (Kind::Float | Kind::Complex, _) => self.each(bytes, out, f64::from_le_bytes),
        }
    }

    /// Converts each `N` bytes, put into little-endian order, into a sample.
    fn each<T: Sample, const N: usize>(
        self,
        bytes: &[u8],
        out: &mut [T],
        number: impl Fn([u8; N]) -> f64,
    ) {
        let (elements, _) = bytes.as_chunks::<N>();
        for (out, &element) in out.iter_mut().zip(elements) {
            let mut element = element;
            if self.big_endian {
                element.reverse();
            }
            *out = T::from_f64(number(element));
        }
    }
}

/// IEEE 754 binary16: 1 sign, 5 exponent (bias 15), 10 fraction bits.
fn half_to_f64(bits: u16) -> f64 {
    let sign = if bits >> 15 == 0 { 1.0 } else { -1.0 };
    let exponent = i32::from(bits >> 10 & 0x1f);
    let fraction = f64::from(bits & 0x3ff) / 1024.0;
    sign * match exponent {
        0 => fraction * 2f64.powi(-14),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1.0 + fraction) * 2f64.powi(exponent - 15),
    }
}

/// Reorders elements stored with the first axis fastest into C order, with the last axis fastest. An axis may have no
/// elements.
pub(super) fn to_c_order<T: Copy>(values: &[T], shape: &[usize]) -> Vec<T> {
    let axes: Vec<usize> = shape.iter().copied().filter(|&axis| axis != 1).collect();
    match axes[..] {
        _ if values.is_empty() => Vec::new(),
        [] | [_] => values.to_vec(),
        [rows, columns] => transposed(values, rows, columns),
        _ => one_by_one(values, &axes),
    }
}

/// Side of the squares in which a matrix is transposed: both sides of a square stay in a
/// processor's first cache.
const SQUARE: usize = 32;

/// A matrix of `rows` by `columns`, stored column by column, row by row.
fn transposed<T: Copy>(values: &[T], rows: usize, columns: usize) -> Vec<T> {
    let mut made = values.to_vec();
    for (band, made) in made.chunks_mut(SQUARE * columns).enumerate() {
        for left in (0..columns).step_by(SQUARE) {
            for (r, row) in made.chunks_exact_mut(columns).enumerate() {
                let end = columns.min(left + SQUARE);
                for (c, place) in row[left..end].iter_mut().enumerate() {
                    *place = values[(left + c) * rows + band * SQUARE + r];
                }
            }
        }
    }
    made
}

fn one_by_one<T: Copy>(values: &[T], shape: &[usize]) -> Vec<T> {
    let mut index = vec![0; shape.len()];
    let strides: Vec<usize> = shape
        .iter()
        .scan(1, |product, &axis| {
            let stride = *product;
            *product *= axis;
            Some(stride)
        })
        .collect();
    (0..values.len())
        .map(|_| {
            let value =
                values[index.iter().zip(&strides).map(|(i, stride)| i * stride).sum::<usize>()];
            for axis in (0..shape.len()).rev() {
                index[axis] += 1;
                if index[axis] < shape[axis] {
                    break;
                }
                index[axis] = 0;
            }
            value
        })
        .collect()
}

#[cfg(test)]
mod tests;
