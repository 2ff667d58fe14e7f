//! Measurements of a file or recording, side by side: one array of differences, whatever the file holds.

use crate::arrays::{array, fill, room};
use crate::errors::of_source;
use crate::made::said;
use crate::measurement::{FlatField, Lost, Options, lost, numbers, warnings};
use crate::work::{heavy, long};
use nirspi::source::{Index, Several, Source};
use nirspi_recon::Measurements;
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// One measurement, or several of the same scene side by side.
#[pyclass(frozen, get_all, module = "nirspi._nirspi")]
pub struct Loaded {
    /// Side of the images.
    n: usize,
    /// The rows that any of the measurements has.
    rows: Py<PyArray1<i64>>,
    /// Number of measurements; `None` for one that was asked for alone.
    count: Option<usize>,
    /// The differences of one measurement after another, one for each of `rows`. NaN: not read.
    d: Py<PyArray1<f64>>,
    /// The imaginary parts of complex differences.
    imaginary: Option<Py<PyArray1<f64>>>,
    /// The drop-outs of each measurement.
    dropouts: Vec<Vec<Lost>>,
    /// Positions, in the order shown, of patterns that no measurement has read.
    not_read: Vec<usize>,
    /// The file's own image of each measurement.
    references: Option<Py<PyArray1<f32>>>,
    /// Frames of a recording: received, lost, corrupt, late.
    frames: Option<(u64, u64, u64, u64)>,
    notes: Vec<String>,
    /// What a recording lacks.
    damage: Option<String>,
    flat_field: Option<Py<FlatField>>,
    /// Where the readings come from, as JSON.
    taken: String,
    /// Standard deviation of the noise of a difference of each measurement; NaN where it is not known. `None` if it is known
    /// of none.
    noise: Option<Vec<f64>>,
    /// What it is at most, in the same form, if sums of patterns and complements say it.
    most_noise: Option<Vec<f64>>,
}

/// The measurements of a file or recording: one, or all with `index` "all".
#[pyfunction]
pub fn load(py: Python<'_>, path: PathBuf, options: &Bound<'_, PyDict>) -> PyResult<Loaded> {
    let options = options.extract::<Options>()?.checked()?;
    if options.index != Some(Index::All) {
        let source = long(py, |_| Source::read(&path, &options).map_err(of_source))?;
        return Loaded::of(py, vec![source], false);
    }
    let sources = match long(py, |_| Several::of(&path, &options).map_err(of_source))? {
        Some(mut several) => {
            if let Some(block) = Loaded::block(py, &path, &mut several)? {
                return Ok(block);
            }
            long(py, |_| several.each().map_err(of_source))?
        }
        None => long(py, |_| Source::read_all(&path, &options).map_err(of_source))?,
    };
    Loaded::of(py, sources, true)
}

impl Loaded {
    /// The measurements of a file that has them side by side itself; `None` for a file whose measurements differ in
    /// their patterns, or are no real differences.
    fn block(py: Python<'_>, path: &Path, several: &mut Several<'_>) -> PyResult<Option<Self>> {
        let Some(stack) = long(py, |_| several.stack().map_err(of_source))? else {
            return Ok(None);
        };
        let d = room::<f64>(py, stack.count() * stack.rows().len())?;
        {
            let mut place = d.readwrite();
            let values = fill(&mut place)?;
            if !long(py, |_| stack.read_into(values).map_err(|error| of_source(error.into())))? {
                return Ok(None);
            }
        }
        let known: Vec<_> = (0..stack.count()).map(|index| stack.noise(index)).collect();
        Ok(Some(Self {
            n: stack.side().pixels(),
            rows: array(py, numbers(stack.rows())).unbind(),
            count: Some(stack.count()),
            d: d.unbind(),
            imaginary: None,
            dropouts: vec![Vec::new(); stack.count()],
            not_read: Vec::new(),
            references: stack.references().map(|images| array(py, images).unbind()),
            frames: None,
            notes: stack.notes().to_vec(),
            damage: None,
            flat_field: None,
            taken: said(&stack.taken().clone().from_file(path))?,
            noise: of_each(known.iter().map(|[known, _]| *known)),
            most_noise: of_each(known.iter().map(|[_, most]| *most)),
        }))
    }

    /// Measurements that were read one by one, at least one.
    pub(crate) fn of(py: Python<'_>, sources: Vec<Source>, several: bool) -> PyResult<Self> {
        let first = &sources[0];
        let side = first.measurements.side();
        let rows = rows_of_any(&sources);
        let complex = first.imaginary.is_some();
        let d = aligned(py, &rows, &sources, |source| Some(&source.measurements))?;
        let imaginary = match complex {
            true => Some(aligned(py, &rows, &sources, |source| source.imaginary.as_ref())?),
            false => None,
        };
        let not_read = first.not_read.iter().copied();
        let in_none =
            |k: &usize| sources.iter().all(|source| source.not_read.binary_search(k).is_ok());
        let references: Option<Vec<&[f32]>> =
            sources.iter().map(|source| Some(source.reference.as_ref()?.pixels())).collect();
        let mut notes: Vec<String> = Vec::new();
        for source in &sources {
            let said = warnings(&source.outliers, source.warnings.iter().cloned());
            for note in source.notes.iter().cloned().chain(said) {
                if !notes.contains(&note) {
                    notes.push(note);
                }
            }
        }
        let flat_field = first.flat_field.clone();
        let taken = said(&first.taken)?;
        let noise = of_each(sources.iter().map(|source| source.measurements.noise()));
        let most_noise = of_each(sources.iter().map(|source| source.measurements.most_noise()));
        Ok(Self {
            n: side.pixels(),
            rows: array(py, rows.iter().map(|&row| i64::from(row)).collect()).unbind(),
            count: several.then_some(sources.len()),
            d,
            imaginary,
            not_read: not_read.filter(in_none).collect(),
            references: references.map(|images| array(py, images.concat()).unbind()),
            frames: first.frames.map(|c| (c.received, c.lost, c.corrupt, c.late)),
            notes,
            damage: first.damage.clone(),
            taken,
            noise,
            most_noise,
            flat_field: flat_field.map(|flat| Py::new(py, FlatField(flat))).transpose()?,
            dropouts: sources.into_iter().map(|source| lost(source.dropouts)).collect(),
        })
    }
}

/// What is known of each measurement, NaN where it is not; `None` if it is known of none.
fn of_each(known: impl Iterator<Item = Option<f64>> + Clone) -> Option<Vec<f64>> {
    let any = known.clone().any(|one| one.is_some());
    any.then(|| known.map(|one| one.unwrap_or(f64::NAN)).collect())
}

/// The rows of all measurements, parts of one order, in an order of which each measurement's rows are a part.
fn rows_of_any(sources: &[Source]) -> Vec<u32> {
    let each = || sources.iter().map(|source| source.measurements.rows());
    let mut all = Vec::new();
    for rows in each() {
        if rows.len() > all.len() {
            all = rows.to_vec();
        }
    }
    let mut known: HashSet<u32> = all.iter().copied().collect();
    for rows in each() {
        // Most measurements of a file have the same rows.
        if rows.as_slice() == all {
            continue;
        }
        let mut before = None;
        for &row in rows.iter() {
            if known.insert(row) {
                let at = before.and_then(|before| all.iter().position(|&row| row == before));
                all.insert(at.map_or(0, |at| at + 1), row);
            }
            before = Some(row);
        }
    }
    all
}

/// The values of all measurements, one for each of `rows`; NaN where a measurement has none.
fn aligned<'s>(
    py: Python<'_>,
    rows: &[u32],
    sources: &'s [Source],
    part: impl Fn(&'s Source) -> Option<&'s Measurements> + Sync,
) -> PyResult<Py<PyArray1<f64>>> {
    let made = room::<f64>(py, rows.len() * sources.len())?;
    {
        let mut place = made.readwrite();
        let places = fill(&mut place)?;
        heavy(py, || {
            let mut position = vec![0; rows.iter().max().map_or(0, |&last| last as usize + 1)];
            for (at, &row) in rows.iter().enumerate() {
                position[row as usize] = at;
            }
            places.par_chunks_exact_mut(rows.len()).zip(sources).for_each(|(places, source)| {
                places.fill(f64::NAN);
                let Some(found) = part(source) else { return };
                for (&row, value) in found.rows().iter().zip(found.values()) {
                    places[position[row as usize]] = *value;
                }
            });
            Ok(())
        })?;
    }
    Ok(made.unbind())
}
