//! Errors of files. Each is one line that a user can act on.
//!
//! # Invariant
//! A message is a single line, whatever the file or its name holds
//! (`tests::every_message_is_one_line`).

use std::borrow::Cow;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a file could not be read or written. `Display` is one line: file, field, found, expected.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FileError {
    /// The operating system refused.
    #[error("{}: cannot {attempt} it: {}", Shown::path(path), reason(system))]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The operation that failed: "read", "write", "create".
        attempt: &'static str,
        /// The system's error. `Display` already includes its reason, so `system` is not also a
        /// `source()`.
        system: io::Error,
    },
    /// The path leads to a folder instead of a file, or to a file instead of a folder.
    #[error("{}: found {found}, expected {expected}", Shown::path(path))]
    Kind {
        /// The file or folder.
        path: PathBuf,
        /// What the path leads to.
        found: String,
        /// What the path should lead to.
        expected: &'static str,
    },
    /// The file is of the right kind, but is cut short or corrupted.
    #[error(
        "{}: damaged or cut short ({}), expected {expected}",
        Shown::path(path),
        Shown::text(found)
    )]
    Damaged {
        /// The file.
        path: PathBuf,
        /// How the damage showed.
        found: String,
        /// What an undamaged file would hold.
        expected: &'static str,
    },
    /// A required field is missing.
    #[error(
        "{}: no `{field}` in it, found {}; expected {expected}",
        Shown::path(path),
        Shown::names(found)
    )]
    Missing {
        /// The file.
        path: PathBuf,
        /// The field.
        field: &'static str,
        /// The names of the fields in the file.
        found: Vec<String>,
        /// The names that the reader accepts.
        expected: &'static str,
    },
    /// A field has the wrong type, shape or value.
    #[error(
        "{}: `{}` {}, expected {expected}",
        Shown::path(path),
        Shown::text(field),
        Shown::text(found)
    )]
    Field {
        /// The file.
        path: PathBuf,
        /// The field.
        field: Cow<'static, str>,
        /// What was found, as the rest of a sentence: `has shape (3,)`, `is NaN at [7]`.
        found: String,
        /// The value expected.
        expected: String,
    },
    /// A file has the name of a result and stays.
    #[error("{}: is there already, expected {expected}", Shown::path(path))]
    Exists {
        /// The file that is there.
        path: PathBuf,
        /// What the caller can choose.
        expected: &'static str,
    },
    /// The result would replace the file that it is made of.
    #[error("{}: the result is made of this file, expected another name for it", Shown::path(path))]
    Source {
        /// The file.
        path: PathBuf,
    },
    /// The file holds several measurements, and the caller chose none or an index that is too
    /// large.
    #[error("{}: `{}` holds {}", Shown::path(path), Shown::text(field), choice(*count, *asked, *is_square))]
    Choice {
        /// The file.
        path: PathBuf,
        /// The field.
        field: Cow<'static, str>,
        /// The number of measurements in the file.
        count: usize,
        /// The index that the caller chose.
        asked: Option<usize>,
        /// Whether they may be one spectrum, with as many rows as columns.
        is_square: bool,
    },
}

impl FileError {
    /// An attempt, such as "read", that the system refused.
    #[must_use]
    pub fn io(path: &Path, attempt: &'static str, system: io::Error) -> Self {
        Self::Io { path: path.to_owned(), attempt, system }
    }

    /// A field that holds something else than expected.
    pub fn field(
        path: &Path,
        field: impl Into<String>,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> Self {
        let (field, found, expected) = (Cow::Owned(field.into()), found.into(), expected.into());
        Self::Field { path: path.to_owned(), field, found, expected }
    }

    /// A file that is damaged or ends too early.
    pub(crate) fn damaged(path: &Path, found: String, expected: &'static str) -> Self {
        Self::Damaged { path: path.to_owned(), found, expected }
    }

    /// A file without a field, which has others.
    #[cfg(not(target_family = "wasm"))]
    pub(crate) fn missing(
        path: &Path,
        field: &'static str,
        found: &[String],
        expected: &'static str,
    ) -> Self {
        Self::Missing { path: path.to_owned(), field, found: found.to_vec(), expected }
    }

    /// A file that is something else than expected.
    pub fn kind(path: &Path, found: impl Into<String>, expected: &'static str) -> Self {
        Self::Kind { path: path.to_owned(), found: found.into(), expected }
    }
}

fn choice(count: usize, asked: Option<usize>, is_square: bool) -> String {
    let measurements =
        if count == 1 { "1 measurement".to_owned() } else { format!("{count} measurements") };
    let asked =
        asked.map(|index| format!(", found no index {index} among them")).unwrap_or_default();
    match count {
        0 | 1 => format!("{measurements}{asked}, expected --index 0 or none"),
        _ => {
            let spectrum = match is_square {
                true => format!(", or say --side {count} for one spectrum of {count} x {count}"),
                false => String::new(),
            };
            format!("{measurements}{asked}: choose one with --index 0..{}{spectrum}", count - 1)
        }
    }
}

/// The system's reason in a user's words. Any other reason is kept as the system gives it.
fn reason(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::NotFound => "no such file or folder".to_owned(),
        io::ErrorKind::PermissionDenied => "permission denied".to_owned(),
        io::ErrorKind::StorageFull => "no space left on the disk".to_owned(),
        io::ErrorKind::ReadOnlyFilesystem => "the disk is read-only".to_owned(),
        _ => Shown::text(&error.to_string()).to_string(),
    }
}

/// Text from outside the program, prepared for one line: control characters are escaped and the
/// length is limited.
#[derive(Debug)]
pub struct Shown {
    text: String,
    limit: usize,
}

impl Shown {
    /// The most characters of text in a message: enough for every message of nirspi, and short
    /// enough for a terminal.
    const TEXT_LIMIT: usize = 200;
    /// The longest path of common systems.
    const PATH_LIMIT: usize = 4096;
    /// The most names of fields that a message lists.
    const NAMES: usize = 12;

    fn path(path: &Path) -> Self {
        Self { text: path.display().to_string(), limit: Self::PATH_LIMIT }
    }

    /// Words of a file or of a stream, of which the first characters are shown.
    #[must_use]
    pub fn text(text: &str) -> Self {
        Self { text: text.to_owned(), limit: Self::TEXT_LIMIT }
    }

    fn names(names: &[String]) -> String {
        if names.is_empty() {
            return "nothing".to_owned();
        }
        let mut shown: Vec<String> = names
            .iter()
            .take(Self::NAMES)
            .map(|n| format!("`{}`", Self { text: n.clone(), limit: 40 }))
            .collect();
        if names.len() > Self::NAMES {
            shown.push(format!("{} more", names.len() - Self::NAMES));
        }
        shown.join(", ")
    }
}

impl fmt::Display for Shown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, c) in self.text.chars().enumerate() {
            if i == self.limit {
                return f.write_str("...");
            }
            // Line separators are not control characters, but they break a line in some terminals
            // and editors.
            if c.is_control() || matches!(c, '\u{2028}' | '\u{2029}') {
                write!(f, "{}", c.escape_default())?;
            } else {
                write!(f, "{c}")?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_message_is_one_line(
            path in any::<String>(),
            names in prop::collection::vec(any::<String>(), 0..20),
            found in any::<String>(),
        ) {
            let path = PathBuf::from(path);
            let errors = [
                FileError::io(&path, "read", io::Error::other(found.clone())),
                FileError::kind(&path, "a folder", "a file"),
                FileError::Damaged { path: path.clone(), found: found.clone(), expected: "a .npz" },
                FileError::Missing { path: path.clone(), field: "n", found: names, expected: "n" },
                FileError::Field { path, field: "y".into(), found, expected: "numbers".to_owned() },
            ];
            for error in errors {
                let line = error.to_string();
                let breaks = ['\n', '\r', '\u{2028}', '\u{85}', '\u{b}', '\u{c}'];
                prop_assert!(!line.contains(breaks), "{line:?}");
            }
        }
    }

    #[test]
    fn a_long_list_of_names_is_cut() {
        let found = (0..1000).map(|i| format!("field{i}")).collect();
        let line =
            FileError::Missing { path: "a.npz".into(), field: "n", found, expected: "n, h_row" }
                .to_string();
        assert!(line.contains("`field11`, 988 more; expected n, h_row"), "{line}");
    }
}
