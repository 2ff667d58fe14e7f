//! The images of a stack on their way into a folder: as they come, with bounded memory.
//!
//! Images and their reports go to the disk at once. Networks take the images of a file when all are there, because all
//! have one white level. Pictures for people show some of the images, which are read again.

use super::for_networks::{Enhanced, ForNetworks};
use super::frame_reports::{FrameReports, Writer};
use super::images::Images;
use super::pipeline_error::{Full, PipelineError};
use super::said::AllSaid;
use super::watch::Watch;
use super::{FileImage, Networks, ResultFolder, Skipped};
use crate::files::FileError;
use crate::files::output::OutputDir;
use crate::imaging::MethodReport;
use crate::picture::{Pictures, Unit};
use crate::provenance::Taken;
use crate::source::OutlierReport;
use crate::stage_times::StageTimes;
use nirspi_nets::deblur;
use nirspi_recon::words::count_of;
use serde::Serialize;
use std::io;
use std::path::{Path, PathBuf};

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
    pub frames: FrameReports,
    /// Files without an image.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub skipped: Vec<Skipped>,
    /// Why there are no more images, if there should be.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ended: Option<String>,
    /// What is black and white in the pictures.
    pub pictures: Pictures,
    /// The time of each stage.
    pub stage_ms: StageTimes,
    /// Whether networks have enlarged and deblurred images.
    #[serde(skip)]
    pub enhanced: bool,
    /// Number of images that started from the images before.
    #[serde(skip)]
    pub warm: usize,
    /// The last image: number of measurements used, and the method in words.
    #[serde(skip)]
    pub last: (usize, String),
    /// What is said of the images.
    #[serde(skip)]
    pub said: AllSaid,
}

impl StackReport {
    /// The images in words, a line each: their number, and the last one.
    #[must_use]
    pub fn words(&self) -> Vec<String> {
        let Self { input, n, order, warm, last: (used, method), .. } = self;
        let count = self.frames.len();
        let each = self.stage_ms.of("reconstruct") / count as f64;
        let warm = match warm {
            0 => String::new(),
            warm => format!("{warm} started from the frame before, "),
        };
        vec![
            format!(
                "{}: {} of {n} x {n}, order {order}, {warm}{each:.3} ms a frame",
                input.display(),
                count_of(count, "frame"),
            ),
            format!("the last: {}, {method}", count_of(*used, "measurement")),
        ]
    }
}

/// The report of one image of a stack.
#[derive(Debug, Serialize)]
struct ImageReport<'i> {
    /// The file, if there are several.
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<&'i Path>,
    /// Number of the measurement in a file of several, if there are several files.
    #[serde(skip_serializing_if = "Option::is_none")]
    index: Option<usize>,
    /// Number of measurements used.
    used: usize,
    /// Whether the image started from those before it.
    warm: bool,
    /// The method.
    #[serde(flatten)]
    method: &'i MethodReport,
    /// Readings that light cannot have given, whose patterns are left out.
    outliers: &'i [OutlierReport],
    /// What contradicts the readings.
    warnings: &'i [String],
    /// Notes for the user.
    notes: &'i [String],
}

/// A stack that is being written.
pub(super) struct Writing<'r> {
    folder: &'r ResultFolder<'r>,
    for_networks: Option<ForNetworks>,
    images: Images,
    reports: Writer,
    origin: Origin,
    order: String,
    unit: Unit,
    warm: usize,
    last: (usize, String),
    said: AllSaid,
    /// Number of images of which all is on the disk.
    whole: usize,
    /// The last to be dropped: a folder that the run has made can go when no file is in it.
    out: OutputDir,
}

impl<'r> Writing<'r> {
    /// Begins a stack of images like this one, which networks will enhance if `enhanced`.
    pub(super) fn new(
        folder: &'r ResultFolder<'r>,
        enhanced: bool,
        first: &FileImage,
    ) -> Result<Self, FileError> {
        let out = OutputDir::create(folder.out)?;
        let for_networks = match enhanced {
            true => Some(ForNetworks::new(out.scratch()?)),
            false => None,
        };
        let n = first.image.side().pixels();
        Ok(Self {
            images: Images::new(&out, "image.npy", (n, n))?,
            reports: Writer::new(out.scratch()?),
            origin: Origin::of(first),
            order: first.order.clone(),
            unit: Unit::of_readings(first.recorded),
            warm: 0,
            last: (0, String::new()),
            said: AllSaid::default(),
            whole: 0,
            folder,
            out,
            for_networks,
        })
    }

    /// Adds images, all of the side of the first one.
    pub(super) fn add(&mut self, images: &[FileImage]) -> Result<(), PipelineError> {
        if self.for_networks.is_some() && images.iter().any(|image| image.complex) {
            return Err(PipelineError::Complex);
        }
        self.write(images).map_err(|error| FileError::io(self.folder.out, "write to", error))?;
        for (number, image) in (self.whole..).zip(images) {
            self.said.of_image(number, image);
            self.origin.add(image);
            self.warm += usize::from(image.report.made.warm);
        }
        self.whole = self.images.count;
        if let Some(last) = images.last() {
            self.last = (last.used.len(), last.report.to_string());
        }
        Ok(())
    }

    /// Brings images and their reports to the disk.
    fn write(&mut self, images: &[FileImage]) -> io::Result<()> {
        let many = self.folder.many;
        for image in images {
            self.reports.push(&ImageReport {
                file: many.then_some(&image.file),
                index: image.index.filter(|_| many),
                used: image.used.len(),
                warm: image.report.made.warm,
                method: &image.report,
                outliers: &image.outliers,
                warnings: &image.warnings,
                notes: &image.notes,
            })?;
            self.images.push(image.image.pixels())?;
            if let Some(for_networks) = &mut self.for_networks {
                for_networks.push(image)?;
            }
        }
        self.reports.flush()?;
        self.images.flush()
    }

    /// Enhances the images by these networks, if there are any, and writes the pictures and the report. `ended` says why there are no
    /// more images; where a disk was full, there may be fewer.
    pub(super) fn finish(
        mut self,
        skipped: Vec<Skipped>,
        mut ended: Option<PipelineError>,
        networks: Option<&Networks>,
        watch: Watch<'_>,
        mut times: StageTimes,
    ) -> Result<StackReport, PipelineError> {
        if let Some(error) = ended.take_if(|error| self.whole == 0 || !error.leaves_images()) {
            return Err(error);
        }
        let wrong = |error| FileError::io(self.folder.out, "write to", error);
        let provenance = self.origin.taken(self.folder.input).made(self.folder.made);
        let all = match ended.as_ref().and_then(PipelineError::full) {
            None => self.reports.finish().map(|reports| (self.images, reports)),
            Some(full) => {
                // Their images need more space than there is.
                self.for_networks = None;
                those_that_fit(self.images, self.reports, self.whole, full)
            }
        };
        let (mut images, mut frames) = all.map_err(wrong)?;
        let mut enhanced = None;
        if let Some((images, networks)) = self.for_networks.take().zip(networks) {
            let pixels = Images::new(&self.out, "enhanced.npy", (deblur::SIDE, deblur::SIDE))?;
            let mut made = Enhanced {
                pixels,
                reports: Writer::new(self.out.scratch()?),
                warned: Vec::new(),
                said: &mut self.said,
            };
            let work = || images.enhance(networks, &mut made, watch);
            let worked = times.time("enhance", work);
            let Enhanced { pixels, reports, warned, .. } = made;
            match worked {
                // What was enhanced gives its space to the rest of the results.
                Err(error) if error.full().is_some() => ended = ended.or(Some(error)),
                // Nothing was enhanced: there is no half of a result.
                Err(error) if pixels.count == 0 || matches!(error, PipelineError::File(_)) => {
                    return Err(error);
                }
                worked => {
                    ended = ended.or(worked.err());
                    let (reports, to) = (reports.finish().map_err(wrong)?, self.out.scratch()?);
                    frames = frames.with("enhancement", &reports, to).map_err(wrong)?;
                    enhanced = Some((pixels, warned));
                }
            }
        }
        let pictures = times.time("pictures", || -> io::Result<Pictures> {
            let header = format!("{}, {} frames", self.folder.named, images.count);
            let shown = images.chosen()?;
            let sheet = shown.sheet(header.clone(), self.unit);
            let sharp = match &mut enhanced {
                Some((pixels, warned)) => Some((pixels.chosen()?, std::mem::take(warned))),
                None => None,
            };
            let sharp = sharp.as_ref().map(|(shown, warned)| {
                shown
                    .sheet(format!("{header}, enhanced"), Unit::OfWhite)
                    .with_warned(warned.clone())
            });
            Ok(Pictures::of_stack(&sheet, sharp.as_ref(), self.folder.figure, &provenance))
        });
        let pictures = pictures.map_err(wrong)?;
        let (n, is_enhanced) = (images.size.0, enhanced.is_some());
        times.time("write", || -> Result<(), FileError> {
            images.finish(&mut self.out)?;
            if let Some((pixels, _)) = enhanced {
                pixels.finish(&mut self.out)?;
            }
            pictures.write(&mut self.out)
        })?;
        let report = StackReport {
            input: self.folder.input.to_owned(),
            n,
            order: self.order,
            warm_start: self.folder.warm_start,
            frames,
            skipped,
            ended: ended.map(|error| crate::causes::in_one_line(&error)),
            pictures,
            stage_ms: times,
            enhanced: is_enhanced,
            warm: self.warm,
            last: self.last,
            said: self.said.sorted(),
        };
        self.out.write_in_pieces("report.json", |to| provenance.sign_into(&report, to))?;
        self.out.commit()?;
        Ok(report)
    }
}

/// Space for pictures and the beginning of the report.
const ROOM: u64 = 8 << 20;

/// Number of images whose space the rest of the results needs: pictures, and a report that repeats the reports of all images that
/// are left. An image has `bytes`, all reports together have `reports`.
fn given_up(images: usize, bytes: u64, reports: u64) -> usize {
    let each = bytes + 2 * (reports / (images as u64).max(1));
    (reports + ROOM).div_ceil(each) as usize
}

/// The first `whole` images and their reports; of a disk that is full, only as many as leave room for the rest of the results.
fn those_that_fit(
    images: Images,
    reports: Writer,
    whole: usize,
    full: Full,
) -> io::Result<(Images, FrameReports)> {
    let reports = reports.flushed(whole)?;
    let given_up = match full {
        Full::File => 0,
        Full::Disk => given_up(whole, images.bytes_of(1), reports.bytes()?),
    };
    match whole.checked_sub(given_up).filter(|&count| count > 0) {
        Some(count) => Ok((images.cut(count)?, reports.first(count)?)),
        None => Err(io::ErrorKind::StorageFull.into()),
    }
}

/// Where the readings of all images come from, as far as these have it in common.
struct Origin {
    file: PathBuf,
    taken: Taken,
    /// Whether all are of this file, so that all that is known of it holds for all.
    is_one_file: bool,
    is_one_camera: bool,
    is_alike: bool,
}

impl Origin {
    fn of(first: &FileImage) -> Self {
        let (file, taken) = (first.file.clone(), first.taken.clone());
        Self { file, taken, is_one_file: true, is_one_camera: true, is_alike: true }
    }

    fn add(&mut self, image: &FileImage) {
        self.is_one_file &= image.file == self.file;
        self.is_one_camera &= image.taken.camera == self.taken.camera;
        self.is_alike &= image.taken.simulated() == self.taken.simulated();
    }

    /// `named` is the folder, or the first of several files.
    fn taken(&self, named: &Path) -> Taken {
        match self.is_one_file {
            true => self.taken.clone(),
            false => Taken {
                camera: self.taken.camera.clone().filter(|_| self.is_one_camera),
                ..Taken::of_file(named, self.taken.simulated().filter(|_| self.is_alike))
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_given_up_of_a_full_disk_is_enough_for_the_rest() {
        for (images, bytes, of_report) in
            [(4096, 4096, 90), (100_000, 64, 300), (9000, 1 << 18, 2000)]
        {
            let reports = images as u64 * of_report;
            let given_up = given_up(images, bytes, reports);
            let left = images.saturating_sub(given_up) as u64;
            let freed = (bytes + of_report) * given_up as u64;
            assert!(freed >= left * of_report + ROOM, "{images} images of {bytes} bytes");
            assert!(given_up < images, "{given_up} of {images}");
        }
        // Few and small images leave no room.
        assert!(given_up(4096, 64, 4096 * 90) > 4096);
    }
}
