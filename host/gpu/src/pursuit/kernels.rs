//! The kernels: one source, compiled for CUDA, Vulkan, Metal or DirectX at run time.
//!
//! Every unit of a workgroup that pursues a frame computes the same choice from the same shared
//! numbers. Barriers stand outside every branch. Of equal scores the lower atom wins, as on the CPU
//! (`omp::tests::gpu::of_equal_atoms_the_lowest_is_chosen`).
//!
//! A loop whose length is known when the kernel is compiled is unrolled. [`super::budget`] counts
//! the rounds of the other loops.

// A kernel's arguments are its buffers and sizes, and the macro makes functions with as many
// arguments.
#![allow(clippy::too_many_arguments)]

use super::layout::{
    CLOSEST, COUNT, DECIDED, DEPENDENT, ENERGY, ENOUGH, EXPLAINED, FIRST_BEST, LEAD, LOOKING,
    NO_ATOM_LEFT, REMAINING, STATE, STOP, Shape, TOGETHER,
};
use super::referee::decide;
use cubecl::prelude::*;

/// Adds `vectors * matrix` over the rows from `first` to `last` to `out`: inner products of
/// `vectors` (`count x rows`) with the columns of `matrix` (`rows x width`). The launch with the
/// first row starts from 0. This kernel computes both the Gram matrix (where the vectors are the
/// atoms) and the initial projections. `count` is a multiple of [`TOGETHER`]. Each unit computes
/// one column; workgroups form a grid.
#[cube(launch_unchecked)]
pub(super) fn products<F: Float>(
    vectors: &Array<F>,
    matrix: &Array<F>,
    out: &mut Array<F>,
    rows: u32,
    width: u32,
    first: u32,
    last: u32,
) {
    let rows = rows as usize;
    let width = width as usize;
    let column = ABSOLUTE_POS_X as usize;
    let top = CUBE_POS_Y as usize * TOGETHER;
    let mut sums = Array::<F>::new(TOGETHER);
    #[unroll]
    for v in 0..TOGETHER {
        sums[v] = F::cast_from(0.0f32);
        if first > 0 {
            sums[v] = out[(top + v) * width + column];
        }
    }
    for row in first as usize..last as usize {
        let entry = matrix[row * width + column];
        #[unroll]
        for v in 0..TOGETHER {
            sums[v] += vectors[(top + v) * rows + row] * entry;
        }
    }
    #[unroll]
    for v in 0..TOGETHER {
        out[(top + v) * width + column] = sums[v];
    }
}

/// Marks with 1 each atom that is parallel to a lower one, to within the rounding of `f32`. Two
/// atoms are parallel if the square of their cosine is at least `like`. Each unit checks one atom.
#[cube(launch)]
pub(super) fn doubles(gram: &Array<f32>, out: &mut Array<u32>, width: u32, like: f32) {
    let atom = ABSOLUTE_POS;
    let width = width as usize;
    let own = gram[atom * width + atom];
    let mut found = 0u32;
    for other in 0..atom {
        let product = gram[other * width + atom];
        if product * product >= like * own * gram[other * width + other] && product != 0.0 {
            found = 1u32;
        }
    }
    out[atom] = found;
}

/// Orthogonal matching pursuit, steps `first` to `last` of at most `sparsity`; one workgroup for
/// each frame.
///
/// As on the CPU, columns of the Gram matrix are orthogonalised when their atom is chosen. Row `i`
/// of `rows` updates the projection `p` of all atoms. The rows contain the Cholesky factor of the
/// support, so no triangular system is solved. `atoms` has one over each norm, then the squared
/// norms. `values` of a frame has a step and one over the root of a pivot for each atom of the
/// support.
///
/// With `refereed`, a choice whose lead over the next best atom is below `believed`, relative to the
/// norm of the measurement, is left to [`decide`]; `exact_gram`, `exact_projection` and `exact_norms`
/// are the numbers that it needs in `D`, which is `f64`. Otherwise these are not read.
#[cube(launch_unchecked)]
pub(super) fn pursue<D: Float>(
    gram: &Array<f32>,
    atoms: &Array<f32>,
    projection: &mut Array<f32>,
    rows: &mut Array<f32>,
    support: &mut Array<u32>,
    values: &mut Array<f32>,
    state: &mut Array<f32>,
    exact_gram: &Array<D>,
    exact_projection: &Array<D>,
    exact_norms: &Array<D>,
    sparsity: u32,
    first: u32,
    last: u32,
    rounding: f32,
    dependent: f32,
    believed: f32,
    #[comptime] shape: Shape,
    #[comptime] refereed: bool,
) {
    let units = comptime!(shape.units);
    let per_unit = comptime!(shape.per_unit);
    let width = comptime!(shape.units * shape.per_unit);
    let sparsity = sparsity as usize;
    let frame = CUBE_POS;
    let unit = UNIT_POS as usize;

    let mut numbers = SharedMemory::<f32>::new(units);
    let mut seconds = SharedMemory::<f32>::new(units);
    let mut places = SharedMemory::<u32>::new(units);
    let mut weights = SharedMemory::<f32>::new(comptime!(shape.capacity));
    let mut chosen = SharedMemory::<f32>::new(1usize);
    // The referee's numbers; without one, a single number each.
    let mut x = SharedMemory::<D>::new(comptime!(if refereed { shape.capacity } else { 1 }));
    let mut scores = SharedMemory::<D>::new(comptime!(if refereed { shape.units } else { 1 }));

    // The atoms of this unit.
    let mut p = Array::<f32>::new(per_unit);
    let mut norms = Array::<f32>::new(per_unit);
    let mut row = Array::<f32>::new(per_unit);
    #[unroll]
    for a in 0..per_unit {
        p[a] = projection[frame * width + a * units + unit];
        norms[a] = atoms[a * units + unit];
    }
    for i in 0..first as usize {
        let taken = support[frame * sparsity + i] as usize;
        #[unroll]
        for a in 0..per_unit {
            if a * units + unit == taken {
                norms[a] = 0.0;
            }
        }
    }

    let energy = state[frame * STATE + ENERGY];
    let enough = state[frame * STATE + ENOUGH];
    let mut remaining = state[frame * STATE + REMAINING];
    let mut first_best = state[frame * STATE + FIRST_BEST];
    let mut count = state[frame * STATE + COUNT];
    let mut stop = state[frame * STATE + STOP];
    let mut lead = state[frame * STATE + LEAD];
    let mut closest = state[frame * STATE + CLOSEST];
    let mut decided = state[frame * STATE + DECIDED];
    // Every unit must have read the state before its owner writes it again.
    sync_storage();

    for step in first as usize..last as usize {
        if stop == LOOKING {
            closest = min(closest, (remaining - enough).abs());
            if remaining <= enough {
                stop = EXPLAINED.runtime();
            }
        }

        // The largest score, the lowest atom with that score, and the largest score of the other
        // atoms.
        let mut best = 0.0f32;
        let mut second = 0.0f32;
        let mut place = unit as u32;
        #[unroll]
        for a in 0..per_unit {
            let score = p[a].abs() * norms[a];
            if score > best {
                second = best;
                best = score;
                place = (a * units + unit) as u32;
            } else if score > second {
                second = score;
            }
        }
        numbers[unit] = best;
        seconds[unit] = second;
        places[unit] = place;
        sync_cube();
        #[unroll]
        for level in 0..comptime!(units.trailing_zeros()) {
            let half = comptime!(units >> (level + 1));
            if unit < half {
                let (a, b) = (numbers[unit], numbers[unit + half]);
                let (at_a, at_b) = (places[unit], places[unit + half]);
                let (after_a, after_b) = (seconds[unit], seconds[unit + half]);
                if b > a || (b == a && at_b < at_a) {
                    numbers[unit] = b;
                    places[unit] = at_b;
                    seconds[unit] = max(a, after_b);
                } else {
                    seconds[unit] = max(b, after_a);
                }
            }
            sync_cube();
        }
        let best = numbers[0];
        let second = seconds[0];
        let mut atom = places[0] as usize;
        sync_cube();

        if step == 0 {
            first_best = best;
        }
        // With NaN the comparison is false, which ends the pursuit.
        let more = best > rounding * first_best;
        if stop == LOOKING {
            if more {
                let margin = believed * f32::sqrt(energy);
                if comptime!(refereed) && best - second < margin {
                    decided += 1.0;
                    atom = decide::<D>(
                        exact_gram,
                        exact_projection,
                        exact_norms,
                        rows,
                        support,
                        values,
                        &p,
                        &norms,
                        &mut weights,
                        &mut numbers,
                        &mut places,
                        &mut x,
                        &mut scores,
                        frame,
                        frame * sparsity,
                        step,
                        best - margin,
                        shape,
                    );
                } else {
                    lead = min(lead, best - second);
                }
            } else {
                stop = NO_ATOM_LEFT.runtime();
            }
        }

        // The rows' weights of the chosen atom, and what the rows leave of the atom.
        let taken = if stop == LOOKING { step } else { 0usize.runtime() };
        let mut sum = 0.0f32;
        let mut i = unit;
        while i < taken {
            let weight = rows[(frame * sparsity + i) * width + atom];
            weights[i] = weight;
            sum += weight * weight;
            i += units;
        }
        numbers[unit] = sum;
        #[unroll]
        for a in 0..per_unit {
            if a * units + unit == atom {
                chosen[0] = p[a];
            }
        }
        sync_cube();
        #[unroll]
        for level in 0..comptime!(units.trailing_zeros()) {
            let half = comptime!(units >> (level + 1));
            if unit < half {
                numbers[unit] = numbers[unit] + numbers[unit + half];
            }
            sync_cube();
        }
        let own = atoms[width + atom];
        let pivot = own - numbers[0];
        let projected = chosen[0];
        sync_cube();

        if stop == LOOKING {
            if pivot > dependent * own {
                let root = f32::sqrt(pivot);
                let scale = 1.0f32 / root;
                let along = projected * scale;
                #[unroll]
                for a in 0..per_unit {
                    row[a] = gram[atom * width + a * units + unit];
                }
                for i in 0..taken {
                    let weight = weights[i];
                    let before = (frame * sparsity + i) * width + unit;
                    #[unroll]
                    for a in 0..per_unit {
                        row[a] -= weight * rows[before + a * units];
                    }
                }
                let start = (frame * sparsity + step) * width + unit;
                #[unroll]
                for a in 0..per_unit {
                    let entry = row[a] * scale;
                    rows[start + a * units] = entry;
                    p[a] -= along * entry;
                    if a * units + unit == atom {
                        norms[a] = 0.0;
                    }
                }
                if unit == 0 {
                    support[frame * sparsity + step] = atom as u32;
                    values[(frame * sparsity + step) * 2] = along;
                    values[(frame * sparsity + step) * 2 + 1] = scale;
                }
                remaining -= along * along;
                count += 1.0;
            } else {
                stop = DEPENDENT.runtime();
            }
        }
        // The next choice reads this row, which other units have written.
        sync_storage();
    }

    #[unroll]
    for a in 0..per_unit {
        projection[frame * width + a * units + unit] = p[a];
    }
    if unit == 0 {
        state[frame * STATE + ENERGY] = energy;
        state[frame * STATE + REMAINING] = remaining;
        state[frame * STATE + FIRST_BEST] = first_best;
        state[frame * STATE + COUNT] = count;
        state[frame * STATE + STOP] = stop;
        state[frame * STATE + LEAD] = lead;
        state[frame * STATE + CLOSEST] = closest;
        state[frame * STATE + DECIDED] = decided;
    }
}

/// Coefficients of the support by back substitution; one workgroup for each frame.
#[cube(launch)]
pub(super) fn coefficients(
    rows: &Array<f32>,
    support: &Array<u32>,
    values: &Array<f32>,
    state: &Array<f32>,
    out: &mut Array<f32>,
    sparsity: u32,
    width: u32,
    #[comptime] shape: Shape,
) {
    let units = comptime!(shape.units);
    let sparsity = sparsity as usize;
    let width = width as usize;
    let frame = CUBE_POS;
    let unit = UNIT_POS as usize;
    let count = state[frame * STATE + COUNT] as usize;
    let mut x = SharedMemory::<f32>::new(comptime!(shape.capacity));
    let mut i = unit;
    while i < count {
        x[i] = values[(frame * sparsity + i) * 2];
        i += units;
    }
    sync_cube();
    for back in 0..sparsity {
        let last = sparsity - 1 - back;
        if last < count {
            let value = x[last] * values[(frame * sparsity + last) * 2 + 1];
            let atom = support[frame * sparsity + last] as usize;
            let mut i = unit;
            while i < last {
                x[i] -= rows[(frame * sparsity + i) * width + atom] * value;
                i += units;
            }
            if unit == 0 {
                out[frame * sparsity + last] = value;
            }
        }
        sync_cube();
    }
}

/// The Cholesky factor of each support, row after row of its lower triangle; one workgroup for each
/// atom of the support, with frames in the second dimension of the grid.
#[cube(launch)]
pub(super) fn factor(
    rows: &Array<f32>,
    support: &Array<u32>,
    values: &Array<f32>,
    state: &Array<f32>,
    out: &mut Array<f32>,
    sparsity: u32,
    width: u32,
    #[comptime] units: usize,
) {
    let sparsity = sparsity as usize;
    let width = width as usize;
    let (last, frame) = (CUBE_POS_X as usize, CUBE_POS_Y as usize);
    let count = state[frame * STATE + COUNT] as usize;
    let start = frame * (sparsity * (sparsity + 1) / 2) + last * (last + 1) / 2;
    let at = frame * sparsity;
    if last < count {
        let atom = support[at + last] as usize;
        let mut i = UNIT_POS as usize;
        while i < last {
            out[start + i] = rows[(at + i) * width + atom];
            i += units;
        }
        if UNIT_POS == 0 {
            out[start + last] = 1.0 / values[(at + last) * 2 + 1];
        }
    }
}

/// Images: each atom's picture (`atoms x pixels`) times its coefficient. Each unit computes one
/// pixel; frames are the second dimension of the grid.
#[cube(launch)]
pub(super) fn images(
    pictures: &Array<f32>,
    support: &Array<u32>,
    coefficients: &Array<f32>,
    state: &Array<f32>,
    out: &mut Array<f32>,
    sparsity: u32,
    pixels: u32,
) {
    let sparsity = sparsity as usize;
    let (pixel, frame) = (ABSOLUTE_POS_X as usize, CUBE_POS_Y as usize);
    let pixels = pixels as usize;
    if pixel < pixels {
        let count = state[frame * STATE + COUNT] as usize;
        let mut sum = 0.0f32;
        for i in 0..count {
            let atom = support[frame * sparsity + i] as usize;
            sum += coefficients[frame * sparsity + i] * pictures[atom * pixels + pixel];
        }
        out[frame * pixels + pixel] = sum;
    }
}

/// Coefficients at the places of their atoms, 0 elsewhere; one workgroup for each frame.
#[cube(launch)]
pub(super) fn scatter(
    support: &Array<u32>,
    coefficients: &Array<f32>,
    state: &Array<f32>,
    out: &mut Array<f32>,
    sparsity: u32,
    atoms: u32,
    #[comptime] units: usize,
) {
    let sparsity = sparsity as usize;
    let frame = CUBE_POS;
    let atoms = atoms as usize;
    let count = state[frame * STATE + COUNT] as usize;
    let mut i = UNIT_POS as usize;
    while i < atoms {
        out[frame * atoms + i] = 0.0;
        i += units;
    }
    sync_storage();
    let mut i = UNIT_POS as usize;
    while i < count {
        let atom = support[frame * sparsity + i] as usize;
        out[frame * atoms + atom] = coefficients[frame * sparsity + i];
        i += units;
    }
}
