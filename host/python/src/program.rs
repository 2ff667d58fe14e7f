//! The program `nirspi`, which the package installs as a script.

use pyo3::prelude::*;
use std::ffi::OsString;

/// Runs the command of these arguments in this process, and returns its exit code. The first argument is the program's name.
#[pyfunction]
pub(crate) fn program(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| nirspi_cli::main(arguments))
}
