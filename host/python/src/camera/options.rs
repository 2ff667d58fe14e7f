//! Options of a camera, as Python gives them.

use crate::errors::{refusal, refused};
use crate::orders::named;
use nirspi::capture::CalibrationPolicy;
use nirspi::scene::{SceneMap, SceneSource};
use nirspi::setup::MeasurementSetup;
use nirspi_recon::Sampling;
use nirspi_virtual::weather::read_weather;
use nirspi_virtual::{CameraModel, VirtualOptics};
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use std::path::PathBuf;

/// Edge of a drawn scene's map of reflectance.
const SCENE_PX: usize = 256;

/// Options of a camera.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(super) struct Options<'py> {
    pub(super) order: String,
    pub(super) sampling: String,
    pub(super) sweeps: u32,
    pub(super) clocks_per_pattern: Option<u16>,
    pub(super) blanked: Option<u16>,
    pub(super) differential: bool,
    pub(super) calibration: String,
    pub(super) calibration_file: Option<PathBuf>,
    pub(super) adc_latency: Option<u8>,
    pub(super) scene: Option<String>,
    pub(super) scene_map: Option<PyReadonlyArray1<'py, f32>>,
    pub(super) scene_side_mm: Option<f64>,
    pub(super) distance_m: Option<f64>,
    pub(super) weather: Option<String>,
    pub(super) model: Option<String>,
    pub(super) model_text: Option<String>,
    pub(super) seed: u64,
}

impl Options<'_> {
    pub(super) fn model(&self) -> PyResult<CameraModel> {
        match (&self.model_text, &self.model) {
            (Some(text), _) => CameraModel::parse(text).map_err(refusal),
            (None, Some(name)) => nirspi_virtual::read_camera_model(name).map_err(refusal),
            (None, None) => Ok(CameraModel::paper().clone()),
        }
    }

    pub(super) fn setup(&self, model: &CameraModel) -> PyResult<MeasurementSetup> {
        let order = named(&self.order)?;
        let sampling: Sampling = self
            .sampling
            .parse()
            .map_err(|error| refused(format!("sampling is {}, {error}", self.sampling)))?;
        let mut setup = MeasurementSetup::new(&order, sampling.share()).map_err(refusal)?;
        let clocks = self.clocks_per_pattern.unwrap_or(model.readout.clocks_per_pattern);
        setup = setup.timed(clocks, self.blanked.unwrap_or(model.readout.blanked));
        setup.sweeps = self.sweeps;
        setup.differential = self.differential;
        setup.adc_latency = self.adc_latency.unwrap_or(0);
        setup.check().map_err(refusal)?;
        Ok(setup)
    }

    pub(super) fn policy(&self) -> PyResult<CalibrationPolicy> {
        Ok(match (self.calibration.as_str(), &self.calibration_file) {
            ("off", _) if self.adc_latency.is_none() => {
                return Err(refused("calibration is \"off\", which needs adc_latency"));
            }
            ("off", _) => CalibrationPolicy::Off,
            (_, _) if self.adc_latency.is_some() => {
                return Err(refused("adc_latency belongs to calibration=\"off\""));
            }
            ("file", Some(file)) => CalibrationPolicy::File(file.clone()),
            ("kept", _) => CalibrationPolicy::Kept,
            ("measure", _) => CalibrationPolicy::Measure,
            (other, _) => {
                return Err(refused(format!(
                    "calibration is {other:?}, expected \"kept\", \"measure\", \"off\" or a file"
                )));
            }
        })
    }

    pub(super) fn map(&self) -> PyResult<SceneMap> {
        if let Some(values) = &self.scene_map {
            let reflectance = crate::arrays::slice(values)?.to_vec();
            let size_px = reflectance.len().isqrt();
            if let Some(at) = reflectance.iter().position(|v| !(0.0..=1.0).contains(v)) {
                let (row, column, value) = (at / size_px, at % size_px, reflectance[at]);
                return Err(refused(format!(
                    "scene is {value} at [{row}, {column}], expected 0 to 1"
                )));
            }
            return Ok(SceneMap {
                name: "array".to_owned(),
                size_px,
                reflectance,
                side_mm: self.scene_side_mm,
            });
        }
        let source: SceneSource =
            self.scene.as_deref().unwrap_or("letter:R").parse().map_err(refusal)?;
        source.load(SCENE_PX).map_err(refusal)
    }

    pub(super) fn optics(&self, model: &CameraModel) -> PyResult<VirtualOptics> {
        let distance_mm = self.distance_m.map_or(model.projector().focus_distance_mm, |m| m * 1e3);
        if !(distance_mm.is_finite() && distance_mm > 0.0) {
            let found = distance_mm / 1e3;
            return Err(refused(format!(
                "distance_m is {found}, expected a positive number of metres"
            )));
        }
        let optics = VirtualOptics::before(model, &self.map()?, distance_mm).map_err(refusal)?;
        let air = match &self.weather {
            Some(weather) => read_weather(weather).map_err(refusal)?,
            None => model.weather.air.clone(),
        };
        optics.in_air(&air).map_err(refusal)
    }
}
