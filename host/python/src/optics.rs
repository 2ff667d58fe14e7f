//! What rain does to light, and descriptions of cameras.

use crate::errors::{of_file, refusal, refused};
use crate::work::long;
use nirspi_eval::{camera_model as evaluated, rain as effects};
use nirspi_optics::mie::Index;
use nirspi_optics::rain::DropLaw;
use nirspi_virtual::weather::{WeatherError, is_drop_file, read_drops};
use nirspi_virtual::{CameraModel, read_camera_model};
use pyo3::prelude::*;
use serde::Serialize;
use std::path::Path;

fn json(report: &impl Serialize) -> PyResult<String> {
    serde_json::to_string(report).map_err(|error| refused(error.to_string()))
}

/// The report of `nirspi physics rain` as JSON.
#[pyfunction]
pub fn rain(
    py: Python<'_>,
    rate_mm_h: f64,
    drops: &str,
    wavelengths_nm: Vec<f64>,
    distance_m: f64,
) -> PyResult<String> {
    let report = long(py, |_| {
        let fallen = if is_drop_file(drops) {
            read_drops(Path::new(drops)).map_err(|error| match error {
                WeatherError::File(error) => of_file(error),
                error => refusal(error),
            })?
        } else {
            let law: DropLaw = drops
                .parse()
                .map_err(|error| refused(format!("drops: {error}, or a .csv file")))?;
            law.drops(rate_mm_h).map_err(refusal)?
        };
        let radar = !drops.starts_with("fog");
        effects::rain(drops, &fallen, &wavelengths_nm, distance_m, radar).map_err(refusal)
    })?;
    json(&report)
}

/// Efficiencies of a sphere, of `nirspi physics sphere`, as JSON.
#[pyfunction]
pub fn mie(py: Python<'_>, x: f64, real: f64, imaginary: f64) -> PyResult<String> {
    json(&long(py, |_| effects::sphere(x, Index { real, imaginary }).map_err(refusal))?)
}

/// A camera description and what follows from it: `(name, TOML, report as JSON)`. `text` is TOML; without a text, `name`
/// is that of a shipped camera or of a file.
#[pyfunction]
pub fn camera_model(
    py: Python<'_>,
    name: &str,
    text: Option<&str>,
) -> PyResult<(String, String, String)> {
    let (camera, report) = long(py, |_| {
        let camera = match text {
            Some(text) => CameraModel::parse(text).map_err(refusal)?,
            None => read_camera_model(name).map_err(refusal)?,
        };
        let report = evaluated::camera_model(&camera).map_err(refusal)?;
        Ok((camera, report))
    })?;
    Ok((camera.name.clone(), camera.to_toml(), json(&report)?))
}
