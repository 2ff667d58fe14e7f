//! Exports a recording for other programs: arrays for NumPy, a table, a video, a recording with
//! images.
//!
//! # Invariant
//! An exported file holds the numbers that `reconstruct` uses: the image of the exported file is
//! the image of the recording before the flat field, to the bit
//! (`an_exported_file_gives_the_image_of_the_recording_to_the_bit` in `host/tests/export.rs`).
//! Frames are read some at a time, so memory does not grow with the readings of a recording.

mod arrays;
#[cfg(feature = "enhance")]
mod images;
#[cfg(feature = "enhance")]
mod mcap;
#[cfg(feature = "enhance")]
mod video;

use crate::files::FileError;
use crate::files::output::Existing;
use crate::provenance::Made;
use crate::recording::RecordingError;
use crate::source::{Frames, Source, SourceError, SourceOptions, Stamp};
use nirspi_optics::CameraModel;
use nirspi_recon::Measurements;
use nirspi_recon::reconstruct::AT_A_TIME;
use nirspi_recon::words::count;
use serde::Serialize;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use thiserror::Error;

/// The form of an exported file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Format {
    /// NumPy: several arrays.
    Npz,
    /// NumPy: one array.
    Npy,
    /// A table for spreadsheets.
    Csv,
    /// A recording with images, for viewers of MCAP files.
    #[cfg(feature = "enhance")]
    Mcap,
    /// A video.
    #[cfg(feature = "enhance")]
    Apng,
}

impl Format {
    /// Every format.
    pub const ALL: &'static [Self] = &[
        Self::Npz,
        Self::Npy,
        Self::Csv,
        #[cfg(feature = "enhance")]
        Self::Mcap,
        #[cfg(feature = "enhance")]
        Self::Apng,
    ];

    /// The name on the command line, and the ending of the file's name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Npz => "npz",
            Self::Npy => "npy",
            Self::Csv => "csv",
            #[cfg(feature = "enhance")]
            Self::Mcap => "mcap",
            #[cfg(feature = "enhance")]
            Self::Apng => "apng",
        }
    }

    /// The name of an exported file beside the recording: the same name with another ending.
    #[must_use]
    pub fn beside(self, recording: &Path) -> PathBuf {
        let name = recording.with_extension(self.name());
        if name == recording {
            recording.with_extension(format!("export.{}", self.name()))
        } else {
            name
        }
    }

    /// Whether the file holds readings alone. A flat field corrects images, not readings.
    fn holds_readings(self) -> bool {
        matches!(self, Self::Npz | Self::Npy | Self::Csv)
    }

    /// What a file of this format holds, in one line.
    #[must_use]
    pub fn about(self) -> &'static str {
        match self {
            Self::Npz => "n, h_row, d (mean of all frames), frames (F, M), sequence, times",
            Self::Npy => "the readings of each frame alone, (F, M)",
            Self::Csv => "n, h_row and d, the mean of all frames, one pattern a line",
            #[cfg(feature = "enhance")]
            Self::Mcap => "the recording with images for Foxglove and Rerun, 30 a second at most",
            #[cfg(feature = "enhance")]
            Self::Apng => "a video of the reconstructed frames",
        }
    }
}

impl FromStr for Format {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let names: Vec<&str> = Self::ALL.iter().map(|format| format.name()).collect();
        Self::ALL
            .iter()
            .copied()
            .find(|format| format.name() == name)
            .ok_or_else(|| format!("expected {}", names.join(", ")))
    }
}

/// How to export, and what the recording does not say.
#[derive(Debug, Clone, Default)]
pub struct ExportOptions {
    /// Whether to leave the leak between patterns uncorrected.
    pub keep_leak: bool,
    /// The description of the camera: the geometry of the images and the place of depth maps in them,
    /// two channels of MCAP files.
    pub model: Option<CameraModel>,
    /// Whether MCAP files also get the enhanced images, and how well each of their pixels repeats.
    pub enhance: bool,
    /// Whether a file of the same name is replaced. The recording itself never is.
    pub overwrite: bool,
}

/// What was exported.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Exported {
    /// The file.
    pub file: PathBuf,
    /// The form of the file.
    pub format: Format,
    /// Size of the file.
    pub bytes: u64,
    /// Frames of the recording that are in the file or in its mean.
    pub frames: usize,
    /// Patterns of a frame.
    pub patterns: usize,
    /// Images in the file.
    pub images: usize,
    /// What a user must know: what the recording lacks, and what contradicts its readings.
    pub warnings: Vec<String>,
    /// Notes about the recording.
    pub notes: Vec<String>,
}

impl fmt::Display for Exported {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { file, format, bytes, frames, patterns, images, .. } = self;
        let frames = count(*frames as u64, "frame");
        write!(f, "{}: {}, {frames} of {patterns} patterns", file.display(), format.name())?;
        if *images > 0 {
            write!(f, ", {}", count(*images as u64, "image"))?;
        }
        write!(f, ", {:.1} MB", *bytes as f64 / 1e6)
    }
}

/// Why a recording cannot be exported.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ExportError {
    /// The recording gives no measurements.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// The recording cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The file cannot be written, or the image of the scene cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The networks cannot be used.
    #[cfg(feature = "enhance")]
    #[error(transparent)]
    Weights(#[from] nirspi_nets::WeightsError),
    /// An image cannot be enhanced.
    #[cfg(feature = "enhance")]
    #[error("{}: the image of {time_ns} ns", .path.display())]
    Enhance {
        /// The recording.
        path: PathBuf,
        /// The time of the image.
        time_ns: u64,
        /// The problem.
        #[source]
        problem: crate::imaging::EnhanceError,
    },
    /// Images cannot be made.
    #[cfg(feature = "enhance")]
    #[error(transparent)]
    Images(#[from] crate::reconstruct::SolverError),
}

/// Exports a recording to the file `out`, which is whole or not made. The file holds its
/// provenance, of the recording and of the program `made`; an `.npy` file has no place for it and gets
/// a file `NAME.npy.json` beside it.
///
/// # Errors
/// [`ExportError`] names the file and the problem.
pub fn export(
    input: &Path,
    out: &Path,
    format: Format,
    options: &ExportOptions,
    made: &Made,
) -> Result<Exported, ExportError> {
    let existing = Existing::of(options.overwrite, Some(input));
    existing.check(out)?;
    let source = SourceOptions { keep_leak: options.keep_leak, ..SourceOptions::default() };
    let frames = Frames::open(input, &source)?;
    let whole = &Whole { source: frames.together()?, frames };
    let provenance = &whole.source.taken.made(made);
    let images = match format {
        Format::Npz => arrays::npz(whole, out, existing, provenance).map(|()| 0)?,
        Format::Npy => arrays::npy(whole, out, existing, provenance).map(|()| 0)?,
        Format::Csv => arrays::csv(whole, out, existing, provenance).map(|()| 0)?,
        #[cfg(feature = "enhance")]
        Format::Mcap => mcap::write((whole, input), out, options, provenance)?,
        #[cfg(feature = "enhance")]
        Format::Apng => video::apng((whole, input), out, existing, provenance)?,
    };
    let bytes = std::fs::metadata(out).map_or(0, |file| file.len());
    let (frames, patterns) = (whole.frames.len(), whole.source.measurements.rows().len());
    let (file, warnings) = (out.to_owned(), whole.source.all_warnings());
    let mut notes = whole.source.notes.clone();
    if whole.source.flat_field.is_some() && format.holds_readings() {
        notes.push(
            "readings are exported without the flat field that is kept for this camera, so their image has the \
             pattern of its LEDs"
                .to_owned(),
        );
    }
    Ok(Exported { file, format, bytes, frames, patterns, images, warnings, notes })
}

/// A recording that was read once.
struct Whole<'a> {
    frames: Frames<'a>,
    /// The mean of all frames.
    source: Source,
}

impl Whole<'_> {
    /// Whether no real light was measured.
    fn is_simulated(&self) -> bool {
        self.source.taken.simulated() == Some(true)
    }

    /// Reads the frames in their order.
    fn each(
        &self,
        mut on: impl FnMut(Stamp, &Measurements) -> Result<(), FileError>,
    ) -> Result<(), ExportError> {
        let reading = self.frames.read(AT_A_TIME)?;
        while let Some(frames) = reading.next() {
            let frames = frames?;
            let stamps: Vec<Stamp> = frames.iter().map(|frame| frame.last).collect();
            let all = self.frames.measurements(frames)?;
            stamps.iter().zip(&all).try_for_each(|(&stamp, frame)| on(stamp, frame))?;
        }
        Ok(())
    }
}
