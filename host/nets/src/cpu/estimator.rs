//! The estimator on the CPU: estimates blur and noise of an image from the image itself.

use pulp::Arch;

use super::activation::softplus;
use super::conv::Conv;
use super::layers::{Linear, conv, means, relu, single};
use crate::schema;
use crate::weights::{Weights, WeightsError};

/// Constant added to each mean feature before the logarithm.
pub(crate) const LOG_FLOOR: f32 = 1e-3;

/// Constant added to the logarithm, to centre it.
pub(crate) const LOG_OFFSET: f32 = 3.0;

/// The network, with weights in the order of the loops.
#[derive(Debug, Clone)]
pub struct Estimator {
    arch: Arch,
    convs: Vec<Conv>,
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
            // All convolutions except the first have stride 2; the skipped pixels are computed and
            // dropped, because that is cheap.
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
