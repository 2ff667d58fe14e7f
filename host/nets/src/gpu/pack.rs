//! Weights in the order in which the kernel reads them.
//!
//! A workgroup computes a tile of channels. For each tile, each tap and each group of [`DEPTH`]
//! input channels, the weights of the whole tile stand side by side. Weights beyond the last input
//! or output channel are zero. [`products`] has the order for tensor cores.

use crate::filter::Filter;
use nirspi_gpu::network::plan::DEPTH;
use nirspi_gpu::network::tiles::{Columns, STEP, half_at};

/// Number of input channels in half a row of the weights for products.
const HALF: usize = STEP / 2;

/// The order in which the kernel stores its output channels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Order {
    /// The order of the file.
    AsStored,
    /// The order for a pixel shuffle: the place in the block of 2 x 2 first, then the channel of
    /// the enlarged image, so that one pixel's channels are stored side by side. The file has the
    /// channel first.
    Shuffled,
}

impl Order {
    /// The channel of the file that is channel `at` of the kernel.
    fn stored(self, at: usize, outputs: usize) -> usize {
        match self {
            Self::AsStored => at,
            Self::Shuffled => {
                let channels = outputs / 4;
                4 * (at % channels) + at / channels
            }
        }
    }
}

/// The weights for tiles of `tile` channels.
pub(super) fn weights(filter: &Filter, tile: usize, order: Order) -> Vec<f32> {
    let steps = filter.inputs.div_ceil(DEPTH);
    let length = filter.outputs.next_multiple_of(tile) * filter.side.pow(2) * steps * DEPTH;
    let mut packed = Vec::with_capacity(length);
    for first in (0..filter.outputs).step_by(tile) {
        for (ky, kx) in (0..filter.side).flat_map(|ky| (0..filter.side).map(move |kx| (ky, kx))) {
            for input in 0..steps * DEPTH {
                packed.extend((first..first + tile).map(|output| {
                    if input < filter.inputs && output < filter.outputs {
                        filter.at(order.stored(output, filter.outputs), input, ky, kx)
                    } else {
                        0.0
                    }
                }));
            }
        }
    }
    packed
}

/// The weights for products of small matrices. For each workgroup's output channels, each step of
/// [`STEP`] input channels and each tap, there is a row for each output channel, in two halves.
pub(super) fn products(filter: &Filter, columns: Columns, order: Order) -> Vec<f32> {
    let Filter { inputs, outputs, side, .. } = *filter;
    let channels = columns.channels();
    let block = side * side * channels * STEP;
    let mut packed = vec![0.0; outputs / channels * inputs.div_ceil(STEP) * block];
    let places = (0..outputs).step_by(channels);
    let places = places.flat_map(|first| (0..inputs).step_by(STEP).map(move |from| (first, from)));
    for (block, (first, from)) in packed.chunks_exact_mut(block).zip(places) {
        for row in 0..side * side * channels {
            let (tap, channel) = (row / channels, first + row % channels);
            for k in 0..STEP.min(inputs - from) {
                let at = half_at(row, k / HALF) * HALF + k % HALF;
                let stored = order.stored(channel, outputs);
                block[at] = filter.at(stored, from + k, tap / side, tap % side);
            }
        }
    }
    packed
}

/// The bias of each channel, followed by the slope of its PReLU; 0 for `None`, which is ReLU.
pub(super) fn table(filter: &Filter, slopes: Option<&[f32]>, order: Order) -> Vec<f32> {
    let stored = || (0..filter.outputs).map(|output| order.stored(output, filter.outputs));
    let bias = stored().map(|output| filter.bias[output]);
    let slopes = stored().map(|output| slopes.map_or(0.0, |slopes| slopes[output]));
    bias.chain(slopes).collect()
}

#[cfg(test)]
mod tests {
    use super::super::tests::{definition, random_filter};
    use super::*;

    /// The kernel's result for packed weights, computed one number at a time, with zeros around the
    /// image.
    fn interpreted(
        packed: &[f32],
        table: &[f32],
        filter: &Filter,
        (tile, stride, centre): (usize, usize, usize),
        (image, side, out): (&[f32], usize, usize),
    ) -> Vec<f32> {
        let Filter { inputs, outputs, side: kernel, .. } = *filter;
        let steps = inputs.div_ceil(DEPTH);
        let mut made = Vec::new();
        for pixel in 0..out * out {
            for (output, bias) in table[..outputs].iter().enumerate() {
                let mut at = output / tile * kernel * kernel * steps * DEPTH * tile + output % tile;
                let mut sum = *bias;
                for (ky, kx) in (0..kernel).flat_map(|ky| (0..kernel).map(move |kx| (ky, kx))) {
                    let y = (pixel / out * stride + ky).wrapping_sub(centre);
                    let x = (pixel % out * stride + kx).wrapping_sub(centre);
                    for input in 0..steps * DEPTH {
                        if input < inputs && y < side && x < side {
                            sum += packed[at] * image[(y * side + x) * inputs + input];
                        }
                        at += tile;
                    }
                }
                made.push(sum);
            }
        }
        made
    }

    #[test]
    fn packed_weights_are_the_convolution() {
        for (inputs, outputs, kernel, stride, centre, tile) in
            [(3, 5, 5, 1, 2, 16), (9, 33, 3, 2, 1, 32), (8, 16, 2, 2, 0, 16), (12, 70, 1, 1, 0, 48)]
        {
            let filter = random_filter(inputs, outputs, kernel, 7);
            let side = 6;
            let image: Vec<f32> = random_filter(inputs, side * side, 1, 3).weights;
            let out = (side + 2 * centre - kernel) / stride + 1;
            let ours = interpreted(
                &weights(&filter, tile, Order::AsStored),
                &table(&filter, None, Order::AsStored),
                &filter,
                (tile, stride, centre),
                (&image, side, out),
            );
            let expected = definition(&filter, (stride, centre), &image, side);
            assert_eq!(ours.len(), expected.len());
            for (a, b) in ours.iter().zip(&expected) {
                assert!((a - b).abs() < 1e-4, "{inputs} {outputs}: {a} {b}");
            }
        }
    }

    #[test]
    fn weights_for_products_are_the_convolution() {
        for (inputs, outputs, kernel, stride, centre) in
            [(48, 48, 3, 1, 1), (8, 96, 3, 1, 1), (16, 192, 1, 1, 0), (40, 32, 2, 2, 0)]
        {
            let filter = random_filter(inputs, outputs, kernel, 7);
            let columns = Columns::of(outputs).unwrap();
            let packed = products(&filter, columns, Order::AsStored);
            let side = 6;
            let image: Vec<f32> = random_filter(inputs, side * side, 1, 3).weights;
            let expected = definition(&filter, (stride, centre), &image, side);
            let out = (side + 2 * centre - kernel) / stride + 1;
            let (channels, steps) = (columns.channels(), inputs.div_ceil(STEP));
            let block = kernel * kernel * channels * STEP;
            for (at, expected) in expected.iter().enumerate() {
                let (pixel, output) = (at / outputs, at % outputs);
                let mut sum = filter.bias[output];
                for (tap, input) in
                    (0..kernel * kernel).flat_map(|tap| (0..inputs).map(move |i| (tap, i)))
                {
                    let y = (pixel / out * stride + tap / kernel).wrapping_sub(centre);
                    let x = (pixel % out * stride + tap % kernel).wrapping_sub(centre);
                    if y < side && x < side {
                        let first = (output / channels * steps + input / STEP) * block;
                        let row = tap * channels + output % channels;
                        let at = half_at(row, input % STEP / HALF) * HALF + input % HALF;
                        sum += packed[first + at] * image[(y * side + x) * inputs + input];
                    }
                }
                assert!((sum - expected).abs() < 1e-4, "{inputs} {outputs}: {sum} {expected}");
            }
        }
    }

    #[test]
    fn shuffled_channels_go_by_place_then_by_channel() {
        let filter = random_filter(2, 12, 1, 5);
        let packed = weights(&filter, 16, Order::Shuffled);
        let table = table(&filter, Some(&filter.bias), Order::Shuffled);
        for (place, channel) in (0..4).flat_map(|q| (0..3).map(move |c| (q, c))) {
            let (at, stored) = (3 * place + channel, 4 * channel + place);
            assert_eq!(packed[at], filter.at(stored, 0, 0, 0));
            assert_eq!(packed[16 + at], filter.at(stored, 1, 0, 0));
            assert_eq!(table[at], filter.bias[stored]);
            assert_eq!(table[12 + at], filter.bias[stored]);
        }
        assert!(packed[12..16].iter().chain(&packed[32..]).all(|&v| v == 0.0), "padding");
    }
}
