//! FSRCNN on a GPU.

use std::sync::Arc;

use nirspi_gpu::network::plan::frames_at_once;
use nirspi_gpu::network::{Activation, Add, Finish, Layer};
use nirspi_gpu::{Buffer, Kernels};

use super::layer::{self, checked};
use super::pack::Order;
use super::unet::AT_ONCE;
use crate::filter::Filter;
use crate::network::RunFsrcnn;
use crate::schema;
use crate::weights::{Weights, WeightsError};

/// Input channels: intensity, depth, validity.
const CHANNELS: usize = 3;

/// The network, with its weights on a device.
pub(crate) struct Fsrcnn {
    engine: Arc<dyn Kernels>,
    /// Convolutions, each followed by PReLU.
    layers: Vec<Layer>,
    /// The transposed convolution, as a convolution followed by a pixel shuffle.
    doubling: Layer,
}

impl Fsrcnn {
    /// Uploads the network with these weights to a device.
    ///
    /// # Errors
    /// [`WeightsError`] if a tensor is missing, of another shape, not finite, unknown, or too wide.
    pub(crate) fn new(engine: &Arc<dyn Kernels>, weights: &Weights) -> Result<Self, WeightsError> {
        let on = engine.as_ref();
        let [_, _, maps] = schema::fsrcnn(weights)?;
        let names = ["feature".to_owned(), "shrink".to_owned()]
            .into_iter()
            .map(|name| (format!("{name}_act"), name))
            .chain((0..maps).map(|i| (format!("map_act.{i}"), format!("map.{i}"))))
            .chain([("expand_act".to_owned(), "expand".to_owned())]);
        let layers = names.map(|(act, name)| {
            let filter = checked(weights, &name, Filter::convolution(weights, &name)?)?;
            let slopes = weights.tensor(&format!("{act}.weight"), &[filter.outputs])?;
            let reach = (1, filter.side / 2);
            Ok(layer::layer(on, &filter, reach, Some(&slopes.values), Order::AsStored))
        });
        let layers = layers.collect::<Result<_, WeightsError>>()?;
        let filter = checked(weights, "deconv", Filter::transposed(weights, "deconv")?)?;
        let doubling = layer::layer(on, &filter, (1, filter.side / 2), None, Order::Shuffled);
        Ok(Self { engine: Arc::clone(engine), layers, doubling })
    }

    /// Number of images of `side` x `side` that the network processes at once.
    pub(crate) fn at_once(&self, side: usize) -> usize {
        let widest = self.layers.iter().map(|layer| layer.geometry().outputs).max().unwrap_or(0);
        frames_at_once(
            widest.max(CHANNELS + 1) * side * side,
            self.engine.limits().buffer_bytes,
            AT_ONCE,
        )
    }

    /// Enlarges `readings` (frames, side, side) to twice the side; `depth` is (frames, 2, side,
    /// side), if there is any.
    pub(crate) fn forward(
        &self,
        (frames, side): (usize, usize),
        readings: &Buffer,
        depth: Option<&Buffer>,
        clamp: bool,
    ) -> Buffer {
        let on = self.engine.as_ref();
        let prelu = Finish { activation: Activation::Prelu, ..Finish::default() };
        let mut h = on.stacked(readings, depth, side * side);
        for layer in &self.layers {
            h = on.convolve(layer, &h, frames, side, prelu).out;
        }
        let add = Some((Add::Pixel, readings));
        let finish = Finish { add, shuffle: true, clamp, ..Finish::default() };
        on.convolve(&self.doubling, &h, frames, side, finish).out
    }
}

impl RunFsrcnn for Fsrcnn {
    fn run(&self, side: usize, input: &[f32]) -> Vec<f32> {
        let on = self.engine.as_ref();
        let area = side * side;
        let parts = input.chunks(self.at_once(side) * CHANNELS * area).map(|part| {
            let images = || part.chunks_exact(CHANNELS * area);
            let readings: Vec<f32> = images().flat_map(|image| &image[..area]).copied().collect();
            let depth: Vec<f32> = images().flat_map(|image| &image[area..]).copied().collect();
            let [readings, depth] = [&readings, &depth].map(|numbers| on.upload(numbers));
            self.forward((images().len(), side), &readings, Some(&depth), false)
        });
        parts.flat_map(|out| super::read(on, &[&out]).swap_remove(0)).collect()
    }
}
