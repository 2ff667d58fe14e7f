//! The UNet on a GPU.

use std::sync::Arc;

use nirspi_gpu::network::plan::frames_at_once;
use nirspi_gpu::network::{Activation, Add, Degraded, Finish, Layer, Made};
use nirspi_gpu::{Buffer, Kernels};

use super::layer::{self, checked};
use super::pack::Order;
use crate::filter::Filter;
use crate::network::{CONDITIONS, Conditions, RunUNet};
use crate::schema::{self, UNetSizes};
use crate::weights::{Weights, WeightsError};

/// Largest number of images processed at once.
pub(super) const AT_ONCE: usize = 256;

/// A residual block: convolution, scale and shift by the conditions, convolution.
struct Block {
    conv1: Layer,
    conv2: Layer,
    /// Index of the block's first scale among the scales of all blocks.
    film: usize,
}

/// The network, with its weights on a device.
pub(crate) struct UNet {
    engine: Arc<dyn Kernels>,
    embed: [Layer; 2],
    /// Scales and shifts of all blocks.
    film: Layer,
    input: Layer,
    encoder: Vec<Vec<Block>>,
    reduce: Vec<Layer>,
    expand: Vec<Layer>,
    decoder: Vec<Vec<Block>>,
    output: Layer,
    /// Largest number of channels of a pixel of the finest level.
    channels: usize,
}

impl UNet {
    /// Uploads the network with these weights to a device.
    ///
    /// # Errors
    /// [`WeightsError`] if a tensor is missing, of another shape, not finite, unknown, or too wide.
    pub(crate) fn new(engine: &Arc<dyn Kernels>, weights: &Weights) -> Result<Self, WeightsError> {
        let on = engine.as_ref();
        let UNetSizes { channels, blocks: count, .. } = schema::unet(weights)?;
        let levels = channels.len();
        let mut films = Films::default();
        let mut blocks = |side: &str, level: usize| -> Result<Vec<Block>, WeightsError> {
            let block = |j| {
                let name = format!("{side}.{level}.{j}");
                let conv = |which: &str| layer::named(on, weights, &format!("{name}.{which}"));
                let film = films.push(Filter::linear(weights, &format!("{name}.film"))?);
                Ok(Block { conv1: conv("conv1")?, conv2: conv("conv2")?, film })
            };
            (0..count).map(block).collect()
        };
        let below = levels - 1;
        let encoder =
            (0..levels).map(|level| blocks("encoder", level)).collect::<Result<Vec<_>, _>>()?;
        let decoder =
            (0..below).map(|level| blocks("decoder", level)).collect::<Result<Vec<_>, _>>()?;
        let reduce = |i| {
            let name = format!("reduce.{i}");
            let filter = checked(weights, &name, Filter::convolution(weights, &name)?)?;
            Ok(layer::layer(on, &filter, (2, 0), None, Order::AsStored))
        };
        let input = layer::named(on, weights, "input_conv")?;
        Ok(Self {
            engine: Arc::clone(engine),
            embed: [layer::linear(on, weights, "embed1")?, layer::linear(on, weights, "embed2")?],
            film: layer::layer(
                on,
                &checked(weights, "film", films.all)?,
                (1, 0),
                None,
                Order::AsStored,
            ),
            channels: input.geometry().outputs.max(8),
            input,
            encoder,
            reduce: (0..below).map(reduce).collect::<Result<_, _>>()?,
            expand: (0..below)
                .map(|i| layer::shuffled(on, weights, &format!("expand.{i}")))
                .collect::<Result<_, _>>()?,
            decoder,
            output: layer::shuffled(on, weights, "output_conv")?,
        })
    }

    /// Number of images of `side` x `side` that the network processes at once.
    pub(super) fn at_once(&self, side: usize) -> usize {
        let largest = self.channels * (side / 2) * (side / 2);
        frames_at_once(largest.max(2 * side * side), self.engine.limits().buffer_bytes, AT_ONCE)
    }

    /// The network's output for `frames` images of `side` x `side`, given their conditions (frames,
    /// 6) and degraded images; `start` is added, if there is one.
    pub(super) fn forward(
        &self,
        (frames, side): (usize, usize),
        current: &Buffer,
        degraded: Degraded<'_>,
        conditions: &Buffer,
        start: Option<&Buffer>,
    ) -> Buffer {
        let on = self.engine.as_ref();
        let silu = Finish { activation: Activation::Silu, ..Finish::default() };
        let [embed1, embed2] = &self.embed;
        let embedding = on.convolve(embed1, conditions, frames, 1, silu).out;
        let embedding = on.convolve(embed2, &embedding, frames, 1, silu).out;
        let film = on.convolve(&self.film, &embedding, frames, 1, Finish::default()).out;

        let mut side = side / 2;
        let input = on.paired(current, degraded, side);
        let activated = Finish { activated: true, ..Finish::default() };
        let mut h = on.convolve(&self.input, &input, frames, side, activated);
        let mut skips = Vec::with_capacity(self.reduce.len());
        for (level, blocks) in self.encoder.iter().enumerate() {
            for (j, block) in blocks.iter().enumerate() {
                h = self.block(block, h, (frames, side), &film, j + 1 < blocks.len());
            }
            if let Some(reduce) = self.reduce.get(level) {
                let coarse = on.convolve(reduce, &h.out, frames, side, activated);
                skips.push((h.out, side));
                (h, side) = (coarse, reduce.geometry().side(side));
            }
        }
        for ((expand, blocks), (skip, fine)) in
            self.expand.iter().zip(&self.decoder).zip(skips).rev()
        {
            let add = Some((Add::Alike, &skip));
            let finish = Finish { add, shuffle: true, activated: true, ..Finish::default() };
            h = on.convolve(expand, &h.out, frames, side, finish);
            side = fine;
            for (j, block) in blocks.iter().enumerate() {
                h = self.block(block, h, (frames, side), &film, j + 1 < blocks.len());
            }
        }
        let add = start.map(|start| (Add::Alike, start));
        let finish = Finish { add, shuffle: true, ..Finish::default() };
        on.convolve(&self.output, &h.out, frames, side, finish).out
    }

    /// A block's output, with its SiLU if another block follows.
    fn block(
        &self,
        block: &Block,
        h: Made,
        (frames, side): (usize, usize),
        film: &Buffer,
        activated: bool,
    ) -> Made {
        let on = self.engine.as_ref();
        let first = Finish {
            activation: Activation::FilmSilu,
            film: Some((film, block.film)),
            ..Finish::default()
        };
        let seen = h.activated.as_ref().unwrap_or_else(|| unreachable!("blocks follow SiLU"));
        let inner = on.convolve(&block.conv1, seen, frames, side, first).out;
        let last = Finish { add: Some((Add::Alike, &h.out)), activated, ..Finish::default() };
        on.convolve(&block.conv2, &inner, frames, side, last)
    }
}

/// The layers that compute scales and shifts from the conditions, as one layer.
struct Films {
    all: Filter,
}

impl Default for Films {
    fn default() -> Self {
        Self {
            all: Filter { inputs: 0, outputs: 0, side: 1, weights: Vec::new(), bias: Vec::new() },
        }
    }
}

impl Films {
    /// Adds a layer; returns the index of its first output.
    fn push(&mut self, film: Filter) -> usize {
        let first = self.all.outputs;
        self.all.inputs = film.inputs;
        self.all.outputs += film.outputs;
        self.all.weights.extend(film.weights);
        self.all.bias.extend(film.bias);
        first
    }
}

impl RunUNet for UNet {
    fn run(
        &self,
        side: usize,
        current: &[f32],
        degraded: &[f32],
        conditions: &[Conditions],
    ) -> Vec<f32> {
        let on = self.engine.as_ref();
        let (area, frames) = (side * side, self.at_once(side));
        let images = current.chunks(frames * area).zip(degraded.chunks(frames * area));
        let parts =
            images.zip(conditions.chunks(frames)).map(|((current, degraded), conditions)| {
                debug_assert_eq!(conditions.as_flattened().len(), CONDITIONS * conditions.len());
                let [current, degraded, told] = [current, degraded, conditions.as_flattened()]
                    .map(|numbers| on.upload(numbers));
                let size = (conditions.len(), side);
                self.forward(size, &current, Degraded::Fine(&degraded), &told, None)
            });
        parts.flat_map(|out| super::read(on, &[&out]).swap_remove(0)).collect()
    }
}
