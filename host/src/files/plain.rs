//! Opens plain files, reads text, and tells kinds of files apart.

use super::FileError;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// The first bytes of a NumPy array.
pub(super) const NUMPY: &[u8; 6] = b"\x93NUMPY";

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
        (NUMPY, "a single NumPy array (.npy)"),
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
