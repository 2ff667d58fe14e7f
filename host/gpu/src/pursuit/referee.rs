//! The referee: chooses in double precision between atoms that single precision cannot distinguish.
//!
//! The law is that of `omp::referee` in `nirspi-recon`. The coefficients of the support solve `G x =
//! p0` in `f64`; the pursuit's `f32` factor of `G` gives them by iterative refinement. The correlation
//! of a rival is what `x` leaves of its initial projection. All units of a workgroup work on one
//! frame, and only frames with a doubtful choice do this at all.
//!
//! Work of a choice with `k` atoms chosen: each step of refinement takes `k^2` products in `f64`, `k^2`
//! in `f32` and `2 k` barriers, and three steps are usual; each rival takes `k` products in `f64`.

// The functions of a kernel take its buffers and sizes, one by one.
#![allow(clippy::too_many_arguments)]

use super::layout::Shape;
use cubecl::prelude::*;

/// Change of the coefficients, relative to the largest, below which a further step would only add
/// rounding. `nirspi-recon` holds it against its own.
pub const REFINED: f64 = 1e-11;

/// Largest number of refinement steps. `nirspi-recon` holds it against its own.
pub const STEPS: usize = 5;

/// The largest of one number of each unit; every unit gets it.
#[cube]
fn largest(own: f32, numbers: &mut SharedMemory<f32>, #[comptime] units: usize) -> f32 {
    let unit = UNIT_POS as usize;
    numbers[unit] = own;
    sync_cube();
    #[unroll]
    for level in 0..comptime!(units.trailing_zeros()) {
        let half = comptime!(units >> (level + 1));
        if unit < half {
            numbers[unit] = max(numbers[unit], numbers[unit + half]);
        }
        sync_cube();
    }
    let found = numbers[0];
    sync_cube();
    found
}

/// Solves L^T x = b in place, for the support's factor L; `count` numbers.
#[cube]
fn substitute_back(
    b: &mut SharedMemory<f32>,
    rows: &Array<f32>,
    support: &Array<u32>,
    values: &Array<f32>,
    at: usize,
    count: usize,
    #[comptime] shape: Shape,
) {
    let units = comptime!(shape.units);
    let width = comptime!(shape.units * shape.per_unit);
    let unit = UNIT_POS as usize;
    for back in 0..count {
        let last = count - 1 - back;
        let value = b[last] * values[(at + last) * 2 + 1];
        let atom = support[at + last] as usize;
        sync_cube();
        let mut i = unit;
        while i < last {
            b[i] -= rows[(at + i) * width + atom] * value;
            i += units;
        }
        if unit == 0 {
            b[last] = value;
        }
        sync_cube();
    }
}

/// Solves L x = b in place.
#[cube]
fn substitute(
    b: &mut SharedMemory<f32>,
    rows: &Array<f32>,
    support: &Array<u32>,
    values: &Array<f32>,
    at: usize,
    count: usize,
    #[comptime] shape: Shape,
) {
    let units = comptime!(shape.units);
    let width = comptime!(shape.units * shape.per_unit);
    let unit = UNIT_POS as usize;
    for first in 0..count {
        let value = b[first] * values[(at + first) * 2 + 1];
        sync_cube();
        let mut i = first + 1 + unit;
        while i < count {
            b[i] -= rows[(at + first) * width + support[at + i] as usize] * value;
            i += units;
        }
        if unit == 0 {
            b[first] = value;
        }
        sync_cube();
    }
}

/// The best of the atoms whose score in `f32` is at least `least`, of equal ones the lowest.
///
/// `at` is the place of the frame's first chosen atom, `count` their number. `gram` is `width x
/// width`, `projection` `frames x width`, `norms` has one over each norm: all in `D`. `weights` and
/// `numbers` are overwritten.
#[cube]
pub(super) fn decide<D: Float>(
    gram: &Array<D>,
    projection: &Array<D>,
    norms: &Array<D>,
    rows: &Array<f32>,
    support: &Array<u32>,
    values: &Array<f32>,
    p: &Array<f32>,
    inverse_norms: &Array<f32>,
    weights: &mut SharedMemory<f32>,
    numbers: &mut SharedMemory<f32>,
    places: &mut SharedMemory<u32>,
    x: &mut SharedMemory<D>,
    scores: &mut SharedMemory<D>,
    frame: usize,
    at: usize,
    count: usize,
    least: f32,
    #[comptime] shape: Shape,
) -> usize {
    let units = comptime!(shape.units);
    let per_unit = comptime!(shape.per_unit);
    let width = comptime!(shape.units * shape.per_unit);
    let unit = UNIT_POS as usize;

    // The coefficients in single precision, to begin with.
    let mut i = unit;
    while i < count {
        weights[i] = values[(at + i) * 2];
        i += units;
    }
    sync_cube();
    substitute_back(weights, rows, support, values, at, count, shape);
    let mut i = unit;
    while i < count {
        x[i] = D::cast_from(weights[i]);
        i += units;
    }
    sync_cube();
    let mut more = count > 0;
    let mut step = 0u32;
    while more {
        // p0 - G x.
        let mut i = unit;
        while i < count {
            let atom = support[at + i] as usize;
            let mut missing = projection[frame * width + atom];
            for j in 0..count {
                missing -= gram[support[at + j] as usize * width + atom] * x[j];
            }
            weights[i] = f32::cast_from(missing);
            i += units;
        }
        sync_cube();
        substitute(weights, rows, support, values, at, count, shape);
        substitute_back(weights, rows, support, values, at, count, shape);
        let mut change = 0.0f32;
        let mut size = 0.0f32;
        let mut i = unit;
        while i < count {
            x[i] += D::cast_from(weights[i]);
            change = max(change, f32::abs(weights[i]));
            size = max(size, f32::abs(f32::cast_from(x[i])));
            i += units;
        }
        let change = largest(change, numbers, units);
        let size = largest(size, numbers, units);
        step += 1;
        more = step < comptime!(STEPS as u32) && change > comptime!(REFINED as f32) * size;
    }

    let mut best = D::cast_from(-1.0f32);
    let mut place = (width as u32).runtime();
    #[unroll]
    for a in 0..per_unit {
        if inverse_norms[a] > 0.0f32 && p[a].abs() * inverse_norms[a] >= least {
            let atom = a * units + unit;
            let mut left = projection[frame * width + atom];
            for j in 0..count {
                left -= gram[support[at + j] as usize * width + atom] * x[j];
            }
            let score = left.abs() * norms[atom];
            if score > best {
                best = score;
                place = atom as u32;
            }
        }
    }
    scores[unit] = best;
    places[unit] = place;
    sync_cube();
    #[unroll]
    for level in 0..comptime!(units.trailing_zeros()) {
        let half = comptime!(units >> (level + 1));
        if unit < half {
            let (a, b) = (scores[unit], scores[unit + half]);
            let (at_a, at_b) = (places[unit], places[unit + half]);
            if b > a || (b == a && at_b < at_a) {
                scores[unit] = b;
                places[unit] = at_b;
            }
        }
        sync_cube();
    }
    let chosen = places[0] as usize;
    sync_cube();
    chosen
}
