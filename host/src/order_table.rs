//! Reads a user's own order of patterns: a text file of numbers, in which entry k is the
//! natural-order Hadamard row shown k-th.
//!
//! Numbers are separated by blanks, commas, semicolons or line ends; `#` begins a comment. Anything
//! else is an error that names its line
//! (`tests::what_is_no_table_is_refused_in_one_line_that_names_the_place`).

use crate::files::{FileError, read_text};
use std::path::Path;

const EXPECTED: &str = "a text file of pattern numbers";

/// Reads a table. [`Order::rows`](nirspi_recon::Order::rows), which knows the side, checks that the
/// table is a permutation.
///
/// # Errors
/// [`FileError`], one line that names file, line, what was found and what was expected.
pub fn read_order_table(path: &Path) -> Result<Vec<u32>, FileError> {
    let text = read_text(path, EXPECTED)?;
    let mut table = Vec::new();
    for (line, content) in (1..).zip(text.lines()) {
        let numbers = content.split('#').next().unwrap_or("");
        for word in numbers.split([' ', '\t', ',', ';']).filter(|word| !word.is_empty()) {
            table.push(word.parse().map_err(|_| FileError::Field {
                path: path.to_owned(),
                field: "order table".into(),
                found: format!("has {word:?} in line {line}"),
                expected: "whole numbers from 0".to_owned(),
            })?);
        }
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{file, line};

    #[test]
    fn numbers_are_read_however_they_are_separated() {
        let (_folder, path) = file("order.txt", b"# mine\n3, 1\t2\r\n\n0 # last\n");
        assert_eq!(read_order_table(&path).unwrap(), [3, 1, 2, 0]);
    }

    #[test]
    fn what_is_no_table_is_refused_in_one_line_that_names_the_place() {
        for (content, found) in [
            (&b"0 1\n2 x\n"[..], "\"x\" in line 2"),
            (b"0 -1", "\"-1\" in line 1"),
            (b"0 1.5", "\"1.5\" in line 1"),
            (b"\xc3\x28", "a binary file"),
            (b"", "an empty file"),
        ] {
            let (_folder, path) = file("order.txt", content);
            let message = line(&read_order_table(&path).unwrap_err(), "order.txt");
            assert!(message.contains(found), "{message}");
        }
    }
}
