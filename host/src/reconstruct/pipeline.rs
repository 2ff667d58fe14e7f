//! From measurements to images and pictures: one measurement, all of a file or recording, many files.
//!
//! ```no_run
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let made = nirspi::provenance::Made::by("my program", None, ["my program"], 0);
//! # let (file, out) = (std::path::Path::new("rec.mcap"), std::path::Path::new("out"));
//! use nirspi::reconstruct::{Pipeline, Recipe, ResultFolder, Solver};
//! use nirspi::source::{Source, SourceOptions};
//! let pipeline = Pipeline::new(Solver::new(Recipe::default())?).with_networks("cpu".parse()?)?;
//! let source = Source::read(file, &SourceOptions::default())?;
//! let folder = ResultFolder::of_file(file, out, &made, Default::default());
//! let report = pipeline.one(source, &folder, Default::default())?;
//! # Ok(())
//! # }
//! ```
//!
//! # Invariant
//! The program `nirspi` gives the pictures that a program of this kind gives, for one measurement and for stacks
//! (`one_recording_gives_one_picture_through_every_door` in `host/cli/tests/cli/doors.rs`).

use super::many::{FileImage, Part, Series, file_images, many_images};
use super::one::{OneReport, one_image};
use super::pipeline_error::PipelineError;
use super::stack::{StackReport, Writing};
use super::watch::{Step, Watch};
use super::{Networks, NetworksError, ResultFolder, Solver, SolverError};
use crate::source::{Source, SourceOptions, Sources};
use crate::stage_times::StageTimes;
use nirspi_recon::Backend;
use nirspi_recon::reconstruct::{AT_A_TIME, ReconstructError};
use nirspi_recon::words::count_of;
use std::path::PathBuf;
use std::sync::mpsc::sync_channel;
use std::thread;

/// Files whose readings are in memory together, and are one stack: many small ones, fewer large ones. `side` is that of their
/// images, if it is known.
fn files_at_a_time(side: Option<usize>) -> usize {
    const FEWEST: usize = 256;
    const PIXELS: usize = AT_A_TIME * 32 * 32;
    side.map_or(FEWEST, |n| (PIXELS / (n * n)).clamp(FEWEST, AT_A_TIME))
}

/// A method, and the networks that also enlarge and deblur its images, if they are wanted.
pub struct Pipeline {
    solver: Solver,
    networks: Option<Networks>,
}

impl Pipeline {
    /// Images by this method alone.
    #[must_use]
    pub fn new(solver: Solver) -> Self {
        Self { solver, networks: None }
    }

    /// The same, with networks after it, on this backend. A GPU that fails in the middle of a stack gets fewer images at a time,
    /// and then the processor takes over.
    ///
    /// # Errors
    /// [`NetworksError`] if the requested device is missing, or the built-in weights are damaged.
    pub fn with_networks(self, backend: Backend) -> Result<Self, NetworksError> {
        Ok(Self { networks: Some(Networks::on(backend)?), ..self })
    }

    /// Makes one image and writes it with its pictures and its report.
    ///
    /// # Errors
    /// [`PipelineError`] names the file and the problem. Nothing is left behind.
    pub fn one(
        &self,
        source: Source,
        folder: &ResultFolder<'_>,
        times: StageTimes,
    ) -> Result<OneReport, PipelineError> {
        one_image(&self.solver, self.networks.as_ref(), source, folder, times)
    }

    /// Makes the images of all measurements of a file or recording, in their order, and writes `image.npy`, `enhanced.npy`, the
    /// pictures and `report.json`. What is the same for measurements of [one kind](nirspi_recon::reconstruct::stack) is found
    /// out once. With [`ResultFolder::warm_start`], each frame starts from the frames before, and all are in memory together.
    ///
    /// Where a measurement cannot be read, the images of those before it are written, and where images cannot be made, those of
    /// the batches before; [`StackReport::ended`] says why there are no more.
    ///
    /// # Errors
    /// [`PipelineError`] if there is no image at all, or a result cannot be written. Nothing is left behind.
    pub fn all(
        &self,
        mut sources: Sources<'_>,
        folder: &ResultFolder<'_>,
        watch: Watch<'_>,
        mut times: StageTimes,
    ) -> Result<StackReport, PipelineError> {
        let most = match folder.warm_start {
            true => sources.fit_together().map(|()| usize::MAX)?,
            false => AT_A_TIME,
        };
        let (series, several, mut number) = (Series::of(&self.solver), sources.len() > 1, 0);
        let batches = sources.batches(most)?;
        let (writing, ended) = thread::scope(|scope| {
            let (to, from) = sync_channel(0);
            // Also ends when the receiver is gone, because the run was stopped or has failed.
            scope.spawn(move || batches.map(|batch| to.send(batch)).all(|sent| sent.is_ok()));
            self.writing_beside(folder, &mut times, move |times| {
                let batch = times.time("read", || from.recv()).ok()?;
                let part = Part { from: number, several };
                let images = batch.map_err(PipelineError::from).and_then(|batch| {
                    times.time("reconstruct", || of_batch(&batch, &series, part, folder, watch))
                });
                number += images.as_ref().map_or(0, Vec::len);
                Some(images)
            })
        });
        match writing {
            Some(writing) => {
                writing.finish(Vec::new(), ended, self.networks.as_ref(), watch, times)
            }
            None => Err(ended.unwrap_or_else(|| PipelineError::Empty(folder.input.to_owned()))),
        }
    }

    /// Makes the images of many files, and writes them as one stack: of each all measurements, or one or all frames, as
    /// [`SourceOptions::index`] says. What is the same for measurements of [one kind](nirspi_recon::reconstruct::stack) is found
    /// out once for files that are in memory together. A file that gives no image is among [`StackReport::skipped`].
    ///
    /// # Errors
    /// As [`all`](Self::all).
    pub fn files(
        &self,
        files: &[PathBuf],
        options: &SourceOptions,
        folder: &ResultFolder<'_>,
        watch: Watch<'_>,
        mut times: StageTimes,
    ) -> Result<StackReport, PipelineError> {
        let (mut skipped, mut left) = (Vec::new(), files);
        let mut series = Series::of(&self.solver);
        let (writing, ended) = self.writing_beside(folder, &mut times, |times| {
            let (some, rest) = left.split_at(files_at_a_time(series.side).min(left.len()));
            left = rest;
            if some.is_empty() {
                return None;
            }
            let goes_on = || watch(Step::Reconstruct);
            let made =
                times.time("reconstruct", || many_images(some, options, &mut series, &goes_on));
            skipped.extend(made.skipped);
            Some(if made.stopped { Err(PipelineError::Stopped) } else { Ok(made.images) })
        });
        match (writing, ended) {
            (Some(writing), ended) => {
                writing.finish(skipped, ended, self.networks.as_ref(), watch, times)
            }
            (None, Some(ended)) => Err(ended),
            (None, None) => {
                let reason = skipped.into_iter().next().map(|skipped| skipped.reason);
                let (files, reason) = (count_of(files.len(), "file"), reason.unwrap_or_default());
                Err(PipelineError::NoneOf { files, reason })
            }
        }
    }

    /// Writes the images that `next` makes until it makes none or fails, while it makes those after them. Also gives the error
    /// that ended them, of making or of writing.
    fn writing_beside<'p>(
        &self,
        folder: &'p ResultFolder<'p>,
        times: &mut StageTimes,
        mut next: impl FnMut(&mut StageTimes) -> Option<Result<Vec<FileImage>, PipelineError>>,
    ) -> (Option<Writing<'p>>, Option<PipelineError>) {
        let (to, from) = sync_channel::<Vec<FileImage>>(0);
        let enhanced = self.networks.is_some();
        thread::scope(|scope| {
            let writer = scope.spawn(move || {
                let mut writing = None;
                let write = |images: Vec<FileImage>| {
                    let Some(first) = images.first() else { return Ok(()) };
                    let writing = match &mut writing {
                        Some(writing) => writing,
                        none => none.insert(Writing::new(folder, enhanced, first)?),
                    };
                    writing.add(&images)
                };
                let failed = from.iter().map(write).find_map(Result::err);
                (writing, failed)
            });
            let mut ended = None;
            while let Some(images) = next(times) {
                match images {
                    Ok(images) => {
                        if times.time("write", || to.send(images)).is_err() {
                            // The writer has ended with an error, which `join` gives.
                            break;
                        }
                    }
                    Err(error) => {
                        ended = Some(error);
                        break;
                    }
                }
            }
            drop(to);
            let (writing, failed) = times
                .time("write", || writer.join())
                .unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            (writing, failed.or(ended))
        })
    }
}

/// The images of some measurements of a file.
fn of_batch(
    batch: &[Source],
    series: &Series<'_>,
    part: Part,
    folder: &ResultFolder<'_>,
    watch: Watch<'_>,
) -> Result<Vec<FileImage>, PipelineError> {
    let going_on = || match watch(Step::Reconstruct) {
        true => Ok(()),
        false => Err(ReconstructError::Stopped),
    };
    let made = file_images(folder.input, batch, series, part, folder.warm_start, &going_on);
    made.map_err(|error| match error {
        SolverError::Method(ReconstructError::Stopped) => PipelineError::Stopped,
        error => error.into(),
    })
}
