//! Convolution of [`Planes`] by any kernel: all of FSRCNN. The UNets' convolutions are in
//! [`winograd`](super::winograd).
//!
//! A tap is an offset into a channel (the margins supply zeros at the edges), so a convolution is a
//! sum over channels and taps of a shifted run of floats times a weight. Four output channels by
//! three vectors of pixels stay in registers during that sum, and the multipliers limit the speed.
//!
//! # Invariant
//! An output is its bias plus its products, added over input channels and taps in one order, fused
//! (`cpu::tests::a_convolution_is_the_sum_over_channels_and_taps`). Images and threads never share
//! a sum, so a batch and a single image give the same bits.

use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use super::planes::Planes;

/// Number of output channels computed together.
const BLOCK: usize = 4;

/// Number of vectors of pixels computed together.
const VECTORS: usize = 3;

/// Number of multiplications from which another thread is used.
pub(super) const THREAD_WORK: usize = 2_000_000;

/// Weights of a convolution with stride 1 that keeps the size of its input, in the order of the
/// loop.
#[derive(Debug, Clone)]
pub(super) struct Conv {
    inputs: usize,
    outputs: usize,
    /// Offset in rows and columns from a pixel to each of its taps.
    taps: Vec<(isize, isize)>,
    /// For each block of outputs, each input and each tap: one weight for each output.
    weights: Vec<[f32; BLOCK]>,
    /// Biases of each block of outputs.
    bias: Vec<[f32; BLOCK]>,
}

impl Conv {
    /// Takes `weight(output, input, ky, kx)` of a `kernel` x `kernel` convolution whose tap
    /// (`centre`, `centre`) is the pixel itself.
    pub fn new(
        (outputs, inputs, kernel, centre): (usize, usize, usize, usize),
        weight: impl Fn(usize, usize, usize, usize) -> f32,
        bias: impl Fn(usize) -> f32,
    ) -> Self {
        let from_centre = |k: usize| k as isize - centre as isize;
        let taps = (0..kernel)
            .flat_map(|ky| (0..kernel).map(move |kx| (from_centre(ky), from_centre(kx))))
            .collect();
        let mut weights = Vec::new();
        for block in (0..outputs).step_by(BLOCK) {
            for input in 0..inputs {
                for (ky, kx) in (0..kernel).flat_map(|ky| (0..kernel).map(move |kx| (ky, kx))) {
                    weights.push(std::array::from_fn(|lane| {
                        let output = block + lane;
                        if output < outputs { weight(output, input, ky, kx) } else { 0.0 }
                    }));
                }
            }
        }
        let bias = (0..outputs)
            .step_by(BLOCK)
            .map(|block| {
                std::array::from_fn(
                    |lane| if block + lane < outputs { bias(block + lane) } else { 0.0 },
                )
            })
            .collect();
        Self { inputs, outputs, taps, weights, bias }
    }

    /// Number of output channels.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// The convolution of `input`, whose margin must be as wide as the taps reach.
    pub fn apply(&self, arch: Arch, input: &Planes) -> Planes {
        debug_assert_eq!(input.channels(), self.inputs);
        let mut out = input.like(self.outputs);
        let stride = input.stride();
        let offsets: Vec<usize> = self
            .taps
            .iter()
            .map(|&(dy, dx)| {
                let offset = input.first() as isize + dy * input.row_stride() as isize + dx;
                usize::try_from(offset).expect("the margin holds the taps")
            })
            .collect();
        let per_block = self.inputs * self.taps.len();
        let work = per_block * BLOCK * input.span();
        let block = |(index, out): (usize, &mut [f32])| {
            arch.dispatch(Block {
                input: input.values(),
                stride,
                offsets: &offsets,
                weights: &self.weights[index * per_block..][..per_block],
                bias: &self.bias[index],
                span: input.span(),
                first: input.first(),
                out,
            });
        };
        let blocks = BLOCK * stride;
        let grain = (THREAD_WORK / work.max(1)).max(1);
        out.values_mut().par_chunks_mut(blocks).enumerate().with_min_len(grain).for_each(block);
        out.clear_margins();
        out
    }
}

/// One block of output channels.
struct Block<'a> {
    input: &'a [f32],
    stride: usize,
    offsets: &'a [usize],
    weights: &'a [[f32; BLOCK]],
    bias: &'a [f32; BLOCK],
    span: usize,
    first: usize,
    out: &'a mut [f32],
}

impl WithSimd for Block<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let tile = VECTORS * S::F32_LANES;
        let taps = self.offsets.len();
        for start in (0..self.span).step_by(tile) {
            let mut sums: [[S::f32s; VECTORS]; BLOCK] =
                self.bias.map(|b| [simd.splat_f32s(b); VECTORS]);
            for (channel, weights) in
                self.input.chunks_exact(self.stride).zip(self.weights.chunks_exact(taps))
            {
                for (&offset, weights) in self.offsets.iter().zip(weights) {
                    let run = &channel[start + offset..][..tile];
                    let (run, _) = S::as_simd_f32s(run);
                    let run: [S::f32s; VECTORS] = std::array::from_fn(|v| run[v]);
                    for (sums, &weight) in sums.iter_mut().zip(weights) {
                        let weight = simd.splat_f32s(weight);
                        for (sum, &pixels) in sums.iter_mut().zip(&run) {
                            *sum = simd.mul_add_e_f32s(weight, pixels, *sum);
                        }
                    }
                }
            }
            for (channel, sums) in self.out.chunks_exact_mut(self.stride).zip(&sums) {
                let (to, _) = S::as_mut_simd_f32s(&mut channel[self.first + start..][..tile]);
                to.copy_from_slice(sums);
            }
        }
    }
}
