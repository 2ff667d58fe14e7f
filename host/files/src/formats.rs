//! The formats of measurement files: their endings, and the list of those whose file is read whole into columns.
//!
//! A new format of this kind is a file in `formats/` that defines its `FORMAT`, an entry of [`COLUMNS`], and its ending in
//! [`ENDINGS`] and `endings!`. Errors, and the search of folders, take their lists from here.

mod wav;

use super::FileError;
use super::field::Field;
use std::path::Path;

/// The endings as errors list them.
macro_rules! endings {
    () => {
        ".npz, .npy, .mat, .h5, .csv, .txt or .wav"
    };
}

/// The kind of file that a path should lead to, for error messages.
pub(super) const EXPECTED: &str = concat!("measurements: ", endings!(), ", or a recording (.mcap)");

/// The same for the samples of a trace.
pub(super) const EXPECTED_TRACE: &str =
    concat!("a trace: ", endings!(), ", or numbers without a heading (--raw)");

/// Endings of the files in a folder that are taken for measurements.
pub(super) const ENDINGS: [&str; 9] =
    ["npz", "npy", "mat", "h5", "hdf5", "csv", "txt", "wav", "mcap"];

/// A format whose file is read whole, into columns.
pub(super) struct Columns {
    /// The format in a few words: `a WAV file`.
    pub(super) name: &'static str,
    /// Whether a file with these first bytes has this format.
    pub(super) is_start: fn(&[u8]) -> bool,
    /// Reads the columns; one alone needs no name.
    pub(super) read: fn(&Path) -> Result<Vec<Field>, FileError>,
}

/// Every format of this kind.
const COLUMNS: [Columns; 1] = [wav::FORMAT];

/// The format of a file with these first bytes.
pub(super) fn of_start(start: &[u8]) -> Option<&'static Columns> {
    COLUMNS.iter().find(|format| (format.is_start)(start))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_name_the_endings_that_a_folder_is_searched_for() {
        // Two endings of one format are named once.
        for ending in ENDINGS.iter().filter(|ending| **ending != "hdf5") {
            assert!(EXPECTED.contains(&format!(".{ending}")), "{ending}");
        }
        let named = EXPECTED.matches('.').count();
        assert_eq!(named, ENDINGS.len() - 1, "{EXPECTED}");
    }
}
