//! Tables of archives and of sets by the virtual camera: the engine of `nirspi reconstruct DIR`.
//!
//! # Invariant
//! A table has the bytes of the program's table (`test_archive.py`).

use crate::errors::{of_file, refusal, refused};
use crate::orders::named;
use crate::work::{backend, long};
use crate::{measurement, reconstruct};
use nirspi::archive::{
    ArchiveError, ArchiveOptions, Grid, GridAxes, ImageFiles, RowReader, Shard, Work, archive,
    archive_part,
};
use nirspi::exposure::Length;
use nirspi::files::output::write_atomic;
use nirspi::reconstruct::Solver;
use nirspi::virtual_camera::{CameraModel, read_camera_model};
use nirspi_recon::Sampling;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

enum Kind {
    Files(Box<ImageFiles>),
    Grid(Box<Grid>),
}

impl Kind {
    fn work(&self) -> &dyn Work {
        match self {
            Self::Files(files) => &**files,
            Self::Grid(grid) => &**grid,
        }
    }
}

/// Files of an archive, or measurements by the virtual camera, with a method that is prepared once.
#[pyclass(frozen, module = "nirspi._nirspi")]
pub struct Table(Kind);

fn of_archive(error: ArchiveError) -> PyErr {
    match error {
        ArchiveError::File(error) => of_file(error),
        error => refusal(error),
    }
}

/// The values of every axis.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Axes {
    scenes: Vec<String>,
    weathers: Vec<String>,
    distances_m: Vec<f64>,
    orders: Vec<String>,
    samplings: Vec<String>,
    seeds: Vec<u64>,
    frames: u32,
}

impl Axes {
    fn checked(self) -> PyResult<GridAxes> {
        let share = |text: &String| {
            let wrong = |error| refused(format!("sampling is {text}, {error}"));
            text.parse::<Sampling>().map_err(wrong)
        };
        Ok(GridAxes {
            scenes: self.scenes,
            weathers: self.weathers,
            distances_m: self.distances_m,
            orders: self.orders.iter().map(|name| named(name)).collect::<PyResult<_>>()?,
            samplings: self.samplings.iter().map(share).collect::<PyResult<_>>()?,
            seeds: self.seeds,
            length: Length::Frames(self.frames, None),
        })
    }
}

#[pymethods]
impl Table {
    /// Files of a folder: those of these names, or all that are there.
    #[staticmethod]
    fn files(
        py: Python<'_>,
        folder: PathBuf,
        names: Option<Vec<String>>,
        source: &Bound<'_, PyDict>,
        options: &Bound<'_, PyDict>,
        dictionary: Option<PathBuf>,
        enhance: Option<&str>,
    ) -> PyResult<Self> {
        let source = source.extract::<measurement::Options>()?.checked()?;
        let recipe = options.extract::<reconstruct::Options<'_>>()?.recipe(dictionary)?;
        let device = enhance.map(backend).transpose()?.map(|(_, device)| device);
        long(py, |_| {
            let mut reader = RowReader::new(source, Solver::new(recipe).map_err(refusal)?);
            if let Some(device) = device {
                reader = reader.enhanced(device);
            }
            let files = match names {
                Some(names) => ImageFiles::named(&folder, names, reader),
                None => ImageFiles::of(&folder, reader).map_err(of_archive)?,
            };
            Ok(Self(Kind::Files(Box::new(files))))
        })
    }

    /// Every combination of these values, measured by the virtual camera.
    #[staticmethod]
    fn grid(
        py: Python<'_>,
        axes: &Bound<'_, PyDict>,
        model: Option<&str>,
        model_text: Option<&str>,
        options: &Bound<'_, PyDict>,
        dictionary: Option<PathBuf>,
    ) -> PyResult<Self> {
        let axes = axes.extract::<Axes>()?.checked()?;
        let recipe = options.extract::<reconstruct::Options<'_>>()?.recipe(dictionary)?;
        long(py, |_| {
            let model = match (model_text, model) {
                (Some(text), _) => CameraModel::parse(text).map_err(refusal)?,
                (None, Some(name)) => read_camera_model(name).map_err(refusal)?,
                (None, None) => CameraModel::paper().clone(),
            };
            let solver = Solver::new(recipe).map_err(refusal)?;
            let grid = Grid::new(axes, model, solver).map_err(refusal)?;
            Ok(Self(Kind::Grid(Box::new(grid))))
        })
    }

    /// The names of the items.
    fn names(&self) -> Vec<String> {
        self.0.work().names().to_vec()
    }

    /// What the rows depend on, as JSON.
    fn settings(&self) -> String {
        serde_json::Value::Object(self.0.work().settings()).to_string()
    }

    /// Makes the table, and the data card of a set: the report as JSON.
    fn run(
        &self,
        py: Python<'_>,
        out: PathBuf,
        jobs: Option<usize>,
        resume: bool,
        shard: Option<&str>,
    ) -> PyResult<String> {
        let shard = match shard {
            None => Shard::WHOLE,
            Some(text) => {
                text.parse().map_err(|error| refused(format!("shard is {text:?}, {error}")))?
            }
        };
        let jobs = match jobs {
            None => None,
            Some(jobs) => Some(
                NonZeroUsize::new(jobs).ok_or_else(|| refused("jobs is 0, expected at least 1"))?,
            ),
        };
        let options = ArchiveOptions { out, jobs, resume, shard };
        long(py, |stop| {
            let made = archive(self.0.work(), &options, stop, &mut |_| {}).map_err(of_archive)?;
            if let Kind::Grid(grid) = &self.0 {
                let card = options.out.with_extension("md");
                write_atomic(&card, grid.card(&made).as_bytes()).map_err(of_file)?;
            }
            json(&made)
        })
    }

    /// Makes a table of some items: the report as JSON.
    fn part(&self, py: Python<'_>, out: PathBuf, start: usize, end: usize) -> PyResult<String> {
        let out: &Path = &out;
        long(py, |stop| {
            json(&archive_part(self.0.work(), start..end, out, stop).map_err(of_archive)?)
        })
    }
}

fn json(report: &impl serde::Serialize) -> PyResult<String> {
    serde_json::to_string(report).map_err(|error| refused(error.to_string()))
}
