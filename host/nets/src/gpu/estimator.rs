//! The estimator of blur and noise on a GPU.

use std::sync::Arc;

use nirspi_gpu::network::plan::frames_at_once;
use nirspi_gpu::network::{Activation, Finish, Layer};
use nirspi_gpu::{Buffer, Kernels};

use super::layer::{self, checked};
use super::pack::Order;
use super::unet::AT_ONCE;
use crate::cpu::estimator::{LOG_FLOOR, LOG_OFFSET};
use crate::filter::Filter;
use crate::network::RunEstimator;
use crate::schema;
use crate::weights::{Weights, WeightsError};

/// Strides of the convolutions.
const STRIDES: [usize; 4] = [1, 2, 2, 2];

/// The network, with its weights on a device.
pub(crate) struct Estimator {
    engine: Arc<dyn Kernels>,
    convs: Vec<Layer>,
    fc1: Layer,
    fc2: Layer,
}

impl Estimator {
    /// Uploads the network with these weights to a device.
    ///
    /// # Errors
    /// [`WeightsError`] if a tensor is missing, of another shape, not finite, unknown, or too wide.
    pub(crate) fn new(engine: &Arc<dyn Kernels>, weights: &Weights) -> Result<Self, WeightsError> {
        schema::estimator(weights)?;
        let on = engine.as_ref();
        let convs = STRIDES.into_iter().enumerate().map(|(index, stride)| {
            let name = format!("conv{}", index + 1);
            let filter = checked(weights, &name, Filter::convolution(weights, &name)?)?;
            Ok(layer::layer(on, &filter, (stride, filter.side / 2), None, Order::AsStored))
        });
        Ok(Self {
            engine: Arc::clone(engine),
            convs: convs.collect::<Result<_, WeightsError>>()?,
            fc1: layer::linear(on, weights, "fc1")?,
            fc2: layer::linear(on, weights, "fc2")?,
        })
    }

    /// Number of images of `side` x `side` that the network processes at once.
    pub(crate) fn at_once(&self, side: usize) -> usize {
        let widest = self.convs.iter().map(|layer| layer.geometry().outputs).max().unwrap_or(0);
        frames_at_once(widest * side * side, self.engine.limits().buffer_bytes, AT_ONCE)
    }

    /// The two outputs for each of `frames` images of `side` x `side`.
    pub(crate) fn forward(&self, (frames, side): (usize, usize), images: &Buffer) -> Buffer {
        let on = self.engine.as_ref();
        // These layers have no slopes, so PReLU is ReLU.
        let relu = Finish { activation: Activation::Prelu, ..Finish::default() };
        let (mut h, mut side, mut channels) = (images.clone(), side, 1);
        for conv in &self.convs {
            h = on.convolve(conv, &h, frames, side, relu).out;
            (side, channels) = (conv.geometry().side(side), conv.geometry().outputs);
        }
        let features = on.pooled(&h, side * side, channels, (LOG_FLOOR, LOG_OFFSET));
        let hidden = on.convolve(&self.fc1, &features, frames, 1, relu).out;
        let softplus = Finish { activation: Activation::Softplus, ..Finish::default() };
        on.convolve(&self.fc2, &hidden, frames, 1, softplus).out
    }
}

impl RunEstimator for Estimator {
    fn run(&self, side: usize, images: &[f32]) -> Vec<[f32; 2]> {
        let on = self.engine.as_ref();
        let area = side * side;
        let parts = images.chunks(self.at_once(side) * area).map(|part| {
            let out = self.forward((part.len() / area, side), &on.upload(part));
            super::read(on, &[&out]).swap_remove(0)
        });
        parts.flat_map(|outputs| outputs.as_chunks().0.to_vec()).collect()
    }
}
