//! The convolution by products of small matrices: tensor cores, or their imitation.
//!
//! [`super::tiles`] says how a workgroup's tile is taken through shared memory. Sums are `f32`;
//! activations and weights are rounded to `f16` on their way into shared memory. With two planes an
//! activation is the sum of two `f16`, which have 22 bits together, and each is multiplied: the
//! result is that of `f32` where the weights are exact in `f16`, as those of the shipped UNet are.
//!
//! [`Product::Imitated`] computes what the tensor cores compute, each unit its part of each matrix,
//! from the same places in shared memory. It is for tests on devices that have `f16` and no tensor
//! cores: all but three instructions of the kernel run there.

// A kernel's arguments are its buffers and sizes, and the macro makes functions with as many
// arguments.
#![allow(clippy::too_many_arguments)]

use super::LARGEST_F16;
use super::finish::{Ending, store};
use super::tiles::{CHANNELS, PIXELS, STEP, Tiles, WARP, place};
use cubecl::cmma::MmaDefinition;
use cubecl::ir::MatrixIdent;
use cubecl::ir::features::{Features, MmaConfig};
use cubecl::prelude::*;
use half::f16;

/// What multiplies matrices.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Product {
    /// Tensor cores, by `mma.m16n8k16` with operands in `f16`.
    TensorCores,
    /// Multiplications and additions in `f32`, of the same numbers in `f16`.
    Imitated,
}

impl Product {
    /// Number of numbers of a vector in shared memory.
    pub(super) fn width(self) -> usize {
        match self {
            Self::TensorCores => 8,
            Self::Imitated => 4,
        }
    }

    /// Whether a device with these features can compute it.
    pub(super) fn is_on(self, features: &Features) -> bool {
        let half = f16::as_type_native_unchecked().storage_type();
        let single = f32::as_type_native_unchecked().storage_type();
        let config = MmaConfig {
            a_type: half,
            b_type: half,
            cd_type: single,
            m: PIXELS as u32,
            n: CHANNELS as u32,
            k: STEP as u32,
        };
        match self {
            Self::TensorCores => {
                features.matmul.mma.contains(&config) && features.matmul.ldmatrix.contains(&half)
            }
            Self::Imitated => features.supports_type(half),
        }
    }
}

/// Facts about a convolution that its kernel is compiled for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Shape {
    pub tiles: Tiles,
    pub product: Product,
    pub ending: Ending,
}

/// The place of an input pixel in `from` that lies outside the image.
const OUTSIDE: u32 = u32::MAX;

/// The inner product of eight numbers of a row of pixels and of a row of weights, where both rows
/// begin at these vectors.
#[cube]
fn eight<N: Size>(
    pixels: &SharedMemory<Vector<f16, N>>,
    weights: &SharedMemory<Vector<f16, N>>,
    pixel: usize,
    weight: usize,
) -> f32 {
    let width = N::value();
    let mut sum = 0.0f32;
    for v in 0..comptime!(8 / width) {
        let p = pixels[pixel + v];
        let w = weights[weight + v];
        #[unroll]
        for k in 0..width {
            sum += f32::cast_from(p[k]) * f32::cast_from(w[k]);
        }
    }
    sum
}

/// A convolution, one workgroup for a tile of pixels and output channels. Buffers are those of the
/// kernel in [`super::kernels`], except `weights`: for each tile of output channels, each step of 16
/// input channels and each tap, a row for each output channel, whose halves lie where
/// [`super::tiles::half_at`] says. `beyond[0]` becomes 1 if an activation is not a number of `f16`.
#[cube(launch_unchecked)]
pub(super) fn convolve<N: Size>(
    input: &Array<Vector<f32, Const<4>>>,
    weights: &Array<Vector<f16, N>>,
    table: &Array<f32>,
    film: &Array<f32>,
    addend: &Array<f32>,
    out: &mut Array<f32>,
    activated: &mut Array<f32>,
    beyond: &mut Array<f32>,
    frames: u32,
    inputs: u32,
    outputs: u32,
    film_width: u32,
    film_first: u32,
    #[comptime] shape: Shape,
) {
    let tiles = comptime!(shape.tiles);
    let product = comptime!(shape.product);
    // An index that is not known when the kernel is compiled sends registers of a GPU to memory.
    // Without tensor cores shorter code matters more: software Vulkan compiles it for seconds.
    let in_registers = comptime!(shape.product == Product::TensorCores);
    // Numbers of a vector, and vectors of eight and of sixteen numbers.
    let width = N::value();
    let of_half = comptime!(8 / width);
    let of_row = comptime!(STEP / width);
    let units = comptime!(tiles.units());
    let staged = comptime!(tiles.staged());
    let staged_rows = comptime!(tiles.staged_rows());
    let staged_columns = comptime!(tiles.staged_columns());
    let down = comptime!(tiles.down);
    let across = comptime!(tiles.columns.across);
    let planes = comptime!(tiles.planes);
    let out_side = comptime!(tiles.out_side);
    let side = comptime!(tiles.side);
    let rows = comptime!(tiles.rows());
    let channels = comptime!(tiles.columns.channels());
    let side_of_kernel = comptime!(tiles.kernel);
    let lines = comptime!(tiles.lines);
    let bands = comptime!(tiles.out_side / tiles.rows());
    let frames = frames as usize;
    let inputs = inputs as usize;
    let outputs = outputs as usize;

    let unit = UNIT_POS as usize;
    let lane = unit % WARP;
    let warp = unit / WARP;
    let warp_across = warp % comptime!(tiles.columns.warps);
    let warp_down = warp / comptime!(tiles.columns.warps);
    let first_frame = CUBE_POS_X as usize / bands * comptime!(tiles.frames());
    let first_row = CUBE_POS_X as usize % bands * rows;

    let mut seen =
        SharedMemory::<Vector<f16, N>>::new_aligned(comptime!(planes * staged * of_row), 16usize);
    let mut kernel = SharedMemory::<Vector<f16, N>>::new_aligned(
        comptime!(lines * side_of_kernel * channels * of_row),
        16usize,
    );

    // For each vector that this unit stages: where it begins in the input, as a number of vectors of
    // four, in the first step.
    let items = comptime!(staged * of_row);
    let loads = comptime!((staged * of_row).div_ceil(tiles.units()));
    let mut from = Array::<u32>::new(loads);
    #[unroll(in_registers)]
    for i in 0..loads {
        let item = unit + units * i;
        let pixel = item / of_row;
        let frame = first_frame + pixel / comptime!(staged_rows * staged_columns);
        let within = pixel % comptime!(staged_rows * staged_columns);
        // Both are larger by `centre`.
        let y = first_row * comptime!(tiles.stride) + within / staged_columns;
        let x = within % staged_columns;
        let centre = comptime!(tiles.centre);
        let inside = item < items
            && frame < frames
            && y >= centre
            && y < side + centre
            && x >= centre
            && x < side + centre;
        let mut at = OUTSIDE.runtime();
        if inside {
            let number = (frame * side + (y - centre)) * side + (x - centre);
            at = ((number * inputs + item % of_row * width) / 4) as u32;
        }
        from[i] = at;
    }

    // The first number of the pixels under this unit's row of each product, for the first tap.
    let mut pixels = Array::<usize>::new(down);
    #[unroll(in_registers)]
    for i in 0..down {
        let pixel = (warp_down * down + i) * PIXELS + lane % PIXELS;
        let within = pixel % comptime!(rows * out_side);
        let frame = pixel / comptime!(rows * out_side);
        pixels[i] = (frame * staged_rows + within / out_side * comptime!(tiles.stride))
            * staged_columns
            + within % out_side * comptime!(tiles.stride);
    }

    let mut sums = Sequence::<Array<Vector<f32, Const<2>>>>::new();
    #[unroll]
    for _ in 0..comptime!(down * across) {
        let mut sum = Array::<Vector<f32, Const<2>>>::new(2usize);
        sum[0] = Vector::zeroed();
        sum[1] = Vector::zeroed();
        sums.push(sum);
    }

    let mut within_f16 = true;
    let steps = inputs.div_ceil(STEP);
    // Vectors of the weights of as many lines of the kernel as are in shared memory at a time.
    let of_lines = comptime!(tiles.lines * tiles.kernel * channels * of_row);
    let copies = comptime!(of_lines.div_ceil(tiles.units()));
    let turns = comptime!(tiles.kernel / tiles.lines);
    for step in 0..steps {
        #[unroll(in_registers)]
        for i in 0..loads {
            let item = unit + units * i;
            if item < items {
                let mut high = Vector::<f16, N>::zeroed();
                let mut low = Vector::<f16, N>::zeroed();
                let known = from[i];
                if known != OUTSIDE && step * STEP + item % of_row * width < inputs {
                    #[unroll]
                    for v in 0..comptime!(width / 4) {
                        let four = input[known as usize + step * comptime!(STEP / 4) + v];
                        #[unroll]
                        for k in 0..4usize {
                            let x = four[k];
                            // A comparison with NaN is false.
                            within_f16 = within_f16 && f32::abs(x) <= LARGEST_F16;
                            let near = f16::cast_from(x);
                            high[4 * v + k] = near;
                            if comptime!(planes == 2) {
                                low[4 * v + k] = f16::cast_from(x - f32::cast_from(near));
                            }
                        }
                    }
                }
                let pixel = item / of_row;
                let part = item % of_row;
                let to = place(pixel, part / of_half) * of_half + part % of_half;
                seen[to] = high;
                if comptime!(planes == 2) {
                    seen[comptime!(staged * of_row) + to] = low;
                }
            }
        }
        for turn in 0..turns {
            let first = ((CUBE_POS_Y as usize * steps + step) * turns + turn) * of_lines;
            #[unroll(in_registers)]
            for i in 0..copies {
                let item = unit + units * i;
                if item < of_lines {
                    kernel[item] = weights[first + item];
                }
            }
            sync_cube();
            for tap in 0..comptime!(lines * side_of_kernel) {
                let shift =
                    (turn * lines + tap / side_of_kernel) * staged_columns + tap % side_of_kernel;
                let tap_rows = tap * channels;
                if comptime!(product == Product::TensorCores) {
                    multiply::<N>(
                        &seen,
                        &kernel,
                        &pixels,
                        &mut sums,
                        shift,
                        tap_rows,
                        warp_across,
                        lane,
                        tiles,
                    );
                } else {
                    imitate::<N>(
                        &seen,
                        &kernel,
                        &mut sums,
                        shift,
                        tap_rows,
                        warp_across,
                        warp_down,
                        lane,
                        tiles,
                    );
                }
            }
            sync_cube();
        }
    }
    if !within_f16 {
        beyond[0] = 1.0f32;
    }

    // Of each product a unit has two neighbouring channels of two pixels.
    #[unroll]
    for i in 0..down {
        #[unroll(in_registers)]
        for part in 0..2usize {
            let pixel = (warp_down * down + i) * PIXELS + 8 * part + lane / 4;
            let within = pixel % comptime!(rows * out_side);
            let frame = first_frame + pixel / comptime!(rows * out_side);
            if frame < frames {
                let output = frame * comptime!(out_side * out_side) + first_row * out_side + within;
                #[unroll]
                for j in 0..across {
                    let two = sums.index(i * across + j)[part];
                    let channel = CUBE_POS_Y as usize * channels
                        + (warp_across * across + j) * CHANNELS
                        + lane % 4 * 2;
                    #[unroll(in_registers)]
                    for k in 0..2usize {
                        store(
                            two[k],
                            output,
                            channel + k,
                            outputs,
                            out_side,
                            table,
                            film,
                            film_width as usize,
                            film_first as usize,
                            addend,
                            out,
                            activated,
                            comptime!(shape.ending),
                        );
                    }
                }
            }
        }
    }
}

/// Adds the products of one tap with the tensor cores.
#[cube]
fn multiply<N: Size>(
    seen: &SharedMemory<Vector<f16, N>>,
    kernel: &SharedMemory<Vector<f16, N>>,
    pixels: &Array<usize>,
    sums: &mut Sequence<Array<Vector<f32, Const<2>>>>,
    shift: usize,
    tap_rows: usize,
    warp_across: usize,
    lane: usize,
    #[comptime] tiles: Tiles,
) {
    let width = N::value();
    let of_half = comptime!(8 / width);
    let across = comptime!(tiles.columns.across);
    let staged = comptime!(tiles.staged());
    let products = MmaDefinition::<f16, f16, f32>::new(PIXELS, CHANNELS, STEP);

    // One ldmatrix fetches the weights of two products side by side: their first and second halves.
    let mut columns = Sequence::<Array<Vector<f16, Const<2>>>>::new();
    #[unroll]
    for pair in 0..comptime!(tiles.columns.across / 2) {
        let channel = (warp_across * across + 2 * pair) * CHANNELS + lane / 16 * 8 + lane % 8;
        let at = place(tap_rows + channel, lane / 8 % 2) * of_half;
        let four = products.load_matrix::<Vector<f16, N>, Const<2>>(
            &kernel.slice(at, at + of_half),
            MatrixIdent::B,
            4usize,
            false,
        );
        #[unroll]
        for k in 0..2usize {
            let mut two = Array::<Vector<f16, Const<2>>>::new(2usize);
            two[0] = four[2 * k];
            two[1] = four[2 * k + 1];
            columns.push(two);
        }
    }
    #[unroll]
    for plane in 0..comptime!(tiles.planes) {
        #[unroll]
        for i in 0..comptime!(tiles.down) {
            // The first two matrices are the first halves of 16 pixels, then come the second ones.
            let at =
                (place(pixels[i] + shift, lane / 16) + comptime!(2 * staged) * plane) * of_half;
            let line = products.load_matrix::<Vector<f16, N>, Const<2>>(
                &seen.slice(at, at + of_half),
                MatrixIdent::A,
                4usize,
                false,
            );
            #[unroll]
            for j in 0..across {
                products.execute_inplace(&line, columns.index(j), sums.index_mut(i * across + j));
            }
        }
    }
}

/// Adds what this unit has of the products of one tap, without tensor cores.
#[cube]
fn imitate<N: Size>(
    seen: &SharedMemory<Vector<f16, N>>,
    kernel: &SharedMemory<Vector<f16, N>>,
    sums: &mut Sequence<Array<Vector<f32, Const<2>>>>,
    shift: usize,
    tap_rows: usize,
    warp_across: usize,
    warp_down: usize,
    lane: usize,
    #[comptime] tiles: Tiles,
) {
    let width = N::value();
    let of_half = comptime!(8 / width);
    let across = comptime!(tiles.columns.across);
    let down = comptime!(tiles.down);
    let area = comptime!(tiles.rows() * tiles.out_side);
    let columns = comptime!(tiles.staged_columns());
    for half in 0..comptime!(2 * tiles.planes) {
        let plane = half / 2 * comptime!(2 * tiles.staged());
        #[unroll]
        for i in 0..down {
            for part in 0..2usize {
                let pixel = (warp_down * down + i) * PIXELS + 8 * part + lane / 4;
                let within = pixel % area;
                let row = pixel / area * comptime!(tiles.staged_rows())
                    + within / comptime!(tiles.out_side) * comptime!(tiles.stride);
                let first =
                    row * columns + within % comptime!(tiles.out_side) * comptime!(tiles.stride);
                let at = (place(first + shift, half % 2) + plane) * of_half;
                #[unroll]
                for j in 0..across {
                    let mut two = Vector::<f32, Const<2>>::empty();
                    let before = sums.index(i * across + j)[part];
                    for k in 0..2usize {
                        let channel = (warp_across * across + j) * CHANNELS + lane % 4 * 2 + k;
                        let weight = place(tap_rows + channel, half % 2) * of_half;
                        two[k] = before[k] + eight::<N>(seen, kernel, at, weight);
                    }
                    sums.index_mut(i * across + j)[part] = two;
                }
            }
        }
    }
}
