//! Characters as our own classifier sees them: which one an image shows, and how far two sets of images are apart.
//!
//! The law: its Fréchet distance is called *Fréchet character distance* wherever it is shown. It is of 128 features of
//! a small network trained on characters, and tells nothing about FID.

use super::frechet::{FrechetError, frechet_distance};
use crate::images::Images;
use crate::model::{Classifier, ClassifierConfig, fill};
use crate::weights::{Weights, WeightsError};
use burn::backend::Flex;
use burn::tensor::{Tensor, TensorData};

/// Side of the images that are judged.
pub const SIDE: usize = 64;

/// Images that are judged at once.
const BATCH: usize = 32;

/// The classifier, on the CPU.
#[derive(Debug)]
pub struct CharacterJudge {
    network: Classifier<Flex>,
    features: usize,
}

/// What the classifier says of a stack.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Judged {
    /// (N, features), row-major.
    pub features: Vec<f32>,
    /// The likeliest class of each image, 0 to 61 for 0-9, A-Z, a-z.
    pub classes: Vec<u8>,
    /// How likely the classifier finds it, 0 to 1.
    pub certainty: Vec<f32>,
}

impl CharacterJudge {
    /// The network of these weights (model `classifier`).
    ///
    /// # Errors
    /// [`WeightsError`] if they are of another network.
    pub fn new(weights: &Weights) -> Result<Self, WeightsError> {
        weights.expect_model("classifier")?;
        let config = ClassifierConfig::of(weights)?;
        let network = fill(config.init(&Default::default()), weights)?;
        Ok(Self { network, features: config.channels[2] })
    }

    /// Features of an image.
    #[must_use]
    pub fn features(&self) -> usize {
        self.features
    }

    /// Judges a stack.
    #[must_use]
    pub fn judge(&self, images: Images<'_, SIDE>) -> Judged {
        let mut all = Judged::default();
        for batch in images.values().chunks(BATCH * SIDE * SIDE) {
            let shape = [batch.len() / (SIDE * SIDE), 1, SIDE, SIDE];
            let data = TensorData::new(batch.to_vec(), shape);
            let features = self.network.features(Tensor::from_data(data, &Default::default()));
            all.features.extend(features.to_data().iter::<f32>());
            let logits: Vec<f32> = self.network.logits(features).into_data().iter().collect();
            for logits in logits.chunks_exact(logits.len() / shape[0]) {
                let (class, certainty) = likeliest(logits);
                all.classes.push(class);
                all.certainty.push(certainty);
            }
        }
        all
    }

    /// Fréchet character distance of two judged stacks of at least two images each.
    ///
    /// # Errors
    /// [`FrechetError`] if there are fewer.
    pub fn distance(&self, reference: &Judged, test: &Judged) -> Result<f64, FrechetError> {
        frechet_distance(&reference.features, &test.features, self.features)
    }
}

/// The class of the largest logit, and its part of all (softmax).
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
        let judge = CharacterJudge::new(&Weights::embedded("classifier").unwrap()).unwrap();
        let pixel = |at: usize| ((at * 7919 + at / 64) % 97) as f32 / 96.0;
        let stack: Vec<f32> = (0..(BATCH + 2) * SIDE * SIDE).map(pixel).collect();
        let all = judge.judge(Images::new(&stack).unwrap());
        assert_eq!(all.features.len(), (BATCH + 2) * judge.features());
        let last = judge.judge(Images::new(&stack[(BATCH + 1) * SIDE * SIDE..]).unwrap());
        assert_eq!(all.classes[BATCH + 1..], last.classes[..]);
        let tail = &all.features[(BATCH + 1) * judge.features()..];
        assert!(tail.iter().zip(&last.features).all(|(a, b)| (a - b).abs() < 1e-4));
        assert!(judge.distance(&all, &all).unwrap() < 1e-3);
        assert!(judge.distance(&all, &last).is_err());
    }
}
