//! Orders of patterns.

use crate::arrays::{array, side};
use crate::errors::{of_file, refusal, refused};
use nirspi::order_table::read_order_table;
use nirspi_recon::Order;
use numpy::PyArray1;
use pyo3::prelude::*;
use std::path::Path;

/// The order of this name, or of the file in `table:FILE`.
pub fn named(name: &str) -> PyResult<Order> {
    match name.strip_prefix("table:") {
        Some(file) => Ok(Order::Table(read_order_table(Path::new(file)).map_err(of_file)?)),
        None => name.parse().map_err(|error| refused(format!("{error} or table:FILE"))),
    }
}

/// Natural rows in the order shown.
#[pyfunction]
pub fn order<'py>(py: Python<'py>, name: &str, n: u64) -> PyResult<Bound<'py, PyArray1<i64>>> {
    let rows = named(name)?.rows(side(n)?).map_err(refusal)?;
    Ok(array(py, rows.iter().map(|&row| i64::from(row)).collect()))
}

/// Name, description, package and whether ties are undefined, of every order with a name.
#[pyfunction]
pub fn orders() -> Vec<(&'static str, &'static str, Option<&'static str>, bool)> {
    let facts = |o: &nirspi_recon::NamedOrder| (o.name, o.about, o.package, o.has_undefined_ties);
    Order::NAMED.iter().map(facts).collect()
}
