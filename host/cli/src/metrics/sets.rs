//! What two stacks are to each other as sets: distances of features, and who can read them.
//!
//! The law: a figure that could not be had is `null`, and `notes` says why. No number is called FID but FID.

use super::Args;
use anyhow::{Context, Result, bail};
use indicatif::{ProgressBar, ProgressStyle};
use nirspi::files::npy::{Stack, read_list};
use nirspi::legibility::{Judge, LegibilityError};
use nirspi_nets::Weights;
use nirspi_nets::data::CHARACTERS;
use nirspi_nets::images::Images;
use nirspi_nets::metrics::{CharacterJudge, Inception, frechet_distance, inception};
use serde::Serialize;
use std::path::Path;

/// A share of the reference's images and of the test's.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Shares {
    reference: f64,
    test: f64,
}

#[derive(Debug, Default, Serialize)]
pub struct Sets {
    /// On 128 features of this program's own classifier: comparable with nobody's FID.
    frechet_character_distance: Option<f64>,
    /// How often the classifier sees the labelled character.
    character_accuracy: Option<Shares>,
    fid: Option<f64>,
    legibility_judge: Option<String>,
    /// How often the outside judge reads the labelled character.
    legibility: Option<Shares>,
    notes: Vec<String>,
}

impl Sets {
    pub fn compare(args: &Args, reference: &Stack, test: &Stack) -> Result<Self> {
        let labels = args.labels.as_deref().map(|path| labels(path, test.count)).transpose()?;
        let mut sets = Self::default();
        sets.judge_characters(reference, test, labels.as_deref())?;
        if let Some(path) = &args.inception {
            sets.measure_fid(path, reference, test)?;
        }
        if let Some(labels) = labels.as_deref().filter(|_| args.legibility) {
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

    fn measure_fid(&mut self, path: &Path, reference: &Stack, test: &Stack) -> Result<()> {
        let network = Inception::new(&Weights::read(path)?)?;
        if !network.is_of_fid() {
            self.notes.push(format!(
                "these weights tell other than {} classes: FID is defined with those that do; compare this one only \
                 with itself",
                inception::FID_CLASSES
            ));
        }
        let style = ProgressStyle::with_template("inception {bar:30} {pos}/{len}, {eta} left")
            .unwrap_or_else(|_| ProgressStyle::default_bar());
        let bar = ProgressBar::new(2 * test.count as u64).with_style(style);
        let features = |stack: &Stack| -> Result<Vec<f32>> {
            let mut all = Vec::with_capacity(stack.count * inception::FEATURES);
            for image in stack.values.chunks_exact(stack.height * stack.width) {
                all.extend(network.features(image, (stack.height, stack.width))?);
                bar.inc(1);
            }
            Ok(all)
        };
        let (a, b) = (features(reference)?, features(test)?);
        bar.finish_and_clear();
        let named = || format!("FID with {}", path.display());
        self.fid = Some(frechet_distance(&a, &b, inception::FEATURES).with_context(named)?);
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

/// How often two lists of one length say the same.
fn agreement<T: PartialEq>(found: &[T], expected: &[T]) -> f64 {
    let same = found.iter().zip(expected).filter(|(a, b)| a == b).count();
    same as f64 / expected.len() as f64
}

fn labels(path: &Path, images: usize) -> Result<Vec<u8>> {
    let labels = read_list(path)?;
    if labels.len() != images {
        bail!("{}: {} labels, expected {images}, one an image", path.display(), labels.len());
    }
    let class = |(at, label): (usize, &f64)| {
        let known = label.fract() == 0.0 && (0.0..CHARACTERS.len() as f64).contains(label);
        known.then_some(*label as u8).with_context(|| {
            let last = CHARACTERS.len() - 1;
            format!(
                "{}: {label} at [{at}], expected whole numbers from 0 to {last}",
                path.display()
            )
        })
    };
    labels.iter().enumerate().map(class).collect()
}
