//! Pictures of images, as the command line writes them.

use crate::arrays::{slice, whole};
use crate::errors::refused;
use crate::made::of_origin;
use crate::work::heavy;
use nirspi::picture::{Figure, FigureStyle, Panel, Sheet, Unit};
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

fn unit(name: &str) -> PyResult<Unit> {
    let all = [Unit::OfWhite, Unit::Reflectance, Unit::AdcCounts, Unit::Readings];
    all.into_iter().find(|unit| unit.name() == name).ok_or_else(|| {
        let names = all.map(Unit::name).join(", ");
        refused(format!("unit is {name:?}, expected one of: {names}"))
    })
}

/// A PNG of one image with a grey bar, and with what is said of it: lines of facts, and warnings.
#[pyfunction]
pub fn picture<'py>(
    py: Python<'py>,
    values: PyReadonlyArray1<'py, f32>,
    size: (usize, usize),
    title: &str,
    unit_name: &str,
    said: (Vec<String>, Vec<String>),
    taken: Option<&str>,
) -> PyResult<Bound<'py, PyBytes>> {
    let values = slice(&values)?;
    let ((width, height), (caption, warnings)) = (size, said);
    if width == 0 || height == 0 || values.len() != width * height {
        return Err(refused(format!(
            "{} values, expected {width} x {height}, at least one",
            values.len()
        )));
    }
    let provenance = of_origin(py, taken)?;
    let panel = Panel {
        width,
        height,
        caption,
        warnings,
        ..Panel::square(title, 1, values, unit(unit_name)?)
    };
    let look = FigureStyle::Paper.on_screen();
    let png = heavy(py, || Ok(Figure::Images(panel.into()).png(&look, &provenance)))?;
    Ok(PyBytes::new(py, &png))
}

/// A PNG of a contact sheet.
#[pyfunction]
pub fn sheet<'py>(
    py: Python<'py>,
    values: PyReadonlyArray1<'py, f32>,
    n: usize,
    header: String,
    unit_name: &str,
    taken: Option<&str>,
) -> PyResult<Bound<'py, PyBytes>> {
    let values = slice(&values)?;
    whole("the stack", values.len(), n * n)?;
    let unit = unit(unit_name)?;
    let provenance = of_origin(py, taken)?;
    let png = heavy(py, || {
        let sheet = Sheet::new(header, (n, n), values.chunks_exact(n * n).collect(), unit);
        Ok(sheet.png(&FigureStyle::Paper.on_screen(), &provenance))
    })?;
    Ok(PyBytes::new(py, &png))
}
