//! Reads a user's table of numbers: a text file of lines with fields, as a spreadsheet writes it.
//!
//! Fields are separated by commas, semicolons or tabs. Empty lines and lines that start with `#`
//! are skipped. A first line of names is a heading and is skipped too.

use super::FileError;
use super::plain::{is_heading, read_text};
use std::path::{Path, PathBuf};

const EXPECTED: &str = "a text file with a row of numbers a line";

/// The fields of a table, line by line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Table {
    path: PathBuf,
    /// The number of each line, and its fields.
    rows: Vec<(usize, Vec<String>)>,
}

impl Table {
    /// Reads a table.
    ///
    /// # Errors
    /// [`FileError`] for a file that cannot be read, is too large or is not text.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let text = read_text(path, EXPECTED)?;
        let lines = text.lines().enumerate().map(|(at, line)| (at + 1, line.trim()));
        let mut rows: Vec<(usize, Vec<String>)> = lines
            .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
            .map(|(at, line)| {
                (at, line.split([',', ';', '\t']).map(|f| f.trim().to_owned()).collect())
            })
            .collect();
        if rows.first().is_some_and(|(_, row)| is_heading(row.iter().map(String::as_str))) {
            rows.remove(0);
        }
        Ok(Self { path: path.to_owned(), rows })
    }

    /// The last field of each row.
    ///
    /// # Errors
    /// [`FileError::Field`] for a field that is not a number.
    pub fn last_column(&self) -> Result<Vec<f64>, FileError> {
        let last = |(line, fields): &(usize, Vec<String>)| {
            self.number(*line, fields.last().map_or("", String::as_str))
        };
        self.rows.iter().map(last).collect()
    }

    /// Rows of two numbers. `columns` names the two columns in error messages.
    ///
    /// # Errors
    /// [`FileError::Field`] for a row of another length, or a field that is not a number.
    pub fn pairs(&self, columns: &str) -> Result<Vec<[f64; 2]>, FileError> {
        let pair = |(line, fields): &(usize, Vec<String>)| match &fields[..] {
            [a, b] => Ok([self.number(*line, a)?, self.number(*line, b)?]),
            _ => {
                Err(self.wrong(*line, &format!("{} fields", fields.len()), format!("2: {columns}")))
            }
        };
        self.rows.iter().map(pair).collect()
    }

    fn number(&self, line: usize, field: &str) -> Result<f64, FileError> {
        let wrong = || self.wrong(line, &format!("{field:?}"), "a number".to_owned());
        field.parse().ok().filter(|number: &f64| number.is_finite()).ok_or_else(wrong)
    }

    fn wrong(&self, line: usize, found: &str, expected: String) -> FileError {
        FileError::field(&self.path, "table", format!("has {found} in line {line}"), expected)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{file, line};

    #[test]
    fn a_heading_comments_and_empty_lines_are_no_rows() {
        let (_folder, path) = file("a.csv", b"place,ml\n# left\n1, 8\r\n\n2;12\n3\t9\n");
        assert_eq!(Table::read(&path).unwrap().last_column().unwrap(), [8.0, 12.0, 9.0]);
        let pairs = Table::read(&path).unwrap().pairs("place, ml").unwrap();
        assert_eq!(pairs, [[1.0, 8.0], [2.0, 12.0], [3.0, 9.0]]);
        // A first line with one number in it is a row, not a heading.
        let (_folder, path) = file("b.csv", b"left,8\nright,12\n");
        assert_eq!(Table::read(&path).unwrap().last_column().unwrap(), [8.0, 12.0]);
    }

    #[test]
    fn a_field_that_is_no_number_is_named_with_its_line() {
        let (_folder, path) = file("a.csv", b"place,ml\n1,8\n2,wet\n");
        let error = Table::read(&path).unwrap().last_column().unwrap_err();
        let message = line(&error, "a.csv");
        assert!(message.contains("\"wet\" in line 3, expected a number"), "{message}");
        let (_folder, path) = file("a.csv", b"1,8\n2,3,4\n");
        let message = line(&Table::read(&path).unwrap().pairs("mm, drops").unwrap_err(), "a.csv");
        assert!(message.contains("3 fields in line 2, expected 2: mm, drops"), "{message}");
        for (content, found) in [
            (&b"1.5.2\n2\n"[..], "\"1.5.2\" in line 1"),
            (b"8 ml\n2\n", "\"8 ml\" in line 1"),
            (b"ml\ninf\n", "\"inf\" in line 2"),
        ] {
            let (_folder, path) = file("a.csv", content);
            let message = line(&Table::read(&path).unwrap().last_column().unwrap_err(), "a.csv");
            assert!(message.contains(found), "{message}");
        }
        let (_folder, path) = file("a.csv", b"\xc3\x28");
        assert!(line(&Table::read(&path).unwrap_err(), "a.csv").contains("a binary file"));
    }
}
