//! Reads a NumPy `.npz` archive: a zip file in which each member is one `.npy` array.
//!
//! # Invariant
//! A member is opened only when its field is read. Other members (text, pickled objects, large
//! images) cost nothing (`measurement::tests::a_good_file_reads_however_it_was_zipped`). A member whose
//! numbers are read is read to its end, so the checksum of numbers is always verified
//! (`measurement::tests::a_changed_reading_is_caught_by_the_checksum`).

mod members;

use super::FileError;
use super::array::{
    ArrayError, Header, MAX_MEMORY_BYTES, NUMBERS, Sample, Take, claims, has_shape,
};
use super::field::Field;
use super::npy;
use super::plain::{kind_by_start, open_start};
use super::stored::{EXPECTED, Stored, damaged};
pub use members::{Members, write_members};
use std::fs::File;
use std::io::{BufReader, Cursor};
use std::path::{Path, PathBuf};
use zip::read::ZipFile;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

/// The suffix that NumPy appends to the name of an array.
const MEMBER_SUFFIX: &str = ".npy";
/// Ends of the names of members of other files that are zip archives, and what to do with these files.
const OTHERS: [(&str, &str); 3] = [
    ("xl/workbook.xml", "a workbook of Excel (save it as CSV)"),
    ("content.xml", "a spreadsheet of OpenDocument (save it as CSV)"),
    ("/data.pkl", "tensors of PyTorch (save the array with NumPy)"),
];
/// The largest field read into memory. A 256 x 256 sweep of raw pairs in float64 is 1 MiB; the
/// limit is 256 times as much.
pub const MAX_FIELD_BYTES: u64 = 256 << 20;

/// An open archive.
pub struct Archive {
    path: PathBuf,
    zip: ZipArchive<BufReader<File>>,
    names: Vec<String>,
}

/// A field of numbers in C order.
#[derive(Debug)]
pub struct Numbers<T = f64> {
    /// Length of each axis.
    pub shape: Vec<usize>,
    /// The numbers, the last axis fastest.
    pub values: Vec<T>,
}

impl Archive {
    /// Opens an archive of arrays (`.npz`).
    ///
    /// # Errors
    /// [`FileError`] for a file of another kind, and for a damaged one.
    pub fn open(path: &Path) -> Result<Self, FileError> {
        let (file, _, start) = open_start(path, EXPECTED, 8)?;
        if !start.starts_with(b"PK") {
            return Err(FileError::kind(path, kind_by_start(&start), EXPECTED));
        }
        let zip = ZipArchive::new(BufReader::new(file))
            .map_err(|error| damaged(path, error.to_string()))?;
        // A field of nirspi always has a name in UTF-8, so other names are skipped.
        let members: Vec<String> = zip.file_names().flatten().map(Into::into).collect();
        if let Some((_, kind)) =
            OTHERS.iter().find(|(end, _)| members.iter().any(|name| name.ends_with(end)))
        {
            return Err(FileError::kind(path, *kind, EXPECTED));
        }
        let mut names: Vec<String> = members
            .iter()
            .filter_map(|name| name.strip_suffix(MEMBER_SUFFIX).map(str::to_owned))
            .collect();
        if let ([], Some(first)) = (&names[..], members.first()) {
            let first: String = first.chars().take(60).collect();
            let found = format!("a zip archive without arrays, with {first:?} in it (unpack it)");
            return Err(FileError::kind(path, found, EXPECTED));
        }
        names.sort_unstable();
        Ok(Self { path: path.to_owned(), zip, names })
    }

    /// The names of all fields, sorted.
    #[must_use]
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Whether there is a field of this name.
    #[must_use]
    pub fn holds(&self, field: &str) -> bool {
        self.names.iter().any(|name| name == field)
    }

    /// Reads a field. `accept` checks the shape; its error is a description of the expected shape.
    ///
    /// # Errors
    /// [`FileError`] if the field is missing, damaged or too large, or its shape is not accepted.
    pub fn numbers(
        &mut self,
        field: &str,
        accept: impl FnOnce(&[u64]) -> Result<(), String>,
    ) -> Result<Numbers, FileError> {
        self.numbers_of(field, accept)
    }

    /// Reads a field as [`numbers`](Self::numbers) does, as numbers of another type. Stacks of
    /// images do not need 8 bytes a pixel.
    ///
    /// # Errors
    /// Those of [`numbers`](Self::numbers).
    pub fn numbers_of<T: Sample>(
        &mut self,
        field: &str,
        accept: impl FnOnce(&[u64]) -> Result<(), String>,
    ) -> Result<Numbers<T>, FileError> {
        let (shape, values) = self.member(field, accept, |header, member| {
            header.data_bytes(MAX_FIELD_BYTES)?;
            header.fits::<T>(MAX_MEMORY_BYTES)?;
            header.read_data(member, MAX_FIELD_BYTES)
        })?;
        Ok(Numbers { shape, values })
    }

    /// Reads a field as [`numbers`](Self::numbers) does, of real or complex numbers.
    pub(super) fn field(
        &mut self,
        field: &str,
        accept: impl FnOnce(&[u64]) -> Result<(), String>,
    ) -> Result<Field, FileError> {
        let (shape, (real, imaginary)) = self.member(field, accept, |header, member| {
            header.data_bytes(MAX_FIELD_BYTES)?;
            header.fits::<f64>(MAX_MEMORY_BYTES)?;
            header.read_parts(member, MAX_FIELD_BYTES)
        })?;
        Ok(Field { shape, real, imaginary })
    }

    /// The shape of a field whose numbers are not read yet. `accept` is that of
    /// [`numbers`](Self::numbers).
    pub(super) fn shape(
        &mut self,
        field: &str,
        accept: impl FnOnce(&[u64]) -> Result<(), String>,
    ) -> Result<Vec<usize>, FileError> {
        let (shape, ()) = self.member(field, accept, |header, _| {
            header.data_bytes(MAX_FIELD_BYTES)?;
            header.fits::<f64>(MAX_MEMORY_BYTES)
        })?;
        Ok(shape)
    }

    /// The shape of a field of any size, and what `take` makes of its numbers, a block of them at a time; the numbers are not
    /// read without it. `accept` is that of [`numbers`](Self::numbers).
    pub(super) fn each_block(
        &mut self,
        field: &str,
        accept: impl FnOnce(&[u64]) -> Result<(), String>,
        take: Option<&mut Take<'_>>,
    ) -> Result<Vec<usize>, FileError> {
        let (shape, ()) = self.member(field, accept, |header, member| match take {
            Some(take) => header.each_block(member, u64::MAX, take),
            None => header.data_bytes(u64::MAX).map(|_| ()),
        })?;
        Ok(shape)
    }

    /// A field whose real numbers lie in the file as they are; `None` for any other field.
    pub(super) fn stored(&mut self, field: &str) -> Result<Option<Stored>, FileError> {
        let path = self.path.clone();
        let (_, found) = self.member(
            field,
            |_| Ok(()),
            |header, member| {
                let bytes = header.data_bytes(MAX_FIELD_BYTES)?;
                let as_it_is = member.compression() == CompressionMethod::Stored
                    && !member.encrypted()
                    && header.is_plain()
                    && member.size() == header.header_bytes + bytes
                    && member.compressed_size() == member.size();
                let start = member.data_start().filter(|_| as_it_is);
                Ok(start.map(|start| Stored {
                    path,
                    field: field.to_owned(),
                    header: header.clone(),
                    start,
                    crc32: member.crc32(),
                    count: bytes as usize / header.number_bytes(),
                }))
            },
        )?;
        Ok(found)
    }

    /// A field that is one short text; `None` for any other.
    pub(super) fn text(&mut self, field: &str) -> Option<String> {
        let mut member = self.zip.by_name(&format!("{field}{MEMBER_SUFFIX}")).ok()?;
        npy::read_text(&mut member)
    }

    /// The type of the numbers of a field, as NumPy calls it; `None` if they are no numbers.
    pub(super) fn kind(&mut self, field: &str) -> Option<String> {
        self.member(field, |_| Ok(()), |header, _| Ok(header.type_name()))
            .ok()
            .map(|(_, kind)| kind)
    }

    fn member<D>(
        &mut self,
        field: &str,
        accept: impl FnOnce(&[u64]) -> Result<(), String>,
        decode: impl FnOnce(&Header, &mut ZipFile<'_, BufReader<File>>) -> Result<D, ArrayError>,
    ) -> Result<(Vec<usize>, D), FileError> {
        let path = &self.path;
        let mut member = self
            .zip
            .by_name(&format!("{field}{MEMBER_SUFFIX}"))
            .map_err(|error| damaged(path, format!("`{field}`: {error}")))?;
        let refuse = |found, expected: String| FileError::field(path, field, found, expected);
        let explain = |error| match error {
            // A failed checksum and an incomplete deflate stream also arrive as I/O errors.
            ArrayError::Damaged(what) => damaged(path, format!("`{field}`: {what}")),
            ArrayError::Io(error) => damaged(path, format!("`{field}`: {error}")),
            ArrayError::Dtype(found) => refuse(found, NUMBERS.to_owned()),
            ArrayError::TooLarge { shape, limit_bytes } => claims(path, field, &shape, limit_bytes),
        };
        let header = Header::read(&mut member).map_err(explain)?;
        accept(header.shape()).map_err(|expected| refuse(has_shape(header.shape()), expected))?;
        let values = decode(&header, &mut member).map_err(explain)?;
        Ok((header.shape().iter().map(|&axis| axis as usize).collect(), values))
    }
}

/// The bytes of an archive with these members. Each member is a whole `.npy` file under the name of
/// its field.
///
/// # Errors
/// [`FileError`] naming `path`, if the archive cannot be written.
pub fn encode(path: &Path, members: &[(&str, Vec<u8>)]) -> Result<Vec<u8>, FileError> {
    use std::io::Write as _;
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    for (field, bytes) in members {
        archive
            .start_file(format!("{field}{MEMBER_SUFFIX}"), SimpleFileOptions::default())
            .map_err(std::io::Error::from)
            .and_then(|()| archive.write_all(bytes))
            .map_err(|error| FileError::io(path, "write", error))?;
    }
    let bytes = archive.finish().map_err(|error| FileError::io(path, "write", error.into()))?;
    Ok(bytes.into_inner())
}
