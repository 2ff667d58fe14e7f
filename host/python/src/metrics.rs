//! Numbers that compare two images: those of `nirspi metrics`.

use crate::arrays::{array, slice, whole};
use crate::errors::{refusal, refused};
use crate::work::heavy;
use nirspi::files::npy::Stack;
use nirspi::imaging::Fit;
use nirspi_eval::sets::{self, Align, Scaled};
use nirspi_recon::metrics::{self, MetricError};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use std::path::Path;

type Values<'py> = PyReadonlyArray1<'py, f32>;

/// Two stacks brought to the scale of the comparison: `(reference, test, data_range)`.
#[pyfunction]
#[expect(clippy::type_complexity, reason = "a tuple for Python")]
pub fn scaled<'py>(
    py: Python<'py>,
    reference: Values<'py>,
    test: Values<'py>,
    shape: (usize, usize, usize),
    align: Option<&str>,
    data_range: Option<f64>,
) -> PyResult<(Bound<'py, PyArray1<f32>>, Bound<'py, PyArray1<f32>>, f64)> {
    let align = match align {
        None => Align::None,
        Some("gain-offset") => Align::GainOffset,
        Some(other) => {
            return Err(refused(format!("align is {other:?}, expected \"gain-offset\" or None")));
        }
    };
    let (count, height, width) = shape;
    let stack = |values: &[f32]| Stack { count, height, width, values: values.to_vec() };
    let (reference, test) = (stack(slice(&reference)?), stack(slice(&test)?));
    for values in [&reference.values, &test.values] {
        if values.len() != count * height * width {
            return Err(refused(format!("{} values, expected {shape:?}", values.len())));
        }
    }
    let found = heavy(py, || {
        let paths = [Path::new("reference"), Path::new("test")];
        let in_python = |text: String| {
            text.replace("--data-range R", "data_range=")
                .replace("--align gain-offset", "align=\"gain-offset\"")
        };
        sets::scaled(paths, reference, test, align, data_range)
            .map_err(|error| refused(in_python(nirspi::causes::in_one_line(&error))))
    })?;
    let Scaled { reference, test, data_range } = found;
    Ok((array(py, reference.values), array(py, test.values), data_range))
}

/// One number a pair of images.
fn each(
    py: Python<'_>,
    reference: &[f32],
    test: &[f32],
    (width, height): (usize, usize),
    of: impl Fn(&[f32], &[f32]) -> Result<f64, MetricError> + Sync,
) -> PyResult<Vec<f64>> {
    let area = width * height;
    if whole("reference", reference.len(), area)? != whole("test", test.len(), area)? {
        return Err(refused(format!("{} values, expected {}", test.len(), reference.len())));
    }
    heavy(py, || {
        let pairs = reference.chunks_exact(area).zip(test.chunks_exact(area));
        pairs.map(|(reference, test)| of(reference, test).map_err(refusal)).collect()
    })
}

/// PSNR of each pair, in dB.
#[pyfunction]
pub fn psnr(
    py: Python<'_>,
    reference: Values<'_>,
    test: Values<'_>,
    size: (usize, usize),
    data_range: f64,
) -> PyResult<Vec<f64>> {
    let of = |a: &[f32], b: &[f32]| metrics::psnr(a, b, size.0, size.1, data_range);
    each(py, slice(&reference)?, slice(&test)?, size, of)
}

/// SSIM of each pair.
#[pyfunction]
pub fn ssim(
    py: Python<'_>,
    reference: Values<'_>,
    test: Values<'_>,
    size: (usize, usize),
    data_range: f64,
) -> PyResult<Vec<f64>> {
    let of = |a: &[f32], b: &[f32]| metrics::ssim(a, b, size.0, size.1, data_range);
    each(py, slice(&reference)?, slice(&test)?, size, of)
}

/// Pearson's correlation of each pair.
#[pyfunction]
pub fn correlation(
    py: Python<'_>,
    reference: Values<'_>,
    test: Values<'_>,
    size: (usize, usize),
) -> PyResult<Vec<f64>> {
    let of = |a: &[f32], b: &[f32]| metrics::correlation(a, b, size.0, size.1);
    each(py, slice(&reference)?, slice(&test)?, size, of)
}

/// Gain (0 or more) and offset of least squares, and whether the image is inverted.
#[pyfunction]
pub fn fit(image: Values<'_>, reference: Values<'_>) -> PyResult<(f64, f64, bool)> {
    let (image, reference) = (slice(&image)?, slice(&reference)?);
    if image.len() != reference.len() || image.is_empty() {
        return Err(refused(format!("{} values, expected {}", image.len(), reference.len())));
    }
    let fit = Fit::of(image, reference);
    Ok((fit.gain, fit.offset, fit.inverted))
}
