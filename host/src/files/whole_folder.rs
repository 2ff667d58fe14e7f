//! Writes a folder of results that is whole, or does not exist.
//!
//! # Invariant
//! The folder appears under its name only when all its files are complete. A run that fails leaves
//! everything as before (`tests::a_folder_appears_whole_and_replaces_its_like_alone`,
//! `tests::a_run_that_fails_leaves_nothing`).

use super::FileError;
use super::interrupt::{Noted, undisturbed};
use super::output::{STAGED_PREFIX, sync_folder};
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// A folder that is being written under a hidden name.
#[derive(Debug)]
pub struct WholeFolder {
    target: PathBuf,
    staged: PathBuf,
    /// The file by which an older folder of the same kind is known.
    mark: &'static str,
    /// What an interrupted run removes.
    noted: Vec<Noted>,
}

impl WholeFolder {
    /// Begins a folder that will have the name `target`. An older folder there is replaced if it holds
    /// a file named `mark`.
    ///
    /// # Errors
    /// [`FileError`] if something else has the name, or the system refuses.
    pub fn create(target: &Path, mark: &'static str) -> Result<Self, FileError> {
        match fs::metadata(target) {
            Err(_) => {}
            Ok(found) if !found.is_dir() => {
                return Err(FileError::kind(target, "a file", "the name of a folder to write"));
            }
            Ok(_) if target.join(mark).is_file() => {}
            Ok(_) => {
                let found = format!("a folder without {mark}");
                return Err(FileError::kind(
                    target,
                    found,
                    "a new name, or a folder that was exported before",
                ));
            }
        }
        let parent = parent(target);
        if let Err(error) = fs::metadata(parent) {
            return Err(FileError::io(parent, "write to", error));
        }
        let made = tempfile::Builder::new()
            .prefix(STAGED_PREFIX)
            .make_in(parent, |path| Noted::make(path, || fs::create_dir(path)))
            .map_err(|error| FileError::io(target, "create", error))?;
        let (((), noted), path) = made.into_parts();
        let staged = path.to_path_buf();
        // The folder is removed by this module: the crate would try to remove a file.
        std::mem::forget(path);
        Ok(Self { target: target.to_owned(), staged, mark, noted: vec![noted] })
    }

    /// Writes a file at this path in the folder, `a/b/c`.
    ///
    /// # Errors
    /// [`FileError`] names the file by its later path.
    pub fn write(&mut self, name: &str, bytes: &[u8]) -> Result<(), FileError> {
        let mut write = || -> io::Result<()> {
            let mut path = self.staged.clone();
            let (folders, file) = name.rsplit_once('/').unwrap_or(("", name));
            for folder in folders.split('/').filter(|folder| !folder.is_empty()) {
                path.push(folder);
                if !path.is_dir() {
                    self.noted.push(Noted::make(&path, || fs::create_dir(&path))?.1);
                }
            }
            path.push(file);
            let (mut file, noted) = Noted::make(&path, || fs::File::create_new(&path))?;
            self.noted.push(noted);
            file.write_all(bytes)?;
            file.sync_all()
        };
        write().map_err(|error| FileError::io(&self.target.join(name), "write", error))
    }

    /// Gives the folder its name.
    ///
    /// # Errors
    /// [`FileError`]; then an older folder stays.
    pub fn commit(mut self) -> Result<(), FileError> {
        let _undisturbed = undisturbed();
        let wrong = |error| FileError::io(&self.target, "write", error);
        let old = self.staged.with_extension("old");
        let replaces = self.target.join(self.mark).is_file();
        if replaces {
            fs::rename(&self.target, &old).map_err(wrong)?;
        }
        if let Err(error) = fs::rename(&self.staged, &self.target) {
            if replaces {
                // The first error is reported; an error of the way back adds nothing.
                let _ = fs::rename(&old, &self.target);
            }
            return Err(wrong(error));
        }
        self.noted.clear();
        if replaces {
            fs::remove_dir_all(&old).map_err(|error| FileError::io(&old, "remove", error))?;
        }
        let parent = parent(&self.target);
        sync_folder(parent).map_err(|error| FileError::io(parent, "write to", error))
    }
}

impl Drop for WholeFolder {
    fn drop(&mut self) {
        // After `commit` the hidden name is gone. What cannot be removed stays.
        let _ = fs::remove_dir_all(&self.staged);
    }
}

fn parent(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap().map(Result::unwrap);
        let mut names: Vec<String> =
            entries.map(|entry| entry.file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    fn written(target: &Path, text: &[u8]) -> Result<WholeFolder, FileError> {
        let mut folder = WholeFolder::create(target, "mark.json")?;
        folder.write("a/b/0", text)?;
        folder.write("a/b/1", text)?;
        folder.write("mark.json", b"{}")?;
        Ok(folder)
    }

    #[test]
    fn a_folder_appears_whole_and_replaces_its_like_alone() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("out.zarr");
        let folder = written(&target, b"1").unwrap();
        assert!(!target.exists());
        folder.commit().unwrap();
        assert_eq!(names(root.path()), ["out.zarr"]);
        assert_eq!(names(&target.join("a/b")), ["0", "1"]);
        written(&target, b"22").unwrap().commit().unwrap();
        assert_eq!(fs::read(target.join("a/b/0")).unwrap(), b"22");
        assert_eq!(names(root.path()), ["out.zarr"]);

        let other = root.path().join("photographs");
        fs::create_dir(&other).unwrap();
        let error = written(&other, b"1").unwrap_err().to_string();
        assert!(error.contains("found a folder without mark.json, expected a new name"), "{error}");
        let file = root.path().join("file");
        fs::write(&file, b"x").unwrap();
        let error = written(&file, b"1").unwrap_err().to_string();
        assert!(error.contains("file: found a file, expected the name of a folder"), "{error}");
        let error = written(&root.path().join("none/out"), b"1").unwrap_err().to_string();
        assert!(error.contains("none: cannot write to it: no such file or folder"), "{error}");
        assert_eq!(names(root.path()), ["file", "out.zarr", "photographs"]);
    }

    #[test]
    fn a_run_that_fails_leaves_nothing() {
        let root = tempfile::tempdir().unwrap();
        let target = root.path().join("out.zarr");
        written(&target, b"1").unwrap().commit().unwrap();
        let mut folder = written(&target, b"2").unwrap();
        let error = folder.write("a/b/0", b"twice").unwrap_err().to_string();
        assert!(error.contains("out.zarr/a/b/0: cannot write it"), "{error}");
        drop(folder);
        assert_eq!(names(root.path()), ["out.zarr"]);
        assert_eq!(fs::read(target.join("a/b/0")).unwrap(), b"1");
    }
}
