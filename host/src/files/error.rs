//! What can be wrong with a file, each as one line that a user can act on.
//!
//! The law: a message is a single line, whatever the file or its name holds.

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
        /// What was tried: "read", "write", "create".
        attempt: &'static str,
        /// What the system said. The message tells this in a user's words, so it is no `source()`.
        system: io::Error,
    },
    /// The path leads to something else than it should: a folder for a file, or the reverse.
    #[error("{}: found {found}, expected {expected}", Shown::path(path))]
    Kind {
        /// The file or folder.
        path: PathBuf,
        /// What stands there.
        found: String,
        /// What should.
        expected: &'static str,
    },
    /// The file is of the right kind, but cut short or corrupted.
    #[error(
        "{}: damaged or cut short ({}), expected {expected}",
        Shown::path(path),
        Shown::text(found)
    )]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What the damage showed as.
        found: String,
        /// What a whole file would be.
        expected: &'static str,
    },
    /// A field that must be there is not.
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
        /// The names that are there.
        found: Vec<String>,
        /// The names that should be.
        expected: &'static str,
    },
    /// A field is there, but is not what it should be.
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
        /// What should be.
        expected: String,
    },
    /// The file holds several measurements and the caller chose none, or one that is not there.
    #[error("{}: `{}` holds {}", Shown::path(path), Shown::text(field), choice(*count, *asked))]
    Choice {
        /// The file.
        path: PathBuf,
        /// The field.
        field: Cow<'static, str>,
        /// How many there are.
        count: usize,
        /// Which was asked for.
        asked: Option<usize>,
    },
}

impl FileError {
    pub(crate) fn io(path: &Path, attempt: &'static str, system: io::Error) -> Self {
        Self::Io { path: path.to_owned(), attempt, system }
    }

    pub(crate) fn field(
        path: &Path,
        field: impl Into<String>,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> Self {
        let (field, found, expected) = (Cow::Owned(field.into()), found.into(), expected.into());
        Self::Field { path: path.to_owned(), field, found, expected }
    }

    pub(crate) fn kind(path: &Path, found: impl Into<String>, expected: &'static str) -> Self {
        Self::Kind { path: path.to_owned(), found: found.into(), expected }
    }
}

fn choice(count: usize, asked: Option<usize>) -> String {
    let measurements =
        if count == 1 { "1 measurement".to_owned() } else { format!("{count} measurements") };
    let asked =
        asked.map(|index| format!(", found no index {index} among them")).unwrap_or_default();
    match count {
        0 | 1 => format!("{measurements}{asked}, expected --index 0 or none"),
        _ => format!("{measurements}{asked}: choose one with --index 0..{}", count - 1),
    }
}

/// The system's reason in a user's words; its own where it has a better one.
fn reason(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::NotFound => "no such file or folder".to_owned(),
        io::ErrorKind::PermissionDenied => "permission denied".to_owned(),
        io::ErrorKind::StorageFull => "no space left on the disk".to_owned(),
        io::ErrorKind::ReadOnlyFilesystem => "the disk is read-only".to_owned(),
        _ => Shown::text(&error.to_string()).to_string(),
    }
}

/// Foreign text made fit for one line: control characters escaped, cut at a length.
pub(super) struct Shown {
    text: String,
    limit: usize,
}

impl Shown {
    /// Long enough for any message of ours, short enough for a terminal.
    const TEXT_LIMIT: usize = 200;
    /// The longest path of common systems.
    const PATH_LIMIT: usize = 4096;
    /// Names of fields that a message lists before it stops.
    const NAMES: usize = 12;

    fn path(path: &Path) -> Self {
        Self { text: path.display().to_string(), limit: Self::PATH_LIMIT }
    }

    pub(super) fn text(text: &str) -> Self {
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
            // Line separators are no control characters, yet break a line in some terminals and
            // editors.
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
