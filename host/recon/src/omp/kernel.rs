//! The loops that take the time, for the widest vectors that the running machine has.
//!
//! The one law: the width of a vector never shows in a result. Every atom is a lane with its own sum, products are
//! rounded before they are added (no fused multiply-add), and sums run over rows in one order; so SSE2, AVX2, AVX-512
//! and NEON give the same bits, and a recording reconstructs alike everywhere.
//!
//! Atoms are dealt out in panels of [`PANEL`], whose sums stay in registers while the rows before them stream by once,
//! contiguously. What limits the loop is the second-level cache, so a row that is read serves two columns: the one
//! chosen, and the one that is most likely next.

use super::scalar::Scalar;
use pulp::{Arch, Simd, WithSimd};

/// Atoms worked on together.
pub(crate) const PANEL: usize = 64;

/// Orthogonalised columns of a Gram matrix, as rows: for each panel of atoms, row after row.
#[derive(Debug, Clone)]
pub(super) struct Rows<T> {
    panels: Vec<Vec<[T; PANEL]>>,
}

impl<T: Scalar> Rows<T> {
    /// None yet, of `panels * PANEL` atoms, with room for some.
    pub(super) fn new(panels: usize, room: usize) -> Self {
        Self { panels: (0..panels).map(|_| Vec::with_capacity(room)).collect() }
    }

    /// Forgets all but the first rows, keeps their memory.
    pub(super) fn truncate(&mut self, rows: usize) {
        self.panels.iter_mut().for_each(|panel| panel.truncate(rows));
    }

    /// Takes `step` times row `at` from the projection `p`.
    pub(super) fn take_from(&self, at: usize, step: T, p: &mut [T]) {
        for (rows, p) in self.panels.iter().zip(p.as_chunks_mut::<PANEL>().0) {
            for (p, entry) in p.iter_mut().zip(&rows[at]) {
                *p -= step * *entry;
            }
        }
    }

    /// Entries of the rows from `first` on for one atom, appended to `out`.
    pub(super) fn of_atom(&self, atom: usize, first: usize, out: &mut Vec<T>) {
        out.extend(self.panels[atom / PANEL][first..].iter().map(|row| row[atom % PANEL]));
    }
}

/// What one chosen atom does to all atoms.
pub(super) struct Step<'a, T> {
    /// Its column of the Gram matrix, with the rows before `first` taken out.
    pub column: &'a [T],
    /// Rows that are taken out already.
    pub first: usize,
    /// What the rows from `first` on say of the atom.
    pub weights: &'a [T],
    /// Another column, to take all rows out of in passing.
    pub next: Option<Next<'a, T>>,
    /// One over the root of the pivot.
    pub scale: T,
    /// The atom's share in the measurement.
    pub step: T,
    /// One over each atom's norm; 0 for what must not be chosen.
    pub inverse_norms: &'a [T],
}

/// A column that is not a row yet.
pub(super) struct Next<'a, T> {
    /// A column of the Gram matrix.
    pub column: &'a [T],
    /// What the rows say of its atom.
    pub weights: &'a [T],
    /// Gets the column without the rows.
    pub out: &'a mut [T],
}

impl<T: Scalar> Rows<T> {
    /// Adds the row `(column - sum_i weights[i] * row[i]) * scale`, takes `step` times it from the projection `p`, and
    /// leaves each panel's [`Best`].
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

/// [`Rows::push`] as `pulp` wants it: what is inlined into [`WithSimd::with_simd`] is compiled for each vector width.
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
            // No vectors known: four at a time is what baseline x86-64 has, and no loss elsewhere.
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
                // All rows for the next column: the chosen one has had none either.
                take_out::<T, S, 2, 4>(simd, rows, columns, [step.weights, next.weights], out);
            } else {
                let (rows, row) = (&rows[step.first..], [&mut row[..]]);
                // Eight sums hide the latency of an addition, where a panel has so many.
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

/// Lanes in which the largest scores are kept: to the end of a panel, one is not compared with its neighbour.
const SCORES: usize = 16;

/// The largest `|p| * inverse_norm` of a panel's atoms, of every sixteenth atom apart.
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

/// Leaves each panel's [`Best`].
pub(super) fn score<T: Scalar>(p: &[T], inverse_norms: &[T], best: &mut [Best<T>]) {
    for (panel, best) in best.iter_mut().enumerate() {
        *best = best_of(panel, p, inverse_norms);
    }
}

/// The largest of all but one panel, and the first panel that has it.
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
