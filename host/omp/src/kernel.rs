//! The inner loops, compiled for the widest vectors that the running machine has.
//!
//! # Invariant
//! The width of a vector never changes a result
//! (`tests::batch::every_vector_width_gives_the_same_bits`). Every atom is a lane with its own
//! sum, products are rounded before they are added (no fused multiply-add), and sums run over rows
//! in one order. So SSE2, AVX2, AVX-512 and NEON give the same bits.
//!
//! Atoms are distributed to panels of [`PANEL`], whose sums stay in registers while the earlier
//! rows are read once, contiguously. The second-level cache limits the speed of the loop, so each
//! row that is read serves two columns: the chosen atom's, and that of the most likely next atom.

use super::scalar::Scalar;
use pulp::{Arch, Simd, WithSimd};

/// Number of atoms in a panel.
pub(crate) const PANEL: usize = 64;

/// Orthogonalised columns of a Gram matrix, stored as rows: for each panel of atoms, row after row.
#[derive(Debug, Clone)]
pub(super) struct Rows<T> {
    panels: Vec<Vec<[T; PANEL]>>,
}

impl<T: Scalar> Rows<T> {
    /// No rows yet, for `panels * PANEL` atoms, with memory for `room` rows.
    pub(super) fn new(panels: usize, room: usize) -> Self {
        Self { panels: (0..panels).map(|_| Vec::with_capacity(room)).collect() }
    }

    /// Drops all rows after the first `rows`, and keeps the memory.
    pub(super) fn truncate(&mut self, rows: usize) {
        self.panels.iter_mut().for_each(|panel| panel.truncate(rows));
    }

    /// Subtracts `step` times row `at` from the projection `p`.
    pub(super) fn take_from(&self, at: usize, step: T, p: &mut [T]) {
        for (rows, p) in self.panels.iter().zip(p.as_chunks_mut::<PANEL>().0) {
            for (p, entry) in p.iter_mut().zip(&rows[at]) {
                *p -= step * *entry;
            }
        }
    }

    /// Appends one atom's entries of the rows from `first` on to `out`.
    pub(super) fn of_atom(&self, atom: usize, first: usize, out: &mut Vec<T>) {
        out.extend(self.panels[atom / PANEL][first..].iter().map(|row| row[atom % PANEL]));
    }
}

/// The effect of one chosen atom on all atoms.
pub(super) struct Step<'a, T> {
    /// The atom's column of the Gram matrix, without its part along the rows before `first`.
    pub column: &'a [T],
    /// Number of rows that are already subtracted.
    pub first: usize,
    /// The atom's entries in the rows from `first` on.
    pub weights: &'a [T],
    /// Another column, from which the same pass subtracts all rows.
    pub next: Option<Next<'a, T>>,
    /// One over the root of the pivot.
    pub scale: T,
    /// The atom's part of the measurement.
    pub step: T,
    /// One over each atom's norm; 0 for atoms that must not be chosen.
    pub inverse_norms: &'a [T],
}

/// A column that is not a row yet.
pub(super) struct Next<'a, T> {
    /// A column of the Gram matrix.
    pub column: &'a [T],
    /// The rows' entries for the column's atom.
    pub weights: &'a [T],
    /// Receives the column without the rows.
    pub out: &'a mut [T],
}

impl<T: Scalar> Rows<T> {
    /// Adds the row `(column - sum_i weights[i] * row[i]) * scale`, subtracts `step` times this row
    /// from the projection `p`, and computes each panel's [`Best`].
    pub(super) fn push(
        &mut self,
        arch: Arch,
        step: Step<'_, T>,
        p: &mut [T],
        best: &mut [Best<T>],
    ) {
        arch.dispatch(Push { panels: &mut self.panels, step, p, best });
    }
}

/// [`Rows::push`] as a type, because `pulp` compiles a type's method for each vector width.
struct Push<'a, T> {
    panels: &'a mut [Vec<[T; PANEL]>],
    step: Step<'a, T>,
    p: &'a mut [T],
    best: &'a mut [Best<T>],
}

impl<T: Scalar> WithSimd for Push<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        if S::F32_LANES == 1 {
            // Without known vectors, four numbers at a time suit baseline x86-64 and cost nothing
            // elsewhere.
            self.run(pulp::Scalar128b);
        } else {
            self.run(simd);
        }
    }
}

impl<T: Scalar> Push<'_, T> {
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { panels, mut step, p, best } = self;
        for (panel, (rows, best)) in panels.iter_mut().zip(best).enumerate() {
            let atoms = panel * PANEL..(panel + 1) * PANEL;
            let mut row = [T::default(); PANEL];
            let column = &step.column[atoms.clone()];
            if let Some(next) = &mut step.next {
                let columns = [column, &next.column[atoms.clone()]];
                let out = [&mut row[..], &mut next.out[atoms.clone()]];
                // All rows are subtracted from the next column; none was subtracted from the chosen
                // one either.
                take_out::<T, S, 2, 4>(simd, rows, columns, [step.weights, next.weights], out);
            } else {
                let (rows, row) = (&rows[step.first..], [&mut row[..]]);
                // Eight sums hide the latency of an addition, if a panel has that many vectors.
                if 8 * size_of::<T::Vector<S>>() <= PANEL * size_of::<T>() {
                    take_out::<T, S, 1, 8>(simd, rows, [column], [step.weights], row);
                } else {
                    take_out::<T, S, 1, 4>(simd, rows, [column], [step.weights], row);
                }
            }
            let p_of: &mut [T; PANEL] = &mut p[atoms].as_chunks_mut().0[0];
            for lane in 0..PANEL {
                row[lane] = row[lane] * step.scale;
                p_of[lane] -= step.step * row[lane];
            }
            rows.push(row);
            *best = best_of(panel, p, step.inverse_norms);
        }
    }
}

/// `out[c] = columns[c] - sum_i weights[c][i] * rows[i]`.
#[inline(always)]
fn take_out<T: Scalar, S: Simd, const COLUMNS: usize, const VECTORS: usize>(
    simd: S,
    rows: &[[T; PANEL]],
    columns: [&[T]; COLUMNS],
    weights: [&[T]; COLUMNS],
    out: [&mut [T]; COLUMNS],
) {
    let columns = columns.map(T::vectors::<S>);
    let weights = weights.map(|weights| &weights[..rows.len()]);
    let out = out.map(T::vectors_mut::<S>);
    for start in (0..columns[0].len()).step_by(VECTORS) {
        let mut sums: [[T::Vector<S>; VECTORS]; COLUMNS] =
            std::array::from_fn(|c| *first_of(&columns[c][start..]));
        for (i, row) in rows.iter().enumerate() {
            let row: &[T::Vector<S>; VECTORS] = first_of(&T::vectors::<S>(row)[start..]);
            for c in 0..COLUMNS {
                let weight = T::splat(simd, T::default() - weights[c][i]);
                for v in 0..VECTORS {
                    sums[c][v] = T::accumulate(simd, sums[c][v], weight, row[v]);
                }
            }
        }
        for c in 0..COLUMNS {
            out[c][start..start + VECTORS].copy_from_slice(&sums[c]);
        }
    }
}

/// Number of lanes that keep the largest scores. Lanes are compared only at the end of a panel.
const SCORES: usize = 16;

/// The largest `|p| * inverse_norm` of a panel's atoms, for every sixteenth atom.
pub(super) type Best<T> = [T; SCORES];

#[inline(always)]
fn best_of<T: Scalar>(panel: usize, p: &[T], inverse_norms: &[T]) -> Best<T> {
    let atoms = panel * PANEL..(panel + 1) * PANEL;
    let mut best = [T::default(); SCORES];
    let p = p[atoms.clone()].as_chunks::<SCORES>().0;
    for (p, norms) in p.iter().zip(inverse_norms[atoms].as_chunks::<SCORES>().0) {
        for lane in 0..SCORES {
            best[lane] = larger(best[lane], p[lane].magnitude() * norms[lane]);
        }
    }
    best
}

/// Computes each panel's [`Best`].
pub(super) fn score<T: Scalar>(p: &[T], inverse_norms: &[T], best: &mut [Best<T>]) {
    for (panel, best) in best.iter_mut().enumerate() {
        *best = best_of(panel, p, inverse_norms);
    }
}

/// The largest of all panels except `but`, and the first panel that has it.
pub(super) fn largest<T: Scalar>(best: &[Best<T>], but: Option<usize>) -> (usize, T) {
    let others = || best.iter().enumerate().filter(|(panel, _)| Some(*panel) != but);
    let mut lanes = [T::default(); SCORES];
    for (_, best) in others() {
        for (lane, best) in lanes.iter_mut().zip(best) {
            *lane = larger(*lane, *best);
        }
    }
    let largest = lanes.into_iter().fold(T::default(), larger);
    let has_it = others().find(|(_, best)| best.contains(&largest));
    (has_it.map_or(0, |(panel, _)| panel), largest)
}

#[inline(always)]
fn larger<T: Scalar>(a: T, b: T) -> T {
    if b > a { b } else { a }
}

/// The first `COUNT` values.
#[inline(always)]
pub(super) fn first_of<V, const COUNT: usize>(values: &[V]) -> &[V; COUNT] {
    &values.as_chunks::<COUNT>().0[0]
}
