//! The estimator on the CPU: estimates blur and noise of an image from the image itself.

use pulp::Arch;

use super::activation::softplus;
use super::layers::{Linear, Rectified, means, single};
use crate::schema;
use crate::weights::{Weights, WeightsError};

/// Constant added to each mean feature before the logarithm.
pub(crate) const LOG_FLOOR: f32 = 1e-3;

/// Constant added to the logarithm, to centre it.
pub(crate) const LOG_OFFSET: f32 = 3.0;

/// Strides of the convolutions.
const STRIDES: [usize; 4] = [1, 2, 2, 2];

/// The network, with weights in the order of the loops.
#[derive(Debug, Clone)]
pub struct Estimator {
    arch: Arch,
    convs: Vec<Rectified>,
    fc1: Linear,
    fc2: Linear,
}

impl Estimator {
    /// The network with these weights.
    ///
    /// # Errors
    /// [`WeightsError`] if a tensor is missing, of another shape, not finite, or unknown.
    pub fn new(weights: &Weights) -> Result<Self, WeightsError> {
        schema::estimator(weights)?;
        let convs = (1..).zip(STRIDES);
        let convs = convs.map(|(i, stride)| Rectified::new(weights, &format!("conv{i}"), stride));
        Ok(Self {
            arch: Arch::new(),
            convs: convs.collect::<Result<_, _>>()?,
            fc1: Linear::new(weights, "fc1")?,
            fc2: Linear::new(weights, "fc2")?,
        })
    }

    /// The network's two outputs for an image of `height` x `width` pixels.
    pub fn forward(&self, image: &[f32], (height, width): (usize, usize)) -> [f32; 2] {
        let mut h = single(image, (height, width));
        for conv in &self.convs {
            h = conv.apply(self.arch, &h);
        }
        let features: Vec<f32> =
            means(&h).into_iter().map(|mean| (mean + LOG_FLOOR).ln() + LOG_OFFSET).collect();
        let mut hidden = self.fc1.apply(&features);
        hidden.iter_mut().for_each(|x| *x = x.max(0.0));
        let out = self.fc2.apply(&hidden);
        [softplus(out[0]), softplus(out[1])]
    }
}
