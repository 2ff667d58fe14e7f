//! A folder for the results of measurements.

use crate::picture::FigureStyle;
use crate::provenance::Made;
use std::path::Path;

/// Where results go, and what is said of them.
pub struct ResultFolder<'r> {
    /// The file or folder of the measurements, or the first of several files, for the report.
    pub input: &'r Path,
    /// The same in words, above the pictures of a stack.
    pub named: String,
    /// Whether there are several files, which the report of a stack then names.
    pub many: bool,
    /// Whether each frame of a stack starts from the frames before.
    pub warm_start: bool,
    /// The folder.
    pub out: &'r Path,
    /// The program, for the provenance of the results.
    pub made: &'r Made,
    /// What the pictures are made for.
    pub figure: FigureStyle,
}

impl<'r> ResultFolder<'r> {
    /// Results of one file.
    #[must_use]
    pub fn of_file(input: &'r Path, out: &'r Path, made: &'r Made, figure: FigureStyle) -> Self {
        let named = input.display().to_string();
        Self { input, named, many: false, warm_start: false, out, made, figure }
    }
}
