//! Prints results on stdout, and remarks and errors on stderr.
//!
//! # Invariant
//! Printing never makes the program panic, also if the reader has closed the pipe
//! (`a_reader_that_stops_reading_is_no_failure` in `host/cli/tests/cli/arguments.rs`).

use anyhow::{Context, Result};
use nirspi::provenance::Provenance;
use serde::Serialize;
use std::fmt;
use std::io::{self, Write};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

static QUIET: AtomicBool = AtomicBool::new(false);
static VERBOSE: AtomicBool = AtomicBool::new(false);
static WARNED: AtomicBool = AtomicBool::new(false);

/// How much the program says from now on.
pub fn say(quiet: bool, verbose: bool) {
    QUIET.store(quiet, Relaxed);
    VERBOSE.store(verbose, Relaxed);
}

/// Whether notes, remarks and progress are switched off.
pub fn is_quiet() -> bool {
    QUIET.load(Relaxed)
}

/// Whether a warning was printed.
pub fn has_warned() -> bool {
    WARNED.load(Relaxed)
}

/// Prints one line. A reader that has closed the pipe (`nirspi demo | head -1`) does not count as a
/// failure.
pub fn line(text: impl fmt::Display) -> Result<()> {
    match writeln!(io::stdout(), "{text}") {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other.context("cannot write to stdout"),
    }
}

/// Prints a note beside a result, unless the user wants none.
pub fn note(text: impl fmt::Display) -> Result<()> {
    if is_quiet() { Ok(()) } else { line(format_args!("note: {text}")) }
}

/// Prints several notes.
pub fn notes(notes: &[String]) -> Result<()> {
    notes.iter().try_for_each(note)
}

/// Prints how to interpret the numbers of a table.
pub fn reading(lines: &[String]) -> Result<()> {
    lines.iter().try_for_each(|text| line(format_args!("reading: {text}")))
}

/// Prints a report with its provenance as JSON.
pub fn json(report: &(impl Serialize + ?Sized), provenance: &Provenance) -> Result<()> {
    line(provenance.sign(report)?.trim_end())
}

/// Prints an answer that is no report of readings, such as a list of devices, as JSON.
pub fn json_answer(answer: &(impl Serialize + ?Sized)) -> Result<()> {
    line(serde_json::to_string_pretty(answer)?)
}

/// Prints one line on stderr. If stderr is closed too, the exit code alone reports the failure.
pub fn complain(text: impl fmt::Display) {
    let _ = writeln!(io::stderr(), "nirspi: {text}");
}

/// Prints what a user must know of a result, on stderr, with --quiet too.
pub fn warning(text: impl fmt::Display) {
    WARNED.store(true, Relaxed);
    complain(format_args!("warning: {text}"));
}

/// Prints one line on stderr that is not an error. With --quiet the line is left out.
pub fn remark(text: impl fmt::Display) {
    if !is_quiet() {
        complain(text);
    }
}

/// Prints one line on stderr for a user who wants more detail.
pub fn detail(text: impl fmt::Display) {
    if VERBOSE.load(Relaxed) {
        complain(text);
    }
}
