//! The kernels: one source, compiled for CUDA, Vulkan, Metal or DirectX at run time.
//!
//! Barriers stand outside every branch. A loop whose length is known when a kernel is compiled is
//! unrolled, except the loop over a step's channels. [`super::plan`] counts the rounds of the other
//! loops.

// A kernel's arguments are its buffers and sizes, and the macro makes functions with as many
// arguments.
#![allow(clippy::too_many_arguments)]

use super::finish::{Ending, store};
use super::plan::{COLUMNS, DEPTH, ROWS, UNITS};
use cubecl::prelude::*;

/// Padding between the input channels of a step in shared memory, after the pixels. It makes the
/// eight channels of a pixel go to eight different banks.
const SKEW: usize = 4;

/// Facts about a convolution that its kernel is compiled for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Shape {
    /// Number of pixels of a unit: `row + ROWS * i`.
    pub pixels: usize,
    /// Number of channels of a unit: `column + COLUMNS * j`.
    pub channels: usize,
    pub ending: Ending,
}

/// A convolution: pixels of all frames as rows, channels as columns, one workgroup for a tile of
/// both. The input is `frame x side x side x inputs`; [`super::Layer`] says how `weights` and `table` are packed; the
/// output is `frame x out_side x out_side x outputs`, or with twice the side after a shuffle.
#[cube(launch_unchecked)]
pub(super) fn convolve(
    input: &Array<f32>,
    weights: &Array<f32>,
    table: &Array<f32>,
    film: &Array<f32>,
    addend: &Array<f32>,
    out: &mut Array<f32>,
    activated: &mut Array<f32>,
    pixels: u32,
    side: u32,
    out_side: u32,
    inputs: u32,
    outputs: u32,
    kernel: u32,
    stride: u32,
    centre: u32,
    film_width: u32,
    film_first: u32,
    #[comptime] shape: Shape,
) {
    let mine = comptime!(shape.pixels);
    let own = comptime!(shape.channels);
    let pitch = comptime!(ROWS * shape.pixels + SKEW);
    let tile = comptime!(COLUMNS * shape.channels);
    let step = comptime!(DEPTH * COLUMNS * shape.channels);
    let loads = comptime!((DEPTH * COLUMNS * shape.channels).div_ceil(UNITS));

    let pixels = pixels as usize;
    let side = side as usize;
    let out_side = out_side as usize;
    let inputs = inputs as usize;
    let outputs = outputs as usize;
    let kernel = kernel as usize;
    let stride = stride as usize;
    let centre = centre as usize;

    let unit = UNIT_POS as usize;
    let column = unit % COLUMNS;
    let row = unit / COLUMNS;
    let first_pixel = CUBE_POS_X as usize * comptime!(ROWS * shape.pixels) + row;
    let first_channel = CUBE_POS_Y as usize * tile + column;

    let mut seen = SharedMemory::<f32>::new(comptime!(DEPTH * (ROWS * shape.pixels + SKEW)));
    let mut taps = SharedMemory::<f32>::new(step);
    let mut sums = Array::<f32>::new(comptime!(shape.pixels * shape.channels));
    #[unroll]
    for i in 0..comptime!(shape.pixels * shape.channels) {
        sums[i] = 0.0f32;
    }

    // For each of this unit's pixels: the first pixel of its frame, and row and column of its first
    // tap, both larger by `centre`.
    let mut frames = Array::<usize>::new(mine);
    let mut ys = Array::<usize>::new(mine);
    let mut xs = Array::<usize>::new(mine);
    #[unroll]
    for i in 0..mine {
        let pixel = first_pixel + ROWS * i;
        let within = pixel % (out_side * out_side);
        frames[i] = pixel / (out_side * out_side) * side * side;
        ys[i] = within / out_side * stride;
        xs[i] = within % out_side * stride;
    }

    let steps = inputs.div_ceil(DEPTH);
    let mut at = CUBE_POS_Y as usize * kernel * kernel * steps * step;
    for ky in 0..kernel {
        for kx in 0..kernel {
            for chunk in 0..steps {
                let channel = chunk * DEPTH + column;
                #[unroll]
                for i in 0..mine {
                    let y = ys[i] + ky;
                    let x = xs[i] + kx;
                    let inside = channel < inputs
                        && first_pixel + ROWS * i < pixels
                        && y >= centre
                        && y < side + centre
                        && x >= centre
                        && x < side + centre;
                    let mut value = 0.0f32;
                    if inside {
                        let pixel = frames[i] + (y - centre) * side + (x - centre);
                        value = input[pixel * inputs + channel];
                    }
                    seen[column * pitch + row + ROWS * i] = value;
                }
                #[unroll]
                for i in 0..loads {
                    let index = unit + UNITS * i;
                    if index < step {
                        taps[index] = weights[at + index];
                    }
                }
                at += step;
                sync_cube();
                for k in 0..DEPTH {
                    let mut across = Array::<f32>::new(own);
                    #[unroll]
                    for j in 0..own {
                        across[j] = taps[k * tile + column + COLUMNS * j];
                    }
                    #[unroll]
                    for i in 0..mine {
                        let down = seen[k * pitch + row + ROWS * i];
                        #[unroll]
                        for j in 0..own {
                            sums[i * own + j] += down * across[j];
                        }
                    }
                }
                sync_cube();
            }
        }
    }

    #[unroll]
    for i in 0..mine {
        let pixel = first_pixel + ROWS * i;
        if pixel < pixels {
            #[unroll]
            for j in 0..own {
                let channel = first_channel + COLUMNS * j;
                if channel < outputs {
                    store(
                        sums[i * own + j],
                        pixel,
                        channel,
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

/// Takes `images` from number `first` on, divides by `white` and clamps to [0, 1]. Each unit
/// computes one number.
#[cube(launch_unchecked)]
pub(super) fn readings(
    images: &Array<f32>,
    out: &mut Array<f32>,
    first: u32,
    white: f32,
    count: u32,
) {
    let at = ABSOLUTE_POS;
    if at < count as usize {
        let image = images[first as usize + at];
        let mut reading = min(max(image / white, 0.0f32), 1.0f32);
        // Limits hide NaN; the last kernel tells it.
        if u32::reinterpret(image) & 0x7fff_ffffu32 > 0x7f80_0000u32 {
            reading = image;
        }
        out[at] = reading;
    }
}

/// FSRCNN's input: intensity, depth and validity of each pixel side by side. `depth`, if there is
/// any, has the two planes of a frame one after the other. Each unit computes one number.
#[cube(launch_unchecked)]
pub(super) fn stacked(
    readings: &Array<f32>,
    depth: &Array<f32>,
    out: &mut Array<f32>,
    area: u32,
    count: u32,
    #[comptime] has_depth: bool,
) {
    let at = ABSOLUTE_POS;
    if at < count as usize {
        let area = area as usize;
        let channel = at % 3;
        let pixel = at / 3;
        let mut value = 0.0f32;
        if channel == 0 {
            value = readings[pixel];
        } else {
            if comptime!(has_depth) {
                let plane = pixel / area * 2 + channel - 1;
                value = depth[plane * area + pixel % area];
            }
        }
        out[at] = value;
    }
}

/// The UNet's input: blocks of 2 x 2 pixels of `current` (channels 0 to 3) and of `degraded` (4 to
/// 7). With `coarse`, `degraded` has one pixel for each block. `side` is that of the blocks. Each
/// unit computes one number.
#[cube(launch_unchecked)]
pub(super) fn paired(
    current: &Array<f32>,
    degraded: &Array<f32>,
    out: &mut Array<f32>,
    side: u32,
    count: u32,
    #[comptime] coarse: bool,
) {
    let at = ABSOLUTE_POS;
    if at < count as usize {
        let side = side as usize;
        let place = at % 4;
        let block = at / 8;
        let line = block / side * 2 + place / 2;
        let fine = line * 2 * side + block % side * 2 + place % 2;
        if at % 8 < 4 {
            out[at] = current[fine];
        } else {
            let mut seen = fine;
            if comptime!(coarse) {
                seen = block;
            }
            out[at] = degraded[seen];
        }
    }
}

/// ln(mean + `floor`) + `offset` of each channel of each frame. Each unit computes one channel of a
/// frame.
#[cube(launch_unchecked)]
pub(super) fn pooled(
    input: &Array<f32>,
    out: &mut Array<f32>,
    pixels: u32,
    channels: u32,
    count: u32,
    floor: f32,
    offset: f32,
) {
    let at = ABSOLUTE_POS;
    if at < count as usize {
        let channels = channels as usize;
        let first = at / channels * pixels as usize * channels + at % channels;
        let mut sum = 0.0f32;
        for pixel in 0..pixels as usize {
            sum += input[first + pixel * channels];
        }
        out[at] = f32::ln(sum / pixels as f32 + floor) + offset;
    }
}

/// The UNet's six conditions from the estimator's two outputs: the path, then blur and noise on the
/// scale of the networks, clamped to their bounds, and their squares. `scale` converts blur to the
/// 64 x 64 grid. Each unit computes one frame.
#[cube(launch_unchecked)]
pub(super) fn conditions(
    estimates: &Array<f32>,
    bounds: &Array<f32>,
    out: &mut Array<f32>,
    scale: f32,
    count: u32,
) {
    let frame = ABSOLUTE_POS;
    if frame < count as usize {
        let blur = min(max(estimates[frame * 2] * scale, bounds[2]), bounds[3]);
        let noise = min(max(estimates[frame * 2 + 1], bounds[4]), bounds[5]);
        out[frame * 6] = bounds[0];
        out[frame * 6 + 1] = bounds[1];
        out[frame * 6 + 2] = blur;
        out[frame * 6 + 3] = blur * blur;
        out[frame * 6 + 4] = noise;
        out[frame * 6 + 5] = noise * noise;
    }
}
