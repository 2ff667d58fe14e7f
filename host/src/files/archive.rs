//! Reads a NumPy `.npz` archive: a zip file in which each member is one `.npy` array.
//!
//! # Invariant
//! A member is opened only when its field is read. Other members (text, pickled objects, large
//! images) cost nothing (`measurement::tests::a_good_file_reads_however_it_was_zipped`). An opened
//! member is read to its end, so its checksum is always verified
//! (`measurement::tests::a_changed_reading_is_caught_by_the_checksum`).

use super::FileError;
use super::array::{ArrayError, Header, MAGIC, Sample, has_shape, shape_text};
use super::fields::Field;
use std::fs::File;
use std::io::{BufReader, Cursor, Read, Seek};
use std::path::{Path, PathBuf};
use zip::read::ZipFile;
use zip::write::SimpleFileOptions;
use zip::{ZipArchive, ZipWriter};

/// The kind of file that a path should lead to, for error messages.
const EXPECTED: &str = "a NumPy .npz archive";
/// The suffix that NumPy appends to the name of an array.
const MEMBER_SUFFIX: &str = ".npy";
/// The numeric types that the reader accepts, for error messages.
pub(super) const NUMBERS: &str = "real numbers of up to 8 bytes";
/// The largest field read into memory. A 256 x 256 sweep of raw pairs in float64 is 1 MiB; the
/// limit is 256 times as much.
const MAX_FIELD_BYTES: u64 = 256 << 20;
/// The most memory that the numbers of a field may take: 512 sweeps of 256 x 256 pairs in float64.
const MAX_MEMORY_BYTES: u64 = 512 << 20;

/// An open archive.
pub(super) struct Archive {
    path: PathBuf,
    zip: ZipArchive<BufReader<File>>,
    names: Vec<String>,
}

/// A field of numbers in C order.
#[derive(Debug)]
pub(super) struct Numbers<T = f64> {
    pub(super) shape: Vec<usize>,
    pub(super) values: Vec<T>,
}

/// Opens a plain file. Every error names the path.
pub(super) fn open_file(path: &Path, expected: &'static str) -> Result<(File, u64), FileError> {
    let read = |error| FileError::io(path, "read", error);
    // The kind of file is checked before opening, because opening a named pipe would wait for a
    // writer.
    let metadata = std::fs::metadata(path).map_err(read)?;
    if metadata.is_dir() {
        return Err(FileError::kind(path, "a folder", expected));
    }
    if !metadata.is_file() {
        return Err(FileError::kind(path, "a device or pipe", expected));
    }
    if metadata.len() == 0 {
        return Err(FileError::kind(path, "an empty file", expected));
    }
    Ok((File::open(path).map_err(read)?, metadata.len()))
}

/// Largest text file of numbers that is read: a table of 100 000 rows of four numbers is 4 MB.
const MAX_TEXT_MIB: u64 = 4;
/// Largest text file of measurements: 32 sweeps of 256 x 256 pairs with 20 characters a reading are
/// 84 MB.
const MAX_LARGE_TEXT_MIB: u64 = 256;

/// Reads a plain text file of at most 4 MiB. Every error names the path.
pub(super) fn read_text(path: &Path, expected: &'static str) -> Result<String, FileError> {
    let bytes = read_bytes(path, expected, MAX_TEXT_MIB)?;
    String::from_utf8(bytes).map_err(|_| FileError::kind(path, "a binary file", expected))
}

/// Reads a plain text file of at most 256 MiB. Every error names the path. A heading may be in
/// another code page than UTF-8.
pub(super) fn read_large_text(path: &Path, expected: &'static str) -> Result<String, FileError> {
    let bytes = read_bytes(path, expected, MAX_LARGE_TEXT_MIB)?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// The largest file that [`read_small`] reads. The bitstream of the largest ECP5 has 2 MB.
const MAX_SMALL_BYTES: u64 = 32 << 20;

/// The bytes of a file of at most 32 MiB: descriptions, calibrations, bitstreams. A pipe is refused,
/// because opening a pipe waits for a writer, and so is a device, which may never end.
///
/// # Errors
/// The system's error; [`ErrorKind::InvalidInput`](std::io::ErrorKind::InvalidInput) for anything
/// but a file of that size.
pub fn read_small(path: &Path) -> std::io::Result<Vec<u8>> {
    use std::io::{Error, ErrorKind};
    let metadata = std::fs::metadata(path)?;
    if metadata.is_dir() {
        return Err(ErrorKind::IsADirectory.into());
    }
    if !metadata.is_file() {
        return Err(Error::new(ErrorKind::InvalidInput, "a device or pipe, expected a file"));
    }
    let mut bytes = Vec::new();
    File::open(path)?.take(MAX_SMALL_BYTES + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > MAX_SMALL_BYTES {
        let reason = format!("more than {} MiB", MAX_SMALL_BYTES >> 20);
        return Err(Error::new(ErrorKind::InvalidInput, reason));
    }
    Ok(bytes)
}

fn read_bytes(path: &Path, expected: &'static str, most_mib: u64) -> Result<Vec<u8>, FileError> {
    let (file, _) = open_file(path, expected)?;
    let mut bytes = Vec::new();
    file.take((most_mib << 20) + 1)
        .read_to_end(&mut bytes)
        .map_err(|error| FileError::io(path, "read", error))?;
    match bytes.len() as u64 <= most_mib << 20 {
        true => Ok(bytes),
        false => Err(FileError::kind(path, format!("more than {most_mib} MiB"), expected)),
    }
}

/// The kind of a file by its first bytes. An error message uses the kind to tell a user which file
/// was chosen by mistake.
pub(super) fn kind_by_start(start: &[u8]) -> &'static str {
    const KINDS: [(&[u8], &str); 8] = [
        (b"PK", "a zip archive"),
        (MAGIC, "a single NumPy array (.npy)"),
        (b"\x89PNG", "a PNG image"),
        (b"\xff\xd8\xff", "a JPEG image"),
        (b"\x89HDF", "an HDF5 file"),
        (b"\x89MCAP", "a recording (MCAP)"),
        (b"MATLAB", "a MATLAB file"),
        (b"\x1f\x8b", "a gzip file"),
    ];
    KINDS
        .iter()
        .find(|(magic, _)| start.starts_with(magic))
        .map_or("a file of another kind", |&(_, kind)| kind)
}

impl Archive {
    pub(super) fn open(path: &Path) -> Result<Self, FileError> {
        let (mut file, _) = open_file(path, EXPECTED)?;
        let mut start = Vec::new();
        file.by_ref()
            .take(8)
            .read_to_end(&mut start)
            .and_then(|_| file.rewind())
            .map_err(|error| FileError::io(path, "read", error))?;
        if !start.starts_with(b"PK") {
            return Err(FileError::kind(path, kind_by_start(&start), EXPECTED));
        }
        let zip = ZipArchive::new(BufReader::new(file))
            .map_err(|error| damaged(path, error.to_string()))?;
        // A field of nirspi always has a name in UTF-8, so other names are skipped.
        let members = zip.file_names().flatten();
        let mut names: Vec<String> = members
            .filter_map(|name| name.strip_suffix(MEMBER_SUFFIX).map(str::to_owned))
            .collect();
        names.sort_unstable();
        Ok(Self { path: path.to_owned(), zip, names })
    }

    /// The names of all fields, sorted.
    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    pub(super) fn holds(&self, field: &str) -> bool {
        self.names.iter().any(|name| name == field)
    }

    /// Reads a field. `accept` checks the shape; its error is a description of the expected shape.
    pub(super) fn numbers(
        &mut self,
        field: &str,
        accept: impl FnOnce(&[u64]) -> Result<(), String>,
    ) -> Result<Numbers, FileError> {
        self.numbers_of(field, accept)
    }

    /// Reads a field as [`numbers`](Self::numbers) does, as numbers of another type. Stacks of
    /// images do not need 8 bytes a pixel.
    pub(super) fn numbers_of<T: Sample>(
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
            ArrayError::TooLarge { shape, limit_bytes } => refuse(
                format!("claims shape {}", shape_text(&shape)),
                format!("at most {} MiB", limit_bytes >> 20),
            ),
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
pub(crate) fn encode(path: &Path, members: &[(&str, Vec<u8>)]) -> Result<Vec<u8>, FileError> {
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

fn damaged(path: &Path, found: String) -> FileError {
    FileError::Damaged { path: path.to_owned(), found, expected: EXPECTED }
}
