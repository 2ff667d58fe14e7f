//! The estimator of [`crate::model::estimator`], on the CPU.

use pulp::Arch;

use super::activation::softplus;
use super::conv::Conv;
use super::layers::{Linear, conv, means, prelu};
use super::planes::Planes;
use crate::model::estimator::{LOG_FLOOR, LOG_OFFSET};
use crate::weights::{Weights, WeightsError};

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
    /// [`WeightsError`] for a tensor that is missing or of another shape.
    pub fn new(weights: &Weights) -> Result<Self, WeightsError> {
        Ok(Self {
            arch: Arch::new(),
            convs: (1..=4).map(|i| conv(weights, &format!("conv{i}"))).collect::<Result<_, _>>()?,
            fc1: Linear::new(weights, "fc1")?,
            fc2: Linear::new(weights, "fc2")?,
        })
    }

    /// The network's two outputs for an image of `height` x `width` pixels.
    pub fn forward(&self, image: &[f32], (height, width): (usize, usize)) -> [f32; 2] {
        let mut h = Planes::new(1, height, width, 1);
        for (row, line) in image.chunks_exact(width).enumerate() {
            h.row_mut(0, row).copy_from_slice(line);
        }
        for (index, conv) in self.convs.iter().enumerate() {
            let full = conv.apply(self.arch, &h);
            // All but the first have stride 2; what they skip is cheap enough to be thrown away.
            h = if index == 0 { full } else { full.every_second() };
            let zeros = vec![0.0; h.channels()];
            prelu(self.arch, &mut h, &zeros);
        }
        let features: Vec<f32> =
            means(&h).into_iter().map(|mean| (mean + LOG_FLOOR).ln() + LOG_OFFSET).collect();
        let mut hidden = self.fc1.apply(&features);
        hidden.iter_mut().for_each(|x| *x = x.max(0.0));
        let out = self.fc2.apply(&hidden);
        [softplus(out[0]), softplus(out[1])]
    }
}
