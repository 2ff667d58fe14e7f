//! Reads measurements from a file of nirspi or another lab, a recording, or a finished capture.

use crate::account::LossCounters;
use crate::calibration::{FlatField, KeptFlatField};
use crate::capture::Capture;
use crate::feed::{Header, OwnPatterns};
use crate::files::FileError;
use crate::files::measurement::{
    self, Form, MeasurementFile, Readings, Reference, Selection, Sweeps,
};
use crate::integrate::IntegrateError;
use crate::moving::followed;
use crate::provenance::Taken;
use crate::recording::RecordingError;
use crate::tally::Misfit;
use nirspi_recon::law::{self, Claim, Doubt, Lamp, Places, Reading, Witness};
use nirspi_recon::words::count_of;
use nirspi_recon::{
    Dropout, Image, MeasurementError, Measurements, Order, Outlier, Rows, ShorterSweep, reconstruct,
};
use serde::Serialize;
use std::fmt;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use thiserror::Error;

mod batches;
mod halves;
mod recording;
mod several;

pub use batches::{Batches, Sources};
use recording::from_recording;
pub(crate) use recording::{Frames, Stamp};
pub use several::Several;

/// How to read measurements.
#[derive(Debug, Clone, Default)]
pub struct SourceOptions {
    /// The measurement in a file that holds several. For a recording, `All` gives each frame and
    /// any other choice gives their sum.
    pub index: Option<Index>,
    /// What a measurement file does not state itself; its `index` is ignored.
    pub file: Selection,
    /// The part of complex readings to use.
    pub part: Part,
    /// Whether to leave the leak between patterns of a recording uncorrected.
    pub keep_leak: bool,
    /// Whether to ignore the flat field that is kept for a recording's camera.
    pub no_flat_field: bool,
}

/// The part of complex readings to use. Lock-in amplifiers, terahertz and ultrasound detectors give
/// complex readings. Real readings are used unchanged.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Part {
    /// Both parts. The image is the magnitude.
    #[default]
    Magnitude,
    /// The real part.
    Real,
    /// The imaginary part.
    Imaginary,
}

impl Part {
    /// Every value.
    pub const ALL: [Self; 3] = [Self::Magnitude, Self::Real, Self::Imaginary];

    /// The name on the command line.
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

/// Which of several measurements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Index {
    /// The measurement with this index.
    One(usize),
    /// Every measurement.
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

/// The order by which patterns are chosen if only a share of them is used.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum FirstPatterns {
    /// The lowest sequencies, whatever order was recorded.
    #[default]
    LowestSequencies,
    /// The recorded order.
    Recorded,
    /// This order.
    Of(Order),
}

impl FirstPatterns {
    /// The first `sampling` (0 to 1) of all patterns, and the name of the order.
    ///
    /// # Errors
    /// As [`FirstPatterns::among`].
    pub fn take(
        &self,
        measurements: &Measurements,
        sampling: f64,
    ) -> Result<(Measurements, String), MeasurementError> {
        let (first, name) = self.among(measurements.rows(), sampling)?;
        Ok((first.of(measurements), name))
    }

    /// Which of these rows [`take`](Self::take) takes of every measurement that has them, and the
    /// name of the order.
    ///
    /// # Errors
    /// [`MeasurementError`] if the share is empty, or the order does not fit these patterns.
    pub fn among(
        &self,
        rows: &Rows,
        sampling: f64,
    ) -> Result<(ShorterSweep, String), MeasurementError> {
        let (order, name) = match self {
            Self::Of(order) => (Some(order.clone()), order.to_string()),
            // All patterns together give the same image in any order.
            Self::LowestSequencies if sampling < 1.0 => {
                let order = reconstruct::LOWEST_SEQUENCIES;
                let name = format!("{order} (lowest sequencies first)");
                (Some(order), name)
            }
            Self::LowestSequencies | Self::Recorded => {
                let known = Order::of(rows.as_slice(), rows.side());
                let name = known.map_or_else(
                    || RECORDED.to_owned(),
                    |order| format!("{RECORDED}, which is {order}"),
                );
                (None, name)
            }
        };
        Ok((ShorterSweep::new(rows, order.as_ref(), sampling)?, name))
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
    /// A feed of patterns of the bench's own.
    #[error(transparent)]
    OwnPatterns(#[from] OwnPatterns),
    /// The readings are not valid measurements.
    #[error("{}", .path.display())]
    Measurements {
        /// The file.
        path: PathBuf,
        /// The problem.
        #[source]
        problem: MeasurementError,
    },
    /// The frames give no measurements.
    #[error("{}", .path.display())]
    Integrate {
        /// The file.
        path: PathBuf,
        /// The problem.
        #[source]
        problem: IntegrateError,
    },
    /// A recording without frames.
    #[error("{}: no intact frame in the recording, expected at least one", .0.display())]
    NoFrame(PathBuf),
    /// Every frame contradicts the setup of the recording.
    #[error("{}: no frame is of the recording's setup", .path.display())]
    Misfit {
        /// The file.
        path: PathBuf,
        /// The contradiction of the first frame.
        #[source]
        misfit: Misfit,
    },
    /// The recording changed between two readings.
    #[error("{}: the recording changed while it was read: wait until its capture has ended", .0.display())]
    Changed(PathBuf),
    /// The options are for measurement files, but the file is a recording.
    #[error(
        "--index N, --part, and what says how a file is laid out belong to measurement files, not to recordings"
    )]
    NotForRecordings,
    /// The readings are complex, but real readings are needed.
    #[error("{}: complex readings, expected real ones here: choose a part with --part real or --part imaginary", .0.display())]
    Complex(PathBuf),
    /// All measurements of a file are too many for the memory.
    #[error("{}: {count} measurements, expected at most {most} of this size at a time: choose one with --index N, or export a recording with nirspi recording export", .path.display())]
    TooMany {
        /// The file.
        path: PathBuf,
        /// Number of measurements in the file.
        count: usize,
        /// The most that are reconstructed at a time.
        most: u64,
    },
    /// The choice is of several measurements, but one is needed.
    #[error("--index all, expected one measurement here")]
    One,
}

impl SourceError {
    /// Whether options contradict each other or the kind of the file.
    #[must_use]
    pub fn is_of_options(&self) -> bool {
        matches!(self, Self::NotForRecordings | Self::One)
    }
}

/// Measurements and their origin.
#[derive(Debug, Clone)]
pub struct Source {
    /// One value for each Hadamard row.
    pub measurements: Measurements,
    /// The imaginary parts of complex measurements of the same rows, if both parts were requested.
    pub imaginary: Option<Measurements>,
    /// Lost readings, with the rows that they affect.
    pub dropouts: Vec<Dropout>,
    /// Single readings that light cannot have given. Their patterns are left out.
    pub outliers: Vec<Outlier>,
    /// Positions in the order shown of the patterns that the file marks as not read: NaN, or a
    /// negative row.
    pub not_read: Vec<usize>,
    /// The file's own image of the same scene.
    pub reference: Option<Image>,
    /// The account of a recording's frames.
    pub frames: Option<LossCounters>,
    /// Where the readings come from.
    pub taken: Taken,
    /// What a recording or a capture lacks, in one line with its numbers: its image is of fewer frames.
    pub damage: Option<String>,
    /// What contradicts the readings, one line each: the image may not be of the scene.
    pub warnings: Vec<String>,
    /// Notes for the user.
    pub notes: Vec<String>,
    /// How steady the light was, of pairs of a file.
    pub lamp: Option<Lamp>,
    /// The flat field of the recorded camera, if one is kept.
    pub flat_field: Option<FlatField>,
}

impl Source {
    /// What a user must know of the image: what the recording lacks, and what contradicts the
    /// readings.
    #[must_use]
    pub fn all_warnings(&self) -> Vec<String> {
        self.damage.iter().chain(&self.warnings).cloned().collect()
    }

    /// Corrects a reconstructed image by the flat field, if there is one.
    #[must_use]
    pub fn flattened(&self, image: Image) -> Image {
        FlatField::corrected(self.flat_field.as_ref(), image)
    }

    /// The same measurements with the flat field of their camera.
    #[must_use]
    pub fn with_flat_field(mut self, kept: KeptFlatField) -> Self {
        self.notes.push(kept.summary());
        self.flat_field = Some(kept.flat);
        self
    }

    /// Reads one measurement, or the sum of a recording's frames.
    ///
    /// # Errors
    /// [`SourceError`], which names the file and the problem.
    pub fn read(path: &Path, options: &SourceOptions) -> Result<Self, SourceError> {
        let index = options.one()?;
        if options.fits_recording(path)? {
            return from_recording(path, options);
        }
        let want = Selection { index, ..options.file.clone() };
        from_file(path, measurement::read(path, &want)?, options.part)
    }

    /// The measurements of one sweep of a feed, which `origin` names.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn of_sweep(origin: &Path, sweep: MeasurementFile) -> Result<Self, SourceError> {
        from_file(origin, sweep, Part::default())
    }

    /// The measurements of readings of a feed with this header, which `origin` names: of a frame, or of the mean of
    /// several.
    ///
    /// # Errors
    /// As [`read`](Self::read); and [`SourceError::OwnPatterns`] for patterns of the bench's own.
    pub fn of_feed(
        header: &Header,
        origin: &Path,
        readings: Vec<f64>,
    ) -> Result<Self, SourceError> {
        let (side, rows) = header.hadamard()?;
        let sweeps = Sweeps::new(origin, side, rows, header.form, header.simulated)?;
        Self::of_sweep(origin, sweeps.read(readings)?)
    }

    /// Reads all measurements of a file, or each frame of a recording.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn read_all(path: &Path, options: &SourceOptions) -> Result<Vec<Self>, SourceError> {
        let mut sources = Sources::open(path, options)?;
        sources.fit_together()?;
        let batches: Vec<Vec<Self>> = sources.batches(usize::MAX)?.collect::<Result<_, _>>()?;
        Ok(batches.into_iter().flatten().collect())
    }

    /// The measurements, for uses that need real ones.
    ///
    /// # Errors
    /// [`SourceError::Complex`] for both parts of complex readings.
    pub fn real(self, path: &Path) -> Result<Measurements, SourceError> {
        match self.imaginary {
            None => Ok(self.measurements),
            Some(_) => Err(SourceError::Complex(path.to_owned())),
        }
    }

    /// The frames of a finished capture, without reading its recording again.
    ///
    /// # Errors
    /// [`IntegrateError`] if its frames give no measurements.
    pub fn of_capture(capture: &Capture) -> Result<Self, IntegrateError> {
        let Capture { camera, setup, settling, integrated, counters, .. } = capture;
        let (measurements, mut notes) = followed(integrated, setup, settling.as_ref(), false)?;
        notes.extend(settling.is_none().then(|| NOT_CALIBRATED.to_owned()));
        let read = of_frames(measurements)?;
        Ok(Self {
            measurements: read.measurements,
            imaginary: None,
            dropouts: Vec::new(),
            outliers: read.outliers,
            not_read: Vec::new(),
            reference: None,
            frames: Some(*counters),
            taken: Taken::by(camera),
            damage: capture.missing().map(|missing| not_whole(*counters, &[missing])),
            warnings: read.doubts.iter().map(Doubt::to_string).collect(),
            notes,
            lamp: None,
            flat_field: None,
        })
    }
}

/// The measurements of frames, whose signed values the law of readings holds for.
fn of_frames(measurements: Measurements) -> Result<Reading, MeasurementError> {
    let noise = measurements.noise();
    let mut read = law::read(measurements.rows(), measurements.values(), Form::Differences.into())?;
    if let Some(noise) = noise {
        read.measurements = read.measurements.with_noise(noise)?;
    }
    Ok(read)
}

/// A note about what a capture lacks. The text may come from a file.
/// What is said of a recording that is not whole, for these reasons.
fn not_whole(counters: LossCounters, reasons: &[String]) -> String {
    // The camera's words may hold anything.
    let reasons = reasons.join("; ").replace(char::is_control, " ");
    format!("the recording is not whole: {counters}; {reasons}")
}

const NOT_CALIBRATED: &str = "no calibration in the recording: the settling leak stays";

impl SourceOptions {
    /// The requested index.
    ///
    /// # Errors
    /// [`SourceError::One`] if all measurements were requested.
    pub fn one(&self) -> Result<Option<usize>, SourceError> {
        match self.index {
            None => Ok(None),
            Some(Index::One(index)) => Ok(Some(index)),
            Some(Index::All) => Err(SourceError::One),
        }
    }

    /// Whether the file is a recording. An error if options do not apply to recordings.
    pub(crate) fn fits_recording(&self, path: &Path) -> Result<bool, SourceError> {
        let mut magic = [0; 4];
        // Opening a pipe would wait for a writer. Reading the file later refuses everything that is
        // not a file.
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

/// The measurements of a file, by the law of readings; of complex readings, the imaginary parts as well, if
/// both parts are wanted.
pub(crate) fn by_law(
    path: &Path,
    file: &MeasurementFile,
    part: Part,
) -> Result<(Reading, Option<Measurements>), SourceError> {
    let wrong = |problem| SourceError::Measurements { path: path.to_owned(), problem };
    // The law of readings is that of light, and light has no phase.
    let plain = |readings: &Readings| as_they_are(&file.h_row, readings).map_err(wrong);
    Ok(match (&file.imaginary, part) {
        (None, _) => {
            let y = file.readings.values();
            // Of patterns that were shown several times, readings are in no order.
            let is_in_order = file.places.len() + file.not_read.len() == file.patterns;
            let places = Places { read: &file.places, patterns: file.patterns };
            let places = Some(places).filter(|_| is_in_order);
            let mut read = law::read_at(&file.h_row, y, file.claim, places).map_err(wrong)?;
            // Of readings the law says it, and of differences the file.
            if file.most_noise.is_some() {
                read.measurements = read.measurements.with_most_noise(file.most_noise);
            }
            if let Some(noise) = file.noise {
                read.measurements = read.measurements.with_noise(noise).map_err(wrong)?;
            }
            (read, None)
        }
        (Some(_), Part::Real) => (plain(&file.readings)?, None),
        (Some(imaginary), Part::Imaginary) => (plain(imaginary)?, None),
        (Some(imaginary), Part::Magnitude) => {
            (plain(&file.readings)?, Some(plain(imaginary)?.measurements))
        }
    })
}

fn from_file(path: &Path, file: MeasurementFile, part: Part) -> Result<Source, SourceError> {
    let mut notes = file.notes.clone();
    let (read, imaginary) = by_law(path, &file, part)?;
    if let Some(level) = read.dark_level {
        notes.push(format!("a dark level of {level:.4} was found in `y` and removed"));
    }
    // Readings are numbered as in the file, including those that were not read.
    let outliers: Vec<Outlier> = read
        .outliers
        .iter()
        .map(|outlier| Outlier { reading: file.place(outlier.reading), ..*outlier })
        .collect();
    let mut dropouts = read.dropouts;
    for dropout in &mut dropouts {
        let last = file.place(dropout.start + dropout.length - 1);
        dropout.start = file.place(dropout.start);
        if file.claim.form == Form::Pairs {
            dropout.length = last + 1 - dropout.start;
        }
    }
    let mut warnings: Vec<String> = read.doubts.iter().map(Doubt::to_string).collect();
    warnings.extend(overload_words(&file.overloads));
    let lamp = file.lamp.or(read.lamp);
    warnings.extend(lamp.and_then(|lamp| drift_words(lamp, file.claim)));
    let complex = file.imaginary.is_some();
    let reference = file.reference.map(|Reference { real, imaginary }| {
        match (imaginary, imaginary_of(part, complex)) {
            (Some(imaginary), Part::Magnitude) => Image::magnitude(&real, &imaginary),
            (Some(imaginary), Part::Imaginary) => imaginary,
            (_, _) => real,
        }
    });
    let not_read = file.not_read;
    let taken = file.taken.from_file(path);
    let (frames, flat_field) = (None, None);
    Ok(Source {
        measurements: read.measurements,
        imaginary,
        dropouts,
        outliers,
        not_read,
        reference,
        frames,
        taken,
        damage: None,
        warnings,
        notes,
        lamp,
        flat_field,
    })
}

/// A warning about a lamp whose drift limits the image.
fn drift_words(lamp: Lamp, claim: Claim) -> Option<String> {
    let drift = 100.0 * lamp.drift;
    (lamp.limits && !claim.divide_by_lamp).then(|| match lamp.by {
        Witness::Level => format!(
            "the level of the readings drifts by {drift:.1} % over the sweep, as if the lamp or the dark level did: show the all-on \
             pattern again and again, which --divide-by-lamp uses, or each pattern and its complement"
        ),
        Witness::Sums | Witness::AllOn(_) => format!(
            "the lamp drifts by {drift:.1} % over the sweep, which harms the image more than the noise; --divide-by-lamp corrects \
             it, if there is no ambient light"
        ),
    })
}

/// A warning about readings that are an instrument's word for overload.
#[must_use]
pub fn overload_words(readings: &[usize]) -> Option<String> {
    let first = readings.first()?;
    let (say, from, patterns) = match readings.len() {
        1 => ("says", format!("y[{first}]"), "the pattern is"),
        _ => ("say", format!("from y[{first}] on"), "the patterns are"),
    };
    Some(format!(
        "overload: {} {say} that the detector was overloaded (9.9e37, OL or ∞), {from}; {patterns} left out",
        count_of(readings.len(), "reading")
    ))
}

/// A reading that light cannot have given, for a report.
#[derive(Debug, Clone, Serialize)]
pub struct OutlierReport {
    /// The place of the reading in the file, or of the pattern in a recording.
    pub reading: usize,
    /// The reading.
    pub value: f64,
    /// The row of its pattern, which is left out.
    pub row: u32,
    /// What is impossible, in words.
    pub why: String,
}

impl OutlierReport {
    /// The report of an outlier.
    #[must_use]
    pub fn of(outlier: &Outlier) -> Self {
        let Outlier { reading, value, row, .. } = *outlier;
        Self { reading, value, row, why: outlier.to_string() }
    }
}

impl fmt::Display for OutlierReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "outlier: reading [{}], {}; its pattern is left out", self.reading, self.why)
    }
}

/// The part of a complex reference to compare with; for real readings, the real part.
fn imaginary_of(part: Part, complex: bool) -> Part {
    if complex { part } else { Part::Real }
}

/// The measurements of all these readings, whether or not light can have given them.
fn as_they_are(rows: &Rows, readings: &Readings) -> Result<Reading, MeasurementError> {
    let mut dark_level = None;
    let measurements = match readings {
        Readings::Pairs(y) => {
            let differences: Vec<f64> = y.as_chunks::<2>().0.iter().map(|[p, m]| p - m).collect();
            Measurements::from_differential(rows, &differences)?
        }
        Readings::Differential(d) => Measurements::from_differential(rows, d)?,
        Readings::Single(y) => {
            let mut measurements = Measurements::from_single(rows, y)?;
            dark_level = measurements.remove_dark_level();
            measurements
        }
    };
    let (dropouts, outliers, doubts) = (Vec::new(), Vec::new(), Vec::new());
    Ok(Reading { measurements, dropouts, outliers, doubts, dark_level, lamp: None })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::{archive, npy};

    #[test]
    fn more_measurements_than_the_memory_holds_are_refused_by_their_number() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("many.npz");
        // One pattern of a 2 x 2 image, eight million times: 30 KB in the file.
        let members = [
            ("n", npy::encode(&[], &[2.0_f32])),
            ("h_row", npy::encode(&[1], &[0.0_f32])),
            ("d", npy::encode(&[8_000_000, 1], &vec![0.0_f32; 8_000_000])),
        ];
        std::fs::write(&path, archive::encode(&path, &members).unwrap()).unwrap();
        let error = Source::read_all(&path, &SourceOptions::default()).unwrap_err().to_string();
        assert!(error.contains("8000000 measurements, expected at most"), "{error}");
        assert!(error.contains("--index N") && error.lines().count() == 1, "{error}");
        let one = SourceOptions { index: Some(Index::One(7)), ..SourceOptions::default() };
        assert!(Source::read(&path, &one).is_ok());
    }
}
