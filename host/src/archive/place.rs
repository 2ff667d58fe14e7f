//! Where an archive's files are and where its table goes: on this computer, or in an object store.

use super::shelf::{LocalShelf, Shelf};
#[cfg(feature = "object-store")]
use super::store::{StoreShelf, Stored};
use super::{ArchiveError, files};
use crate::files::FileError;
use crate::files::output::{write_atomic, write_in_pieces};
use std::fs::File;
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};

/// Beginnings of the addresses of object stores, before `://`.
const SCHEMES: [&str; 11] =
    ["s3", "s3a", "gs", "az", "azure", "adl", "abfs", "abfss", "http", "https", "file"];

/// A file that is read at any position.
pub(super) trait Source: Read + Seek {}
impl<T: Read + Seek> Source for T {}

/// An open file.
pub(super) struct Opened<'p> {
    pub source: Box<dyn Source + 'p>,
    /// Size of the file.
    pub bytes: u64,
}

/// Whether a path is a folder of measurements and not a single file: a folder of this computer, or an
/// address in an object store (`s3://bucket/folder`).
#[must_use]
pub fn is_folder(path: &Path) -> bool {
    path.is_dir() || is_address(path)
}

fn is_address(path: &Path) -> bool {
    let scheme = path.to_str().and_then(|text| Some(text.split_once("://")?.0));
    scheme.is_some_and(|scheme| SCHEMES.contains(&scheme))
}

/// Writes a file beside a table, whole or not at all. `path` is a path or an address.
///
/// # Errors
/// [`ArchiveError`] if the file cannot be written.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), ArchiveError> {
    match Place::of(path)? {
        Place::Here(path) => Ok(write_atomic(&path, bytes)?),
        #[cfg(feature = "object-store")]
        Place::Store(object) => Ok(object.put(bytes.to_vec())?),
    }
}

/// A folder or a file.
#[derive(Debug)]
pub(super) enum Place {
    /// On this computer.
    Here(PathBuf),
    /// In an object store.
    #[cfg(feature = "object-store")]
    Store(Stored),
}

impl Place {
    /// The place that a path or an address names. No store is asked yet.
    pub(super) fn of(path: &Path) -> Result<Self, ArchiveError> {
        if !is_address(path) {
            return Ok(Self::Here(path.to_owned()));
        }
        #[cfg(feature = "object-store")]
        return Stored::of(path);
        #[cfg(not(feature = "object-store"))]
        Err(ArchiveError::NoStores(path.to_owned()))
    }

    /// The place in words: a password in an address is left out.
    pub(super) fn shown(&self) -> &Path {
        match self {
            Self::Here(path) => path,
            #[cfg(feature = "object-store")]
            Self::Store(object) => object.shown(),
        }
    }

    /// The measurement files of this folder and the folders below (see [`files::find`]).
    pub(super) fn find(&self) -> Result<Vec<String>, ArchiveError> {
        match self {
            Self::Here(folder) => files::find(folder),
            #[cfg(feature = "object-store")]
            Self::Store(folder) => {
                let names = folder.names()?;
                files::measurements_of(folder.shown(), names.into_iter().map(|(name, _)| name))
            }
        }
    }

    /// Calls `read` with the path of a file of this folder. A file of a store is a temporary file
    /// meanwhile, and `read`'s error names the address instead.
    pub(super) fn with_file<T>(
        &self,
        name: &str,
        read: impl FnOnce(&Path) -> Result<T, String>,
    ) -> Result<T, String> {
        match self {
            Self::Here(folder) => read(&files::path_of(folder, name)),
            #[cfg(feature = "object-store")]
            Self::Store(folder) => folder.join(name).with_copy(read),
        }
    }

    /// Where the parts of this table are kept while it is made.
    pub(super) fn shelf(&self) -> Result<Box<dyn Shelf + '_>, ArchiveError> {
        match self {
            Self::Here(path) => Ok(Box::new(LocalShelf::of(path)?)),
            #[cfg(feature = "object-store")]
            Self::Store(object) => Ok(Box::new(StoreShelf::of(object)?)),
        }
    }

    /// Writes this file, whole or not at all. Returns its size in bytes.
    pub(super) fn write_whole<E: From<FileError>>(
        &self,
        write: impl FnOnce(&mut dyn Write) -> Result<(), E>,
    ) -> Result<u64, E> {
        match self {
            Self::Here(path) => {
                write_in_pieces(path, |file| write(file))?;
                Ok(std::fs::metadata(path).map_or(0, |file| file.len()))
            }
            #[cfg(feature = "object-store")]
            Self::Store(object) => object.put_in_pieces(write),
        }
    }

    /// Opens this file; `None` if no such file exists.
    pub(super) fn open(&self) -> Result<Option<Opened<'_>>, FileError> {
        match self {
            Self::Here(path) if !path.exists() => Ok(None),
            Self::Here(path) => {
                let unread = |error| FileError::io(path, "read", error);
                let file = File::open(path).map_err(unread)?;
                let bytes = file.metadata().map_err(unread)?.len();
                Ok(Some(Opened { source: Box::new(file), bytes }))
            }
            #[cfg(feature = "object-store")]
            Self::Store(object) => match object.size()? {
                Some(bytes) => Ok(Some(Opened { source: Box::new(object.reader(bytes)), bytes })),
                None => Ok(None),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_a_folder_and_a_path_is_what_it_leads_to() {
        for address in ["s3://bucket/a", "gs://b", "az://c/d", "https://host/x.npz", "file:///a"] {
            assert!(is_folder(Path::new(address)), "{address}");
        }
        for path in ["none.npz", "ftp://host/a", "s3:/bucket", "C:\\a\\b", "a://b"] {
            assert!(!is_folder(Path::new(path)), "{path}");
        }
        assert!(is_folder(tempfile::tempdir().unwrap().path()));
    }

    #[cfg(not(feature = "object-store"))]
    #[test]
    fn a_program_without_object_stores_says_how_to_build_one() {
        let error = Place::of(Path::new("s3://bucket/a")).unwrap_err().to_string();
        assert_eq!(
            error,
            "s3://bucket/a: object stores are not in this program: build it with --features object-store"
        );
    }
}
