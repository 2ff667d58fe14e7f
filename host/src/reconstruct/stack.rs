//! A stack of images, with its pictures and its report, in a folder.

use super::{FileImage, ManyImages, Skipped};
use crate::files::output::OutputDir;
use crate::files::{FileError, npy};
use crate::imaging::{Enhance, FrameReport, FramesError, MethodReport, enhance_frames_by};
use crate::picture::{FigureStyle, Pictures, Unit};
use crate::provenance::Made;
use crate::source::OutlierReport;
use crate::stage_times::StageTimes;
use nirspi_nets::{Device, deblur};
use nirspi_recon::{Image, Rows};
use serde::Serialize;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Where the images of a stack come from, and where they go.
pub struct StackFolder<'r> {
    /// The file, or what the files were named by, for the report.
    pub input: &'r Path,
    /// The same in words, above the pictures.
    pub named: String,
    /// Whether there are several files, which the report then names.
    pub many: bool,
    /// Whether each frame started from the frames before.
    pub warm_start: bool,
    /// The device of the networks that also enlarge and deblur the images; `None`: no networks.
    pub enhance: Option<Device>,
    /// The folder.
    pub out: &'r Path,
    /// The program, for the provenance of the results.
    pub made: &'r Made,
    /// What the pictures are made for.
    pub figure: FigureStyle,
}

/// The report of a stack.
#[derive(Debug, Serialize)]
pub struct StackReport {
    /// The file, or the folder or the first of several files.
    pub input: PathBuf,
    /// Side of the images.
    pub n: usize,
    /// The name of the order that chose the patterns of the first image.
    pub order: String,
    /// Whether each frame started from the frames before.
    pub warm_start: bool,
    /// A report of each image.
    pub frames: Vec<ImageReport>,
    /// Files without an image.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub skipped: Vec<Skipped>,
    /// What is black and white in the pictures.
    pub pictures: Pictures,
    /// The time of each stage.
    pub stage_ms: StageTimes,
}

/// The report of one image of a stack.
#[derive(Debug, Serialize)]
pub struct ImageReport {
    /// The file, if there are several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// Number of the measurement in a file of several, if there are several files.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub index: Option<usize>,
    /// Number of measurements used.
    pub used: usize,
    /// Whether the frame started from the frames before.
    pub warm: bool,
    /// The method.
    #[serde(flatten)]
    pub method: MethodReport,
    /// What the networks report.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub enhancement: Option<FrameReport>,
    /// Readings that light cannot have given, whose patterns are left out.
    pub outliers: Vec<OutlierReport>,
    /// What contradicts the readings.
    pub warnings: Vec<String>,
    /// Notes for the user.
    pub notes: Vec<String>,
}

/// Why a stack is not written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StackFolderError {
    /// There is no image.
    #[error("no image, expected at least one")]
    Empty,
    /// Networks take real images only.
    #[error("--enhance needs real images: choose --part real or --part imaginary")]
    Complex,
    /// The networks failed.
    #[error("--enhance")]
    Enhance(#[from] FramesError),
    /// A result cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
}

/// Enhances the images if that is asked for, and writes `image.npy`, `enhanced.npy`, the pictures and
/// `report.json`. All images of a file have one white level, and files have their own.
///
/// # Errors
/// [`StackFolderError`]. Nothing is left behind.
pub fn write_stack(
    folder: &StackFolder<'_>,
    made: ManyImages,
    mut times: StageTimes,
) -> Result<StackReport, StackFolderError> {
    let provenance = made.taken(folder.input).made(folder.made);
    let ManyImages { images, skipped } = made;
    let Some(first) = images.first() else { return Err(StackFolderError::Empty) };
    if folder.enhance.is_some() && images.iter().any(|image| image.complex) {
        return Err(StackFolderError::Complex);
    }
    let (order, unit) = (first.order.clone(), Unit::of_readings(first.recorded));
    let n = first.image.side().pixels();
    let (sharp, enhancements) = match &folder.enhance {
        Some(device) => {
            let (pixels, reports) = enhanced(&images, device, &mut times)?;
            (Some(pixels), reports)
        }
        None => (None, Vec::new()),
    };
    let mut enhancements = enhancements.into_iter();
    let (mut pixels, mut frames) = (Vec::with_capacity(images.len()), Vec::new());
    for image in images {
        pixels.push(image.image);
        frames.push(ImageReport {
            file: folder.many.then_some(image.file),
            index: image.index.filter(|_| folder.many),
            used: image.used.len(),
            warm: image.report.made.warm,
            method: image.report,
            enhancement: enhancements.next(),
            outliers: image.outliers,
            warnings: image.warnings,
            notes: image.notes,
        });
    }
    let doubted = |frame: &ImageReport| frame.enhancement.as_ref().is_some_and(FrameReport::warns);
    let warned = (0..frames.len()).filter(|&at| doubted(&frames[at])).collect();
    let pictures = times.time("pictures", || {
        let sharp = sharp.as_deref().map(|sharp| (sharp, warned));
        Pictures::of_video(&folder.named, &pixels, unit, sharp, folder.figure, &provenance)
    });
    let mut out = OutputDir::create(folder.out)?;
    times.time("write", || -> Result<(), FileError> {
        let all: Vec<f32> = pixels.iter().flat_map(Image::pixels).copied().collect();
        out.write("image.npy", &npy::encode(&[pixels.len(), n, n], &all))?;
        if let Some(sharp) = &sharp {
            let shape = [pixels.len(), deblur::SIDE, deblur::SIDE];
            out.write("enhanced.npy", &npy::encode(&shape, sharp))?;
        }
        pictures.write(&mut out)
    })?;
    let (input, warm_start, stage_ms) = (folder.input.to_owned(), folder.warm_start, times);
    let report = StackReport { input, n, order, warm_start, frames, skipped, pictures, stage_ms };
    let text = provenance.sign(&report).unwrap_or_default();
    out.write("report.json", text.as_bytes())?;
    out.commit()?;
    Ok(report)
}

/// The enhanced pixels of all images, and a report of each.
fn enhanced(
    images: &[FileImage],
    device: &Device,
    times: &mut StageTimes,
) -> Result<(Vec<f32>, Vec<FrameReport>), FramesError> {
    let networks = Enhance::built_in(device)?;
    let (mut pixels, mut reports) = (Vec::new(), Vec::new());
    for of_file in images.chunk_by(|a, b| a.file == b.file) {
        let given = of_file.iter().map(|image| (&image.with_readings, &image.used));
        let given: Vec<(&Image, &Rows)> = given.collect();
        let (mut made, mut told) = enhance_frames_by(&networks, &given, times)?;
        pixels.append(&mut made);
        reports.append(&mut told);
    }
    Ok((pixels, reports))
}
