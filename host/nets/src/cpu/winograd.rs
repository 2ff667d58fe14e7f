//! The convolution of 3 x 3 by the method of Winograd (Lavin, Gray, CVPR 2016): F(2 x 2, 3 x 3).
//!
//! A tile is 2 x 2 pixels of the output, which need 4 x 4 pixels d of the input. With fixed
//! matrices A, B and G of small whole numbers and halves, the tile of one channel is
//! A^T ((G g G^T) * (B^T d B)) A for a filter g, where * multiplies element by element. So 16
//! products replace 36, and over all channels and tiles each of the 16 elements is one product of
//! matrices. G g G^T is computed once, when the weights are read.
//!
//! # Invariant
//! The result is the convolution to within the rounding of single precision
//! (`cpu::tests::winograds_convolution_is_the_sum_over_channels_and_taps`). The sums of a pixel
//! depend neither on other tiles nor on the number of threads.

use std::cell::Cell;

use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use super::aligned::Aligned;
use super::conv::THREAD_WORK;
use super::pixels::{Pixels, padded};
use super::product::Product;
use crate::filter::Filter;

/// Elements of a transformed tile.
const ELEMENTS: usize = 16;

/// The element that all four pixels of a tile take with factor 1: sums there begin with the bias.
const CENTRE: usize = 5;

/// Number of tiles that are transformed and multiplied together, if rows of tiles are no longer.
/// Their elements fit the second-level cache, with 192 channels too.
const TILES: usize = 32;

thread_local! {
    /// Memory for the elements of tiles, before and after the products. A convolution takes the
    /// memory and puts it back, so another one that begins on the same thread meanwhile gets its
    /// own.
    static SCRATCH: Cell<(Aligned, Aligned)> = Cell::default();
}

/// Weights of a convolution of 3 x 3 that keeps the size of its input; taps beyond the edge read
/// zeros.
#[derive(Debug, Clone)]
pub(super) struct Winograd {
    inputs: usize,
    outputs: usize,
    /// Element by element, a matrix with a row for each input and a column for each output.
    filters: Aligned,
    /// One bias for each column.
    bias: Vec<f32>,
}

impl Winograd {
    /// The convolution with these filters of 3 x 3.
    pub fn new(filter: &Filter) -> Self {
        let Filter { inputs, outputs, .. } = *filter;
        let columns = padded(outputs);
        let mut filters = Aligned::zeros(ELEMENTS * inputs * columns);
        for (input, output) in (0..inputs).flat_map(|i| (0..outputs).map(move |o| (i, o))) {
            let g = |ky, kx| f64::from(filter.at(output, input, ky, kx));
            let down: [[f64; 4]; 3] =
                std::array::from_fn(|kx| spread([g(0, kx), g(1, kx), g(2, kx)]));
            for a in 0..4 {
                for (b, value) in spread(down.map(|column| column[a])).into_iter().enumerate() {
                    filters[((4 * a + b) * inputs + input) * columns + output] = value as f32;
                }
            }
        }
        let mut bias = filter.bias.clone();
        bias.resize(columns, 0.0);
        Self { inputs, outputs, filters, bias }
    }

    /// Number of output channels.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// Adds the convolution of `input` to `out`, an image of the same size.
    pub fn add_to(&self, arch: Arch, input: &Pixels, out: &mut Pixels) {
        debug_assert_eq!((input.channels(), out.channels()), (self.inputs, self.outputs));
        let (height, width) = input.size();
        let across = width.div_ceil(2);
        let down = (TILES / across).max(1);
        let (stride, work) = (out.row_stride(), down * across * self.work());
        let rows = 2 * height.div_ceil(2) * stride;
        let chunks = out.values_mut()[stride..][..rows].par_chunks_mut(2 * down * stride);
        let grain = (THREAD_WORK / work).max(1);
        chunks.enumerate().with_min_len(grain).for_each(|(index, out)| {
            let first = index * down;
            let tiles = Tiles {
                across,
                down: out.len() / (2 * stride),
                size: (height - 2 * first, width),
                pitches: (input.pitch(), padded(self.outputs)),
            };
            let from = &input.values()[2 * first * input.row_stride()..];
            self.add_tiles(arch, tiles, (from, input.row_stride()), (out, stride));
        });
    }

    /// Number of multiplications of a tile.
    fn work(&self) -> usize {
        ELEMENTS * self.inputs * self.bias.len()
    }

    /// Adds the convolution to some rows of tiles. `input` begins with the row above the first
    /// tile's, `out` with the first tile's; both come with the number of floats of a row.
    fn add_tiles(
        &self,
        arch: Arch,
        tiles: Tiles,
        (input, input_stride): (&[f32], usize),
        (out, out_stride): (&mut [f32], usize),
    ) {
        let (mut before, mut after) = SCRATCH.take();
        let count = tiles.across * tiles.down;
        let (left_pitch, columns) = tiles.pitches;
        let left = before.at_least(ELEMENTS * count * left_pitch);
        arch.dispatch(Taken { tiles, input, stride: input_stride, out: left });
        let matrix = self.inputs * columns;
        let sums = after.at_least(ELEMENTS * count * columns);
        let grain = (THREAD_WORK / (count * matrix)).max(1);
        let elements = sums.par_chunks_exact_mut(count * columns).enumerate();
        let zeros = vec![0.0; columns];
        elements.with_min_len(grain).for_each(|(element, out)| {
            Product {
                left: &left[element * count * left_pitch..][..count * left_pitch],
                left_pitch,
                inner: self.inputs,
                right: &self.filters[element * matrix..][..matrix],
                columns,
                start: if element == CENTRE { &self.bias } else { &zeros },
                out,
            }
            .compute(arch);
        });
        arch.dispatch(Added { tiles, sums, out, stride: out_stride });
        SCRATCH.set((before, after));
    }
}

/// G times a column of a filter.
fn spread([a, b, c]: [f64; 3]) -> [f64; 4] {
    [a, 0.5 * (a + b + c), 0.5 * (a - b + c), c]
}

/// Some rows of tiles.
#[derive(Debug, Clone, Copy)]
struct Tiles {
    across: usize,
    down: usize,
    /// Rows and columns of pixels from the first tile on. Tiles may reach one pixel beyond.
    size: (usize, usize),
    /// Number of floats of a pixel of the input, and of the output.
    pitches: (usize, usize),
}

impl Tiles {
    /// Row and column of each tile's first pixel.
    fn corners(self) -> impl Iterator<Item = (usize, usize)> {
        (0..self.down).flat_map(move |row| (0..self.across).map(move |c| (2 * row, 2 * c)))
    }
}

/// B^T d B of each tile.
struct Taken<'a> {
    tiles: Tiles,
    /// From the pixel above and left of the first tile on.
    input: &'a [f32],
    stride: usize,
    /// Element by element, a row for each tile.
    out: &'a mut [f32],
}

impl WithSimd for Taken<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        /// B^T times a column.
        #[inline(always)]
        fn taken<S: Simd>(simd: S, [a, b, c, d]: [S::f32s; 4]) -> [S::f32s; 4] {
            [simd.sub_f32s(a, c), simd.add_f32s(b, c), simd.sub_f32s(c, b), simd.sub_f32s(b, d)]
        }
        let Self { tiles, input, stride, out } = self;
        let (pitch, _) = tiles.pitches;
        let (plane, lanes) = (tiles.across * tiles.down * pitch, S::F32_LANES);
        for (index, (row, column)) in tiles.corners().enumerate() {
            let corner = &input[row * stride + column * pitch..];
            for from in (0..pitch).step_by(lanes) {
                // By column: the closures of array functions would not be compiled for the vectors.
                let mut columns = [[simd.splat_f32s(0.0); 4]; 4];
                for (b, column) in columns.iter_mut().enumerate() {
                    for (a, value) in column.iter_mut().enumerate() {
                        let at = a * stride + b * pitch + from;
                        *value = S::as_simd_f32s(&corner[at..][..lanes]).0[0];
                    }
                    *column = taken(simd, *column);
                }
                for a in 0..4 {
                    let [c0, c1, c2, c3] = columns;
                    let line = taken(simd, [c0[a], c1[a], c2[a], c3[a]]);
                    for (b, value) in line.into_iter().enumerate() {
                        let to = (4 * a + b) * plane + index * pitch + from;
                        S::as_mut_simd_f32s(&mut out[to..][..lanes]).0[0] = value;
                    }
                }
            }
        }
    }
}

/// A^T m A of each tile, added to the tile's pixels.
struct Added<'a> {
    tiles: Tiles,
    /// Element by element, a row for each tile.
    sums: &'a [f32],
    /// From the margin left of the first tile on.
    out: &'a mut [f32],
    stride: usize,
}

impl WithSimd for Added<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        /// A^T times a column.
        #[inline(always)]
        fn pair<S: Simd>(simd: S, [a, b, c, d]: [S::f32s; 4]) -> [S::f32s; 2] {
            let sum = simd.add_f32s(simd.add_f32s(a, b), c);
            [sum, simd.sub_f32s(simd.sub_f32s(b, c), d)]
        }
        let Self { tiles, sums, out, stride } = self;
        let (_, pitch) = tiles.pitches;
        let (plane, lanes) = (tiles.across * tiles.down * pitch, S::F32_LANES);
        for (index, (row, column)) in tiles.corners().enumerate() {
            let sums = &sums[index * pitch..];
            for from in (0..pitch).step_by(lanes) {
                let mut columns = [[simd.splat_f32s(0.0); 2]; 4];
                for (b, pairs) in columns.iter_mut().enumerate() {
                    let mut column = [simd.splat_f32s(0.0); 4];
                    for (a, value) in column.iter_mut().enumerate() {
                        let at = (4 * a + b) * plane + from;
                        *value = S::as_simd_f32s(&sums[at..][..lanes]).0[0];
                    }
                    *pairs = pair(simd, column);
                }
                for y in 0..2 {
                    let [c0, c1, c2, c3] = columns;
                    let line = pair(simd, [c0[y], c1[y], c2[y], c3[y]]);
                    for (x, value) in line.into_iter().enumerate() {
                        let (row, column) = (row + y, column + x);
                        if row < tiles.size.0 && column < tiles.size.1 {
                            let to = row * stride + (column + 1) * pitch + from;
                            let to = &mut S::as_mut_simd_f32s(&mut out[to..][..lanes]).0[0];
                            *to = simd.add_f32s(*to, value);
                        }
                    }
                }
            }
        }
    }
}
