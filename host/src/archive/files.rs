//! The measurement files of a folder, and the share of them that one machine takes.

use super::ArchiveError;
use crate::files::FileError;
use serde::Serialize;
use std::ffi::OsStr;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Endings of the files that are taken for measurements.
pub const ENDINGS: [&str; 8] = ["npz", "npy", "mat", "h5", "hdf5", "csv", "txt", "mcap"];

/// The measurement files in a folder and in the folders below, as paths relative to the folder with
/// `/` between names, in the order of these texts. Hidden files and folders are left out, and so
/// are links to folders.
///
/// # Errors
/// [`ArchiveError`] if a folder cannot be read, or there is no measurement file.
pub fn find(folder: &Path) -> Result<Vec<String>, ArchiveError> {
    let mut names = Vec::new();
    collect(folder, "", &mut names)?;
    measurements_of(folder, names)
}

/// The measurement files among these names of a folder, in order. Hidden names are left out.
pub(super) fn measurements_of(
    folder: &Path,
    names: impl IntoIterator<Item = String>,
) -> Result<Vec<String>, ArchiveError> {
    let is_seen = |name: &String| !name.split('/').any(|part| part.starts_with('.'));
    let is_wanted = |name: &String| is_measurement(Path::new(name)) && is_seen(name);
    let mut names: Vec<String> = names.into_iter().filter(is_wanted).collect();
    if names.is_empty() {
        let expected = ENDINGS.map(|ending| format!(".{ending}")).join(", ");
        return Err(ArchiveError::NoFiles { folder: folder.to_owned(), expected });
    }
    names.sort_unstable();
    Ok(names)
}

fn collect(folder: &Path, prefix: &str, names: &mut Vec<String>) -> Result<(), FileError> {
    let refused = |error| FileError::io(folder, "read", error);
    for entry in std::fs::read_dir(folder).map_err(refused)? {
        let entry = entry.map_err(refused)?;
        let (file_name, path) = (entry.file_name(), entry.path());
        let kind = entry.file_type().map_err(refused)?;
        let Some(name) = file_name.to_str() else {
            if is_measurement(&path) {
                return Err(FileError::kind(&path, "a name that is no UTF-8", "a name in UTF-8"));
            }
            continue;
        };
        if name.starts_with('.') {
            continue;
        }
        let name = format!("{prefix}{name}");
        if kind.is_dir() {
            collect(&path, &format!("{name}/"), names)?;
        } else if !path.is_dir() {
            names.push(name);
        }
    }
    Ok(())
}

fn is_measurement(path: &Path) -> bool {
    let ending = path.extension().map(OsStr::to_ascii_lowercase);
    ENDINGS.iter().any(|known| ending.as_deref().is_some_and(|ending| ending == *known))
}

/// A share of the files: part `part` of `parts`, counted from 1.
///
/// # Invariant
/// Every file is in exactly one of the parts (`tests::every_file_is_in_one_shard`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    part: usize,
    parts: usize,
}

impl Shard {
    /// All files.
    pub const WHOLE: Self = Self { part: 1, parts: 1 };

    /// The positions of this share, of `count` files: every `parts`-th, so that shares are alike.
    pub(super) fn of(self, count: usize) -> impl Iterator<Item = usize> {
        (self.part - 1..count).step_by(self.parts)
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.part, self.parts)
    }
}

impl Serialize for Shard {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected = || "expected I/N with I from 1 to N, such as 2/8".to_owned();
        let (part, parts) = text.split_once('/').ok_or_else(expected)?;
        let [part, parts] = [part, parts].map(|number| number.parse().unwrap_or(0));
        match (1..=parts).contains(&part) {
            true => Ok(Self { part, parts }),
            false => Err(expected()),
        }
    }
}

/// The file of this name in the folder.
pub(super) fn path_of(folder: &Path, name: &str) -> PathBuf {
    name.split('/').fold(folder.to_owned(), |path, part| path.join(part))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_file_is_in_one_shard(count in 0_usize..200, parts in 1_usize..20) {
            let mut taken = vec![0; count];
            for part in 1..=parts {
                let shard: Shard = format!("{part}/{parts}").parse().unwrap();
                prop_assert_eq!(shard.to_string(), format!("{}/{}", part, parts));
                shard.of(count).for_each(|at| taken[at] += 1);
            }
            prop_assert!(taken.iter().all(|&times| times == 1));
        }
    }

    #[test]
    fn a_wrong_shard_is_refused() {
        for text in ["", "1", "0/2", "3/2", "1/0", "a/b", "1/2/3", "-1/2"] {
            assert!(text.parse::<Shard>().unwrap_err().contains("2/8"), "{text}");
        }
    }

    #[test]
    fn files_are_found_in_every_folder_in_one_order() {
        let root = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(root.path().join("b/c")).unwrap();
        std::fs::create_dir_all(root.path().join(".hidden")).unwrap();
        let names = ["b/c/2.NPZ", "a.csv", "b/1.mcap", ".x.npz", ".hidden/1.npz", "notes.md"];
        names.iter().for_each(|name| std::fs::write(root.path().join(name), "x").unwrap());
        assert_eq!(find(root.path()).unwrap(), ["a.csv", "b/1.mcap", "b/c/2.NPZ"]);
        std::fs::create_dir(root.path().join("empty")).unwrap();
        let error = find(&root.path().join("empty")).unwrap_err().to_string();
        assert!(
            error.contains("no measurement files in the folder, expected at least one of .npz"),
            "{error}"
        );
        assert!(find(&root.path().join("none")).is_err());
    }
}
