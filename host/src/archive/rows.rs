//! The rows of one file: its measurements, their images, and what is known of them.

use super::place::Place;
use super::{ArchiveError, Work};
use crate::causes::in_one_line;
use crate::dataset::Row;
use crate::export::{ExportError, Whole};
#[cfg(feature = "enhance")]
use crate::imaging::FramesError;
use crate::imaging::MethodReport;
use crate::reconstruct::{Solved, Solver, SolverError};
use crate::source::{Index, OutlierReport, Source, SourceError, SourceOptions};
#[cfg(feature = "enhance")]
use nirspi_nets::Device;
use nirspi_recon::Measurements;
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Reads files, and makes their images. It is prepared once and used for any number of files, from
/// any number of threads.
pub struct RowReader {
    source: SourceOptions,
    solver: Solver,
    #[cfg(feature = "enhance")]
    enhance: Option<Device>,
}

/// Why a file gives no rows.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RowsError {
    /// The file gives no measurements.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// The recording cannot be read.
    #[error(transparent)]
    Recording(Box<ExportError>),
    /// A measurement gives no image.
    #[error(transparent)]
    Solver(#[from] SolverError),
    /// The networks refuse an image.
    #[cfg(feature = "enhance")]
    #[error("{}: not enhanced", .path.display())]
    Enhance {
        /// The file.
        path: PathBuf,
        /// The problem.
        #[source]
        problem: Box<FramesError>,
    },
    /// Networks take real images only.
    #[error("{}: complex readings, expected real ones for the networks: choose a part with --part real or --part imaginary", .0.display())]
    Complex(PathBuf),
}

impl RowReader {
    /// Reads files with these options and makes images by this solver. Every measurement of a file
    /// is a row, or that of [`Index::One`]; a recording is one row, or one row for each frame with
    /// [`Index::All`].
    #[must_use]
    pub fn new(source: SourceOptions, solver: Solver) -> Self {
        Self {
            source,
            solver,
            #[cfg(feature = "enhance")]
            enhance: None,
        }
    }

    /// The same with networks that enlarge and deblur the images. All images of a file have one
    /// white level, as those of a video. Each thread makes the networks once.
    #[cfg(feature = "enhance")]
    #[must_use]
    pub fn enhanced(self, device: Device) -> Self {
        Self { enhance: Some(device), ..self }
    }

    /// Whether networks enhance the images.
    fn enhances(&self) -> bool {
        #[cfg(feature = "enhance")]
        return self.enhance.is_some();
        #[cfg(not(feature = "enhance"))]
        false
    }

    /// The rows of the file at `path`, which the table calls `name`.
    ///
    /// # Errors
    /// [`RowsError`] names the file and the problem. A file of which one measurement gives no image
    /// gives none.
    pub fn rows(&self, path: &Path, name: &str) -> Result<Vec<Row>, RowsError> {
        let read = match self.source.fits_recording(path)? {
            true => self.of_recording(path).map_err(|error| RowsError::Recording(error.into()))?,
            false => self.of_file(path)?,
        };
        if self.enhances() && read.iter().any(|(_, source)| source.imaginary.is_some()) {
            return Err(RowsError::Complex(path.to_owned()));
        }
        let several = read.len() > 1;
        let (mut rows, mut used) = (Vec::new(), Vec::new());
        for (index, (row, source)) in read.into_iter().enumerate() {
            let solved = self.solver.solve(path, &source)?;
            let image_id = match several {
                true => format!("{name}#{index}"),
                false => name.to_owned(),
            };
            let known = Row {
                image_id,
                file: Some(name.to_owned()),
                index: Some(match self.source.index {
                    Some(Index::One(one)) => one as i64,
                    _ => index as i64,
                }),
                imaginary: source.imaginary.as_ref().map(|part| part.values().to_vec()),
                image: Some(solved.image.pixels().to_vec()),
                meta: meta(row.meta.as_str(), &source, &solved),
                ..row
            };
            rows.push(known);
            used.push((solved.image, solved.used));
        }
        self.enhance_all(path, &used, &mut rows)?;
        Ok(rows)
    }

    #[cfg(feature = "enhance")]
    fn enhance_all(
        &self,
        path: &Path,
        used: &[(nirspi_recon::Image, Measurements)],
        rows: &mut [Row],
    ) -> Result<(), RowsError> {
        let Some(device) = &self.enhance else { return Ok(()) };
        let frames: Vec<_> = used.iter().map(|(image, used)| (image, used.rows())).collect();
        let (pixels, reports) = super::networks::enhance(device, &frames).map_err(|problem| {
            RowsError::Enhance { path: path.to_owned(), problem: problem.into() }
        })?;
        let images = pixels.chunks_exact(pixels.len() / rows.len().max(1));
        for ((row, image), report) in rows.iter_mut().zip(images).zip(reports) {
            row.enhanced = Some(image.to_vec());
            let mut meta: Value = serde_json::from_str(&row.meta).unwrap_or_default();
            meta["enhancement"] = json!(report);
            row.meta = meta.to_string();
        }
        Ok(())
    }

    #[cfg(not(feature = "enhance"))]
    #[allow(clippy::unnecessary_wraps, clippy::unused_self, reason = "there are no networks")]
    fn enhance_all(
        &self,
        _path: &Path,
        _used: &[(nirspi_recon::Image, Measurements)],
        _rows: &mut [Row],
    ) -> Result<(), RowsError> {
        Ok(())
    }

    fn of_file(&self, path: &Path) -> Result<Vec<(Row, Source)>, SourceError> {
        let sources = match self.source.index {
            Some(Index::One(_)) => vec![Source::read(path, &self.source)?],
            _ => Source::read_all(path, &self.source)?,
        };
        let row = |source: Source| {
            let row = Row { simulated: source.taken.simulated(), ..row_of(&source.measurements) };
            (row, source)
        };
        Ok(sources.into_iter().map(row).collect())
    }

    fn of_recording(&self, path: &Path) -> Result<Vec<(Row, Source)>, ExportError> {
        if self.source.index != Some(Index::All) {
            let sum = |whole: Whole| {
                let Row { rows, d, .. } = row_of(&whole.source.measurements);
                (Row { rows, d, ..whole.row() }, whole.source)
            };
            return Ok(Whole::read_each(path, &self.source)?.into_iter().map(sum).collect());
        }
        let whole = Whole::read(path, &self.source)?;
        let fixed = whole.row();
        let mut frames = Vec::new();
        whole.each(|frame| {
            let source = whole.source.clone();
            let source = Source { measurements: frame.measurements.clone(), ..source };
            frames.push((whole.row_of(&fixed, frame), source));
            Ok(())
        })?;
        Ok(frames)
    }
}

fn row_of(measurements: &Measurements) -> Row {
    Row {
        n: measurements.side().pixels() as u32,
        rows: measurements.rows().as_slice().to_vec(),
        d: measurements.values().to_vec(),
        ..Row::default()
    }
}

/// What is known of an image beside the columns.
pub(super) fn meta(of_camera: &str, source: &Source, solved: &Solved) -> String {
    let mut meta: Map<String, Value> = serde_json::from_str(of_camera).unwrap_or_default();
    let method: &MethodReport = &solved.report;
    let dropouts = source.dropouts.iter().map(
        |lost| json!({ "first_reading": lost.start, "readings": lost.length, "rows": lost.rows }),
    );
    let made = json!({
        "report": method,
        "used": solved.used.rows().len(),
        "order": solved.order,
        "dropouts": dropouts.collect::<Vec<_>>(),
        "outliers": source.outliers.iter().map(OutlierReport::of).collect::<Vec<_>>(),
        "not_read": source.not_read,
        "frames": source.frames,
        "warnings": source.warnings,
        "notes": source.notes,
    });
    meta.insert("reconstruction".to_owned(), made);
    Value::Object(meta).to_string()
}

/// The files of a folder, each of which becomes rows.
pub struct ImageFiles {
    folder: Place,
    names: Vec<String>,
    reader: RowReader,
}

impl ImageFiles {
    /// The measurement files in a folder and the folders below.
    ///
    /// # Errors
    /// [`ArchiveError`] if the folder has no measurement files.
    pub fn of(folder: &Path, reader: RowReader) -> Result<Self, ArchiveError> {
        let folder = Place::of(folder);
        Ok(Self { names: folder.find()?, folder, reader })
    }

    /// These files, as paths relative to the folder with `/` between names. Files that are not there
    /// give no rows.
    #[must_use]
    pub fn named(folder: &Path, names: Vec<String>, reader: RowReader) -> Self {
        Self { folder: Place::of(folder), names, reader }
    }
}

impl Work for ImageFiles {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn settings(&self) -> Map<String, Value> {
        let mut settings = self.reader.solver.settings();
        settings.insert("input".to_owned(), self.reader.source.key());
        settings.insert("enhance".to_owned(), self.reader.enhances().into());
        settings
    }

    fn rows(&self, item: usize) -> Result<Vec<Row>, String> {
        let name = &self.names[item];
        let rows = |path: &Path| self.reader.rows(path, name).map_err(|error| in_one_line(&error));
        self.folder.with_file(name, rows)
    }
}
