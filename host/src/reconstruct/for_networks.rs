//! Images that networks take when all of a file are there, because all have one white level.

use super::frame_reports::Writer;
use super::images::{Images, values, write_pixels};
use super::pipeline_error::PipelineError;
use super::said::{AllSaid, Kind};
use super::watch::{Step, Watch};
use super::{FileImage, Networks};
use crate::files::FileError;
use crate::imaging::{FrameReport, White};
use nirspi_recon::{Image, Rows, Side};
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Seek};
use std::path::{Path, PathBuf};

/// Images that networks take at a time: enough for them, few enough for the memory.
const ENHANCED_AT_A_TIME: usize = 256;

/// Images as networks take them, until all of a file are there.
pub(super) struct ForNetworks {
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
pub(super) struct Enhanced<'s> {
    pub pixels: Images,
    pub reports: Writer,
    pub warned: Vec<usize>,
    pub said: &'s mut AllSaid,
}

impl ForNetworks {
    /// None yet. They are kept in this file.
    pub(super) fn new(file: File) -> Self {
        Self { pixels: BufWriter::with_capacity(1 << 16, file), alike: Vec::new() }
    }

    /// Adds an image.
    pub(super) fn push(&mut self, image: &FileImage) -> io::Result<()> {
        let given = image.with_readings.as_ref().unwrap_or(&image.image);
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
    pub(super) fn enhance(
        self,
        networks: &Networks,
        made: &mut Enhanced<'_>,
        watch: Watch<'_>,
    ) -> Result<(), PipelineError> {
        let Self { pixels, alike } = self;
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
