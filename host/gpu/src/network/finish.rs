//! What is done with the sums of a convolution before they are stored, in registers.

// The functions of a kernel take its buffers and sizes, one by one.
#![allow(clippy::too_many_arguments)]

use cubecl::prelude::*;

/// The activation of a sum, before anything is added.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Activation {
    /// None.
    Nothing,
    /// x / (1 + e^-x).
    Silu,
    /// SiLU of x (1 + scale) + shift, where scale and shift come from the conditions of the frame.
    FilmSilu,
    /// PReLU with the slope of the channel; ReLU where the slope is 0.
    Prelu,
    /// ln(1 + e^x).
    Softplus,
}

/// What is added after the activation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Add {
    /// Nothing.
    Nothing,
    /// One number for each output.
    Alike,
    /// One number for each pixel of the convolution, the same for all channels.
    Pixel,
}

/// Facts about the last operations that a kernel is compiled for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Ending {
    pub activation: Activation,
    pub add: Add,
    /// Whether channel `place * C + c` is stored as channel `c` of one of four pixels of an
    /// enlarged image.
    pub shuffle: bool,
    /// Whether the output is clamped to [0, 1].
    pub clamp: bool,
    /// Whether SiLU of the output is stored in a second buffer.
    pub activated: bool,
}

#[cube]
fn silu(x: f32) -> f32 {
    x / (1.0f32 + f32::exp(-x))
}

/// Stores the output of one channel of one pixel, for its sum. `pixel` counts the pixels of all
/// frames.
#[cube]
pub(super) fn store(
    sum: f32,
    pixel: usize,
    channel: usize,
    outputs: usize,
    out_side: usize,
    table: &Array<f32>,
    film: &Array<f32>,
    film_width: usize,
    film_first: usize,
    addend: &Array<f32>,
    out: &mut Array<f32>,
    activated: &mut Array<f32>,
    #[comptime] ending: Ending,
) {
    let frame = pixel / (out_side * out_side);
    let mut value = sum + table[channel];
    if comptime!(ending.activation == Activation::Silu) {
        value = silu(value);
    }
    if comptime!(ending.activation == Activation::FilmSilu) {
        let told = frame * film_width + film_first + channel;
        value = silu(value * (1.0f32 + film[told]) + film[told + outputs]);
    }
    if comptime!(ending.activation == Activation::Prelu) {
        value = max(value, 0.0f32) + table[outputs + channel] * min(value, 0.0f32);
    }
    if comptime!(ending.activation == Activation::Softplus) {
        value = max(value, 0.0f32) + f32::ln(1.0f32 + f32::exp(-f32::abs(value)));
    }
    let mut to = pixel * outputs + channel;
    if comptime!(ending.shuffle) {
        let within = pixel % (out_side * out_side);
        let y = within / out_side;
        let x = within % out_side;
        let channels = outputs / 4;
        let quarter = channel / channels;
        let line = (frame * out_side + y) * 2 + quarter / 2;
        to = (line * 2 * out_side + 2 * x + quarter % 2) * channels + channel % channels;
    }
    if comptime!(ending.add == Add::Alike) {
        value += addend[to];
    }
    if comptime!(ending.add == Add::Pixel) {
        value += addend[pixel];
    }
    if comptime!(ending.clamp) {
        value = min(max(value, 0.0f32), 1.0f32);
    }
    out[to] = value;
    if comptime!(ending.activated) {
        activated[to] = silu(value);
    }
}
