//! Writes results to disk: each file is whole, or does not exist.
//!
//! # Invariant
//! A file appears under its name only when it is complete and synced to the disk
//! (`tests::files_appear_only_at_commit`). A run that fails leaves everything as before, without
//! the folders that it made (`tests::a_run_that_fails_leaves_nothing_of_its_own`,
//! `tests::a_run_that_fails_leaves_what_was_there`). No staged file is kept open, so a folder can
//! receive more files than a process may have open
//! (`tests::a_folder_keeps_no_file_open_however_many_it_takes`).

use super::FileError;
use super::interrupt::Noted;
use std::fs;
use std::io::{self, BufWriter, IntoInnerError, Write};
use std::path::{Path, PathBuf};
use tempfile::TempPath;

/// Prefix of the hidden names of files that are still being written, next to their final paths.
pub(super) const STAGED_PREFIX: &str = ".nirspi-";

/// A folder that receives all the results of a run at once.
///
/// [`create`](Self::create) makes the folder, [`write`](Self::write) stages files in the folder
/// under hidden names, and [`commit`](Self::commit) renames the files into place and replaces older
/// files of the same name. An `OutputDir` that is dropped without `commit` removes its staged files
/// and every folder that it made.
#[derive(Debug)]
pub struct OutputDir {
    path: PathBuf,
    /// `staged` comes before `made`, so that the files are removed before the folders.
    staged: Vec<(Staged, PathBuf)>,
    made: MadeFolders,
}

impl OutputDir {
    /// Opens the folder. Missing folders on its path are made.
    ///
    /// # Errors
    /// [`FileError`] if the path is a file, or the system refuses. Nothing is left behind.
    pub fn create(path: &Path) -> Result<Self, FileError> {
        let mut made = MadeFolders(Vec::new());
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
        let path = if path.as_os_str().is_empty() { PathBuf::from(".") } else { path.to_owned() };
        match fs::metadata(&path) {
            Ok(metadata) if metadata.is_dir() => Ok(Self { path, staged: Vec::new(), made }),
            Ok(_) => Err(FileError::kind(&path, "a file", "a folder for the results")),
            Err(error) => Err(FileError::io(&path, "create", error)),
        }
    }

    /// The path of the folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Stages a file named `name` (a plain file name) in the folder.
    ///
    /// # Errors
    /// [`FileError`] names the file and the system's reason.
    pub fn write(&mut self, name: &str, bytes: &[u8]) -> Result<(), FileError> {
        let target = self.path.join(name);
        let staged = stage(&self.path, &target, |file| {
            file.write_all(bytes).map_err(|error| FileError::io(&target, "write", error))
        })?;
        self.staged.push((staged, target));
        Ok(())
    }

    /// Renames every staged file into place and returns their paths in the order written.
    ///
    /// # Errors
    /// [`FileError`] names the first file that could not be placed. New files placed before the
    /// error are removed again. Older files that were already replaced stay replaced, whole.
    pub fn commit(mut self) -> Result<Vec<PathBuf>, FileError> {
        let _undisturbed = super::interrupt::undisturbed();
        let mut placed: Vec<(PathBuf, bool)> = Vec::new();
        for (staged, target) in std::mem::take(&mut self.staged) {
            let replaces = target.exists();
            if let Err(error) = place(staged, &target) {
                for (new, _) in placed.iter().filter(|(_, replaced)| !replaced) {
                    // The first error is reported; an error of the removal adds nothing.
                    let _ = fs::remove_file(new);
                }
                return Err(error);
            }
            placed.push((target, replaces));
        }
        sync_folder(&self.path).map_err(|error| FileError::io(&self.path, "write to", error))?;
        self.made.0.clear();
        Ok(placed.into_iter().map(|(path, _)| path).collect())
    }
}

/// Writes one file, whole or not at all.
///
/// # Errors
/// [`FileError`] if the folder is missing, the path is a folder, or the system refuses.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    write_in_pieces(path, |file| {
        file.write_all(bytes).map_err(|error| FileError::io(path, "write", error))
    })
}

/// Writes one file piece by piece, whole or not at all: results that are larger than the memory.
///
/// # Errors
/// As [`write_atomic`], and the errors of `write`.
pub fn write_in_pieces<E: From<FileError>>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<fs::File>) -> Result<(), E>,
) -> Result<(), E> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    place(stage(folder, path, write)?, path)?;
    Ok(sync_folder(folder).map_err(|error| FileError::io(folder, "write to", error))?)
}

/// Syncs the names in a folder to the disk, on systems that can do so.
pub(crate) fn sync_folder(folder: &Path) -> io::Result<()> {
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

impl Drop for MadeFolders {
    fn drop(&mut self) {
        for (folder, _) in self.0.iter().rev() {
            // The removal fails if another program put a file into the folder meanwhile; the folder
            // then stays.
            let _ = fs::remove_dir(folder);
        }
    }
}

fn stage<E: From<FileError>>(
    folder: &Path,
    target: &Path,
    fill: impl FnOnce(&mut BufWriter<fs::File>) -> Result<(), E>,
) -> Result<Staged, E> {
    if target.is_dir() {
        return Err(FileError::kind(target, "a folder", "a file to write").into());
    }
    // The error names the missing folder, not the hidden file in it.
    if let Err(error) = fs::metadata(folder) {
        return Err(FileError::io(folder, "write to", error).into());
    }
    let write = |error: io::Error| FileError::io(target, "write", error);
    // This function makes the file itself, because errors of `tempfile` hide the system's reason.
    // Other users may read results as far as the umask allows.
    let staged = tempfile::Builder::new()
        .prefix(STAGED_PREFIX)
        .make_in(folder, |path| Noted::make(path, || fs::File::create_new(path)))
        .map_err(write)?;
    let ((file, noted), path) = staged.into_parts();
    let staged = Staged { path, _noted: noted };
    let mut file = BufWriter::new(file);
    fill(&mut file)?;
    file.into_inner()
        .map_err(IntoInnerError::into_error)
        .and_then(|file| file.sync_all())
        .map_err(write)?;
    Ok(staged)
}

/// A file under its hidden name.
#[derive(Debug)]
struct Staged {
    path: TempPath,
    _noted: Noted,
}

fn place(staged: Staged, target: &Path) -> Result<(), FileError> {
    staged.path.persist(target).map_err(|error| FileError::io(target, "write", error.error))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(folder)
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    fn line(error: &FileError) -> String {
        let line = error.to_string();
        assert!(!line.contains('\n'), "{line}");
        line
    }

    #[test]
    fn files_appear_only_at_commit() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path().join("a/b/out");
        let mut dir = OutputDir::create(&out).unwrap();
        dir.write("image.npy", b"123").unwrap();
        dir.write("report.json", b"{}").unwrap();
        assert!(!out.join("image.npy").exists() && !out.join("report.json").exists());
        let paths = dir.commit().unwrap();
        assert_eq!(paths, [out.join("image.npy"), out.join("report.json")]);
        assert_eq!(names(&out), ["image.npy", "report.json"]);
        assert_eq!(fs::read(out.join("image.npy")).unwrap(), b"123");
    }

    #[test]
    fn a_run_that_fails_leaves_nothing_of_its_own() {
        let root = tempfile::tempdir().unwrap();
        let mut dir = OutputDir::create(&root.path().join("a/b/out")).unwrap();
        dir.write("image.npy", b"123").unwrap();
        drop(dir);
        assert!(names(root.path()).is_empty(), "{:?}", names(root.path()));
    }

    #[test]
    fn a_run_without_results_keeps_its_folder() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path().join("out");
        assert!(OutputDir::create(&out).unwrap().commit().unwrap().is_empty());
        assert!(out.is_dir());
    }

    #[test]
    fn a_run_that_fails_leaves_what_was_there() {
        let root = tempfile::tempdir().unwrap();
        fs::write(root.path().join("image.npy"), b"old").unwrap();
        let mut dir = OutputDir::create(root.path()).unwrap();
        dir.write("image.npy", b"new").unwrap();
        drop(dir);
        assert_eq!(names(root.path()), ["image.npy"]);
        assert_eq!(fs::read(root.path().join("image.npy")).unwrap(), b"old");
    }

    #[test]
    fn a_failing_commit_takes_its_new_files_back() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path().join("out");
        let mut dir = OutputDir::create(&out).unwrap();
        dir.write("first.npy", b"1").unwrap();
        dir.write("second.npy", b"2").unwrap();
        fs::create_dir(out.join("second.npy")).unwrap();
        let error = dir.commit().unwrap_err();
        assert!(line(&error).contains("second.npy: cannot write it"), "{error}");
        assert_eq!(names(&out), ["second.npy"]);
    }

    #[test]
    fn a_file_where_the_folder_should_be_is_named() {
        let root = tempfile::tempdir().unwrap();
        let file = root.path().join("taken");
        fs::write(&file, b"x").unwrap();
        let error = OutputDir::create(&file).unwrap_err();
        assert!(
            line(&error).ends_with("taken: found a file, expected a folder for the results"),
            "{error}"
        );
        let error = OutputDir::create(&file.join("sub/out")).unwrap_err();
        assert!(
            line(&error).ends_with("taken: found a file, expected a folder for the results"),
            "{error}"
        );
        assert_eq!(names(root.path()), ["taken"]);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_folder_keeps_no_file_open_however_many_it_takes() {
        let open = |folder: &Path| {
            let files = fs::read_dir("/proc/self/fd").unwrap().filter_map(Result::ok);
            files
                .filter_map(|fd| fs::read_link(fd.path()).ok())
                .filter(|to| to.starts_with(folder))
                .count()
        };
        let root = tempfile::tempdir().unwrap();
        let mut dir = OutputDir::create(root.path()).unwrap();
        for n in 0..20 {
            dir.write(&format!("{n}.png"), b"x").unwrap();
            assert_eq!(open(root.path()), 0, "after {n}");
        }
        assert_eq!(dir.commit().unwrap().len(), 20);
    }

    #[cfg(unix)]
    #[test]
    fn results_can_be_read_by_others_as_far_as_the_umask_says() {
        use std::os::unix::fs::PermissionsExt;
        let root = tempfile::tempdir().unwrap();
        let (plain, ours) = (root.path().join("plain"), root.path().join("ours"));
        fs::write(&plain, b"x").unwrap();
        write_atomic(&ours, b"x").unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_folder_that_takes_no_files_is_named_with_the_reason() {
        // A program cannot make a file in /proc, not even as root.
        let error = write_atomic(Path::new("/proc/image.npy"), b"x").unwrap_err();
        assert!(line(&error).starts_with("/proc/image.npy: cannot write it: "), "{error}");
        assert!(!error.to_string().contains(STAGED_PREFIX), "{error}");
        let error = OutputDir::create(Path::new("/proc/out")).unwrap_err();
        assert!(line(&error).starts_with("/proc/out: cannot create it: "), "{error}");
    }

    #[test]
    fn one_file_is_whole_or_not_there() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("rec.npy");
        write_atomic(&path, b"abc").unwrap();
        write_atomic(&path, b"defg").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"defg");
        assert_eq!(names(root.path()), ["rec.npy"]);

        let error = write_atomic(&root.path().join("none/rec.npy"), b"x").unwrap_err();
        assert!(
            line(&error).ends_with("none: cannot write to it: no such file or folder"),
            "{error}"
        );
        let error = write_atomic(root.path(), b"x").unwrap_err();
        assert!(line(&error).contains("found a folder, expected a file to write"), "{error}");
    }
}
