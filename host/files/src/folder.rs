//! The measurement files that a user names: files, and all that are in a folder.

use super::FileError;
use super::formats::ENDINGS;
use std::cmp::Ordering;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// The files that these paths name, in the order of the paths. A folder stands for the measurement
/// files in it and in the folders below, in the order of their names. Hidden files and folders are
/// left out, and so are links to folders.
///
/// # Errors
/// [`FileError`] if a folder cannot be read, or has no measurement file.
pub fn measurement_files(named: &[PathBuf]) -> Result<Vec<PathBuf>, FileError> {
    let mut files = Vec::new();
    for path in named {
        match path.is_dir() {
            true => files.extend(find(path)?),
            false => files.push(path.clone()),
        }
    }
    Ok(files)
}

fn find(folder: &Path) -> Result<Vec<PathBuf>, FileError> {
    let mut names = Vec::new();
    collect(folder, "", &mut names)?;
    if names.is_empty() {
        static EXPECTED: LazyLock<String> =
            LazyLock::new(|| format!("at least one of .{}", ENDINGS.join(", .")));
        return Err(FileError::kind(folder, "no measurement file in the folder", &EXPECTED));
    }
    names.sort_unstable();
    Ok(names.into_iter().map(|(_, path)| path).collect())
}

/// The names of the measurement files, relative to the folder where the search began, with `/`
/// between them, and their paths. Names that are not UTF-8 are listed too, so that the report names their files.
fn collect(
    folder: &Path,
    prefix: &str,
    names: &mut Vec<(String, PathBuf)>,
) -> Result<(), FileError> {
    let refused = |error| FileError::io(folder, "read", error);
    for entry in std::fs::read_dir(folder).map_err(refused)? {
        let entry = entry.map_err(refused)?;
        let (file_name, path) = (entry.file_name(), entry.path());
        let kind = entry.file_type().map_err(refused)?;
        let name = file_name.to_string_lossy();
        if name.starts_with('.') {
            continue;
        }
        let name = format!("{prefix}{name}");
        if kind.is_dir() {
            collect(&path, &format!("{name}/"), names)?;
        } else if !path.is_dir() && is_measurement(&path) {
            names.push((name, path));
        }
    }
    Ok(())
}

/// The order of two files whose names count: `p2` before `p10`.
pub(super) fn by_number(one: &Path, other: &Path) -> Ordering {
    let (one, other) = (one.to_string_lossy(), other.to_string_lossy());
    parts(&one).cmp(parts(&other)).then_with(|| one.cmp(&other))
}

/// A name in parts: each number, without leading zeros, by its length and digits, and each other
/// character.
fn parts(name: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut left = name;
    std::iter::from_fn(move || {
        let first = left.chars().next()?;
        let digits = left.bytes().take_while(u8::is_ascii_digit).count();
        let (part, rest) = left.split_at(digits.max(first.len_utf8()));
        left = rest;
        Some(match digits {
            0 => (0, part),
            _ => (1 + part.trim_start_matches('0').len(), part.trim_start_matches('0')),
        })
    })
}

fn is_measurement(path: &Path) -> bool {
    let ending = path.extension().map(OsStr::to_ascii_lowercase);
    ENDINGS.iter().any(|known| ending.as_deref().is_some_and(|ending| ending == *known))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(target_os = "linux")]
    #[test]
    fn a_name_that_is_no_utf_8_is_found_beside_the_others() {
        use std::os::unix::ffi::OsStrExt;
        let root = tempfile::tempdir().unwrap();
        let odd = root.path().join(OsStr::from_bytes(b"b\xff.npz"));
        let names = [root.path().join("a.npz"), odd, root.path().join("c.npz")];
        names.iter().for_each(|name| std::fs::write(name, "x").unwrap());
        assert_eq!(measurement_files(&[root.path().to_owned()]).unwrap(), names);
    }

    #[test]
    fn names_that_count_are_in_the_order_of_their_numbers() {
        let mut names = ["p10", "p9", "p009b", "p1", "q0", "p", "p01"].map(Path::new);
        names.sort_by(|a, b| by_number(a, b));
        assert_eq!(names, ["p", "p01", "p1", "p9", "p009b", "p10", "q0"].map(Path::new));
    }

    #[test]
    fn files_are_found_in_every_folder_in_one_order() {
        let root = tempfile::tempdir().unwrap();
        let here = |name: &str| root.path().join(name);
        std::fs::create_dir_all(here("b/c")).unwrap();
        std::fs::create_dir_all(here(".hidden")).unwrap();
        let names = ["b/c/2.NPZ", "a.csv", "b/1.mcap", ".x.npz", ".hidden/1.npz", "notes.md"];
        names.iter().for_each(|name| std::fs::write(here(name), "x").unwrap());
        let named = [here("notes.md"), root.path().to_owned()];
        let expected = ["notes.md", "a.csv", "b/1.mcap", "b/c/2.NPZ"].map(here);
        assert_eq!(measurement_files(&named).unwrap(), expected);
        std::fs::create_dir_all(here("empty")).unwrap();
        let error = measurement_files(&[here("empty")]).unwrap_err().to_string();
        assert!(error.contains("empty: found no measurement file in the folder"), "{error}");
        for ending in ENDINGS {
            assert!(error.contains(&format!(".{ending}")), "{error}");
        }
        // A file that is not there is named when it is read.
        assert_eq!(measurement_files(&[here("none")]).unwrap(), [here("none")]);
    }
}
