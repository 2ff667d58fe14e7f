//! Text for people and programs: results on stdout, one line on stderr where something failed.
//!
//! The one law: no output makes the program panic, whoever reads it or has stopped reading.

use anyhow::{Context, Result};
use serde::Serialize;
use std::fmt;
use std::io::{self, Write};

/// Prints one line. That the reader has gone (`nirspi demo | head -1`) is no failure: what it wanted, it has.
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

/// One line on stderr. If that cannot be written either, the exit code has to do.
pub fn complain(text: impl fmt::Display) {
    let _ = writeln!(io::stderr(), "nirspi: {text}");
}
