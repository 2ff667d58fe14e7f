//! Where measurements come from: a file of anybody's, a recording, or a capture that has just ended.

use crate::account::LossCounters;
use crate::calibration::{FlatField, KeptFlatField};
use crate::capture::Capture;
use crate::causes;
use crate::files::FileError;
use crate::files::measurement::{self, MeasurementFile, Readings, Reference, Selection};
use crate::integrate::{IntegrateError, Integrated};
use crate::recording::{End, Recording, RecordingError};
use crate::tally::{self, Misfit, Tally, tally_recording};
use nirspi_recon::{Dropout, Image, MeasurementError, Measurements, Order, Rows, reconstruct};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use thiserror::Error;

/// How to read measurements.
#[derive(Debug, Clone, Default)]
pub struct SourceOptions {
    /// Which measurement of a file that holds several. Of a recording: `All` gives each frame, anything else their sum.
    pub index: Option<Index>,
    /// What a measurement file does not say itself; its `index` is not looked at.
    pub file: Selection,
    /// What to take of complex readings.
    pub part: Part,
    /// Leave the leak from pattern to pattern of a recording as it is.
    pub keep_leak: bool,
    /// Leave the pattern of unequal LEDs of a recording as it is, though a flat field is kept for its camera.
    pub no_flat_field: bool,
}

/// What to take of complex readings, as those of a lock-in amplifier, a terahertz or an ultrasound detector are. Real readings
/// are taken as they are.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Part {
    /// Both parts, of which the image is the magnitude.
    #[default]
    Magnitude,
    /// The real part.
    Real,
    /// The imaginary part.
    Imaginary,
}

impl Part {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Magnitude, Self::Real, Self::Imaginary];

    /// As it is written on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Magnitude => "magnitude",
            Self::Real => "real",
            Self::Imaginary => "imaginary",
        }
    }
}

impl FromStr for Part {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        Self::ALL
            .into_iter()
            .find(|part| part.name() == name)
            .ok_or_else(|| format!("expected {}", Self::ALL.map(Self::name).join(", ")))
    }
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
    /// Those of the lowest sequencies, whatever order was recorded.
    #[default]
    LowestSequencies,
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
            Self::LowestSequencies if sampling < 1.0 => {
                let order = reconstruct::LOWEST_SEQUENCIES;
                let name = format!("{order} (lowest sequencies first)");
                (Some(order), name)
            }
            Self::LowestSequencies | Self::Recorded => (None, RECORDED.to_owned()),
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
    #[error(
        "--index N, --part, and what says how a file is laid out belong to measurement files, not to recordings"
    )]
    NotForRecordings,
    /// Complex readings where real ones are expected.
    #[error("{}: complex readings, expected real ones here: choose a part with --part real or --part imaginary", .0.display())]
    Complex(PathBuf),
    /// Several measurements where one is expected.
    #[error("--index all, expected one measurement here")]
    One,
}

/// Measurements with what is known about where they come from.
#[derive(Debug, Clone)]
pub struct Source {
    /// One value a Hadamard row.
    pub measurements: Measurements,
    /// The imaginary part of complex measurements of the same rows, where both parts were asked for.
    pub imaginary: Option<Measurements>,
    /// Readings that were lost, with the rows that they cost.
    pub dropouts: Vec<Dropout>,
    /// Places in the order shown of patterns that the file says were not read: NaN, or a negative row.
    pub not_read: Vec<usize>,
    /// The file's own image of the same scene.
    pub reference: Option<Image>,
    /// What became of a recording's frames.
    pub frames: Option<LossCounters>,
    /// What to tell the user.
    pub notes: Vec<String>,
    /// The flat field of the camera that was recorded, where one is kept.
    pub flat_field: Option<FlatField>,
}

impl Source {
    /// What the camera has seen, given what a reconstruction makes of its measurements: the pattern of unequal LEDs taken away
    /// where their flat field is known.
    #[must_use]
    pub fn flattened(&self, image: Image) -> Image {
        match &self.flat_field {
            Some(flat) => flat.correct(&image),
            None => image,
        }
    }

    /// The same measurements of a camera with this flat field.
    #[must_use]
    pub fn with_flat_field(mut self, kept: KeptFlatField) -> Self {
        self.notes.push(kept.summary());
        self.flat_field = Some(kept.flat);
        self
    }

    /// Reads one measurement, or the sum of a recording's frames.
    ///
    /// # Errors
    /// [`SourceError`], which names the file and what is wrong with it.
    pub fn read(path: &Path, options: &SourceOptions) -> Result<Self, SourceError> {
        let index = options.one()?;
        if options.fits_recording(path)? {
            return from_recording(path, options);
        }
        let want = Selection { index, ..options.file.clone() };
        from_file(path, measurement::read(path, &want)?, options.part)
    }

    /// Reads all measurements of a file, or each frame of a recording.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn read_all(path: &Path, options: &SourceOptions) -> Result<Vec<Self>, SourceError> {
        if options.fits_recording(path)? {
            return frames_of_recording(path, options);
        }
        let files = measurement::read_all(path, &options.file)?;
        files.into_iter().map(|file| from_file(path, file, options.part)).collect()
    }

    /// The measurements, where only real ones serve.
    ///
    /// # Errors
    /// [`SourceError::Complex`] for both parts of complex readings.
    pub fn real(self, path: &Path) -> Result<Measurements, SourceError> {
        match self.imaginary {
            None => Ok(self.measurements),
            Some(_) => Err(SourceError::Complex(path.to_owned())),
        }
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
            imaginary: None,
            dropouts: Vec::new(),
            not_read: Vec::new(),
            reference: None,
            frames: Some(*counters),
            notes,
            flat_field: None,
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
        let for_files = self.file != Selection::default() || self.part != Part::default();
        if (is_mcap || named_mcap) && (one || for_files) {
            return Err(SourceError::NotForRecordings);
        }
        Ok(is_mcap || named_mcap)
    }
}

fn from_file(path: &Path, file: MeasurementFile, part: Part) -> Result<Source, SourceError> {
    let mut notes = file.notes;
    let mut read = |readings: &Readings| {
        measured(&file.h_row, readings, &mut notes)
            .map_err(|problem| SourceError::Measurements { path: path.to_owned(), problem })
    };
    let (measurements, imaginary, mut dropouts) = match (&file.imaginary, part) {
        (None, _) | (_, Part::Real) => {
            let (measurements, dropouts) = read(&file.readings)?;
            (measurements, None, dropouts)
        }
        (Some(imaginary), Part::Imaginary) => {
            let (measurements, dropouts) = read(imaginary)?;
            (measurements, None, dropouts)
        }
        (Some(imaginary), Part::Magnitude) => {
            // Of both parts the same rows are known: light that dims is no law for either part alone.
            let differences = |readings| without_dropouts(&file.h_row, readings);
            let wrong = |problem| SourceError::Measurements { path: path.to_owned(), problem };
            let real = differences(&file.readings).map_err(wrong)?;
            (real, Some(differences(imaginary).map_err(wrong)?), Vec::new())
        }
    };
    for dropout in &mut dropouts {
        // Readings are counted as in the file, those not read among them.
        let place = |reading: usize| 2 * file.places[reading / 2] + reading % 2;
        let last = dropout.start + dropout.length - 1;
        (dropout.start, dropout.length) =
            (place(dropout.start), place(last) + 1 - place(dropout.start));
    }
    let reference = file.reference.map(|Reference { real, imaginary }| {
        match (imaginary, imaginary_of(part, file.imaginary.is_some())) {
            (Some(imaginary), Part::Magnitude) => Image::magnitude(&real, &imaginary),
            (Some(imaginary), Part::Imaginary) => imaginary,
            (_, _) => real,
        }
    });
    let not_read = file.not_read;
    let (frames, flat_field) = (None, None);
    Ok(Source { measurements, imaginary, dropouts, not_read, reference, frames, notes, flat_field })
}

/// The part of a complex reference to compare with: of real readings, its real part.
fn imaginary_of(part: Part, complex: bool) -> Part {
    if complex { part } else { Part::Real }
}

/// The measurements that readings are, with drop-outs left out.
fn measured(
    rows: &Rows,
    readings: &Readings,
    notes: &mut Vec<String>,
) -> Result<(Measurements, Vec<Dropout>), MeasurementError> {
    match readings {
        Readings::Pairs(y) => Measurements::from_pairs(rows, y),
        Readings::Differential(d) => Ok((Measurements::from_differential(rows, d)?, Vec::new())),
        Readings::Single(y) => {
            let mut measurements = Measurements::from_single(rows, y)?;
            if let Some(level) = measurements.remove_dark_level() {
                notes.push(format!("a dark level of {level:.4} was found in `y` and removed"));
            }
            Ok((measurements, Vec::new()))
        }
    }
}

/// The measurements that readings are, all of them.
fn without_dropouts(rows: &Rows, readings: &Readings) -> Result<Measurements, MeasurementError> {
    match readings {
        Readings::Pairs(y) => {
            let differences: Vec<f64> = y.as_chunks::<2>().0.iter().map(|[p, m]| p - m).collect();
            Measurements::from_differential(rows, &differences)
        }
        Readings::Differential(d) => Measurements::from_differential(rows, d),
        Readings::Single(y) => Measurements::from_single(rows, y),
    }
}

/// Sums the frames of a recording, counting again what became of each.
fn from_recording(path: &Path, options: &SourceOptions) -> Result<Source, SourceError> {
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

fn frames_of_recording(path: &Path, options: &SourceOptions) -> Result<Vec<Source>, SourceError> {
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
    options: &SourceOptions,
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
    let (dropouts, not_read, frames) = (Vec::new(), Vec::new(), Some(counters));
    let (imaginary, reference, flat_field) = (None, None, None);
    let source = Source {
        measurements,
        imaginary,
        dropouts,
        not_read,
        reference,
        frames,
        notes,
        flat_field,
    };
    if options.no_flat_field {
        return Ok(source);
    }
    Ok(match KeptFlatField::of(&recording.identity) {
        Ok(Some(kept)) => source.with_flat_field(kept),
        Ok(None) => source,
        Err(problem) => {
            let mut source = source;
            source.notes.push(format!("flat field not used: {}", causes::in_one_line(&problem)));
            source
        }
    })
}
