//! The learned stages: enlarging and deblurring.

use crate::arrays::{array, side, slice, whole};
use crate::errors::{refusal, refused};
use crate::work::{backend, long};
use nirspi::imaging::{Deblurring, enhance_frames};
use nirspi::stage_times::StageTimes;
use nirspi_nets::deblur::{self as deblurring, Model};
use nirspi_nets::{Enhanced, Images, KnownEstimate, Method, Networks, Options, classical, fusion};
use nirspi_recon::{Image, Rows};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use std::hash::{DefaultHasher, Hasher};
use std::num::NonZeroU32;

type Made<'py> = (Bound<'py, PyArray1<f32>>, String);

/// Word and description of every network and classical method that deblurs.
#[pyfunction]
pub fn deblur_models() -> Vec<(&'static str, &'static str)> {
    let networks = Model::ALL.into_iter().map(|model| (model.name(), model.about()));
    let classical = classical::Method::ALL.into_iter().map(|m| (m.name(), m.about()));
    networks.chain(classical).collect()
}

/// What the caller knows and wants.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Known {
    blur_px: Option<f32>,
    noise: Option<f32>,
    consistency: bool,
    seed: u64,
    steps: Option<u32>,
    device: String,
}

impl Known {
    fn options(&self) -> PyResult<Options> {
        let within = |name: &str, value: Option<f32>, most: f32| match value {
            Some(value) if !(0.0..=most).contains(&value) => {
                Err(refused(format!("{name} is {value}, expected 0 to {most}")))
            }
            _ => Ok(()),
        };
        within("blur_px", self.blur_px, 16.0)?;
        within("noise", self.noise, 1.0)?;
        Ok(Options {
            consistency: self.consistency,
            estimate: KnownEstimate { sigma_px: self.blur_px.into(), noise: self.noise.into() },
            seed: self.seed,
            ..Options::default()
        })
    }

    fn method(&self, model: Model) -> PyResult<Method> {
        let steps = match self.steps {
            None => None,
            Some(steps) => Some(
                NonZeroU32::new(steps).ok_or_else(|| refused("steps is 0, expected at least 1"))?,
            ),
        };
        Method::new(model, steps).map_err(|error| refused(format!("steps: {error}")))
    }
}

fn report(words: &Deblurring) -> PyResult<String> {
    let mut report = serde_json::to_value(words).map_err(|error| refused(error.to_string()))?;
    report["words"] = words.line().into();
    Ok(report.to_string())
}

fn made<'py>(
    py: Python<'py>,
    result: Enhanced,
    model: &str,
    steps: u32,
    options: &Options,
) -> PyResult<Made<'py>> {
    let words = Deblurring::of(model, steps, options.consistency, options.seed, &result);
    Ok((array(py, result.images), report(&words)?))
}

/// Images of 32 x 32 in [0, 1] to 64 x 64: `nirspi enhance`.
#[pyfunction]
pub fn enhance<'py>(
    py: Python<'py>,
    values: PyReadonlyArray1<'py, f32>,
    known: &Bound<'py, PyDict>,
) -> PyResult<Made<'py>> {
    let known: Known = known.extract()?;
    let options = known.options()?;
    let method = known.method(Model::DIFFUSION)?;
    let values = slice(&values)?;
    let images = Images::<{ fusion::SIDE }>::new(values).map_err(refusal)?;
    let device = backend(&known.device)?.1;
    let result = long(py, |_| {
        let enhancer = Networks::built_in(device).enhancer(method).map_err(refusal)?;
        enhancer.enhance(images, None, &options, &mut |_| {}).map_err(refusal)
    })?;
    made(py, result, "diffusion", method.steps().get(), &options)
}

/// Images of 64 x 64 in [0, 1], deblurred: `nirspi deblur`.
#[pyfunction]
#[pyo3(name = "deblur")]
pub fn deblur<'py>(
    py: Python<'py>,
    values: PyReadonlyArray1<'py, f32>,
    model: &str,
    known: &Bound<'py, PyDict>,
) -> PyResult<Made<'py>> {
    let known: Known = known.extract()?;
    let options = known.options()?;
    let values = slice(&values)?;
    let images = Images::<{ deblurring::SIDE }>::new(values).map_err(refusal)?;
    let device = backend(&known.device)?.1;
    if let Some(network) = Model::ALL.into_iter().find(|network| network.name() == model) {
        let method = known.method(network)?;
        let result = long(py, |_| {
            let sharpener = Networks::built_in(device).sharpener(method).map_err(refusal)?;
            sharpener.deblur(images, &options, &mut |_| {}).map_err(refusal)
        })?;
        return made(py, result, model, method.steps().get(), &options);
    }
    let classical = classical::Method::ALL.into_iter().find(|m| m.name() == model);
    let classical = classical.ok_or_else(|| {
        let names: Vec<&str> = deblur_models().into_iter().map(|(name, _)| name).collect();
        refused(format!("model is {model:?}, expected one of: {}", names.join(", ")))
    })?;
    if known.steps.is_some_and(|steps| steps > 1) {
        return Err(refused("steps belongs to networks"));
    }
    let result = long(py, |_| {
        let estimator = Networks::built_in(device).estimator().map_err(refusal)?;
        classical::deblur_all(classical, images, &estimator, options.estimate, &mut || {})
            .map_err(refusal)
    })?;
    let options = Options { consistency: false, ..options };
    made(py, result, model, 1, &options)
}

/// A number for each image of n x n pixels, another one as soon as a pixel is another.
#[pyfunction]
pub fn fingerprints<'py>(
    py: Python<'py>,
    values: PyReadonlyArray1<'py, f32>,
    n: usize,
) -> PyResult<Bound<'py, PyArray1<u64>>> {
    let values = slice(&values)?;
    whole("the images", values.len(), n * n)?;
    let print = |image: &[f32]| {
        let mut hasher = DefaultHasher::new();
        image.iter().for_each(|pixel| hasher.write_u32(pixel.to_bits()));
        hasher.finish()
    };
    Ok(array(py, values.par_chunks_exact(n * n).map(print).collect()))
}

/// Images in the units of the readings, 32 x 32 or 64 x 64, enlarged and deblurred as by `nirspi reconstruct --enhance`,
/// with a report of each as JSON. `shown` are the rows of each image, or those of all images.
#[pyfunction]
pub fn enhance_readings<'py>(
    py: Python<'py>,
    n: u64,
    values: PyReadonlyArray1<'py, f32>,
    shown: Vec<PyReadonlyArray1<'py, i64>>,
) -> PyResult<(Bound<'py, PyArray1<f32>>, Vec<String>)> {
    let side = side(n)?;
    let values = slice(&values)?;
    let count = whole("the images", values.len(), side.area())?;
    let rows: Vec<Rows> =
        shown.iter().map(|rows| crate::arrays::rows(side, rows)).collect::<PyResult<_>>()?;
    if rows.len() != count && rows.len() != 1 {
        return Err(refused(format!("{} lists of rows for {count} images", rows.len())));
    }
    let (pixels, reports) = long(py, |_| {
        let images: Vec<Image> = values
            .chunks_exact(side.area())
            .map(|image| Image::new(side, image.to_vec()))
            .collect();
        let frames: Vec<(&Image, &Rows)> =
            images.iter().enumerate().map(|(k, image)| (image, &rows[k % rows.len()])).collect();
        let (pixels, reports) =
            enhance_frames(&frames, &mut StageTimes::default()).map_err(refusal)?;
        let reports: Vec<String> = reports
            .iter()
            .map(|report| {
                let mut json =
                    serde_json::to_value(report).map_err(|error| refused(error.to_string()))?;
                json["words"] = report.line().into();
                Ok(json.to_string())
            })
            .collect::<PyResult<_>>()?;
        Ok((pixels, reports))
    })?;
    Ok((array(py, pixels), reports))
}
