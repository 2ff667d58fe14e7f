//! Where measurements come from: a file of anybody's, a recording, or a capture that has just ended.

use crate::account::LossCounters;
use crate::capture::Capture;
use crate::files::FileError;
use crate::files::npz::{self, MeasurementFile, Readings, Selection};
use crate::integrate::{IntegrateError, Integrated};
use crate::recording::{End, Recording, RecordingError};
use crate::tally::{self, Misfit, Tally, tally_recording};
use nirspi_recon::{Dropout, Image, MeasurementError, Measurements, Order, reconstruct};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use thiserror::Error;

/// How to read measurements.
#[derive(Debug, Clone, Copy, Default)]
pub struct SourceOptions {
    /// Which measurement of a file that holds several. Of a recording: `All` gives each frame, anything else their sum.
    pub index: Option<Index>,
    /// The file's `y` holds one reading a pattern, taken without complements.
    pub non_differential: bool,
    /// Leave the leak from pattern to pattern of a recording as it is.
    pub keep_leak: bool,
}

/// A measurement of several.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Index {
    /// This one.
    One(usize),
    /// Each.
    All,
}

impl FromStr for Index {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "all" => Ok(Self::All),
            _ => text.parse().map(Self::One).map_err(|_| "expected a number or all".to_owned()),
        }
    }
}

/// Which patterns come first where only a share of them is used.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum FirstPatterns {
    /// As recorded, unless that is the natural order, whose first part cannot resolve an image.
    #[default]
    Automatic,
    /// As recorded.
    Recorded,
    /// Those of this order.
    Of(Order),
}

impl FirstPatterns {
    /// The first `sampling` (0 to 1) of all patterns, and the order in words.
    ///
    /// # Errors
    /// [`MeasurementError`] if the share leaves nothing, or the order is not one of these patterns.
    pub fn take(
        &self,
        measurements: &Measurements,
        sampling: f64,
    ) -> Result<(Measurements, String), MeasurementError> {
        let (order, name) = match self {
            Self::Of(order) => (Some(order.clone()), order.to_string()),
            // All patterns give the same image in any order.
            Self::Automatic if sampling < 1.0 => {
                match reconstruct::default_selection(measurements.rows()) {
                    Some(order) => {
                        let name = format!("{order} (the recorded order is the natural one)");
                        (Some(order), name)
                    }
                    None => (None, RECORDED.to_owned()),
                }
            }
            Self::Automatic | Self::Recorded => (None, RECORDED.to_owned()),
        };
        Ok((measurements.take(order.as_ref(), sampling)?, name))
    }
}

const RECORDED: &str = "recorded";

/// Why a file gives no measurements.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SourceError {
    /// The file cannot be read as measurements.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file cannot be read as a recording.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// Its readings are not measurements.
    #[error("{}", .path.display())]
    Measurements {
        /// Which file.
        path: PathBuf,
        /// What is wrong with them.
        #[source]
        problem: MeasurementError,
    },
    /// The frames give no measurements.
    #[error("{}", .path.display())]
    Integrate {
        /// Which file.
        path: PathBuf,
        /// What is wrong with them.
        #[source]
        problem: IntegrateError,
    },
    /// A recording without frames.
    #[error("{}: no intact frame in the recording, expected at least one", .0.display())]
    NoFrame(PathBuf),
    /// Every frame contradicts the setup of the recording.
    #[error("{}: no frame is of the recording's setup", .path.display())]
    Misfit {
        /// Which file.
        path: PathBuf,
        /// How the first one contradicts it.
        #[source]
        misfit: Misfit,
    },
    /// Options of a measurement file with a recording.
    #[error("--index N and --non-differential belong to .npz files, not to recordings")]
    NotForRecordings,
    /// Several measurements where one is expected.
    #[error("--index all, expected one measurement here")]
    One,
}

/// Measurements with what is known about where they come from.
#[derive(Debug, Clone)]
pub struct Source {
    /// One value a Hadamard row.
    pub measurements: Measurements,
    /// Readings that were lost, with the rows that they cost.
    pub dropouts: Vec<Dropout>,
    /// The file's own image of the same scene.
    pub reference: Option<Image>,
    /// What became of a recording's frames.
    pub frames: Option<LossCounters>,
    /// What to tell the user.
    pub notes: Vec<String>,
}

impl Source {
    /// Reads one measurement, or the sum of a recording's frames.
    ///
    /// # Errors
    /// [`SourceError`], which names the file and what is wrong with it.
    pub fn read(path: &Path, options: SourceOptions) -> Result<Self, SourceError> {
        let index = options.one()?;
        if options.fits_recording(path)? {
            return from_recording(path, options);
        }
        let non_differential = options.non_differential;
        from_npz(path, npz::read(path, Selection { index, non_differential })?)
    }

    /// Reads all measurements of a file, or each frame of a recording.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn read_all(path: &Path, options: SourceOptions) -> Result<Vec<Self>, SourceError> {
        if options.fits_recording(path)? {
            return frames_of_recording(path, options);
        }
        let files = npz::read_all(path, options.non_differential)?;
        files.into_iter().map(|file| from_npz(path, file)).collect()
    }

    /// The frames of a capture that has just ended, without reading its recording again.
    ///
    /// # Errors
    /// [`IntegrateError`] where its frames give no measurements.
    pub fn of_capture(capture: &Capture) -> Result<Self, IntegrateError> {
        let Capture { setup, settling, integrated, counters, .. } = capture;
        let mut notes: Vec<String> = integrated.warnings().into_iter().map(str::to_owned).collect();
        notes.extend(settling.is_none().then(|| NOT_CALIBRATED.to_owned()));
        notes.extend(capture.missing().as_deref().map(not_whole));
        Ok(Self {
            measurements: integrated.measurements(setup, settling.as_ref(), false)?,
            dropouts: Vec::new(),
            reference: None,
            frames: Some(*counters),
            notes,
        })
    }
}

/// What a capture lacks, as a note; the text may come from a file.
fn not_whole(missing: &str) -> String {
    format!("the recording is not whole: {}", missing.escape_debug())
}

const NOT_CALIBRATED: &str = "no calibration in the recording: the settling leak stays";

impl SourceOptions {
    /// The one that is asked for.
    ///
    /// # Errors
    /// [`SourceError::One`] if all are.
    pub fn one(&self) -> Result<Option<usize>, SourceError> {
        match self.index {
            None => Ok(None),
            Some(Index::One(index)) => Ok(Some(index)),
            Some(Index::All) => Err(SourceError::One),
        }
    }

    /// Whether the file is a recording, for which these options must make sense.
    fn fits_recording(&self, path: &Path) -> Result<bool, SourceError> {
        let mut magic = [0; 4];
        // A pipe would be waited for; what is no file is refused where it is read.
        let is_mcap = path.is_file()
            && std::fs::File::open(path)
                .and_then(|mut file| file.read_exact(&mut magic))
                .is_ok_and(|()| magic[1..] == *b"MCA");
        let named_mcap = path.extension().is_some_and(|e| e == "mcap");
        let one = matches!(self.index, Some(Index::One(_)));
        if (is_mcap || named_mcap) && (one || self.non_differential) {
            return Err(SourceError::NotForRecordings);
        }
        Ok(is_mcap || named_mcap)
    }
}

fn from_npz(path: &Path, file: MeasurementFile) -> Result<Source, SourceError> {
    let wrong = |problem| SourceError::Measurements { path: path.to_owned(), problem };
    let rows = &file.h_row;
    let mut notes = file.notes;
    let (measurements, dropouts) = match &file.readings {
        Readings::Pairs(y) => Measurements::from_pairs(rows, y).map_err(wrong)?,
        Readings::Differential(d) => {
            (Measurements::from_differential(rows, d).map_err(wrong)?, Vec::new())
        }
        Readings::Single(y) => {
            let mut measurements = Measurements::from_single(rows, y).map_err(wrong)?;
            if let Some(level) = measurements.remove_dark_level() {
                notes.push(format!("a dark level of {level:.4} was found in `y` and removed"));
            }
            (measurements, Vec::new())
        }
    };
    Ok(Source { measurements, dropouts, reference: file.reference, frames: None, notes })
}

/// Sums the frames of a recording, counting again what became of each.
fn from_recording(path: &Path, options: SourceOptions) -> Result<Source, SourceError> {
    let mut recording = Recording::open(path)?;
    let tally = tally_recording(&mut recording)?;
    if tally.integrated().frames() == 0 {
        return Err(no_frame(path, &tally));
    }
    of_frames(path, options, &recording, tally.integrated(), &tally)
}

/// Why no frame of a recording counts.
fn no_frame(path: &Path, tally: &Tally) -> SourceError {
    let path = path.to_owned();
    match tally.misfit() {
        Some(misfit) => SourceError::Misfit { path, misfit },
        None => SourceError::NoFrame(path),
    }
}

fn frames_of_recording(path: &Path, options: SourceOptions) -> Result<Vec<Source>, SourceError> {
    let mut recording = Recording::open(path)?;
    let (frames, tally) = tally::frames_of_recording(&mut recording)?;
    if frames.is_empty() {
        return Err(no_frame(path, &tally));
    }
    frames.iter().map(|frame| of_frames(path, options, &recording, frame, &tally)).collect()
}

/// What the sum of some frames says.
fn of_frames(
    path: &Path,
    options: SourceOptions,
    recording: &Recording,
    integrated: &Integrated,
    tally: &Tally,
) -> Result<Source, SourceError> {
    let counters = tally.account().counters();
    let Recording { setup, settling, .. } = recording;
    let End { cut_short, account, .. } = recording.end();
    let mut notes: Vec<String> = integrated.warnings().into_iter().map(str::to_owned).collect();
    if let Some(reason) = cut_short {
        notes.push(format!("the recording is cut short or damaged: {reason}"));
    }
    if let Some(account) = account {
        if account.counters != counters {
            notes.push("the frames found are not those that the capture counted".to_owned());
        }
        notes.extend(account.missing.as_deref().map(not_whole));
    }
    notes.extend(tally.misfit().map(|misfit| format!("some frames are left out: {misfit}")));
    if settling.is_none() {
        notes.push(NOT_CALIBRATED.to_owned());
    }
    let measurements = integrated
        .measurements(setup, settling.as_ref(), options.keep_leak)
        .map_err(|problem| SourceError::Integrate { path: path.to_owned(), problem })?;
    let (dropouts, frames) = (Vec::new(), Some(counters));
    Ok(Source { measurements, dropouts, reference: None, frames, notes })
}
