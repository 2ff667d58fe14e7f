//! The similarity of two stacks of images: PSNR and SSIM image by image, distances of features, and
//! recognised characters.
//!
//! # Invariant
//! A figure that cannot be computed is `null`, and `notes` says why
//! (`tests::a_figure_that_cannot_be_computed_is_noted`).

mod images;

pub use images::{Align, Scaled, read_images, scaled};

use crate::error::{EvalError, Result};
use crate::legibility::{Judge, LegibilityError};
use images::outside;
use nirspi::files::npy::{Stack, read_list};
use nirspi_nets::Weights;
use nirspi_nets::data::CHARACTERS;
use nirspi_nets::images::Images;
use nirspi_nets::metrics::CharacterJudge;
use nirspi_recon::metrics;
use serde::Serialize;
use std::path::Path;

/// A share of the reference's images and of the test's.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Shares {
    /// Share of the reference's images.
    pub reference: f64,
    /// Share of the test's images.
    pub test: f64,
}

/// The similarity of two stacks as sets.
#[derive(Debug, Default, Serialize)]
pub struct Sets {
    /// Fréchet distance on 128 features of this program's own classifier, which is not comparable
    /// with FID.
    pub frechet_character_distance: Option<f64>,
    /// Share of the images in which the classifier recognises the labelled character.
    pub character_accuracy: Option<Shares>,
    /// The name of the character reader.
    pub legibility_judge: Option<String>,
    /// Share of the images in which the character reader recognises the labelled character.
    pub legibility: Option<Shares>,
    /// Why a figure is missing.
    pub notes: Vec<String>,
}

impl Sets {
    /// Compares two stacks of the same shape, with the further figures that `options` requests.
    ///
    /// # Errors
    /// [`EvalError`] for weights that do not fit, or a character reader that fails.
    fn compare(reference: &Stack, test: &Stack, options: &Options<'_>) -> Result<Self> {
        let mut sets = Self::default();
        sets.judge_characters(reference, test, options.labels)?;
        if let Some(labels) = options.labels.filter(|_| options.legibility) {
            sets.have_read(reference, test, labels)?;
        }
        Ok(sets)
    }

    fn judge_characters(
        &mut self,
        reference: &Stack,
        test: &Stack,
        labels: Option<&[u8]>,
    ) -> Result<()> {
        if (test.height, test.width) != (64, 64) {
            let shape = format!("{} x {}", test.height, test.width);
            self.notes.push(format!("the classifier judges images of 64 x 64, not {shape}"));
            return Ok(());
        }
        if [reference, test].iter().any(|stack| outside(stack).is_some()) {
            self.notes.push("the classifier judges images in [0, 1]".to_owned());
            return Ok(());
        }
        let judge = CharacterJudge::new(&Weights::embedded("classifier")?)?;
        let [a, b] = [&reference.values, &test.values].map(|values| Images::new(values));
        let (a, b) = (judge.judge(a?), judge.judge(b?));
        match judge.distance(&a, &b) {
            Ok(distance) => self.frechet_character_distance = Some(distance),
            Err(why) => self.notes.push(format!("no Fréchet character distance: {why}")),
        }
        self.character_accuracy = labels.map(|labels| Shares {
            reference: agreement(&a.classes, labels),
            test: agreement(&b.classes, labels),
        });
        Ok(())
    }

    fn have_read(&mut self, reference: &Stack, test: &Stack, labels: &[u8]) -> Result<()> {
        let judge = match Judge::tesseract() {
            Ok(judge) => judge,
            Err(why @ LegibilityError::Absent) => {
                self.notes.push(format!("legibility skipped: {why}"));
                return Ok(());
            }
            Err(error) => return Err(error.into()),
        };
        let shown: Vec<_> = labels.iter().map(|&l| CHARACTERS.chars().nth(l.into())).collect();
        let share = |stack: &Stack| -> Result<f64> {
            Ok(agreement(&judge.read(&stack.values, (stack.height, stack.width))?, &shown))
        };
        self.legibility = Some(Shares { reference: share(reference)?, test: share(test)? });
        self.legibility_judge = Some(judge.name);
        Ok(())
    }
}

/// Share of equal entries in two lists of the same length.
fn agreement<T: PartialEq>(found: &[T], expected: &[T]) -> f64 {
    let same = found.iter().zip(expected).filter(|(a, b)| a == b).count();
    same as f64 / expected.len() as f64
}

/// Reads the character in each of `images` images, 0 to 61 for 0-9, A-Z, a-z.
///
/// # Errors
/// [`EvalError`] for a file that cannot be read, another number of labels, or a label out of range.
pub fn read_labels(path: &Path, images: usize) -> Result<Vec<u8>> {
    let labels = read_list(path)?;
    if labels.len() != images {
        return Err(EvalError::Content(format!(
            "{}: {} labels, expected {images}, one an image",
            path.display(),
            labels.len()
        )));
    }
    let class = |(at, label): (usize, &f64)| {
        let known = label.fract() == 0.0 && (0.0..CHARACTERS.len() as f64).contains(label);
        known.then_some(*label as u8).ok_or_else(|| {
            EvalError::Content(format!(
                "{}: {label} at [{at}], expected whole numbers from 0 to {}",
                path.display(),
                CHARACTERS.len() - 1
            ))
        })
    };
    labels.iter().enumerate().map(class).collect()
}

/// The figures of one image.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ImageMetrics {
    /// PSNR; `null` if the images are identical.
    pub psnr_db: Option<f64>,
    /// Structural similarity, Gaussian window of 11 px.
    pub ssim: f64,
}

/// The similarity of two stacks.
#[derive(Debug, Serialize)]
pub struct Comparison {
    /// Number of pairs of images.
    pub images: usize,
    /// Rows of an image.
    pub height: usize,
    /// Columns of an image.
    pub width: usize,
    /// Mean PSNR; `null` if all images are identical.
    pub mean_psnr_db: Option<f64>,
    /// Mean SSIM over the images.
    pub mean_ssim: f64,
    /// The similarity as sets.
    #[serde(flatten)]
    pub sets: Sets,
    /// The figures image by image.
    pub each: Vec<ImageMetrics>,
}

/// The figures besides PSNR, SSIM and the Fréchet character distance.
#[derive(Clone, Copy, Default)]
pub struct Options<'a> {
    /// The character in each image, for the character accuracy.
    pub labels: Option<&'a [u8]>,
    /// Whether Tesseract reads the characters.
    pub legibility: bool,
}

/// Compares two stacks of images in `[0, 1]` of the same shape, without scaling or fitting.
///
/// # Errors
/// [`EvalError`] for stacks of different shapes, images too small for SSIM, or weights that do not
/// fit.
pub fn compare(reference: &Stack, test: &Stack, options: &Options<'_>) -> Result<Comparison> {
    let shape = |s: &Stack| (s.count, s.height, s.width);
    if shape(reference) != shape(test) {
        let (found, expected) = (shape(test), shape(reference));
        return Err(EvalError::Content(format!("shape {found:?}, expected {expected:?}")));
    }
    let (height, width) = (reference.height, reference.width);
    let mut each = Vec::with_capacity(reference.count);
    let pairs = reference.values.chunks_exact(height * width);
    for (a, b) in pairs.zip(test.values.chunks_exact(height * width)) {
        let psnr = metrics::psnr(a, b, width, height, 1.0)?;
        each.push(ImageMetrics {
            // Identical images have an infinite PSNR, which JSON cannot hold.
            psnr_db: psnr.is_finite().then_some(psnr),
            ssim: metrics::ssim(a, b, width, height, 1.0)?,
        });
    }
    let finite: Vec<f64> = each.iter().filter_map(|image| image.psnr_db).collect();
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    Ok(Comparison {
        images: reference.count,
        height,
        width,
        mean_psnr_db: (!finite.is_empty()).then(|| mean(&finite)),
        mean_ssim: each.iter().map(|image| image.ssim).sum::<f64>() / each.len() as f64,
        sets: Sets::compare(reference, test, options)?,
        each,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi::files::npy::encode;

    fn stack(count: usize, side: usize, value: impl Fn(usize) -> f32) -> Stack {
        let values = (0..count * side * side).map(value).collect();
        Stack { count, height: side, width: side, values }
    }

    #[test]
    fn a_figure_that_cannot_be_computed_is_noted() {
        let small = stack(2, 16, |at| (at % 7) as f32 / 7.0);
        let same = compare(&small, &small, &Options::default()).unwrap();
        assert_eq!((same.mean_psnr_db, same.mean_ssim), (None, 1.0));
        assert_eq!(same.sets.frechet_character_distance, None);
        assert_eq!(same.sets.notes, ["the classifier judges images of 64 x 64, not 16 x 16"]);
        let one = stack(1, 64, |at| (at % 7) as f32 / 7.0);
        let one = compare(&one, &one, &Options::default()).unwrap();
        assert!(one.sets.notes[0].starts_with("no Fréchet character distance: "), "{:?}", one.sets);
    }

    #[test]
    fn identical_images_do_not_enter_the_mean_of_the_psnr() {
        let reference = stack(2, 16, |at| (at % 16) as f32 / 32.0);
        let test = stack(2, 16, |at| (at % 16) as f32 / 32.0 + if at < 256 { 0.0 } else { 0.1 });
        let report = compare(&reference, &test, &Options::default()).unwrap();
        assert_eq!(report.each[0].psnr_db, None);
        assert!((report.mean_psnr_db.unwrap() - 20.0).abs() < 1e-4, "{report:?}");
        let wide = compare(&reference, &stack(1, 16, |_| 0.0), &Options::default());
        let told = "shape (1, 16, 16), expected (2, 16, 16)";
        assert_eq!(wide.unwrap_err().to_string(), told);
    }

    #[test]
    fn labels_are_whole_numbers_one_an_image() {
        let folder = tempfile::tempdir().unwrap();
        let read = |labels: &[f64], images| {
            let path = folder.path().join("labels.npy");
            std::fs::write(&path, encode(&[labels.len()], labels)).unwrap();
            read_labels(&path, images).map_err(|error| error.to_string())
        };
        assert_eq!(read(&[0.0, 61.0], 2), Ok(vec![0, 61]));
        assert!(read(&[0.0], 2).unwrap_err().ends_with("1 labels, expected 2, one an image"));
        assert!(read(&[0.0, 62.0], 2).unwrap_err().contains("62 at [1]"));
        assert!(read(&[0.5, 2.0], 2).unwrap_err().contains("0.5 at [0]"));
    }
}
