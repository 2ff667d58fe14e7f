//! The UNet on a GPU.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use nirspi_gpu::network::plan::frames_at_once;
use nirspi_gpu::network::{Activation, Add, Degraded, Finish, Layer, Made, Way};
use nirspi_gpu::{Buffer, GpuError, Kernels, Numbers};

use super::layer::{self, Maker, checked};
use super::multiplier::Multiplier;
use super::pack::Order;
use crate::filter::Filter;
use crate::grid::FINE as SIDE;
use crate::network::RunUNet;
use crate::note::Note;
use crate::random::Noise;
use crate::schema::{self, CONDITIONS, Conditions, UNetSizes};
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
    multiplier: Option<Multiplier>,
    /// Whether the tensor cores are no longer used.
    plain: AtomicBool,
}

impl UNet {
    /// Uploads the network with these weights to a device; `multiplier` are the tensor cores, if
    /// there are any.
    ///
    /// # Errors
    /// [`WeightsError`] if a tensor is missing, of another shape, not finite, unknown, or too wide.
    pub(crate) fn new(
        engine: &Arc<dyn Kernels>,
        weights: &Weights,
        multiplier: Option<Multiplier>,
    ) -> Result<Self, WeightsError> {
        let on = engine.as_ref();
        let make = Maker { engine: on, weights, multiplier: multiplier.as_ref() };
        let UNetSizes { channels, blocks: count, .. } = schema::unet(weights)?;
        let levels = channels.len();
        let mut films = Films::default();
        let mut blocks = |side: &str, level: usize| -> Result<Vec<Block>, WeightsError> {
            let block = |j| {
                let name = format!("{side}.{level}.{j}");
                let conv = |which: &str| make.same(&format!("{name}.{which}"), Order::AsStored);
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
        let reduce = |i| make.layer(&format!("reduce.{i}"), (2, 0), Order::AsStored);
        let input = make.same("input_conv", Order::AsStored)?;
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
                .map(|i| make.same(&format!("expand.{i}"), Order::Shuffled))
                .collect::<Result<_, _>>()?,
            decoder,
            output: make.same("output_conv", Order::Shuffled)?,
            multiplier,
            plain: AtomicBool::new(false),
        })
    }

    /// Whether convolutions leave the tensor cores alone.
    fn is_plain(&self) -> bool {
        self.plain.load(Ordering::Relaxed)
    }

    /// Runs `forward` and reads the buffers that it returns. If an activation in it was not a number
    /// of `f16`, the tensor cores are given up and it runs again.
    ///
    /// # Errors
    /// [`GpuError`] if the GPU or its driver fails while it computes.
    pub(crate) fn read_after<const N: usize>(
        &self,
        forward: impl Fn() -> [Buffer; N],
    ) -> Result<[Numbers; N], GpuError> {
        let on = self.engine.as_ref();
        let as_many = |read: Vec<Numbers>| {
            read.try_into().unwrap_or_else(|_| unreachable!("as many as were made"))
        };
        if let (Some(multiplier), false) = (&self.multiplier, self.is_plain()) {
            let made = forward();
            let all: Vec<&Buffer> = made.iter().chain([multiplier.beyond()]).collect();
            let mut read = on.read(&all)?;
            if read.pop().is_some_and(|beyond| beyond.floats() == [0.0]) {
                return Ok(as_many(read));
            }
            multiplier.note(Note::BeyondF16);
            self.plain.store(true, Ordering::Relaxed);
        }
        on.read(&forward().each_ref()).map(as_many)
    }

    /// The same network after a comparison: one image of noise goes through it by the tensor cores,
    /// in both ways, and without them. If the outputs differ, or the device cannot run the kernels,
    /// the tensor cores are given up.
    pub(crate) fn compared(self) -> Self {
        let Some(multiplier) = &self.multiplier else { return self };
        let on = self.engine.as_ref();
        let image = |seed: u64| -> Vec<f32> {
            let mut noise = Noise::of(seed, 0);
            let pixel = || (0.5 + 0.2 * noise.draw()).clamp(0.0, 1.0);
            std::iter::repeat_with(pixel).take(SIDE * SIDE).collect()
        };
        let [current, degraded] = [1, 2].map(|seed| on.upload(&image(seed)));
        let told = on.upload(&[1.0, 1.0, 0.5, 0.25, 0.1, 0.01]);
        let images = (&current, Degraded::Fine(&degraded));
        let outputs = [Way::Plain, Way::Products(2), Way::Products(4)]
            .map(|way| self.forward_by(way, (1, SIDE), images, &told, None));
        let agree = on.read(&outputs.each_ref()).is_ok_and(|read| {
            let mut pairs =
                read[1..].iter().flat_map(|fast| fast.floats().iter().zip(read[0].floats()));
            // NaN is not within the bound.
            pairs.all(|(fast, plain)| (fast - plain).abs() <= multiplier.bound())
        });
        if !agree {
            multiplier.note(Note::TensorCoresDiffer);
            self.plain.store(true, Ordering::Relaxed);
        }
        self
    }

    /// Number of images of `side` x `side` that the network processes at once.
    pub(crate) fn at_once(&self, side: usize) -> usize {
        let largest = (self.channels * (side / 2) * (side / 2)).max(2 * side * side);
        // About eight buffers of this size live at a time, and two batches are under way. A device
        // allows buffers of a fourth of its memory, so these sixteen fit all of it.
        frames_at_once(4 * largest, self.engine.limits().buffer_bytes, AT_ONCE)
    }

    /// The network's output for `frames` images of `side` x `side`, given their conditions (frames,
    /// 6) and degraded images; `start` is added, if there is one.
    pub(crate) fn forward(
        &self,
        size: (usize, usize),
        current: &Buffer,
        degraded: Degraded<'_>,
        conditions: &Buffer,
        start: Option<&Buffer>,
    ) -> Buffer {
        let way = if self.is_plain() { Way::Plain } else { Way::Best };
        self.forward_by(way, size, (current, degraded), conditions, start)
    }

    /// [`forward`](Self::forward) by these kernels.
    fn forward_by(
        &self,
        way: Way,
        (frames, side): (usize, usize),
        (current, degraded): (&Buffer, Degraded<'_>),
        conditions: &Buffer,
        start: Option<&Buffer>,
    ) -> Buffer {
        let on = self.engine.as_ref();
        let usual = Finish { way, ..Finish::default() };
        let silu = Finish { activation: Activation::Silu, ..usual };
        let [embed1, embed2] = &self.embed;
        let embedding = on.convolve(embed1, conditions, frames, 1, silu).out;
        let embedding = on.convolve(embed2, &embedding, frames, 1, silu).out;
        let film = on.convolve(&self.film, &embedding, frames, 1, usual).out;

        let mut side = side / 2;
        let input = on.paired(current, degraded, side);
        let activated = Finish { activated: true, ..usual };
        let mut h = on.convolve(&self.input, &input, frames, side, activated);
        let mut skips = Vec::with_capacity(self.reduce.len());
        for (level, blocks) in self.encoder.iter().enumerate() {
            for (j, block) in blocks.iter().enumerate() {
                let activated = j + 1 < blocks.len();
                h = self.block(block, h, (frames, side), &film, Finish { activated, ..usual });
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
            let finish = Finish { add, shuffle: true, activated: true, ..usual };
            h = on.convolve(expand, &h.out, frames, side, finish);
            side = fine;
            for (j, block) in blocks.iter().enumerate() {
                let activated = j + 1 < blocks.len();
                h = self.block(block, h, (frames, side), &film, Finish { activated, ..usual });
            }
        }
        let add = start.map(|start| (Add::Alike, start));
        let finish = Finish { add, shuffle: true, ..usual };
        on.convolve(&self.output, &h.out, frames, side, finish).out
    }

    /// A block's output; `last` is what is done at the end, besides the sum.
    fn block<'a>(
        &self,
        block: &Block,
        h: Made,
        (frames, side): (usize, usize),
        film: &'a Buffer,
        last: Finish<'a>,
    ) -> Made {
        let on = self.engine.as_ref();
        let first = Finish {
            activation: Activation::FilmSilu,
            film: Some((film, block.film)),
            activated: false,
            ..last
        };
        let seen = h.activated.as_ref().unwrap_or_else(|| unreachable!("blocks follow SiLU"));
        let inner = on.convolve(&block.conv1, seen, frames, side, first).out;
        let last = Finish { add: Some((Add::Alike, &h.out)), ..last };
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
        let parts = images.zip(conditions.chunks(frames));
        let parts = parts.flat_map(|((current, degraded), conditions)| {
            debug_assert_eq!(conditions.as_flattened().len(), CONDITIONS * conditions.len());
            let [current, degraded, told] =
                [current, degraded, conditions.as_flattened()].map(|numbers| on.upload(numbers));
            let size = (conditions.len(), side);
            let seen = Degraded::Fine(&degraded);
            match self.read_after(|| [self.forward(size, &current, seen, &told, None)]) {
                Ok([images]) => images.floats().to_vec(),
                Err(error) => panic!("{error}"),
            }
        });
        parts.collect()
    }
}
