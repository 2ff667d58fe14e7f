//! Convolutional networks, for any number of images at once.
//!
//! | module | contents |
//! |---|---|
//! | [`plan`] | distribution of a convolution to workgroups within a device's limits: pure functions |
//! | `kernels` | the kernels for every GPU |
//! | [`tiles`], `tensor` | the convolution by products of small matrices, for tensor cores |
//! | `finish` | what both kernels of a convolution do before they store the output |
//!
//! # How
//! Activations are `frame x row x column x channel`. Nearly all work is in one kernel, `convolve`:
//! a convolution as a product of matrices (pixels by taps, and taps by channels), tile by tile
//! through shared memory. The operations after a convolution (bias, modulation by the conditions,
//! activation, residual, pixel shuffle) are done in registers before the output is stored. Fully
//! connected layers are convolutions of 1 x 1 over images of one pixel.

mod finish;
mod kernels;
pub mod plan;
mod tensor;
pub mod tiles;

pub use finish::{Activation, Add};
pub use tensor::Product;

use crate::Buffer;
use crate::engine::{Engine, upload_halves};
use cubecl::prelude::*;
use finish::Ending;
use half::f16;
use kernels::Shape;
use plan::{COLUMNS, DEPTH, Geometry, ROWS, UNITS, pixels_a_unit};
use tiles::{Columns, Tiles};

/// A convolution whose weights are on a device, in the order of its kernel.
#[derive(Debug)]
pub struct Layer {
    geometry: Geometry,
    /// Number of channels of a unit.
    channels: usize,
    pixels: Option<usize>,
    weights: Buffer,
    table: Buffer,
    products: Option<Products>,
}

/// The weights of a convolution for products of small matrices.
#[derive(Debug, Clone)]
pub struct Products {
    /// What multiplies.
    pub product: Product,
    /// Number of terms of each activation: 1, a number in `f16`, or 2, whose sum has 22 bits.
    pub planes: usize,
    /// The output channels of a workgroup.
    pub columns: Columns,
    /// The weights, by [`Convolve::narrow`]. For each workgroup's output channels, each step of
    /// [`STEP`](tiles::STEP) input channels and each tap, there is a row for each output channel;
    /// [`half_at`](tiles::half_at) says where each half of a row lies.
    pub weights: Buffer,
    /// One number, 0. It becomes 1 as soon as an activation is not a number of `f16`: the results
    /// are worthless then.
    pub beyond: Buffer,
}

impl Layer {
    /// A convolution. A workgroup computes a tile of [`COLUMNS`] times `channels` output channels.
    /// For each tile, each tap and each input channel, `weights` has the weights of the whole tile
    /// side by side; input channels go to the next multiple of [`DEPTH`], output channels to that of
    /// the tile, and what is added is 0. `table` has the bias of each output channel, then the slope
    /// of its PReLU.
    ///
    /// # Panics
    /// If the lengths do not fit the geometry.
    #[must_use]
    pub fn new(geometry: Geometry, channels: usize, weights: Buffer, table: Buffer) -> Self {
        let outputs = geometry.outputs.next_multiple_of(COLUMNS * channels);
        assert!(weights.count() >= outputs * geometry.steps() * DEPTH);
        assert!(table.count() >= 2 * geometry.outputs);
        Self { geometry, channels, pixels: None, weights, table, products: None }
    }

    /// The same layer with this number of pixels for each unit, 2 or 8. Otherwise the number of
    /// pixels in all decides.
    #[must_use]
    pub fn with_pixels(self, pixels: usize) -> Self {
        Self { pixels: Some(pixels), ..self }
    }

    /// The same layer by products of small matrices, for those images that fit its tiles.
    ///
    /// # Panics
    /// If the lengths do not fit the geometry.
    #[must_use]
    pub fn with_products(self, products: Products) -> Self {
        let Geometry { inputs, outputs, kernel, .. } = self.geometry;
        assert!(inputs.is_multiple_of(8) && outputs.is_multiple_of(products.columns.channels()));
        let weights = inputs.next_multiple_of(tiles::STEP) * outputs * kernel * kernel;
        assert_eq!(products.weights.count(), weights / 2);
        Self { products: Some(products), ..self }
    }

    /// The sizes of the convolution.
    #[must_use]
    pub fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// Whether the layer has weights for products of small matrices.
    #[must_use]
    pub fn has_products(&self) -> bool {
        self.products.is_some()
    }

    /// Number of channels that a workgroup computes.
    fn tile(&self) -> usize {
        COLUMNS * self.channels
    }
}

/// Largest number of `f16`.
pub const LARGEST_F16: f32 = 65_504.0;

/// Whether a number is one of `f16`, so that rounding to it changes nothing.
#[must_use]
pub fn is_f16(number: f32) -> bool {
    f16::from_f32(number).to_f32() == number
}

/// What is done with the sums of a convolution before they are stored.
#[derive(Debug, Clone, Copy)]
pub struct Finish<'a> {
    /// The activation.
    pub activation: Activation,
    /// For [`Activation::FilmSilu`]: scales and shifts of all layers, one row for each frame, and
    /// the index of this layer's first scale.
    pub film: Option<(&'a Buffer, usize)>,
    /// What is added after the activation.
    pub add: Option<(Add, &'a Buffer)>,
    /// Rearrange four channels into one of twice the side.
    pub shuffle: bool,
    /// Clamp the output to [0, 1].
    pub clamp: bool,
    /// Also store SiLU of the output.
    pub activated: bool,
    /// Which kernel computes.
    pub way: Way,
}

impl Default for Finish<'_> {
    fn default() -> Self {
        Self {
            activation: Activation::Nothing,
            film: None,
            add: None,
            shuffle: false,
            clamp: false,
            activated: false,
            way: Way::Best,
        }
    }
}

/// Which kernel computes a convolution.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// Products of small matrices, if the layer has them and the images fit their tiles.
    Best,
    /// The same, with this number of products below each other in a warp, 2 or 4.
    Products(usize),
    /// The kernel that does without them.
    Plain,
}

/// The output of a convolution.
#[derive(Debug)]
pub struct Made {
    /// The output: `frame x out_side x out_side x outputs`, or with twice the side and a fourth of
    /// the channels after a shuffle.
    pub out: Buffer,
    /// SiLU of the output, if requested.
    pub activated: Option<Buffer>,
}

/// The UNet's input for the degraded image.
#[derive(Debug, Clone, Copy)]
pub enum Degraded<'a> {
    /// An image with as many pixels as the current image.
    Fine(&'a Buffer),
    /// An image with one pixel for each block of 2 x 2.
    Coarse(&'a Buffer),
}

/// Parameters of the kernel that makes the conditions: two numbers of the bridge's path, then the
/// minimum and maximum of blur and of noise, on the scale of the networks.
pub type Bounds = [f32; 6];

/// The kernels of convolutional networks, on one device.
pub trait Convolve: Engine {
    /// A convolution of `frames` images of `side` x `side`: `frame x side x side x inputs`.
    fn convolve(
        &self,
        layer: &Layer,
        input: &Buffer,
        frames: usize,
        side: usize,
        finish: Finish<'_>,
    ) -> Made;
    /// Whether the device can compute this product.
    fn has(&self, product: Product) -> bool;
    /// A buffer with these weights, an even number of them, rounded to `f16`: two in each of its
    /// four-byte numbers.
    fn narrow(&self, weights: &[f32]) -> Buffer;
    /// `count` numbers of `images` from number `first` on, divided by `white` and clamped to
    /// [0, 1].
    fn readings(&self, images: &Buffer, first: usize, white: f32, count: usize) -> Buffer;
    /// FSRCNN's input: intensity, depth and validity of each pixel side by side. `area` is the
    /// number of pixels of a frame; `depth`, if there is any, has the two planes of a frame one
    /// after the other.
    fn stacked(&self, readings: &Buffer, depth: Option<&Buffer>, area: usize) -> Buffer;
    /// The UNet's input: blocks of 2 x 2 pixels of `current` (channels 0 to 3) and of `degraded`
    /// (4 to 7); `side` is the number of blocks in a row.
    fn paired(&self, current: &Buffer, degraded: Degraded<'_>, side: usize) -> Buffer;
    /// ln(mean + floor) + offset of each channel of each frame, for `log`: (floor, offset).
    fn pooled(&self, input: &Buffer, pixels: usize, channels: usize, log: (f32, f32)) -> Buffer;
    /// The UNet's six conditions for each frame from the estimator's two outputs: the path, then
    /// blur and noise on the scale of the networks, within their bounds, and their squares. `scale`
    /// converts blur to the grid of the UNet.
    fn conditions(&self, estimates: &Buffer, bounds: &Bounds, scale: f32) -> Buffer;
}

/// The buffers of one convolution, except the layer's own.
struct Run<'a> {
    input: &'a Buffer,
    film: &'a Buffer,
    addend: &'a Buffer,
    out: &'a Buffer,
    activated: &'a Buffer,
}

/// Launches a convolution by products of small matrices. [`Convolve::convolve`] has checked the
/// lengths of `run`.
#[expect(unsafe_code, reason = "bounds checks would double the loads of the inner loop")]
fn multiply<R: Runtime>(
    client: &ComputeClient<R>,
    layer: &Layer,
    products: &Products,
    run: &Run<'_>,
    (frames, film_width, film_first): (usize, usize, usize),
    (tiles, ending): (Tiles, Ending),
) {
    let Geometry { inputs, outputs, .. } = layer.geometry;
    let shape = tensor::Shape { tiles, product: products.product, ending };
    let columns = outputs / products.columns.channels();
    // SAFETY: the kernel reads pixels inside `frames` images and weights of `columns` workgroups of
    // channels, all of which the layer has, and writes pixels of `frames` images. Barriers are
    // outside every branch.
    unsafe {
        tensor::convolve::launch_unchecked::<R>(
            client,
            cubes(tiles.groups(frames), columns),
            CubeDim::new_1d(tiles.units() as u32),
            products.product.width(),
            run.input.arg(),
            products.weights.arg(),
            layer.table.arg(),
            run.film.arg(),
            run.addend.arg(),
            run.out.arg(),
            run.activated.arg(),
            products.beyond.arg(),
            frames as u32,
            inputs as u32,
            outputs as u32,
            film_width as u32,
            film_first as u32,
            shape,
        );
    }
}

fn cubes(x: usize, y: usize) -> CubeCount {
    CubeCount::Static(x as u32, y as u32, 1)
}

fn units() -> CubeDim {
    CubeDim::new_1d(UNITS as u32)
}

/// Workgroups for one unit per number.
fn groups(count: usize) -> CubeCount {
    CubeCount::Static(count.div_ceil(UNITS) as u32, 1, 1)
}

impl<R: Runtime> Convolve for ComputeClient<R> {
    #[expect(unsafe_code, reason = "bounds checks would double the loads of the inner loop")]
    fn convolve(
        &self,
        layer: &Layer,
        input: &Buffer,
        frames: usize,
        side: usize,
        finish: Finish<'_>,
    ) -> Made {
        let geometry = layer.geometry;
        let out_side = geometry.side(side);
        let pixels = frames * out_side * out_side;
        let count = pixels * geometry.outputs;
        let tiles = geometry.outputs.div_ceil(layer.tile());
        let (add, addend) = match finish.add {
            None => (Add::Nothing, None),
            Some((add, addend)) => (add, Some(addend)),
        };
        assert!(geometry.fits() && input.count() >= frames * side * side * geometry.inputs);
        assert!(!finish.shuffle || geometry.outputs.is_multiple_of(4));
        match (add, addend) {
            (Add::Alike, Some(addend)) => assert!(addend.count() >= count),
            (Add::Pixel, Some(addend)) => assert!(addend.count() >= pixels),
            _ => {}
        }
        let (film, film_width, film_first) = match finish.film {
            None => (&layer.table, 0, 0),
            Some((film, first)) => {
                assert!(film.count().is_multiple_of(frames));
                let width = film.count() / frames;
                assert!(first + 2 * geometry.outputs <= width);
                (film, width, first)
            }
        };
        assert_eq!(finish.film.is_some(), finish.activation == Activation::FilmSilu);
        let ending = Ending {
            activation: finish.activation,
            add,
            shuffle: finish.shuffle,
            clamp: finish.clamp,
            activated: finish.activated,
        };
        let out = Engine::empty(self, count);
        let activated = Engine::empty(self, if finish.activated { count } else { 1 });
        let addend = addend.unwrap_or(&layer.table);
        let tiled = layer.products.as_ref().and_then(|products| {
            let Products { columns, planes, .. } = *products;
            let limits = Engine::limits(self);
            let tiles = Tiles::new(&geometry, columns, (frames, side), planes, &limits)?;
            match finish.way {
                Way::Best => Some((products, tiles)),
                Way::Products(down) => Some((products, tiles.with_down(down, &limits))),
                Way::Plain => None,
            }
        });
        if let Some((products, tiles)) = tiled {
            let run = Run { input, film, addend, out: &out, activated: &activated };
            let sizes = (frames, film_width, film_first);
            multiply(self, layer, products, &run, sizes, (tiles, ending));
            return Made { out, activated: finish.activated.then_some(activated) };
        }
        let shape = Shape {
            pixels: layer.pixels.unwrap_or_else(|| pixels_a_unit(pixels, tiles)),
            channels: layer.channels,
            ending,
        };
        let groups =
            CubeCount::Static(pixels.div_ceil(ROWS * shape.pixels) as u32, tiles as u32, 1);
        // SAFETY: the kernel reads pixels inside `frames` images and weights of `tiles` tiles, and
        // writes pixels below `pixels` and channels below `outputs`. All these lengths are checked
        // above or by the layer; barriers are outside every branch.
        unsafe {
            kernels::convolve::launch_unchecked::<R>(
                self,
                groups,
                units(),
                input.arg(),
                layer.weights.arg(),
                layer.table.arg(),
                film.arg(),
                addend.arg(),
                out.arg(),
                activated.arg(),
                pixels as u32,
                side as u32,
                out_side as u32,
                geometry.inputs as u32,
                geometry.outputs as u32,
                geometry.kernel as u32,
                geometry.stride as u32,
                geometry.centre as u32,
                film_width as u32,
                film_first as u32,
                shape,
            );
        }
        Made { out, activated: finish.activated.then_some(activated) }
    }

    fn has(&self, product: Product) -> bool {
        product.is_on(self.features())
    }

    fn narrow(&self, weights: &[f32]) -> Buffer {
        let rounded: Vec<f16> = weights.iter().map(|&weight| f16::from_f32(weight)).collect();
        upload_halves(self, &rounded)
    }

    #[expect(unsafe_code, reason = "the kernel checks its one index itself")]
    fn readings(&self, images: &Buffer, first: usize, white: f32, count: usize) -> Buffer {
        assert!(images.count() >= first + count);
        let out = Engine::empty(self, count);
        // SAFETY: indices are below `count`, or `first + count`, by the assert above.
        unsafe {
            kernels::readings::launch_unchecked::<R>(
                self,
                groups(count),
                units(),
                images.arg(),
                out.arg(),
                first as u32,
                white,
                count as u32,
            );
        }
        out
    }

    #[expect(unsafe_code, reason = "the kernel checks its one index itself")]
    fn stacked(&self, readings: &Buffer, depth: Option<&Buffer>, area: usize) -> Buffer {
        assert!(depth.is_none_or(|depth| depth.count() >= 2 * readings.count()));
        let count = 3 * readings.count();
        let out = Engine::empty(self, count);
        // SAFETY: indices are below `count` of the output; a third of it are readings, two thirds
        // depth.
        unsafe {
            kernels::stacked::launch_unchecked::<R>(
                self,
                groups(count),
                units(),
                readings.arg(),
                depth.unwrap_or(readings).arg(),
                out.arg(),
                area as u32,
                count as u32,
                depth.is_some(),
            );
        }
        out
    }

    #[expect(unsafe_code, reason = "the kernel checks its one index itself")]
    fn paired(&self, current: &Buffer, degraded: Degraded<'_>, side: usize) -> Buffer {
        assert!(current.count().is_multiple_of(4 * side * side));
        let (degraded, coarse) = match degraded {
            Degraded::Fine(degraded) => (degraded, false),
            Degraded::Coarse(degraded) => (degraded, true),
        };
        assert!(degraded.count() >= current.count() / if coarse { 4 } else { 1 });
        let count = 2 * current.count();
        let out = Engine::empty(self, count);
        // SAFETY: indices are below `count` of the output; half of it are images, an eighth blocks.
        unsafe {
            kernels::paired::launch_unchecked::<R>(
                self,
                groups(count),
                units(),
                current.arg(),
                degraded.arg(),
                out.arg(),
                side as u32,
                count as u32,
                coarse,
            );
        }
        out
    }

    #[expect(unsafe_code, reason = "the kernel checks its one index itself")]
    fn pooled(
        &self,
        input: &Buffer,
        pixels: usize,
        channels: usize,
        (floor, offset): (f32, f32),
    ) -> Buffer {
        assert!(input.count().is_multiple_of(pixels * channels));
        let count = input.count() / pixels;
        let out = Engine::empty(self, count);
        // SAFETY: the input has `pixels` numbers for each number of the output.
        unsafe {
            kernels::pooled::launch_unchecked::<R>(
                self,
                groups(count),
                units(),
                input.arg(),
                out.arg(),
                pixels as u32,
                channels as u32,
                count as u32,
                floor,
                offset,
            );
        }
        out
    }

    #[expect(unsafe_code, reason = "the kernel checks its one index itself")]
    fn conditions(&self, estimates: &Buffer, bounds: &Bounds, scale: f32) -> Buffer {
        let frames = estimates.count() / 2;
        let out = Engine::empty(self, 6 * frames);
        let bounds = self.upload(bounds);
        // SAFETY: a frame below `frames` has two estimates and six conditions.
        unsafe {
            kernels::conditions::launch_unchecked::<R>(
                self,
                groups(frames),
                units(),
                estimates.arg(),
                bounds.arg(),
                out.arg(),
                scale,
                frames as u32,
            );
        }
        out
    }
}
