//! The pictures of a run, with the ranges of their images for the run's report.
//!
//! # Invariant
//! A picture that shows fewer images than there are says so, in the picture, in the report and in
//! words (`tests::what_is_left_out_is_said_in_the_report_and_in_words`).

use super::figure::Figure;
use super::layout::{Panel, SideBySide};
use super::look::FigureStyle;
use super::scale::{PERCENTILES, Range, Scale, Unit};
use super::sheet::Sheet;
use super::video;
use nirspi_files::FileError;
use nirspi_files::output::{Existing, OutputDir, write_result};
use nirspi_files::provenance::Provenance;
use nirspi_recon::{Image, Shape};
use serde::Serialize;
use std::fmt;
use std::path::Path;

/// Pictures that are drawn but not yet written, all of one provenance. As JSON: each file with the
/// ranges of its images.
#[derive(Debug, Clone, Serialize)]
#[serde(transparent)]
pub struct Pictures {
    entries: Vec<Entry>,
    #[serde(skip)]
    style: FigureStyle,
    #[serde(skip)]
    provenance: Provenance,
}

#[derive(Debug, Clone, Serialize)]
struct Entry {
    /// Name of the file.
    file: String,
    /// Number of images in the file.
    shown: usize,
    /// Number of images that there are.
    of: usize,
    /// The percentiles that are black and white, if an image is stretched.
    #[serde(skip_serializing_if = "Option::is_none")]
    percentiles: Option<[f64; 2]>,
    /// What is black and white: for each image, or once for all.
    images: Vec<Shown>,
    /// The picture, then the same in other formats: names and bytes.
    #[serde(skip)]
    files: Vec<(String, Vec<u8>)>,
}

#[derive(Debug, Clone, Serialize)]
struct Shown {
    /// The title above the image.
    #[serde(skip_serializing_if = "String::is_empty")]
    title: String,
    #[serde(flatten)]
    scale: Scale,
}

impl Pictures {
    /// No picture yet.
    #[must_use]
    pub fn new(style: FigureStyle, provenance: &Provenance) -> Self {
        Self { entries: Vec::new(), style, provenance: provenance.clone() }
    }

    /// The provenance of all pictures.
    #[must_use]
    pub fn provenance(&self) -> &Provenance {
        &self.provenance
    }

    /// Draws panels side by side: a PNG of this name, and SVG and PDF beside it.
    ///
    /// # Panics
    /// As [`Figure::draw`].
    pub fn add(&mut self, file: &str, picture: SideBySide) {
        let figure = Figure::Images(picture);
        let files = figure.files(self.style, &self.provenance);
        self.images(file, &figure, named(file, files));
    }

    fn images(&mut self, file: &str, figure: &Figure, files: Vec<(String, Vec<u8>)>) {
        let Figure::Images(picture) = figure else { return };
        let shown = |panel: &Panel| Shown { title: panel.title.clone(), scale: panel.scale() };
        let count = picture.panels.len();
        let stretched = picture.panels.iter().any(|panel| panel.range == Range::Stretched);
        self.entries.push(Entry {
            file: file.to_owned(),
            shown: count,
            of: count,
            percentiles: stretched.then_some(PERCENTILES),
            images: picture.panels.iter().map(shown).collect(),
            files,
        });
    }

    /// Draws one image: a PNG of this name, and SVG and PDF beside it.
    ///
    /// # Panics
    /// As [`Figure::draw`].
    pub fn single(&mut self, file: &str, panel: Panel) {
        self.add(file, panel.into());
    }

    /// Draws each panel of a picture by itself, as a PNG of this name.
    ///
    /// # Panics
    /// As [`Figure::draw`].
    pub fn each(&mut self, names: &[&str], panels: &[Panel]) {
        for (name, panel) in names.iter().zip(panels) {
            let file = format!("{name}.png");
            let figure = Figure::Images(panel.clone().into());
            let png = figure.png(&self.style.look(), &self.provenance);
            self.images(&file, &figure, vec![(file.clone(), png)]);
        }
    }

    /// The pictures of a reconstruction: `image.png`, and `enhanced.png` of the enhanced image in
    /// `[0, 1]` with its warnings, if there is one.
    #[must_use]
    pub fn of_image(
        image: &Image<impl Shape>,
        unit: Unit,
        enhanced: Option<(&[f32], Vec<String>)>,
        style: FigureStyle,
        provenance: &Provenance,
    ) -> Self {
        let mut pictures = Self::new(style, provenance);
        let panel = Panel::of_image("reconstructed", image, unit);
        pictures.single("image.png", panel);
        if let Some((values, warnings)) = enhanced {
            let panel = Panel::square("enhanced", values.len().isqrt(), values, Unit::OfWhite);
            pictures.single("enhanced.png", Panel { warnings, ..panel });
        }
        pictures
    }

    /// The pictures of a stack: a contact sheet and a video of the images, and of the enhanced ones
    /// in `[0, 1]`, if there are any.
    ///
    /// # Panics
    /// If there is no image.
    #[must_use]
    pub fn of_stack(
        images: &Sheet<'_>,
        enhanced: Option<&Sheet<'_>>,
        style: FigureStyle,
        provenance: &Provenance,
    ) -> Self {
        let mut pictures = Self::new(style, provenance);
        pictures.sheet_and_video("image", images);
        enhanced.into_iter().for_each(|sheet| pictures.sheet_and_video("enhanced", sheet));
        pictures
    }

    /// Draws a contact sheet: a PNG of this name, and SVG and PDF beside it.
    pub fn sheet(&mut self, file: &str, sheet: &Sheet<'_>) {
        let files = named(file, sheet.files(self.style, &self.provenance));
        self.many(file, sheet, sheet.shown().len(), files);
    }

    /// Draws a contact sheet, `NAME.png`, and the same images as a video, `NAME.apng`: 100 of them at most,
    /// evenly chosen.
    pub fn sheet_and_video(&mut self, name: &str, sheet: &Sheet<'_>) {
        self.sheet(&format!("{name}.png"), sheet);
        let video = video::beside(sheet, self.style, &self.provenance);
        let file = format!("{name}.apng");
        self.many(&file, sheet, video.frames, vec![(file.clone(), video.bytes)]);
    }

    fn many(&mut self, file: &str, sheet: &Sheet<'_>, shown: usize, files: Vec<(String, Vec<u8>)>) {
        let of_scale = |(title, scale)| Shown { title, scale };
        let images = sheet.scales().into_iter().map(of_scale).collect();
        let (file, of) = (file.to_owned(), sheet.count());
        self.entries.push(Entry { file, shown, of, percentiles: Some(PERCENTILES), images, files });
    }

    /// All files, those beside the pictures among them.
    fn files(&self) -> impl Iterator<Item = &(String, Vec<u8>)> {
        self.entries.iter().flat_map(|entry| &entry.files)
    }

    /// Stages the files in a folder.
    ///
    /// # Errors
    /// [`FileError`] names the file and the system's reason.
    pub fn write(&self, out: &mut OutputDir) -> Result<(), FileError> {
        self.files().try_for_each(|(name, bytes)| out.write(name, bytes))
    }

    /// Writes the files, whose names are paths here.
    ///
    /// # Errors
    /// [`FileError`] names the file and the system's reason.
    pub fn write_files(&self, existing: Existing<'_>) -> Result<(), FileError> {
        self.files().try_for_each(|(name, _)| existing.check(Path::new(name)))?;
        self.files().try_for_each(|(name, bytes)| write_result(Path::new(name), existing, bytes))
    }
}

/// Files beside each other: the name of the PNG with other endings.
fn named(png: &str, files: Vec<(&'static str, Vec<u8>)>) -> Vec<(String, Vec<u8>)> {
    let name = |ending| match ending {
        "png" => png.to_owned(),
        _ => Path::new(png).with_extension(ending).display().to_string(),
    };
    files.into_iter().map(|(ending, bytes)| (name(ending), bytes)).collect()
}

/// The files in words, with what each leaves out.
impl fmt::Display for Pictures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (k, Entry { file, shown, of, .. }) in self.entries.iter().enumerate() {
            let comma = if k == 0 { "" } else { ", " };
            write!(f, "{comma}{file}")?;
            if shown < of {
                write!(f, " ({shown} of {of} frames)")?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::provenance;

    #[test]
    fn the_range_of_every_picture_is_in_the_report() {
        let mut pictures = Pictures::new(FigureStyle::Paper, &provenance());
        let mut values = vec![1.0; 1024];
        values[..100].fill(-2.0);
        values[7] = 99.0;
        pictures.single("image.png", Panel::square("image", 32, &values, Unit::AdcCounts));
        let report = serde_json::to_value(&pictures).unwrap();
        let expected = serde_json::json!([{
            "file": "image.png", "shown": 1, "of": 1, "percentiles": [0.5, 99.5],
            "images": [{
                "title": "image", "unit": "ADC counts",
                "black": -2.0, "white": 1.0, "least": -2.0, "most": 99.0
            }]
        }]);
        assert_eq!(report, expected);
        assert_eq!(pictures.to_string(), "image.png");
    }

    #[test]
    fn what_is_left_out_is_said_in_the_report_and_in_words() {
        let values: Vec<f32> = (0..100 * 16).map(|p| (p % 16) as f32).collect();
        let images = values.chunks_exact(16).collect();
        let sheet = Sheet::new("frames".to_owned(), (4, 4), images, Unit::Readings);
        let mut pictures = Pictures::new(FigureStyle::Paper, &provenance());
        pictures.sheet_and_video("image", &sheet);
        assert_eq!(pictures.to_string(), "image.png (64 of 100 frames), image.apng");
        let report = serde_json::to_value(&pictures).unwrap();
        assert_eq!((&report[0]["shown"], &report[0]["of"]), (&64.into(), &100.into()));
        assert_eq!((&report[1]["shown"], &report[1]["of"]), (&100.into(), &100.into()));
    }
}
