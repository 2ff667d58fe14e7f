//! The kernel: one workgroup for each frame.
//!
//! # How
//! Readings of 32 x 32 are compared in their cosine transform, where the camera's model is a product
//! with a matrix of 32 x 64 on either side; the matrix depends on the blur of the frame and is made
//! in shared memory. With all rows measured, A A^T is diagonal there. With some rows, Lanczos' basis
//! is built as on the processor (`nirspi_nets::consistency`), each unit with four elements of each
//! vector. All units try values of lambda at once, 256 in a round, and three rounds give more digits
//! than the processor's halvings.
//!
//! Barriers stand outside branches, except in the loop over Lanczos' steps, whose end all units of a
//! workgroup compute from the same numbers.

// A kernel's arguments are its buffers and sizes, and the macro makes functions with as many
// arguments.
#![allow(clippy::too_many_arguments)]

use super::BROKEN;
use super::layout::{COSINES, COSINES_ACROSS, FINE, MASK, SETTINGS, WALSH, WALSH_ACROSS, WAVES};
use cubecl::prelude::*;
use std::f32::consts::PI;

/// Number of units of a workgroup.
pub(super) const UNITS: usize = 256;

/// Side of the readings.
pub(super) const SIDE: usize = 32;

/// Number of readings, and of those of one unit.
const AREA: usize = SIDE * SIDE;
const OWN: usize = AREA / UNITS;

/// Distance of two rows of the camera's matrix in shared memory. An odd number sends the same column
/// of neighbouring rows to different banks.
const PITCH: usize = FINE + 1;

/// Number of values of lambda of one round, as a number.
const TRIED: f32 = UNITS as f32;

/// Facts that the kernel is compiled for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Shape {
    /// Whether images are moved into agreement.
    pub binding: bool,
    /// Whether only some rows were measured.
    pub sampled: bool,
    /// Largest number of Lanczos' steps.
    pub steps: usize,
    /// Number of steps between two checks of the error.
    pub look: usize,
    /// Number of halvings of the interval of lambda.
    pub halvings: usize,
}

impl Shape {
    /// Numbers of shared memory.
    pub(super) const fn shared(&self) -> usize {
        SIDE * PITCH + SIDE * FINE + AREA + UNITS + SIDE + 4 * (self.steps + 1)
    }
}

/// The sum of one number of each unit; every unit gets it.
#[cube]
fn total(own: f32, sums: &mut SharedMemory<f32>) -> f32 {
    let unit = UNIT_POS as usize;
    sums[unit] = own;
    sync_cube();
    for round in 0..8u32 {
        let half = 128usize >> round as usize;
        if unit < half {
            let other = sums[unit + half];
            sums[unit] += other;
        }
        sync_cube();
    }
    let sum = sums[0];
    sync_cube();
    sum
}

/// The product of two vectors.
#[cube]
fn dot(a: &Array<f32>, b: &Array<f32>, sums: &mut SharedMemory<f32>) -> f32 {
    let mut own = 0.0f32;
    #[unroll]
    for i in 0..OWN {
        own += a[i] * b[i];
    }
    total(own, sums)
}

/// The factor of cosine `k` of the image in its readings.
#[cube]
fn gain(k: usize, sigma: f32) -> f32 {
    let omega = k as f32 * comptime!(PI / FINE as f32);
    let blur = f32::exp(-0.5f32 * sigma * omega * sigma * omega);
    // The factor of a pair's mean, and of its norm.
    blur * f32::cos(0.5f32 * omega) * comptime!(0.5_f32.sqrt())
}

/// M X M^T of the vector in `small`, for a matrix of 32 x 32 in the tables: `down` is the first
/// number of M, `across` that of its transposed. The result is in registers.
#[cube]
fn transformed(
    small: &SharedMemory<f32>,
    half: &mut SharedMemory<f32>,
    tables: &Array<f32>,
    down: usize,
    across: usize,
    out: &mut Array<f32>,
) {
    let unit = UNIT_POS as usize;
    let column = unit % SIDE;
    let row = unit / SIDE;
    let mut sums = Array::<f32>::new(OWN);
    #[unroll]
    for i in 0..OWN {
        sums[i] = 0.0f32;
    }
    for k in 0..SIDE {
        let value = small[k * SIDE + column];
        #[unroll]
        for i in 0..OWN {
            sums[i] += tables[down + (row + comptime!(UNITS / SIDE) * i) * SIDE + k] * value;
        }
    }
    #[unroll]
    for i in 0..OWN {
        half[unit + UNITS * i] = sums[i];
        sums[i] = 0.0f32;
    }
    sync_cube();
    for k in 0..SIDE {
        let factor = tables[across + k * SIDE + column];
        #[unroll]
        for i in 0..OWN {
            sums[i] += half[(row + comptime!(UNITS / SIDE) * i) * SIDE + k] * factor;
        }
    }
    sync_cube();
    #[unroll]
    for i in 0..OWN {
        out[i] = sums[i];
    }
}

/// Puts a vector from registers into `small`.
#[cube]
fn share(own: &Array<f32>, small: &mut SharedMemory<f32>) {
    #[unroll]
    for i in 0..OWN {
        small[UNIT_POS as usize + UNITS * i] = own[i];
    }
    sync_cube();
}

/// The measured part of readings, given by their cosine transform, in place.
#[cube]
fn measured_part(
    own: &mut Array<f32>,
    small: &mut SharedMemory<f32>,
    half: &mut SharedMemory<f32>,
    tables: &Array<f32>,
) {
    share(own, small);
    transformed(small, half, tables, WALSH, WALSH_ACROSS, own);
    #[unroll]
    for i in 0..OWN {
        own[i] *= tables[MASK + UNIT_POS as usize + UNITS * i];
    }
    share(own, small);
    transformed(small, half, tables, WALSH_ACROSS, WALSH, own);
}

/// Subtracts the cosine transform of the readings of `image`, clamped to [0, 1].
#[cube]
fn without_seen(
    own: &mut Array<f32>,
    image: &Array<f32>,
    frame: usize,
    camera: &SharedMemory<f32>,
    half: &mut SharedMemory<f32>,
) {
    let unit = UNIT_POS as usize;
    let first = frame * comptime!(FINE * FINE);
    let x = unit % FINE;
    let top = unit / FINE;
    let mut sums = Array::<f32>::new(8usize);
    #[unroll]
    for i in 0..8usize {
        sums[i] = 0.0f32;
    }
    for y in 0..FINE {
        let value = min(max(image[first + y * FINE + x], 0.0f32), 1.0f32);
        #[unroll]
        for i in 0..8usize {
            sums[i] += camera[(top + 4 * i) * PITCH + y] * value;
        }
    }
    #[unroll]
    for i in 0..8usize {
        half[(top + 4 * i) * FINE + x] = sums[i];
    }
    sync_cube();
    let column = unit % SIDE;
    let row = unit / SIDE;
    for x in 0..FINE {
        let factor = camera[column * PITCH + x];
        #[unroll]
        for i in 0..OWN {
            own[i] -= half[(row + 8 * i) * FINE + x] * factor;
        }
    }
    sync_cube();
}

/// Norm of (T + lambda)^-1 e_1 for the first `count` steps. With f(lambda) = e_1^T (T + lambda)^-1
/// e_1, a continued fraction, its square is -f'(lambda).
#[cube]
fn norm_of_solution(
    diagonal: &SharedMemory<f32>,
    beside: &SharedMemory<f32>,
    count: usize,
    lambda: f32,
) -> f32 {
    let mut pivot = diagonal[count - 1] + lambda;
    let mut slope = 1.0f32;
    for back in 1..count {
        let k = count - 1 - back;
        let share = beside[k] / pivot;
        slope = 1.0f32 + share * share * slope;
        pivot = diagonal[k] + lambda - beside[k] * share;
    }
    f32::sqrt(slope) / pivot
}

/// The largest lambda, as its logarithm, for which lambda |x| is at most `radius`: `length` is the
/// norm of the right-hand side.
#[cube]
fn lambda_of(
    diagonal: &SharedMemory<f32>,
    beside: &SharedMemory<f32>,
    count: usize,
    length: f32,
    radius: f32,
    least: f32,
    most: f32,
    sums: &mut SharedMemory<f32>,
) -> f32 {
    let mut low = least;
    let mut width = most - least;
    for _ in 0..3u32 {
        let tried = low + width * (UNIT_POS as f32 + 1.0f32) / TRIED;
        let lambda = f32::powf(10.0f32, tried);
        let norm = lambda * length * norm_of_solution(diagonal, beside, count, lambda);
        let mut inside = 1.0f32;
        if norm > radius {
            inside = 0.0f32;
        }
        // The norm grows with lambda, so those inside are the first ones.
        low += width * total(inside, sums) / TRIED;
        width /= TRIED;
    }
    low
}

/// Moves guesses into agreement with their readings, and says how far they are from it.
///
/// `readings`: frames x 32 x 32. `guesses`: frames x 64 x 64. `estimates`: two outputs of the
/// estimator for each frame. `tables` and `law`: [`super::layout`]. `basis`: frames x (steps +
/// 1) x 1024 numbers of scratch, where rows are missing. `out`: frames x 64 x 64, in [0, 1].
/// `ratios`: the inconsistency of each frame.
#[cube(launch_unchecked)]
pub(super) fn agree(
    readings: &Array<f32>,
    guesses: &Array<f32>,
    estimates: &Array<f32>,
    tables: &Array<f32>,
    law: &Array<f32>,
    basis: &mut Array<f32>,
    out: &mut Array<f32>,
    ratios: &mut Array<f32>,
    #[comptime] shape: Shape,
) {
    let unit = UNIT_POS as usize;
    let frame = CUBE_POS_X as usize;
    let mut camera = SharedMemory::<f32>::new(comptime!(SIDE * PITCH));
    let mut half = SharedMemory::<f32>::new(comptime!(SIDE * FINE));
    let mut small = SharedMemory::<f32>::new(AREA);
    let mut sums = SharedMemory::<f32>::new(UNITS);
    let mut power = SharedMemory::<f32>::new(SIDE);
    let mut diagonal = SharedMemory::<f32>::new(comptime!(shape.steps + 1));
    let mut beside = SharedMemory::<f32>::new(comptime!(shape.steps + 1));
    let mut pivots = SharedMemory::<f32>::new(comptime!(shape.steps + 1));
    let mut coefficients = SharedMemory::<f32>::new(comptime!(shape.steps + 1));

    let sigma = min(
        max(
            estimates[2 * frame] * law[comptime!(SETTINGS.sigma_scale)],
            law[comptime!(SETTINGS.sigma_least)],
        ),
        law[comptime!(SETTINGS.sigma_most)],
    );
    let told = min(
        max(
            estimates[2 * frame + 1] * law[comptime!(SETTINGS.noise_scale)],
            law[comptime!(SETTINGS.noise_least)],
        ),
        law[comptime!(SETTINGS.noise_most)],
    );
    let noise = max(told, law[comptime!(SETTINGS.noise_floor)]);
    let expected = noise * f32::sqrt(law[comptime!(SETTINGS.degrees)]);
    let radius = law[comptime!(SETTINGS.tau)] * expected;

    // Pair means fold cosine 64 - k onto cosine k, with the other sign, and remove cosine 32.
    #[unroll]
    for i in 0..comptime!(SIDE * FINE / UNITS) {
        let at = unit + UNITS * i;
        let k = at / FINE;
        let x = at % FINE;
        let mut value = gain(k, sigma) * tables[WAVES + at];
        if k > 0 {
            value -= gain(FINE - k, sigma) * tables[WAVES + (FINE - k) * FINE + x];
        }
        camera[k * PITCH + x] = value;
    }
    if unit < SIDE {
        let own = gain(unit, sigma);
        let mut both = own * own;
        if unit > 0 {
            let folded = gain(FINE - unit, sigma);
            both += folded * folded;
        }
        power[unit] = both;
    }
    // The cosine transform of the readings.
    let mut seen = Array::<f32>::new(OWN);
    #[unroll]
    for i in 0..OWN {
        seen[i] = readings[frame * AREA + unit + UNITS * i];
    }
    share(&seen, &mut small);
    transformed(&small, &mut half, tables, COSINES, COSINES_ACROSS, &mut seen);

    let mut residual = Array::<f32>::new(OWN);
    #[unroll]
    for i in 0..OWN {
        residual[i] = seen[i];
    }
    without_seen(&mut residual, guesses, frame, &camera, &mut half);
    if comptime!(shape.sampled) {
        measured_part(&mut residual, &mut small, &mut half, tables);
    }
    let length = f32::sqrt(dot(&residual, &residual, &mut sums));

    // What the unit's four elements of A A^T's diagonal are.
    let mut powers = Array::<f32>::new(OWN);
    #[unroll]
    for i in 0..OWN {
        powers[i] = power[unit / SIDE + comptime!(UNITS / SIDE) * i] * power[unit % SIDE];
    }
    let mut dual = Array::<f32>::new(OWN);
    #[unroll]
    for i in 0..OWN {
        dual[i] = 0.0f32;
    }
    if comptime!(shape.binding && !shape.sampled) {
        let mut low = law[comptime!(SETTINGS.least_log)];
        let mut high = law[comptime!(SETTINGS.most_log)];
        for _ in 0..comptime!(shape.halvings) {
            let middle = 0.5f32 * (low + high);
            let lambda = f32::powf(10.0f32, middle);
            let mut left = Array::<f32>::new(OWN);
            #[unroll]
            for i in 0..OWN {
                left[i] = residual[i] * lambda / (powers[i] + lambda);
            }
            if f32::sqrt(dot(&left, &left, &mut sums)) > radius {
                high = middle;
            } else {
                low = middle;
            }
        }
        let lambda = f32::powf(10.0f32, low);
        #[unroll]
        for i in 0..OWN {
            dual[i] = residual[i] / (powers[i] + lambda);
        }
    }
    if comptime!(shape.binding && shape.sampled) {
        let first = frame * comptime!((shape.steps + 1) * AREA) + unit;
        let mut before = Array::<f32>::new(OWN);
        let mut now = Array::<f32>::new(OWN);
        let mut next = Array::<f32>::new(OWN);
        // A residual of 0 has no direction; it is inside the ball, and nothing is changed.
        let scale = 1.0f32 / max(length, 1e-30f32);
        #[unroll]
        for i in 0..OWN {
            before[i] = 0.0f32;
            now[i] = residual[i] * scale;
            basis[first + UNITS * i] = now[i];
        }
        let mut coupling = 0.0f32;
        let mut count = 0usize;
        let mut log = law[comptime!(SETTINGS.least_log)];
        let mut more = true;
        while more {
            #[unroll]
            for i in 0..OWN {
                next[i] = powers[i] * now[i];
            }
            measured_part(&mut next, &mut small, &mut half, tables);
            #[unroll]
            for i in 0..OWN {
                next[i] -= coupling * before[i];
            }
            let along = dot(&now, &next, &mut sums);
            #[unroll]
            for i in 0..OWN {
                next[i] -= along * now[i];
            }
            coupling = f32::sqrt(dot(&next, &next, &mut sums));
            let mut inverse = 0.0f32;
            if coupling > 0.0f32 {
                inverse = 1.0f32 / coupling;
            }
            if unit == 0 {
                diagonal[count] = along;
                beside[count] = coupling;
            }
            count += 1;
            #[unroll]
            for i in 0..OWN {
                before[i] = now[i];
                now[i] = next[i] * inverse;
                basis[first + count * AREA + UNITS * i] = now[i];
            }
            sync_cube();
            let last = count >= comptime!(shape.steps) || coupling <= 0.0f32;
            if last || count.is_multiple_of(comptime!(shape.look)) {
                log = lambda_of(
                    &diagonal,
                    &beside,
                    count,
                    length,
                    radius,
                    law[comptime!(SETTINGS.least_log)],
                    law[comptime!(SETTINGS.most_log)],
                    &mut sums,
                );
                let lambda = f32::powf(10.0f32, log);
                // The last coefficient, by elimination, of a right-hand side of norm 1.
                let mut pivot = diagonal[0] + lambda;
                let mut value = 1.0f32;
                for k in 1..count {
                    let factor = beside[k - 1] / pivot;
                    pivot = diagonal[k] + lambda - factor * beside[k - 1];
                    value *= factor;
                }
                more = !last && coupling * value / pivot > law[comptime!(SETTINGS.tolerance)];
            }
        }
        let lambda = f32::powf(10.0f32, log);
        if unit == 0 {
            pivots[0] = diagonal[0] + lambda;
            coefficients[0] = length;
            for k in 1..count {
                let factor = beside[k - 1] / pivots[k - 1];
                pivots[k] = diagonal[k] + lambda - factor * beside[k - 1];
                coefficients[k] = -factor * coefficients[k - 1];
            }
            let mut after = 0.0f32;
            for back in 0..count {
                let k = count - 1 - back;
                // In the first round `after` is 0, for the last step's coupling leads out of the space.
                after = (coefficients[k] - beside[k] * after) / pivots[k];
                coefficients[k] = after;
            }
        }
        sync_cube();
        for k in 0..count {
            let factor = coefficients[k];
            #[unroll]
            for i in 0..OWN {
                dual[i] += factor * basis[first + k * AREA + UNITS * i];
            }
        }
    }
    // A^T of the dual, added to the guess if that is outside the ball.
    let x = unit % FINE;
    let top = unit / FINE;
    let mut change = Array::<f32>::new(16usize);
    #[unroll]
    for i in 0..16usize {
        change[i] = 0.0f32;
    }
    if comptime!(shape.binding) {
        share(&dual, &mut small);
        let column = unit % SIDE;
        let row = unit / SIDE;
        let mut lines = Array::<f32>::new(8usize);
        #[unroll]
        for i in 0..8usize {
            lines[i] = 0.0f32;
        }
        for k in 0..SIDE {
            let value = small[k * SIDE + column];
            #[unroll]
            for i in 0..8usize {
                lines[i] += camera[k * PITCH + row + 8 * i] * value;
            }
        }
        #[unroll]
        for i in 0..8usize {
            half[(row + 8 * i) * SIDE + column] = lines[i];
        }
        sync_cube();
        for l in 0..SIDE {
            let factor = camera[l * PITCH + x];
            #[unroll]
            for i in 0..16usize {
                change[i] += half[(top + 4 * i) * SIDE + l] * factor;
            }
        }
        sync_cube();
    }
    // Limits hide NaN, so it is looked for by its bits.
    let mut broken = 0.0f32;
    #[unroll]
    for i in 0..16usize {
        let at = frame * comptime!(FINE * FINE) + (top + 4 * i) * FINE + x;
        if u32::reinterpret(guesses[at]) & 0x7fff_ffffu32 > 0x7f80_0000u32 {
            broken = 1.0f32;
        }
        let mut value = min(max(guesses[at], 0.0f32), 1.0f32);
        if length > radius {
            value = min(max(value + change[i], 0.0f32), 1.0f32);
        }
        out[at] = value;
    }
    sync_storage();
    sync_cube();
    without_seen(&mut seen, out, frame, &camera, &mut half);
    if comptime!(shape.sampled) {
        measured_part(&mut seen, &mut small, &mut half, tables);
    }
    let mut left = f32::sqrt(dot(&seen, &seen, &mut sums));
    if comptime!(shape.binding) {
        // No image of the camera's model gives these readings: the guess stays.
        let reached = law[comptime!(SETTINGS.reached)] * expected;
        if length > radius && left > max(reached, law[comptime!(SETTINGS.stuck)] * length) {
            left = length;
            #[unroll]
            for i in 0..16usize {
                let at = frame * comptime!(FINE * FINE) + (top + 4 * i) * FINE + x;
                out[at] = min(max(guesses[at], 0.0f32), 1.0f32);
            }
        }
    }
    let broken = total(broken, &mut sums);
    if unit == 0 {
        let mut ratio = left / expected;
        if broken > 0.0f32 {
            ratio = comptime!(BROKEN);
        }
        ratios[frame] = ratio;
    }
}
