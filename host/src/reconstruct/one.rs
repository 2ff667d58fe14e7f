//! One image, its pictures and its report, in a folder.

use super::many::doubts;
use super::{Networks, PipelineError, ResultFolder, Solved, Solver, not_read_words};
use crate::account::LossCounters;
use crate::files::output::OutputDir;
use crate::files::{FileError, npy};
use crate::imaging::{FrameReport, MethodReport, enhance_frames_by};
use crate::picture::{Pictures, Unit};
use crate::source::{OutlierReport, Part, Source};
use crate::stage_times::StageTimes;
use nirspi_recon::law::{Lamp, Witness};
use nirspi_recon::words::count_of;
use nirspi_recon::{Image, Shape, metrics};
use serde::Serialize;
use std::fmt;
use std::path::{Path, PathBuf};

/// Readings that were lost.
#[derive(Debug, Serialize)]
pub struct DropoutReport {
    /// The first lost reading.
    pub first_reading: usize,
    /// Number of lost readings.
    pub readings: usize,
    /// The rows that they affect.
    pub rows: Vec<u32>,
}

/// How steady the light was.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LampReport {
    /// Number of all-on readings that say so. Without it, the sums of pattern and complement do.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub all_on_readings: Option<usize>,
    /// Standard deviation of these about their level, as a share of the level.
    pub spread: f64,
    /// From the lowest to the highest level during the sweep, as a share of the middle one.
    pub drift: f64,
}

impl LampReport {
    /// `None` if only a drift is known, of which a warning says all.
    fn of(Lamp { by, spread, drift, .. }: Lamp) -> Option<Self> {
        let all_on_readings = match by {
            Witness::Sums => None,
            Witness::AllOn(count) => Some(count),
            Witness::Level => return None,
        };
        Some(Self { all_on_readings, spread, drift })
    }
}

impl fmt::Display for LampReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (spread, drift) = (100.0 * self.spread, 100.0 * self.drift);
        match self.all_on_readings {
            None => f.write_str("sums of pairs")?,
            Some(count) => write!(f, "{count} all-on readings")?,
        }
        write!(f, ": spread {spread:.2} %, drift {drift:.2} %")
    }
}

/// The report of one image.
#[derive(Debug, Serialize)]
pub struct OneReport {
    /// The file or recording.
    pub input: PathBuf,
    /// Side of the image.
    pub n: usize,
    /// Number of measurements.
    pub measurements: usize,
    /// Number of measurements used.
    pub used: usize,
    /// Share of all n x n patterns used.
    pub sampling: f64,
    /// The name of the order that chose them.
    pub order: String,
    /// The method.
    #[serde(flatten)]
    pub method: MethodReport,
    /// Readings that were lost.
    pub dropouts: Vec<DropoutReport>,
    /// Readings that light cannot have given, whose patterns are left out.
    pub outliers: Vec<OutlierReport>,
    /// Positions in the order shown of patterns that the file marks as not read.
    pub not_read: Vec<usize>,
    /// How steady the light was, of pairs of a file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lamp: Option<LampReport>,
    /// The part of complex readings in image.npy.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub part: Option<&'static str>,
    /// The account of a recording's frames.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frames: Option<LossCounters>,
    /// Correlation of the image with the one that the file holds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub correlation_with_files_recon: Option<f64>,
    /// What the networks report.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub enhancement: Option<FrameReport>,
    /// What contradicts the readings.
    pub warnings: Vec<String>,
    /// Notes for the user.
    pub notes: Vec<String>,
    /// What is black and white in the pictures.
    pub pictures: Pictures,
    /// The time of each stage.
    pub stage_ms: StageTimes,
}

impl OneReport {
    /// The report in words, a line each: measurements, losses, method, enhancement. Its warnings are
    /// [`all_warnings`](Self::all_warnings).
    #[must_use]
    pub fn words(&self) -> Vec<String> {
        let Self { input, n, used, .. } = self;
        let percent = self.sampling * 100.0;
        let mut lines = vec![format!(
            "{}: {n} x {n}, {used} of {} measurements ({percent:.1} %), order {}",
            input.display(),
            n * n,
            self.order
        )];
        lines.extend(self.dropouts.iter().map(|dropout| {
            format!(
                "drop-out: {} from y[{}] on, {} left out",
                count_of(dropout.readings, "reading"),
                dropout.first_reading,
                count_of(dropout.rows.len(), "pattern")
            )
        }));
        lines.extend(self.outliers.iter().map(OutlierReport::to_string));
        lines.extend((!self.not_read.is_empty()).then(|| not_read_words(&self.not_read)));
        lines.extend(self.lamp.map(|lamp| lamp.to_string()));
        lines.extend(self.frames.map(|frames| format!("frames: {frames}")));
        lines.push(self.method.to_string());
        lines.extend(self.correlation_with_files_recon.map(|correlation| {
            format!("correlation with the file's own reconstruction: {correlation:.6}")
        }));
        if let Some(enhancement) = &self.enhancement {
            lines.push(enhancement.line());
        }
        lines
    }

    /// What a user must know of the images: of the networks, and of the readings.
    pub fn all_warnings(&self) -> impl Iterator<Item = &String> {
        let enhanced = self.enhancement.iter().flat_map(|enhancement| &enhancement.warnings);
        enhanced.chain(&self.warnings)
    }
}

/// Reconstructs one image and writes it with its pictures and its report.
pub(super) fn one_image(
    solver: &Solver,
    networks: Option<&Networks>,
    source: Source,
    folder: &ResultFolder<'_>,
    mut times: StageTimes,
) -> Result<OneReport, PipelineError> {
    if networks.is_some() && source.imaginary.is_some() {
        return Err(PipelineError::Complex);
    }
    let solved = times.time("reconstruct", || solver.solve(folder.input, &source))?;
    let Solved { image, with_readings, parts, used, order, report: method, .. } = solved;
    let side = image.side().pixels();
    let correlation = source.reference.as_ref().and_then(|reference| {
        metrics::correlation(reference.pixels(), image.pixels(), side, side).ok()
    });
    let (sharp, enhancement) = match networks {
        Some(networks) => {
            let given = [(with_readings.as_ref().unwrap_or(&image), used.rows())];
            let (sharp, mut reports) = enhance_frames_by(networks.for_one(), &given, &mut times)?;
            (Some(sharp), reports.pop())
        }
        None => (None, None),
    };
    let mut warnings = source.all_warnings();
    warnings.extend(doubts(&source, &method));
    let unit = Unit::of_readings(source.frames.is_some());
    let short = enhancement.as_ref().map(|enhancement| enhancement.short.clone());
    let dropouts = source.dropouts.into_iter().map(|d| DropoutReport {
        first_reading: d.start,
        readings: d.length,
        rows: d.rows,
    });
    let provenance = source.taken.made(folder.made);
    let (enhanced, figure) = (sharp.as_deref().zip(short), folder.figure);
    let draw = || Pictures::of_image(&image, unit, enhanced, figure, &provenance);
    let report = OneReport {
        pictures: times.time("pictures", draw),
        input: folder.input.to_owned(),
        n: side,
        measurements: source.measurements.rows().len(),
        used: used.rows().len(),
        sampling: used.rows().len() as f64 / image.side().area() as f64,
        order,
        method,
        dropouts: dropouts.collect(),
        outliers: source.outliers.iter().map(OutlierReport::of).collect(),
        not_read: source.not_read,
        lamp: source.lamp.and_then(LampReport::of),
        part: parts.as_ref().map(|_| Part::Magnitude.name()),
        frames: source.frames,
        correlation_with_files_recon: correlation,
        enhancement,
        warnings,
        notes: source.notes,
        stage_ms: times,
    };
    write_image(folder.out, &image, parts.as_ref(), sharp.as_deref(), &report.pictures, &report)?;
    Ok(report)
}

/// Writes an image, the real and imaginary part of a complex image, the enhanced image, if there is
/// one, the pictures, and the report with the provenance of the pictures.
///
/// # Errors
/// [`FileError`] names the file. Nothing is left behind.
pub(super) fn write_image(
    out: &Path,
    image: &Image<impl Shape>,
    parts: Option<&[Image; 2]>,
    sharp: Option<&[f32]>,
    pictures: &Pictures,
    report: &impl Serialize,
) -> Result<(), FileError> {
    let shape = [image.size().height(), image.size().width()];
    let mut out = OutputDir::create(out)?;
    out.write("image.npy", &npy::encode(&shape, image.pixels()))?;
    for (name, part) in ["real.npy", "imaginary.npy"].iter().zip(parts.into_iter().flatten()) {
        out.write(name, &npy::encode(&shape, part.pixels()))?;
    }
    if let Some(sharp) = sharp {
        let side = nirspi_nets::deblur::SIDE;
        out.write("enhanced.npy", &npy::encode(&[side, side], sharp))?;
    }
    pictures.write(&mut out)?;
    let text = pictures.provenance().sign(report).unwrap_or_default();
    out.write("report.json", text.as_bytes())?;
    out.commit()?;
    Ok(())
}
