//! Reads arrays of MATLAB `.mat` files of level 5, which `save` writes up to `-v7` and SciPy's
//! `savemat` writes.
//!
//! Format: MathWorks, *MAT-File Format*, R2023a, "Level 5 MAT-Files".
//!
//! A field of a structure has the name `structure.field`.
//!
//! Every claim of a header is checked before it is used, and memory grows with the bytes that
//! arrived. A compressed variable is decompressed only when its field is read, and only up to a
//! limit; structures are decompressed once more for the names of their fields, up to the same limit
//! for all of them together.

use super::FileError;
use super::array::{Dtype, Kind, MAX_AXES, has_shape, within_memory};
use super::field::Field;
use flate2::bufread::ZlibDecoder;
use std::borrow::Cow;
use std::io::Read;
use std::path::{Path, PathBuf};

const EXPECTED: &str = "a MATLAB level 5 file";
const HEADER_BYTES: usize = 128;
/// The largest variable read into memory.
const MAX_VARIABLE_BYTES: u64 = 256 << 20;
/// The bytes of a compressed variable that are decompressed to find its name: flags, sizes and
/// name.
const HEAD_BYTES: u64 = 4096;

// Data types of elements.
const INT8: u32 = 1;
const UINT32: u32 = 6;
const INT32: u32 = 5;
/// The most structures around an array that has a name.
const MAX_DEPTH: usize = 8;
/// The class of structures.
const STRUCTURE: u32 = 2;
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;

/// The flag of complex numbers.
const COMPLEX: u32 = 0x0800;

/// An open file, with the position of each variable.
pub(super) struct Mat {
    path: PathBuf,
    bytes: Vec<u8>,
    is_big_endian: bool,
    variables: Vec<Variable>,
}

struct Variable {
    name: String,
    /// Of a structure, the paths of all fields that are not structures themselves.
    fields: Vec<String>,
    /// Start of the matrix's content, compressed or not.
    start: usize,
    end: usize,
    is_compressed: bool,
}

/// Why the content of a variable is not there.
enum Unpacked {
    Larger,
    Damaged(String),
}

/// An element: its type and its data.
struct Element<'b> {
    kind: u32,
    data: &'b [u8],
    /// The bytes after the element.
    rest: &'b [u8],
}

/// The elements of a matrix before its numbers.
struct Head<'b> {
    class: u32,
    is_complex: bool,
    shape: Vec<u64>,
    name: String,
    rest: &'b [u8],
}

impl Mat {
    /// Whether a file with these first bytes is a level 5 `.mat` file.
    pub(super) fn is_start(start: &[u8]) -> bool {
        start.len() >= HEADER_BYTES
            && matches!(&start[124..128], [0, 1, b'I', b'M'] | [1, 0, b'M', b'I'])
    }

    pub(super) fn open(path: &Path, bytes: Vec<u8>) -> Result<Self, FileError> {
        let is_big_endian = bytes[126] == b'M';
        let mut mat = Self { path: path.to_owned(), bytes, is_big_endian, variables: Vec::new() };
        let mut start = HEADER_BYTES;
        let mut listed_bytes = 0;
        while start < mat.bytes.len() {
            let (kind, data, end) = mat.variable_at(start)?;
            let (content, is_compressed) = (&mat.bytes[data..end], kind == COMPRESSED);
            let head = match kind {
                COMPRESSED => {
                    let mut head = Vec::new();
                    // Damage further on is reported when this variable is read.
                    let _ = ZlibDecoder::new(content).take(HEAD_BYTES).read_to_end(&mut head);
                    Some(head)
                }
                MATRIX => Some(content[..content.len().min(HEAD_BYTES as usize)].to_vec()),
                _ => None,
            };
            let named = head.and_then(|head| {
                let inside = if is_compressed { head.get(8..)? } else { &head[..] };
                let head = mat.head(inside)?;
                Some((head.name, head.class == STRUCTURE))
            });
            if let Some((name, is_structure)) = named {
                let mut variable =
                    Variable { name, fields: Vec::new(), start: data, end, is_compressed };
                // Damage is reported when a field of this structure is read.
                if is_structure
                    && listed_bytes < MAX_VARIABLE_BYTES
                    && let Ok(matrix) = mat.unpacked(&variable)
                {
                    listed_bytes += matrix.len() as u64;
                    mat.list(&matrix, "", MAX_DEPTH, &mut variable.fields);
                }
                mat.variables.push(variable);
            }
            start = end;
        }
        Ok(mat)
    }

    /// The type of the element at `start`, and where its data begin and end.
    fn variable_at(&self, start: usize) -> Result<(u32, usize, usize), FileError> {
        let cut = || self.damaged("it ends inside a variable".to_owned());
        let tag = self.bytes.get(start..start + 8).ok_or_else(cut)?;
        let (kind, size) = (self.word(&tag[..4]), self.word(&tag[4..]) as usize);
        let end = (start + 8).checked_add(size).filter(|&end| end <= self.bytes.len());
        Ok((kind, start + 8, end.ok_or_else(cut)?))
    }

    pub(super) fn names(&self) -> Vec<String> {
        let names = self.variables.iter().flat_map(|Variable { name, fields, .. }| {
            let inner = fields.iter().map(move |field| format!("{name}.{field}"));
            std::iter::once(name.clone()).filter(|_| fields.is_empty()).chain(inner)
        });
        names.collect()
    }

    pub(super) fn read(
        &self,
        field: &str,
        accept: impl Fn(&[u64]) -> Result<(), String>,
    ) -> Result<Field, FileError> {
        let refuse =
            |found: String, expected: String| FileError::field(&self.path, field, found, expected);
        let mut path = field.split('.');
        let first = path.next();
        let variable = self.variables.iter().find(|variable| Some(&variable.name[..]) == first);
        let Some(variable) = variable else {
            return Err(refuse("is not there".to_owned(), "a variable of the file".to_owned()));
        };
        let matrix = self.unpacked(variable).map_err(|error| match error {
            Unpacked::Larger => refuse("is larger".to_owned(), "at most 256 MiB".to_owned()),
            Unpacked::Damaged(found) => self.damaged(format!("`{field}`: {found}")),
        })?;
        let cut = || self.damaged(format!("`{field}`: it ends inside its numbers"));
        let mut head = self.head(&matrix).ok_or_else(cut)?;
        for name in path {
            let mut fields = self.structure(&head).into_iter().flatten();
            let inner = fields.find(|(field, _)| field == name).ok_or_else(|| {
                refuse("is not there".to_owned(), "a field of the file".to_owned())
            })?;
            head = self.head(inner.1).ok_or_else(cut)?;
        }
        // Classes 6 to 15 are numbers of any type. Cells, structures, objects, text and sparse
        // matrices have other classes.
        if !(6..=15).contains(&head.class) {
            let kind = match head.class {
                1 => "a cell array",
                STRUCTURE => "a structure",
                4 => "text",
                5 => "a sparse matrix",
                _ => "an object",
            };
            return Err(refuse(format!("is {kind}"), "an array of numbers".to_owned()));
        }
        accept(&head.shape).map_err(|expected| refuse(has_shape(&head.shape), expected))?;
        within_memory(&self.path, field, &head.shape, head.is_complex)?;
        let count = head.shape.iter().try_fold(1_u64, |product, &axis| product.checked_mul(axis));
        let real = self.element(head.rest).ok_or_else(cut)?;
        let numbers = |element: &Element<'_>| {
            self.numbers(element)
                .filter(|numbers| Some(numbers.len() as u64) == count)
                .ok_or_else(cut)
        };
        let (values, imaginary) = match head.is_complex {
            false => (numbers(&real)?, None),
            true => {
                let imaginary = self.element(real.rest).ok_or_else(cut)?;
                (numbers(&real)?, Some(numbers(&imaginary)?))
            }
        };
        let shape = head.shape.iter().map(|&axis| axis as usize).collect();
        Ok(Field::from_column_major(shape, &values, imaginary.as_deref()))
    }

    fn head<'b>(&self, matrix: &'b [u8]) -> Option<Head<'b>> {
        let flags = self.element(matrix).filter(|e| e.kind == UINT32 && e.data.len() == 8)?;
        let sizes = self.element(flags.rest).filter(|e| e.kind == INT32)?;
        let name = self.element(sizes.rest).filter(|e| e.kind == INT8)?;
        let word = self.word(&flags.data[..4]);
        let shape: Vec<u64> =
            sizes.data.chunks_exact(4).map(|axis| u64::from(self.word(axis))).collect();
        (shape.len() <= MAX_AXES).then(|| Head {
            class: word & 0xff,
            is_complex: word & COMPLEX != 0,
            shape,
            name: String::from_utf8_lossy(name.data).into_owned(),
            rest: name.rest,
        })
    }

    /// The content of a variable's matrix.
    fn unpacked(&self, variable: &Variable) -> Result<Cow<'_, [u8]>, Unpacked> {
        let content = &self.bytes[variable.start..variable.end];
        if !variable.is_compressed {
            return Ok(Cow::Borrowed(content));
        }
        let mut unpacked = Vec::new();
        ZlibDecoder::new(content)
            .take(MAX_VARIABLE_BYTES + 1)
            .read_to_end(&mut unpacked)
            .map_err(|error| Unpacked::Damaged(error.to_string()))?;
        if unpacked.len() as u64 > MAX_VARIABLE_BYTES {
            return Err(Unpacked::Larger);
        }
        let inner = self.element(&unpacked).filter(|inner| inner.kind == MATRIX);
        let inner = inner.ok_or_else(|| Unpacked::Damaged("no whole matrix".to_owned()))?;
        let start = inner.data.as_ptr() as usize - unpacked.as_ptr() as usize;
        let end = start + inner.data.len();
        unpacked.truncate(end);
        unpacked.drain(..start);
        Ok(Cow::Owned(unpacked))
    }

    /// The names of the fields of a single structure, and the content of the matrix of each.
    fn structure<'b>(&self, head: &Head<'b>) -> Option<Vec<(String, &'b [u8])>> {
        if head.class != STRUCTURE || head.shape.iter().any(|&axis| axis != 1) {
            return None;
        }
        let length = self.element(head.rest).filter(|e| e.kind == INT32 && e.data.len() == 4)?;
        let names = self.element(length.rest).filter(|e| e.kind == INT8)?;
        let name = |bytes: &[u8]| {
            let end = bytes.iter().position(|&byte| byte == 0).unwrap_or(bytes.len());
            String::from_utf8_lossy(&bytes[..end]).into_owned()
        };
        let mut rest = names.rest;
        let fields = names.data.chunks_exact((self.word(length.data) as usize).max(1));
        let fields = fields.map(|bytes| {
            let matrix = self.element(rest).filter(|inner| inner.kind == MATRIX)?;
            rest = matrix.rest;
            Some((name(bytes), matrix.data))
        });
        fields.collect()
    }

    /// Appends the paths of the fields of a structure; those of structures in it have this many
    /// dots at most.
    fn list(&self, matrix: &[u8], path: &str, depth: usize, paths: &mut Vec<String>) {
        let Some(head) = self.head(matrix) else { return };
        let Some(fields) = self.structure(&head) else {
            paths.extend(path.strip_suffix('.').map(str::to_owned));
            return;
        };
        for (name, inner) in fields.into_iter().filter(|_| depth > 0) {
            self.list(inner, &format!("{path}{name}."), depth - 1, paths);
        }
    }

    /// The element at the start of `bytes`. A small element has its data in its tag.
    fn element<'b>(&self, bytes: &'b [u8]) -> Option<Element<'b>> {
        let tag = bytes.get(..4)?;
        let word = self.word(tag);
        if word >> 16 != 0 {
            let (kind, size) = (word & 0xffff, (word >> 16) as usize);
            let data = bytes.get(4..8)?.get(..size)?;
            return Some(Element { kind, data, rest: &bytes[8..] });
        }
        let size = self.word(bytes.get(4..8)?) as usize;
        let data = bytes.get(8..)?.get(..size)?;
        let rest = bytes.get(8 + size.next_multiple_of(8)..).unwrap_or(&[]);
        Some(Element { kind: word, data, rest })
    }

    fn numbers(&self, element: &Element<'_>) -> Option<Vec<f64>> {
        let (kind, size) = match element.kind {
            1 => (Kind::Signed, 1),
            2 => (Kind::Unsigned, 1),
            3 => (Kind::Signed, 2),
            4 => (Kind::Unsigned, 2),
            5 => (Kind::Signed, 4),
            6 => (Kind::Unsigned, 4),
            7 => (Kind::Float, 4),
            9 => (Kind::Float, 8),
            12 => (Kind::Signed, 8),
            13 => (Kind::Unsigned, 8),
            _ => return None,
        };
        Some(Dtype { kind, size, big_endian: self.is_big_endian }.decode(element.data))
    }

    fn word(&self, bytes: &[u8]) -> u32 {
        let bytes = [bytes[0], bytes[1], bytes[2], bytes[3]];
        if self.is_big_endian { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) }
    }

    fn damaged(&self, found: String) -> FileError {
        FileError::damaged(&self.path, found, EXPECTED)
    }
}
