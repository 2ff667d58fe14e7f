//! The images of a stack on their way into a folder: as they come, with bounded memory.
//!
//! Images and their reports go to the disk at once. Networks take the images of a file when all are there, because all
//! have one white level. Pictures for people show some of the images, which are read again.

use super::frame_reports::{FrameReports, Writer};
use super::pipeline_error::PipelineError;
use super::said::{AllSaid, Kind};
use super::{FileImage, Networks, ResultFolder, Skipped};
use crate::files::output::{Growing, OutputDir};
use crate::files::{FileError, npy};
use crate::imaging::{FrameReport, MethodReport, White};
use crate::picture::{Pictures, Sheet, Unit, chosen};
use crate::provenance::Taken;
use crate::source::OutlierReport;
use crate::stage_times::StageTimes;
use nirspi_nets::deblur;
use nirspi_recon::words::count_of;
use nirspi_recon::{Image, Rows, Side};
use serde::Serialize;
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Seek, Write};
use std::path::{Path, PathBuf};

/// Images that networks take at a time: enough for them, few enough for the memory.
const ENHANCED_AT_A_TIME: usize = 256;

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
        vec![
            format!(
                "{}: {} of {n} x {n}, order {order}, {warm} started from the frame before, {each:.3} ms a frame",
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
    used: usize,
    warm: bool,
    #[serde(flatten)]
    method: &'i MethodReport,
    outliers: &'i [OutlierReport],
    warnings: &'i [String],
    notes: &'i [String],
}

/// What is done to a stack.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// An image is made of measurements, or all images of one of many files.
    Reconstruct,
    /// Networks enlarge and deblur an image.
    Enhance,
}

/// Is called before each step of each image, from any thread. `false` ends the work, and the images that are there are written.
pub type Watch<'w> = &'w (dyn Fn(Step) -> bool + Sync);

/// A stack that is being written.
pub(super) struct Writing<'r> {
    folder: &'r ResultFolder<'r>,
    networks: Option<ForNetworks<'r>>,
    images: Images,
    reports: Writer,
    origin: Origin,
    order: String,
    unit: Unit,
    warm: usize,
    last: (usize, String),
    said: AllSaid,
    /// The last to be dropped: a folder that the run has made can go when no file is in it.
    out: OutputDir,
}

impl<'r> Writing<'r> {
    /// Begins a stack of images like this one.
    pub(super) fn new(
        folder: &'r ResultFolder<'r>,
        networks: Option<&'r Networks>,
        first: &FileImage,
    ) -> Result<Self, FileError> {
        let out = OutputDir::create(folder.out)?;
        let networks = match networks {
            Some(networks) => Some(ForNetworks::new(networks, out.scratch()?)),
            None => None,
        };
        Ok(Self {
            images: Images::new(&out, "image.npy", first.image.side().pixels())?,
            reports: Writer::new(out.scratch()?),
            origin: Origin::of(first),
            order: first.order.clone(),
            unit: Unit::of_readings(first.recorded),
            warm: 0,
            last: (0, String::new()),
            said: AllSaid::default(),
            folder,
            out,
            networks,
        })
    }

    /// Adds images, all of the side of the first one.
    pub(super) fn add(&mut self, images: &[FileImage]) -> Result<(), PipelineError> {
        if self.networks.is_some() && images.iter().any(|image| image.complex) {
            return Err(PipelineError::Complex);
        }
        let many = self.folder.many;
        for image in images {
            self.said.of_image(self.images.count, image);
            self.origin.add(image);
            self.warm += usize::from(image.report.made.warm);
            let report = ImageReport {
                file: many.then_some(&image.file),
                index: image.index.filter(|_| many),
                used: image.used.len(),
                warm: image.report.made.warm,
                method: &image.report,
                outliers: &image.outliers,
                warnings: &image.warnings,
                notes: &image.notes,
            };
            let mut kept = || -> io::Result<()> {
                self.reports.push(&report)?;
                self.images.push(image.image.pixels())?;
                self.networks.as_mut().map_or(Ok(()), |networks| networks.push(image))
            };
            kept().map_err(|error| FileError::io(self.folder.out, "write to", error))?;
        }
        if let Some(last) = images.last() {
            self.last = (last.used.len(), last.report.to_string());
        }
        Ok(())
    }

    /// Enhances the images if that is asked for, and writes the pictures and the report. `ended` says why there are no
    /// more images.
    pub(super) fn finish(
        mut self,
        skipped: Vec<Skipped>,
        mut ended: Option<PipelineError>,
        watch: Watch<'_>,
        mut times: StageTimes,
    ) -> Result<StackReport, PipelineError> {
        let wrong = |error| FileError::io(self.folder.out, "write to", error);
        let provenance = self.origin.taken(self.folder.input).made(self.folder.made);
        let mut frames = self.reports.finish().map_err(wrong)?;
        let mut enhanced = None;
        if let Some(networks) = self.networks.take() {
            let pixels = Images::new(&self.out, "enhanced.npy", deblur::SIDE)?;
            let mut made = Enhanced {
                pixels,
                reports: Writer::new(self.out.scratch()?),
                warned: Vec::new(),
                said: &mut self.said,
            };
            let work = || networks.enhance(&mut made, watch);
            if let Err(error) = times.time("enhance", work) {
                // Nothing was enhanced: there is no half of a result.
                if made.pixels.count == 0 || matches!(error, PipelineError::File(_)) {
                    return Err(error);
                }
                ended = ended.or(Some(error));
            }
            let Enhanced { pixels, reports, warned, .. } = made;
            let reports = reports.finish().map_err(wrong)?;
            frames = frames.with("enhancement", &reports, self.out.scratch()?).map_err(wrong)?;
            enhanced = Some((pixels, warned));
        }
        let pictures = times.time("pictures", || -> io::Result<Pictures> {
            let header = format!("{}, {} frames", self.folder.named, self.images.count);
            let shown = self.images.chosen()?;
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
        let n = self.images.n;
        times.time("write", || -> Result<(), FileError> {
            self.images.finish(&mut self.out)?;
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
            warm: self.warm,
            last: self.last,
            said: self.said.sorted(),
        };
        self.out.write_in_pieces("report.json", |to| provenance.sign_into(&report, to))?;
        self.out.commit()?;
        Ok(report)
    }
}

/// Images of n x n that become an array in a file.
struct Images {
    to: Growing,
    n: usize,
    count: usize,
}

impl Images {
    fn new(out: &OutputDir, name: &str, n: usize) -> Result<Self, FileError> {
        Ok(Self { to: out.grow(name, Self::header(0, n).len())?, n, count: 0 })
    }

    /// The bytes before the pixels, whose number is the same for any number of images
    /// (`tests::a_header_has_one_length`).
    fn header(count: usize, n: usize) -> Vec<u8> {
        npy::header::<f32>(&[count, n, n])
    }

    fn push(&mut self, pixels: &[f32]) -> io::Result<()> {
        write_pixels(&mut self.to, pixels)?;
        self.count += 1;
        Ok(())
    }

    /// Those that pictures show.
    fn chosen(&mut self) -> io::Result<Shown> {
        let numbers = chosen(self.count);
        let area = self.n * self.n;
        let mut bytes = vec![0; 4 * area];
        let mut pixels = Vec::with_capacity(area * numbers.len());
        for &number in &numbers {
            self.to.read_at((number * bytes.len()) as u64, &mut bytes)?;
            pixels.extend(values(&bytes));
        }
        Ok(Shown { count: self.count, n: self.n, numbers, pixels })
    }

    fn finish(self, out: &mut OutputDir) -> Result<(), FileError> {
        out.take(self.to, &Self::header(self.count, self.n))
    }
}

/// Some images of a stack.
struct Shown {
    count: usize,
    n: usize,
    numbers: Vec<usize>,
    pixels: Vec<f32>,
}

impl Shown {
    fn sheet(&self, header: String, unit: Unit) -> Sheet<'_> {
        let n = self.n;
        let images = self.pixels.chunks_exact(n * n).collect();
        Sheet::of_chosen(header, (n, n), self.count, (self.numbers.clone(), images), unit)
    }
}

fn write_pixels(to: &mut impl Write, pixels: &[f32]) -> io::Result<()> {
    let bytes: Vec<u8> = pixels.iter().flat_map(|pixel| pixel.to_le_bytes()).collect();
    to.write_all(&bytes)
}

fn values(bytes: &[u8]) -> impl Iterator<Item = f32> {
    bytes.as_chunks::<4>().0.iter().map(|&pixel| f32::from_le_bytes(pixel))
}

/// Images as networks take them, until all of a file are there.
struct ForNetworks<'r> {
    networks: &'r Networks,
    pixels: BufWriter<File>,
    /// Images one after another that are alike, of which `levels` has the white level of each.
    alike: Vec<Alike>,
}

struct Alike {
    file: PathBuf,
    rows: Rows,
    side: Side,
    levels: Vec<f32>,
    first: usize,
}

/// What networks have made.
struct Enhanced<'s> {
    pixels: Images,
    reports: Writer,
    warned: Vec<usize>,
    said: &'s mut AllSaid,
}

impl<'r> ForNetworks<'r> {
    fn new(networks: &'r Networks, file: File) -> Self {
        Self { networks, pixels: BufWriter::with_capacity(1 << 16, file), alike: Vec::new() }
    }

    fn push(&mut self, image: &FileImage) -> io::Result<()> {
        let given = &image.with_readings;
        write_pixels(&mut self.pixels, given.pixels())?;
        let level = White::Brightest.level(given);
        match self.alike.last_mut() {
            Some(alike) if alike.rows == image.used && alike.file == image.file => {
                alike.levels.push(level);
            }
            before => {
                let first = before.map_or(0, |alike| alike.first + alike.levels.len());
                let (file, rows) = (image.file.clone(), image.used.clone());
                let alike = Alike { file, rows, side: given.side(), levels: vec![level], first };
                self.alike.push(alike);
            }
        }
        Ok(())
    }

    /// Enhances all images. Those of a file have one white level.
    fn enhance(self, made: &mut Enhanced<'_>, watch: Watch<'_>) -> Result<(), PipelineError> {
        let Self { networks, pixels, alike } = self;
        let wrong = |error| FileError::io(Path::new("images for networks"), "read", error);
        let rewound = || -> io::Result<File> {
            let mut file = pixels.into_inner().map_err(io::IntoInnerError::into_error)?;
            file.rewind()?;
            Ok(file)
        };
        let mut pixels = BufReader::with_capacity(1 << 16, rewound().map_err(wrong)?);
        let mut turns = networks.turns();
        for of_file in alike.chunk_by(|a, b| a.file == b.file) {
            let levels = of_file.iter().flat_map(|alike| alike.levels.iter().copied());
            let white = White::median(levels);
            let in_file: usize = of_file.iter().map(|alike| alike.levels.len()).sum();
            let start = of_file[0].first;
            for alike in of_file {
                let mut bytes = vec![0; 4 * alike.side.area()];
                let mut number = alike.first;
                let end = alike.first + alike.levels.len();
                while number < end {
                    let some = ENHANCED_AT_A_TIME.min(end - number);
                    if !(0..some).all(|_| watch(Step::Enhance)) {
                        return Err(PipelineError::Stopped);
                    }
                    let read = (0..some).map(|_| {
                        pixels.read_exact(&mut bytes)?;
                        Ok(Image::new(alike.side, values(&bytes).collect()))
                    });
                    let images: Vec<Image> = read.collect::<io::Result<_>>().map_err(wrong)?;
                    let images: Vec<&Image> = images.iter().collect();
                    let results = networks.enhance(&mut turns, &images, &alike.rows, white)?;
                    for (number, (sharp, report)) in (number..).zip(results) {
                        let index = (in_file > 1).then_some(number - start);
                        let of = || (alike.file.clone(), index);
                        made.push(number, of, &sharp, &report).map_err(wrong)?;
                    }
                    number += some;
                }
            }
        }
        if let (Some(said), Some(first)) = (turns.said(), alike.first()) {
            let said = format!("networks: {said}");
            made.said.add(Kind::Note, &said, 0, || (first.file.clone(), None));
        }
        Ok(())
    }
}

impl Enhanced<'_> {
    fn push(
        &mut self,
        number: usize,
        of: impl Fn() -> (PathBuf, Option<usize>),
        sharp: &[f32],
        report: &FrameReport,
    ) -> io::Result<()> {
        if report.warns() {
            self.warned.push(number);
        }
        for warning in &report.warnings {
            self.said.add(Kind::Warning, warning, number, &of);
        }
        self.reports.push(report)?;
        self.pixels.push(sharp)
    }
}

/// Where the readings of all images come from, as far as these have it in common.
struct Origin {
    file: PathBuf,
    taken: Taken,
    /// Whether all are of this file, so that all that is known of it holds for all.
    is_one_file: bool,
    is_alike: bool,
}

impl Origin {
    fn of(first: &FileImage) -> Self {
        let (file, taken) = (first.file.clone(), first.taken.clone());
        Self { file, taken, is_one_file: true, is_alike: true }
    }

    fn add(&mut self, image: &FileImage) {
        self.is_one_file &= image.file == self.file;
        self.is_alike &= image.taken.simulated() == self.taken.simulated();
    }

    /// `named` is the folder, or the first of several files.
    fn taken(&self, named: &Path) -> Taken {
        match self.is_one_file {
            true => self.taken.clone(),
            false => Taken::of_file(named, self.taken.simulated().filter(|_| self.is_alike)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_has_one_length() {
        for n in [1, 32, 64, 4096] {
            for count in [1, 9, 1_000_000, usize::MAX] {
                assert_eq!(Images::header(count, n).len(), Images::header(0, n).len());
            }
        }
    }
}
