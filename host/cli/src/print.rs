//! Prints results on stdout, and one line on stderr after an error.
//!
//! # Invariant
//! Printing never makes the program panic, also if the reader has closed the pipe
//! (`a_reader_that_stops_reading_is_no_failure` in `host/cli/tests/cli/arguments.rs`).

use anyhow::{Context, Result};
use serde::Serialize;
use std::fmt;
use std::io::{self, Write};

/// Prints one line. A reader that has closed the pipe (`nirspi demo | head -1`) does not count as a
/// failure.
pub fn line(text: impl fmt::Display) -> Result<()> {
    match writeln!(io::stdout(), "{text}") {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other.context("cannot write to stdout"),
    }
}

/// Prints a report as JSON.
pub fn json(report: &impl Serialize) -> Result<()> {
    line(serde_json::to_string_pretty(report)?)
}

/// Prints one line on stderr. If stderr is closed too, the exit code alone reports the failure.
pub fn complain(text: impl fmt::Display) {
    let _ = writeln!(io::stderr(), "nirspi: {text}");
}
