//! A Python program in the provenance of what it writes.

use crate::errors::refused;
use nirspi::provenance::{Made, Origin, Provenance, Taken};
use pyo3::prelude::*;

/// The running program: `sys.argv`, without secrets.
pub fn made(py: Python<'_>) -> PyResult<Made> {
    let arguments: Vec<String> = py.import("sys")?.getattr("argv")?.extract()?;
    let program = concat!("nirspi for Python ", env!("CARGO_PKG_VERSION"));
    Ok(Made::now(program, nirspi_cli::COMMIT, arguments))
}

/// Where readings come from, as JSON.
pub fn said(taken: &Taken) -> PyResult<String> {
    serde_json::to_string(taken).map_err(|error| refused(error.to_string()))
}

/// The provenance of what this program makes of readings of this origin; `None`: unknown.
pub fn of_origin(py: Python<'_>, taken: Option<&str>) -> PyResult<Provenance> {
    let taken = match taken {
        Some(json) => serde_json::from_str(json)
            .map_err(|error| refused(format!("origin is no origin of readings: {error}")))?,
        None => Taken::without_camera(Origin::Unknown),
    };
    Ok(taken.made(&made(py)?))
}

/// The provenance of what this program makes of readings of this origin, as JSON, and whether they are simulated.
#[pyfunction]
pub fn provenance(py: Python<'_>, taken: Option<&str>) -> PyResult<(String, Option<bool>)> {
    let provenance = of_origin(py, taken)?;
    Ok((provenance.json(), provenance.taken.simulated()))
}
