//! Reads arrays of HDF5 files: MATLAB's `.mat` 7.3, and files of h5py and other writers.
//!
//! The file is read into memory whole. A limit bounds the memory for a field, whatever size the
//! file claims.

mod lzf;

use super::FileError;
use super::array::{Dtype, Kind, MAX_AXES, has_shape, within_memory};
use super::field::Field;
use hdf5_reader::error::Error;
use hdf5_reader::messages::datatype::{CompoundField, Datatype};
use hdf5_reader::{ByteOrder, FilterRegistry, Hdf5File, OpenOptions};
use std::path::{Path, PathBuf};

const EXPECTED: &str = "an HDF5 file";
/// The largest field read into memory.
const MAX_FIELD_BYTES: usize = 256 << 20;
/// The most groups around an array that has a name.
const MAX_DEPTH: usize = 8;
/// The most groups that are opened for the names of their arrays.
const MAX_GROUPS: usize = 1000;

/// An open file.
pub(super) struct Hdf5 {
    path: PathBuf,
    file: Hdf5File,
    /// Whether MATLAB wrote the file. MATLAB stores its arrays with the axes in reverse.
    is_matlab: bool,
}

impl Hdf5 {
    pub(super) fn open(path: &Path, bytes: Vec<u8>, is_matlab: bool) -> Result<Self, FileError> {
        if let Some((found, expected)) = cut_at(&bytes) {
            let lengths = format!("{found} bytes, {expected} by its superblock");
            return Err(damaged(path, lengths));
        }
        let mut filters = FilterRegistry::new();
        let lzf = |filter: &_, packed: &[u8], _| lzf::unpacked(filter, packed, MAX_FIELD_BYTES);
        filters.register(lzf::LZF, Box::new(lzf));
        let options = OpenOptions::default()
            .with_filter_registry(filters)
            .with_max_chunk_bytes(MAX_FIELD_BYTES)
            .with_max_read_bytes(MAX_FIELD_BYTES);
        let file = Hdf5File::from_vec_with_options(bytes, options)
            .map_err(|error| damaged(path, error.to_string()))?;
        Ok(Self { path: path.to_owned(), file, is_matlab })
    }

    /// Names of the arrays, those in groups by their path: `run1/adc/y`, or `meas.y` for a field of
    /// a structure of MATLAB.
    pub(super) fn names(&self) -> Result<Vec<String>, FileError> {
        let explain = |error: Error| damaged(&self.path, error.to_string());
        let between = if self.is_matlab { '.' } else { '/' };
        // MATLAB keeps parts of cell arrays in a group of its own.
        let is_hidden = |name: &str| self.is_matlab && name.starts_with('#');
        let mut names = Vec::new();
        let root = self.file.root_group().map_err(explain)?;
        let (mut opened, mut groups) = (0, vec![(String::new(), 0, root)]);
        // A group can hold itself, and many times: what is deeper has no name, nor what comes later.
        while let Some((path, depth, group)) = groups.pop() {
            let (inner, arrays) = match group.member_names() {
                Ok(members) => members,
                // A damaged group does not take the arrays outside it along.
                Err(_) if depth > 0 => continue,
                Err(error) => return Err(explain(error)),
            };
            names.extend(arrays.into_iter().map(|name| format!("{path}{name}")));
            for name in inner.into_iter().filter(|name| !is_hidden(name)) {
                if depth == MAX_DEPTH || opened == MAX_GROUPS {
                    break;
                }
                opened += 1;
                if let Ok(group) = group.group(&name) {
                    groups.push((format!("{path}{name}{between}"), depth + 1, group));
                }
            }
        }
        Ok(names)
    }

    pub(super) fn read(
        &self,
        field: &str,
        accept: impl Fn(&[u64]) -> Result<(), String>,
    ) -> Result<Field, FileError> {
        let explain = |error: Error| damaged(&self.path, format!("`{field}`: {error}"));
        let refuse =
            |found: String, expected: &str| FileError::field(&self.path, field, found, expected);
        let path = if self.is_matlab { field.replace('.', "/") } else { field.to_owned() };
        let data = self.file.dataset(&format!("/{path}")).map_err(explain)?;
        let stored: Vec<u64> = data.shape().to_vec();
        let mut shape = stored.clone();
        if self.is_matlab {
            shape.reverse();
        }
        accept(&shape).map_err(|expected| refuse(has_shape(&shape), &expected))?;
        if shape.len() > MAX_AXES {
            return Err(refuse(has_shape(&shape), "at most 32 axes"));
        }
        let parts = parts(data.dtype());
        let Some((element_bytes, parts)) = parts else {
            // The form of these numbers, IEEE's or another, is not among what the reader says.
            return Err(match data.dtype() {
                Datatype::FloatingPoint { size, .. } => {
                    let found = format!("is an array of floating-point numbers of {size} bytes");
                    refuse(found, "4 or 8 bytes: save it as float32")
                }
                _ => refuse("is no array of numbers".to_owned(), "numbers of up to 8 bytes"),
            });
        };
        within_memory(&self.path, field, &stored, parts.1.is_some())?;
        let bytes = data.read_raw_bytes().map_err(explain)?;
        let count = stored.iter().try_fold(1_u64, |product, &axis| product.checked_mul(axis));
        let found = bytes.len() / element_bytes;
        if count != Some(found as u64) {
            return Err(damaged(&self.path, format!("`{field}`: {found} numbers")));
        }
        let part = |part: &Part| part.numbers(&bytes, element_bytes);
        let (real, imaginary) = (part(&parts.0), parts.1.as_ref().map(part));
        let shape = shape.iter().map(|&axis| axis as usize).collect();
        Ok(match self.is_matlab {
            true => Field::from_column_major(shape, &real, imaginary.as_deref()),
            false => Field { shape, real, imaginary },
        })
    }
}

/// The length of a file that ends before the end-of-file address of its superblock, and that address. Such a file
/// was cut, and h5py refuses it too. `None` for a whole file, and for a superblock that the reader judges.
///
/// Format: The HDF Group, *HDF5 File Format Specification* 3.0, II.A "Superblock". MATLAB has 512 bytes of its own
/// before it; the address counts from the beginning of the file.
fn cut_at(bytes: &[u8]) -> Option<(u64, u64)> {
    const SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";
    let starts = std::iter::once(0).chain((9..).map(|power| 1 << power));
    let mut starts = starts.take_while(|&start| start + SIGNATURE.len() <= bytes.len());
    let start = starts.find(|&start| bytes[start..].starts_with(SIGNATURE))?;
    let block = &bytes[start..];
    // The place of the size of an address, and of the base address; the end-of-file address is two further.
    let (size_at, base_at) = match block.get(8)? {
        0 => (13, 24),
        1 => (13, 28),
        2 | 3 => (9, 12),
        _ => return None,
    };
    let size = usize::from(*block.get(size_at)?);
    let at = base_at + 2 * size;
    let address = block.get(at..at + size).filter(|_| (1..=8).contains(&size))?;
    let expected = address.iter().rev().fold(0_u64, |all, &byte| all << 8 | u64::from(byte));
    let found = bytes.len() as u64;
    (found < expected).then_some((found, expected))
}

/// A number within an element.
#[derive(Clone, Copy)]
struct Part {
    offset: usize,
    dtype: Dtype,
}

impl Part {
    fn of(datatype: &Datatype, offset: usize) -> Option<Self> {
        let (size, kind, order) = match datatype {
            Datatype::FixedPoint { size, signed: true, byte_order } => {
                (*size, Kind::Signed, *byte_order)
            }
            Datatype::FixedPoint { size, byte_order, .. } => (*size, Kind::Unsigned, *byte_order),
            Datatype::FloatingPoint { size, byte_order } => (*size, Kind::Float, *byte_order),
            // h5py stores truth values as enumerations.
            Datatype::Enum { base, .. } => return Self::of(base, offset),
            _ => return None,
        };
        let known = if kind == Kind::Float { &[4, 8][..] } else { &[1, 2, 4, 8] };
        let big_endian = order == ByteOrder::BigEndian;
        let dtype = Dtype { kind, size: usize::from(size), big_endian };
        known.contains(&size).then_some(Self { offset, dtype })
    }

    /// The numbers of elements that are `each` bytes long.
    fn numbers(&self, elements: &[u8], each: usize) -> Vec<f64> {
        let Self { offset, dtype } = self;
        let of = |element: &[u8]| element[*offset..offset + dtype.size].to_vec();
        match each == dtype.size {
            true => dtype.decode(elements),
            false => dtype.decode(&elements.chunks_exact(each).flat_map(of).collect::<Vec<u8>>()),
        }
    }
}

/// The bytes of an element, its number, and its imaginary part if the element is complex. A complex
/// element is a pair of numbers, which MATLAB names `real` and `imag` and h5py names `r` and `i`.
fn parts(datatype: &Datatype) -> Option<(usize, (Part, Option<Part>))> {
    let Datatype::Compound { size, fields } = datatype else {
        let part = Part::of(datatype, 0)?;
        return Some((part.dtype.size, (part, None)));
    };
    let [real, imaginary] = &fields[..] else { return None };
    let named = |field: &CompoundField, names: [&str; 2]| names.contains(&field.name.as_str());
    if !named(real, ["r", "real"]) || !named(imaginary, ["i", "imag"]) {
        return None;
    }
    let size = *size as usize;
    let part = |field: &CompoundField| {
        Part::of(&field.datatype, field.byte_offset as usize)
            .filter(|part| part.offset + part.dtype.size <= size)
    };
    Some((size, (part(real)?, Some(part(imaginary)?))))
}

fn damaged(path: &Path, found: String) -> FileError {
    FileError::damaged(path, found, EXPECTED)
}
