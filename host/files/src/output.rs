//! Writes results to disk: each file is whole, or does not exist, and replaces nothing that a user
//! may miss.
//!
//! A result that is one file is refused where a file has its name, unless the user asks to replace
//! it; then its mode stays, and a link to it. The results of a run that are a folder replace the
//! whole results of an earlier run, and nothing else.
//!
//! # Invariant
//! No result replaces what it was made of (`tests::no_result_replaces_what_it_was_made_of`), nor a
//! file that a person put into a folder of results or changed there
//! (`tests::a_folder_keeps_what_is_not_ours`). No folder has results of two runs of one kind
//! (`tests::a_run_replaces_all_of_the_run_before`).
//!
//! A file appears under its name only when it is complete and synced to the disk
//! (`tests::files_appear_only_at_commit`). A run that fails leaves everything as before, without
//! the folders that it made (`tests::a_run_that_fails_leaves_nothing_of_its_own`,
//! `tests::a_run_that_fails_leaves_what_was_there`). No staged file is kept open, so a folder can
//! receive more files than a process may have open
//! (`tests::a_folder_keeps_no_file_open_however_many_it_takes`).

mod earlier;
mod growing;
#[cfg(not(target_family = "wasm"))]
mod spool;

use super::FileError;
use super::interrupt::Noted;
use earlier::{Content, Earlier};
pub use growing::Growing;
#[cfg(not(target_family = "wasm"))]
pub use spool::Spool;
use std::fs;
use std::io::{self, BufWriter, IntoInnerError, Write};
use std::path::{Path, PathBuf};
use tempfile::TempPath;

/// Prefix of the hidden names of files that are still being written, next to their final paths.
pub(super) const STAGED_PREFIX: &str = ".nirspi-";

/// A folder that receives all the results of a run at once.
///
/// [`create`](Self::create) makes the folder, [`write`](Self::write) stages files in the folder
/// under hidden names, and [`commit`](Self::commit) renames the files into place and removes the
/// results of an earlier run. An `OutputDir` that is dropped without `commit` removes its staged
/// files and every folder that it made.
#[derive(Debug)]
pub struct OutputDir {
    path: PathBuf,
    /// `staged` comes before `made`, so that the files are removed before the folders.
    staged: Vec<(Staged, String)>,
    made: MadeFolders,
    earlier: Earlier,
}

impl OutputDir {
    /// Opens the folder. Missing folders on its path are made.
    ///
    /// # Errors
    /// [`FileError`] if the path is a file, or the system refuses. Nothing is left behind.
    pub fn create(path: &Path) -> Result<Self, FileError> {
        refuse_dash(path)?;
        let made = MadeFolders::on_the_way_to(path)?;
        let path = if path.as_os_str().is_empty() { PathBuf::from(".") } else { path.to_owned() };
        match fs::metadata(&path) {
            Ok(metadata) if metadata.is_dir() => {
                let earlier = Earlier::of(&path);
                Ok(Self { path, staged: Vec::new(), made, earlier })
            }
            Ok(_) => Err(FileError::kind(&path, "a file", "a folder for the results")),
            Err(error) => Err(FileError::io(&path, "create", error)),
        }
    }

    /// The path of the folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Refuses a folder in which a file has one of these names and is not as a run of this program
    /// wrote it. A command asks this before a long computation; [`write`](Self::write) asks it for
    /// each file.
    ///
    /// # Errors
    /// [`FileError::Exists`] for the first such file.
    pub fn check<'n>(&self, names: impl IntoIterator<Item = &'n str>) -> Result<(), FileError> {
        names.into_iter().try_for_each(|name| {
            let path = self.path.join(name);
            match fs::symlink_metadata(&path).is_ok() && !self.earlier.wrote(&path, name) {
                true => Err(FileError::Exists { path, expected: "another folder for the results" }),
                false => Ok(()),
            }
        })
    }

    /// Stages a file named `name` (a plain file name) in the folder.
    ///
    /// # Errors
    /// [`FileError`] names the file and the system's reason; as [`check`](Self::check).
    pub fn write(&mut self, name: &str, bytes: &[u8]) -> Result<(), FileError> {
        let target = self.path.join(name);
        self.check([name])?;
        let ((), staged) = stage(&target, |file| {
            file.write_all(bytes).map_err(|error| FileError::io(&target, "write", error))
        })?;
        self.keep(name, Content::of(bytes), staged);
        Ok(())
    }

    /// Stages a file named `name` that is written piece by piece.
    ///
    /// # Errors
    /// As [`write`](Self::write).
    pub fn write_in_pieces(
        &mut self,
        name: &str,
        write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<(), FileError> {
        let mut growing = self.grow(name, 0)?;
        write(&mut growing)
            .map_err(|error| FileError::io(&self.path.join(name), "write", error))?;
        self.take(growing, &[])
    }

    /// Begins a file named `name`, whose first `beginning` bytes are not known yet.
    ///
    /// # Errors
    /// As [`write`](Self::write).
    pub fn grow(&self, name: &str, beginning: usize) -> Result<Growing, FileError> {
        self.check([name])?;
        Growing::new(&self.path.join(name), name, beginning)
    }

    /// Stages a file that has grown, with its beginning.
    ///
    /// # Errors
    /// As [`write`](Self::write).
    ///
    /// # Panics
    /// If the beginning has another length than was said.
    pub fn take(&mut self, grown: Growing, beginning: &[u8]) -> Result<(), FileError> {
        let (name, content, staged) = grown.finish(&self.path, beginning)?;
        self.keep(&name, content, staged);
        Ok(())
    }

    /// An empty file without a name, on the disk of the folder, for what does not fit into memory. It is gone when it
    /// is closed.
    ///
    /// # Errors
    /// [`FileError`] names the folder and the system's reason.
    pub fn scratch(&self) -> Result<fs::File, FileError> {
        tempfile::tempfile_in(&self.path)
            .map_err(|error| FileError::io(&self.path, "write to", error))
    }

    fn keep(&mut self, name: &str, content: Content, staged: Staged) {
        self.earlier.written(name, content);
        self.staged.push((staged, name.to_owned()));
    }

    /// Renames every staged file into place, removes the other files of the run that these results
    /// replace, and returns the paths in the order written.
    ///
    /// # Errors
    /// [`FileError`] names the first file that could not be placed. New files placed before the
    /// error are removed again. Older files that were already replaced stay replaced, whole.
    pub fn commit(mut self) -> Result<Vec<PathBuf>, FileError> {
        let _undisturbed = super::interrupt::undisturbed();
        let mut placed: Vec<(PathBuf, bool)> = Vec::new();
        for (staged, name) in std::mem::take(&mut self.staged) {
            let target = self.path.join(&name);
            let replaces = fs::symlink_metadata(&target).is_ok();
            let done = self.check([&*name]).and_then(|()| place(staged, &target, replaces));
            if let Err(error) = done {
                for (new, _) in placed.iter().filter(|(_, replaced)| !replaced) {
                    // The first error is reported; an error of the removal adds nothing.
                    let _ = fs::remove_file(new);
                }
                return Err(error);
            }
            placed.push((target, replaces));
        }
        std::mem::take(&mut self.earlier).replace(&self.path)?;
        sync_folder(&self.path).map_err(|error| FileError::io(&self.path, "write to", error))?;
        self.made.0.clear();
        Ok(placed.into_iter().map(|(path, _)| path).collect())
    }
}

/// What happens to a file that has the name of a result.
#[derive(Debug, Clone, Copy)]
pub enum Existing<'a> {
    /// The file stays, and the result is refused.
    Stays,
    /// The file is replaced, unless the result is made of it.
    Replaced {
        /// The file or folder that the result is made of, if it is made of one.
        made_of: Option<&'a Path>,
    },
}

impl<'a> Existing<'a> {
    /// What an option `--overwrite` says, of a result made of `made_of`.
    #[must_use]
    pub fn of(overwrite: bool, made_of: Option<&'a Path>) -> Self {
        if overwrite { Self::Replaced { made_of } } else { Self::Stays }
    }

    /// Refuses a result whose name is taken. A command asks this before a long computation; the
    /// functions that write ask it again.
    ///
    /// # Errors
    /// [`FileError`] if a file of that name is there and has to stay.
    pub fn check(self, target: &Path) -> Result<(), FileError> {
        refuse_dash(target)?;
        let Ok(found) = fs::metadata(target) else { return Ok(()) };
        if found.is_dir() {
            return Err(FileError::kind(target, "a folder", "a file to write"));
        }
        if !found.is_file() {
            return Err(FileError::kind(target, "a device or pipe", "a file to write"));
        }
        let path = target.to_owned();
        match self {
            Self::Stays => {
                Err(FileError::Exists { path, expected: "a name that is free, or --overwrite" })
            }
            Self::Replaced { made_of: Some(source) } if is_part_of(target, source) => {
                Err(FileError::Source { path })
            }
            Self::Replaced { .. } => Ok(()),
        }
    }
}

/// Refuses the name `-`, which other programs take for the standard output: no result of this one is
/// written there.
///
/// # Errors
/// [`FileError`] for this name.
pub fn refuse_dash(path: &Path) -> Result<(), FileError> {
    match path.as_os_str() == "-" {
        true => Err(FileError::kind(path, "no name", "a name; ./- is a file of this name")),
        false => Ok(()),
    }
}

/// Whether a file is this file, by whatever name, or lies in this folder.
fn is_part_of(file: &Path, whole: &Path) -> bool {
    let (Ok(file), Ok(whole)) = (file.canonicalize(), whole.canonicalize()) else { return false };
    file.starts_with(&whole) || is_hard_link(&file, &whole)
}

#[cfg(unix)]
fn is_hard_link(a: &Path, b: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let identity = |path: &Path| fs::metadata(path).ok().map(|found| (found.dev(), found.ino()));
    identity(a).is_some() && identity(a) == identity(b)
}

#[cfg(not(unix))]
fn is_hard_link(_: &Path, _: &Path) -> bool {
    false
}

/// Writes a result of one file, whole or not at all.
///
/// # Errors
/// [`FileError`] if the name is taken, the folder is missing, the path is a folder, or the system
/// refuses.
pub fn write_result(path: &Path, existing: Existing<'_>, bytes: &[u8]) -> Result<(), FileError> {
    write_in_pieces(path, existing, |file| {
        file.write_all(bytes).map_err(|error| FileError::io(path, "write", error))
    })
}

/// Writes a result of one file piece by piece, whole or not at all: results that are larger than the
/// memory.
///
/// # Errors
/// As [`write_result`], and the errors of `write`.
pub fn write_in_pieces<T, E: From<FileError>>(
    path: &Path,
    existing: Existing<'_>,
    write: impl FnOnce(&mut BufWriter<fs::File>) -> Result<T, E>,
) -> Result<T, E> {
    existing.check(path)?;
    let (written, staged) = stage(path, write)?;
    place(staged, path, matches!(existing, Existing::Replaced { .. }))?;
    let folder = folder_of(path);
    sync_folder(folder).map_err(|error| FileError::io(folder, "write to", error))?;
    Ok(written)
}

/// Writes a file that this program keeps for itself, such as settings, whole or not at all. An older
/// one is replaced. Missing folders on its path are made.
///
/// # Errors
/// [`FileError`] if the path is a folder, or the system refuses.
pub fn keep(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    let mut made = MadeFolders::on_the_way_to(path.parent().unwrap_or(Path::new("")))?;
    write_in_pieces(path, Existing::Replaced { made_of: None }, |file| {
        file.write_all(bytes).map_err(|error| FileError::io(path, "write", error))
    })?;
    made.0.clear();
    Ok(())
}

fn folder_of(file: &Path) -> &Path {
    match file.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Syncs the names in a folder to the disk, on systems that can do so.
pub fn sync_folder(folder: &Path) -> io::Result<()> {
    if cfg!(not(unix)) {
        return Ok(());
    }
    match fs::File::open(folder).and_then(|folder| folder.sync_all()) {
        // The folder may be writable but not readable, or the file system cannot sync folders.
        Err(error)
            if matches!(
                error.kind(),
                io::ErrorKind::PermissionDenied
                    | io::ErrorKind::InvalidInput
                    | io::ErrorKind::Unsupported
            ) =>
        {
            Ok(())
        }
        synced => synced,
    }
}

/// Folders to remove when a run fails, outermost first.
#[derive(Debug)]
struct MadeFolders(Vec<(PathBuf, Noted)>);

impl MadeFolders {
    /// Makes the folders that are missing on this path.
    fn on_the_way_to(path: &Path) -> Result<Self, FileError> {
        let mut made = Self(Vec::new());
        // `--out name/` and `--out name` are the same folder, and an empty path is the current
        // folder.
        let missing: Vec<&Path> = path
            .ancestors()
            .take_while(|p| !p.as_os_str().is_empty() && fs::symlink_metadata(p).is_err())
            .collect();
        for folder in missing.into_iter().rev() {
            match Noted::make(folder, || fs::create_dir(folder)) {
                Ok(((), noted)) => made.0.push((folder.to_owned(), noted)),
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) if error.kind() == io::ErrorKind::NotADirectory => {
                    let file = folder.parent().unwrap_or(folder);
                    return Err(FileError::kind(file, "a file", "a folder for the results"));
                }
                Err(error) => return Err(FileError::io(folder, "create", error)),
            }
        }
        Ok(made)
    }
}

impl Drop for MadeFolders {
    fn drop(&mut self) {
        for (folder, _) in self.0.iter().rev() {
            // The removal fails if another program put a file into the folder meanwhile; the folder
            // then stays.
            let _ = fs::remove_dir(folder);
        }
    }
}

/// Writes a file under a hidden name beside the file that it will be.
fn stage<T, E: From<FileError>>(
    target: &Path,
    fill: impl FnOnce(&mut BufWriter<fs::File>) -> Result<T, E>,
) -> Result<(T, Staged), E> {
    let (file, staged) = hidden(target)?;
    let mut file = BufWriter::new(file);
    let filled = fill(&mut file)?;
    file.into_inner()
        .map_err(IntoInnerError::into_error)
        .and_then(|file| file.sync_all())
        .map_err(|error| FileError::io(target, "write", error))?;
    Ok((filled, staged))
}

/// Makes a file under a hidden name beside the file that it will be.
fn hidden(target: &Path) -> Result<(fs::File, Staged), FileError> {
    // A link stays: the file behind it is replaced, and the hidden file is beside that one.
    let behind = fs::canonicalize(target).unwrap_or_else(|_| target.to_owned());
    let folder = folder_of(&behind);
    // The error names the missing folder, not the hidden file in it.
    if let Err(error) = fs::metadata(folder) {
        return Err(FileError::io(folder, "write to", error));
    }
    // This function makes the file itself, because errors of `tempfile` hide the system's reason.
    // Other users may read results as far as the umask allows.
    let make = |path: &Path| {
        let open = || fs::OpenOptions::new().read(true).write(true).create_new(true).open(path);
        Noted::make(path, open)
    };
    let made = tempfile::Builder::new().prefix(STAGED_PREFIX).make_in(folder, make);
    let staged = made.map_err(|error| FileError::io(target, "write", error))?;
    let ((file, noted), path) = staged.into_parts();
    Ok((file, Staged { path, behind, _noted: noted }))
}

/// A file under its hidden name.
#[derive(Debug)]
struct Staged {
    path: TempPath,
    /// The path that the file will have.
    behind: PathBuf,
    _noted: Noted,
}

/// Renames a file into place. Without `replaces`, a file of that name stays and is the error.
fn place(staged: Staged, target: &Path, replaces: bool) -> Result<(), FileError> {
    let Staged { path, behind, _noted } = staged;
    if replaces && let Ok(old) = fs::metadata(&behind) {
        // A file system that has no modes refuses.
        let _ = fs::set_permissions(&path, old.permissions());
    }
    let placed = match replaces {
        true => path.persist(behind),
        false => path.persist_noclobber(&behind).or_else(|refused| {
            // Some file systems have no such call, nor hard links.
            let taken = refused.error.kind() == io::ErrorKind::AlreadyExists;
            match taken || fs::symlink_metadata(&behind).is_ok() {
                true => Err(refused),
                false => refused.path.persist(behind),
            }
        }),
    };
    placed.map_err(|error| match error.error.kind() {
        io::ErrorKind::AlreadyExists => {
            let expected = "a name that is free: another program has taken it meanwhile";
            FileError::Exists { path: target.to_owned(), expected }
        }
        _ => FileError::io(target, "write", error.error),
    })
}

#[cfg(test)]
mod tests;
