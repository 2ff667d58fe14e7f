//! Files in object stores: Amazon S3 and what speaks as it, Google Cloud Storage, Azure Blob
//! Storage, and servers that speak WebDAV.
//!
//! A store knows whole objects and no folders: an object appears when it is written whole. Names,
//! keys and endpoints come from the environment, by the names of the stores' own programs
//! (`AWS_ACCESS_KEY_ID`, `AWS_ENDPOINT`, `GOOGLE_APPLICATION_CREDENTIALS`,
//! `AZURE_STORAGE_ACCOUNT_NAME`, ...).

mod client;
mod shelf;
#[cfg(test)]
mod tests;

use super::ArchiveError;
use super::place::Place;
use crate::files::FileError;
use crate::files::interrupt::Noted;
use client::Client;
use object_store::path::Path as Key;
use object_store::{ObjectStoreScheme, PutMode};
use std::fmt;
use std::fs::{File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use url::Url;

pub(super) use shelf::StoreShelf;

/// Bytes of one request. A larger object comes and goes in several.
const PIECE_BYTES: u64 = 8 << 20;

/// An object in a store, or a folder of objects: all those whose names begin with its name and `/`.
#[derive(Clone)]
pub(crate) struct Stored {
    client: Arc<Client>,
    key: Key,
    shown: PathBuf,
}

impl fmt::Debug for Stored {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Stored").field(&self.shown).finish()
    }
}

impl Stored {
    /// What an address names. `file:` names a place of this computer.
    pub(super) fn of(address: &Path) -> Result<Place, ArchiveError> {
        let text = address.to_string_lossy();
        let shown = PathBuf::from(without_password(&text));
        let refused = |problem: String| {
            let address = shown.clone();
            ArchiveError::Address { address, problem }
        };
        let url = Url::parse(&text).map_err(|error| refused(error.to_string()))?;
        if url.query().is_some() || url.fragment().is_some() {
            return Err(refused("a `?` or `#` in the address (write %3F or %23)".to_owned()));
        }
        let (scheme, key) =
            ObjectStoreScheme::parse(&url).map_err(|error| refused(error.to_string()))?;
        if scheme == ObjectStoreScheme::Local {
            let path = url.to_file_path().map_err(|()| refused("no path of this system".into()))?;
            return Ok(Place::Here(path));
        }
        let client = Client::new(url, scheme);
        Ok(Place::Store(Self { client: Arc::new(client), key, shown }))
    }

    /// The same of a store that is there.
    #[cfg(test)]
    fn in_store(store: Arc<dyn object_store::ObjectStore>, key: &str) -> Self {
        let client = Arc::new(Client::of(store));
        Self { client, key: Key::from(key), shown: PathBuf::from(format!("memory://{key}")) }
    }

    /// The address, without a password.
    pub(super) fn shown(&self) -> &Path {
        &self.shown
    }

    /// The object of this name in the folder.
    pub(super) fn join(&self, name: &str) -> Self {
        let separator = if self.key.as_ref().is_empty() { "" } else { "/" };
        let key = format!("{}{separator}{name}", self.key);
        // A name of a listing is a key as it stands; any other is made one.
        let key = Key::parse(&key).unwrap_or_else(|_| Key::from(key));
        let shown = self.shown.to_string_lossy();
        let shown = PathBuf::from(format!("{}/{name}", shown.trim_end_matches('/')));
        Self { client: Arc::clone(&self.client), key, shown }
    }

    /// The folder beside this object whose name has `ending` after the object's.
    fn with_ending(&self, ending: &str) -> Self {
        let key = Key::parse(format!("{}{ending}", self.key)).unwrap_or_else(|_| self.key.clone());
        let mut shown = self.shown.as_os_str().to_owned();
        shown.push(ending);
        Self { client: Arc::clone(&self.client), key, shown: shown.into() }
    }

    fn error(&self, attempt: &'static str, error: io::Error) -> FileError {
        FileError::io(&self.shown, attempt, error)
    }

    /// The names of all objects in this folder and below, relative to it, with their sizes in bytes.
    pub(super) fn names(&self) -> Result<Vec<(String, u64)>, FileError> {
        let found = self.client.list(&self.key).map_err(|error| self.error("list", error))?;
        let relative = |(key, bytes): (Key, u64)| {
            let name = key.as_ref().strip_prefix(self.key.as_ref())?;
            Some((name.trim_start_matches('/').to_owned(), bytes))
        };
        Ok(found.into_iter().filter_map(relative).collect())
    }

    /// Size of the object in bytes; `None` if the store has no such object.
    pub(super) fn size(&self) -> Result<Option<u64>, FileError> {
        self.client.size(&self.key).map_err(|error| self.error("read", error))
    }

    /// The whole object; `None` if the store has no such object.
    fn get(&self) -> Result<Option<Vec<u8>>, FileError> {
        let mut bytes = Vec::new();
        match self.client.copy_to(&self.key, &mut bytes) {
            Ok(()) => Ok(Some(bytes)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(self.error("read", error)),
        }
    }

    /// Writes the object.
    pub(super) fn put(&self, bytes: Vec<u8>) -> Result<(), FileError> {
        let put = self.client.put(&self.key, bytes, PutMode::Overwrite);
        put.map_err(|error| self.error("write", error))
    }

    /// Writes the object unless the store has one of this name. Returns whether this call has written it. A store that
    /// knows no such condition writes it in any case.
    fn create(&self, bytes: &[u8]) -> Result<bool, FileError> {
        match self.client.put(&self.key, bytes.to_vec(), PutMode::Create) {
            Ok(()) => Ok(true),
            // A request that was repeated may have met its own object.
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                Ok(self.get()?.as_deref() == Some(bytes))
            }
            Err(error) => Err(self.error("write", error)),
        }
    }

    /// Removes these objects of the folder.
    fn remove(&self, names: impl IntoIterator<Item = String>) -> Result<(), FileError> {
        let keys = names.into_iter().map(|name| self.join(&name).key).collect();
        self.client.remove(keys).map_err(|error| self.error("remove parts from", error))
    }

    /// Calls `read` with a temporary copy of the object. An error of `read` names the address.
    pub(super) fn with_copy<T>(
        &self,
        read: impl FnOnce(&Path) -> Result<T, String>,
    ) -> Result<T, String> {
        // Readers know files by their endings.
        let ending = self.shown.extension().unwrap_or_default().to_string_lossy();
        let made = tempfile::Builder::new()
            .prefix(".nirspi-")
            .suffix(&format!(".{ending}"))
            .make(|path| Noted::make(path, || own_file(path)));
        let made = made.map_err(|error| self.error("make a copy of", error).to_string())?;
        // The copy is removed at the end of this function, and by an interrupt.
        let ((mut file, _noted), path) = made.into_parts();
        let copied = self.client.copy_to(&self.key, &mut file);
        copied.map_err(|error| self.error("read", error).to_string())?;
        drop(file);
        let (copy, address) = (path.display().to_string(), self.shown.display().to_string());
        read(&path).map_err(|reason| reason.replace(&copy, &address))
    }

    /// Writes the object from a temporary file that `write` fills. Returns its size in bytes.
    pub(super) fn put_in_pieces<E: From<FileError>>(
        &self,
        write: impl FnOnce(&mut dyn Write) -> Result<(), E>,
    ) -> Result<u64, E> {
        let failed = |error| self.error("write", error);
        let mut file = io::BufWriter::new(tempfile::tempfile().map_err(failed)?);
        write(&mut file)?;
        let mut file = file.into_inner().map_err(|error| failed(error.into_error()))?;
        let bytes = file.stream_position().map_err(failed)?;
        file.rewind().map_err(failed)?;
        self.client.put_file(&self.key, &mut file, bytes).map_err(failed)?;
        Ok(bytes)
    }

    /// Reads an object of this size at any position.
    pub(super) fn reader(&self, bytes: u64) -> Reader<'_> {
        Reader { object: self, bytes, at: 0, held: (0, Vec::new()) }
    }
}

/// A new file that other users cannot read.
fn own_file(path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    options.open(path)
}

/// The address with `***` for a password.
fn without_password(address: &str) -> String {
    let hidden = || {
        let (scheme, rest) = address.split_once("://")?;
        let end = rest.find(['/', '?', '#']).unwrap_or(rest.len());
        let (authority, path) = rest.split_at(end);
        let (user, host) = authority.rsplit_once('@')?;
        let (name, _password) = user.split_once(':')?;
        Some(format!("{scheme}://{name}:***@{host}{path}"))
    };
    hidden().unwrap_or_else(|| address.to_owned())
}

/// Reads an object piece by piece.
pub(super) struct Reader<'o> {
    object: &'o Stored,
    bytes: u64,
    at: u64,
    /// The piece in hand and where it begins.
    held: (u64, Vec<u8>),
}

impl Reader<'_> {
    fn range(&self) -> Range<u64> {
        self.at..(self.at + PIECE_BYTES).min(self.bytes)
    }
}

impl Read for Reader<'_> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        if self.at >= self.bytes {
            return Ok(0);
        }
        let rest = |held: &(u64, Vec<u8>), at: u64| {
            let from = usize::try_from(at.checked_sub(held.0)?).ok()?;
            (from < held.1.len()).then_some(from)
        };
        let from = match rest(&self.held, self.at) {
            Some(from) => from,
            None => {
                self.held = (self.at, self.object.client.range(&self.object.key, self.range())?);
                0
            }
        };
        let mut rest = self.held.1.get(from..).unwrap_or_default();
        let read = rest.read(to)?;
        self.at += read as u64;
        Ok(read)
    }
}

impl Seek for Reader<'_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let at = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::End(by) => self.bytes.checked_add_signed(by),
            SeekFrom::Current(by) => self.at.checked_add_signed(by),
        };
        self.at = at.ok_or(io::ErrorKind::InvalidInput)?;
        Ok(self.at)
    }
}
