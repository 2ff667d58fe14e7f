//! The network that estimates blur and noise of an image from the image itself, on the CPU.

use pulp::Arch;

use super::activation::softplus;
use super::conv::Conv;
use super::layers::{Linear, conv, means, relu, single};
use crate::schema;
use crate::weights::{Weights, WeightsError};

/// Added to each mean feature before its logarithm is taken.
pub(crate) const LOG_FLOOR: f32 = 1e-3;

/// Added to the logarithm, to centre it.
pub(crate) const LOG_OFFSET: f32 = 3.0;

/// The network, its weights in the order of the loops.
#[derive(Debug, Clone)]
pub struct Estimator {
    arch: Arch,
    convs: Vec<Conv>,
    fc1: Linear,
    fc2: Linear,
}

impl Estimator {
    /// The network of these weights.
    ///
    /// # Errors
    /// [`WeightsError`] for a tensor that is missing, of another shape, not finite, or unknown.
    pub fn new(weights: &Weights) -> Result<Self, WeightsError> {
        schema::estimator(weights)?;
        Ok(Self {
            arch: Arch::new(),
            convs: (1..=4).map(|i| conv(weights, &format!("conv{i}"))).collect::<Result<_, _>>()?,
            fc1: Linear::new(weights, "fc1")?,
            fc2: Linear::new(weights, "fc2")?,
        })
    }

    /// The network's two outputs for an image of `height` x `width` pixels.
    pub fn forward(&self, image: &[f32], (height, width): (usize, usize)) -> [f32; 2] {
        let mut h = single(image, (height, width));
        for (index, conv) in self.convs.iter().enumerate() {
            let full = conv.apply(self.arch, &h);
            // All but the first have stride 2; what they skip is cheap enough to be thrown away.
            h = if index == 0 { full } else { full.every_second() };
            relu(self.arch, &mut h);
        }
        let features: Vec<f32> =
            means(&h).into_iter().map(|mean| (mean + LOG_FLOOR).ln() + LOG_OFFSET).collect();
        let mut hidden = self.fc1.apply(&features);
        hidden.iter_mut().for_each(|x| *x = x.max(0.0));
        let out = self.fc2.apply(&hidden);
        [softplus(out[0]), softplus(out[1])]
    }
}
