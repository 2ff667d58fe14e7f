//! The classifier as a judge of characters: which character an image shows, and how far apart two
//! sets of images are.
//!
//! The distance is always called *Fréchet character distance*. Its 128 features come from a small
//! network trained on characters, so the distance is not comparable with FID.

use super::frechet::{FrechetError, frechet_distance};
use crate::cpu::Classifier;
use crate::images::Images;
use crate::weights::{Weights, WeightsError};
use rayon::prelude::*;

/// Side of the judged images in pixels.
pub const SIDE: usize = crate::grid::FINE;

/// The classifier, on the CPU.
#[derive(Debug)]
pub struct CharacterJudge {
    network: Classifier,
}

/// The classifier's results for a stack.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Judged {
    /// (N, features), row-major.
    pub features: Vec<f32>,
    /// The likeliest class of each image, 0 to 61 for 0-9, A-Z, a-z.
    pub classes: Vec<u8>,
    /// Probability of that class according to the classifier, 0 to 1.
    pub certainty: Vec<f32>,
}

impl CharacterJudge {
    /// The network with these weights (model `classifier`).
    ///
    /// # Errors
    /// [`WeightsError`] if the weights belong to another network.
    pub fn new(weights: &Weights) -> Result<Self, WeightsError> {
        weights.expect_model("classifier")?;
        Ok(Self { network: Classifier::new(weights)? })
    }

    /// Number of features of an image.
    #[must_use]
    pub fn features(&self) -> usize {
        self.network.feature_count()
    }

    /// Judges a stack.
    #[must_use]
    pub fn judge(&self, images: Images<'_, SIDE>) -> Judged {
        let mut all = Judged::default();
        let images = images.values().par_chunks_exact(SIDE * SIDE);
        let features: Vec<_> =
            images.map(|image| self.network.features(image, (SIDE, SIDE))).collect();
        for features in &features {
            let (class, certainty) = likeliest(&self.network.logits(features));
            all.classes.push(class);
            all.certainty.push(certainty);
        }
        all.features = features.concat();
        all
    }

    /// Features, and logits of the 62 classes, of each image.
    #[must_use]
    pub fn evidence(&self, images: Images<'_, SIDE>) -> Vec<(Vec<f32>, Vec<f32>)> {
        let of = |image| {
            let features = self.network.features(image, (SIDE, SIDE));
            let logits = self.network.logits(&features);
            (features, logits)
        };
        images.values().par_chunks_exact(SIDE * SIDE).map(of).collect()
    }

    /// Fréchet character distance between two judged stacks of at least two images each.
    ///
    /// # Errors
    /// [`FrechetError`] if a stack has fewer images.
    pub fn distance(&self, reference: &Judged, test: &Judged) -> Result<f64, FrechetError> {
        frechet_distance(&reference.features, &test.features, self.features())
    }
}

/// The class of the largest logit, and its softmax probability.
fn likeliest(logits: &[f32]) -> (u8, f32) {
    let (mut class, mut most) = (0, f32::NEG_INFINITY);
    for (k, &logit) in logits.iter().enumerate() {
        if logit > most {
            (class, most) = (k as u8, logit);
        }
    }
    (class, 1.0 / logits.iter().map(|logit| (logit - most).exp()).sum::<f32>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn certainty_is_the_share_of_the_likeliest_class() {
        let (class, certainty) = likeliest(&[0.0, 2.0_f32.ln(), 5.0_f32.ln()]);
        assert_eq!(class, 2);
        assert!((certainty - 5.0 / 8.0).abs() < 1e-6);
        assert_eq!(likeliest(&[1e4, -1e4]), (0, 1.0));
    }

    #[test]
    fn each_image_is_judged_on_its_own_whatever_the_batch() {
        const COUNT: usize = 5;
        let judge = CharacterJudge::new(&Weights::embedded("classifier").unwrap()).unwrap();
        let pixel = |at: usize| ((at * 7919 + at / 64) % 97) as f32 / 96.0;
        let stack: Vec<f32> = (0..COUNT * SIDE * SIDE).map(pixel).collect();
        let all = judge.judge(Images::new(&stack).unwrap());
        assert_eq!(all.features.len(), COUNT * judge.features());
        let last = judge.judge(Images::new(&stack[(COUNT - 1) * SIDE * SIDE..]).unwrap());
        assert_eq!(all.classes[COUNT - 1..], last.classes[..]);
        assert_eq!(all.features[(COUNT - 1) * judge.features()..], last.features[..]);
        assert!(judge.distance(&all, &all).unwrap() < 1e-3);
        assert!(judge.distance(&all, &last).is_err());
    }
}
