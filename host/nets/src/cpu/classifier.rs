//! The classifier on the CPU: which of the 62 characters an image shows. Character accuracy and the
//! Fréchet character distance use it.

use pulp::Arch;

use super::layers::{Linear, Rectified, means, single};
use crate::schema;
use crate::weights::{Weights, WeightsError};

/// Strides of the convolutions.
const STRIDES: [usize; 6] = [2, 1, 2, 1, 2, 1];

/// The network, with weights in the order of the loops.
#[derive(Debug, Clone)]
pub struct Classifier {
    arch: Arch,
    convs: Vec<Rectified>,
    fc: Linear,
}

impl Classifier {
    /// The network with these weights.
    ///
    /// # Errors
    /// [`WeightsError`] if a tensor is missing, of another shape, not finite, or unknown.
    pub fn new(weights: &Weights) -> Result<Self, WeightsError> {
        schema::classifier(weights)?;
        let convs = (1..).zip(STRIDES);
        let convs = convs.map(|(i, stride)| Rectified::new(weights, &format!("conv{i}"), stride));
        Ok(Self {
            arch: Arch::new(),
            convs: convs.collect::<Result<_, _>>()?,
            fc: Linear::new(weights, "fc")?,
        })
    }

    /// Number of features of an image.
    pub fn feature_count(&self) -> usize {
        self.fc.inputs()
    }

    /// Features of an image of `height` x `width` pixels in [0, 1].
    pub fn features(&self, image: &[f32], (height, width): (usize, usize)) -> Vec<f32> {
        let mut h = single(image, (height, width));
        for conv in &self.convs {
            h = conv.apply(self.arch, &h);
        }
        means(&h)
    }

    /// Logits of the classes for [`Self::features`].
    pub fn logits(&self, features: &[f32]) -> Vec<f32> {
        self.fc.apply(features)
    }
}
