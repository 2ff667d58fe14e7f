//! The loops that take the time, for the widest vectors that the running machine has.
//!
//! The one law: the width of a vector never shows in a result. Every atom is a lane with its own sum, products are
//! rounded before they are added (no fused multiply-add), and sums run over rows in one order; so SSE2, AVX2, AVX-512
//! and NEON give the same bits, and a recording reconstructs alike everywhere.
//!
//! Atoms are dealt out in panels of [`PANEL`]. A panel's accumulators stay in registers (16 of SSE2's, 8 of AVX2's, 4 of
//! AVX-512's for `f32`) while the rows before it stream by once, contiguously.

use super::scalar::Scalar;
use pulp::{Arch, Simd, WithSimd};

/// Atoms worked on together.
pub(crate) const PANEL: usize = 64;

/// Rows that are allocated together: memory grows with the atoms chosen, not with the most that might be.
const SLAB: usize = 32;

/// Orthogonalised columns of a Gram matrix, as rows: `[slab][panel][row of the slab][atom of the panel]`.
#[derive(Debug, Clone)]
pub(super) struct Rows<T> {
    slabs: Vec<Vec<T>>,
    panels: usize,
    len: usize,
}

impl<T: Scalar> Rows<T> {
    /// None yet, of `panels * PANEL` atoms.
    pub(super) fn new(panels: usize) -> Self {
        Self { slabs: Vec::new(), panels, len: 0 }
    }

    /// Forgets the rows, keeps their memory.
    pub(super) fn clear(&mut self) {
        self.len = 0;
    }

    /// Entries of every row for one atom, appended to `out`.
    pub(super) fn of_atom(&self, atom: usize, out: &mut Vec<T>) {
        let start = atom / PANEL * SLAB * PANEL + atom % PANEL;
        let entries =
            self.slabs.iter().flat_map(|slab| slab[start..].iter().step_by(PANEL).take(SLAB));
        out.extend(entries.take(self.len));
    }
}

/// What one chosen atom does to all atoms: see [`Step::run`].
pub(super) struct Step<'a, T> {
    /// Column of the Gram matrix of the atom chosen.
    pub column: &'a [T],
    /// What the rows before say of that atom.
    pub weights: &'a [T],
    /// One over the root of the pivot.
    pub scale: T,
    /// The atom's share in the measurement.
    pub step: T,
    /// One over each atom's norm; 0 for what must not be chosen.
    pub inverse_norms: &'a [T],
}

impl<T: Scalar> Step<'_, T> {
    /// Adds the row `(column - sum_i weights[i] * row[i]) * scale`, takes `step` times it from the projection `p`, and
    /// leaves each panel's largest `|p| * inverse_norm` in `best`.
    pub(super) fn run(self, arch: Arch, rows: &mut Rows<T>, p: &mut [T], best: &mut [T]) {
        if rows.len == rows.slabs.len() * SLAB {
            rows.slabs.push(vec![T::default(); rows.panels * SLAB * PANEL]);
        }
        arch.dispatch(EveryPanel { step: self, rows, p, best });
        rows.len += 1;
    }

    #[inline(always)]
    fn panel<const LANES: usize>(&self, rows: &mut Rows<T>, panel: usize, p: &mut [T]) -> T {
        let mut best = T::default();
        for start in (0..PANEL).step_by(LANES) {
            let atoms = panel * PANEL + start..panel * PANEL + start + LANES;
            let mut row: [T; LANES] = lanes(&self.column[atoms.clone()]);
            for (slab, weights) in rows.slabs.iter().zip(self.weights.chunks(SLAB)) {
                let before = slab[panel * SLAB * PANEL..].as_chunks::<PANEL>().0;
                for (before, weight) in before.iter().zip(weights) {
                    let before: &[T; LANES] = lanes_of(&before[start..start + LANES]);
                    for (row, before) in row.iter_mut().zip(before) {
                        *row -= *weight * *before;
                    }
                }
            }
            let at = (panel * SLAB + rows.len % SLAB) * PANEL + start;
            let out = &mut rows.slabs[rows.len / SLAB][at..at + LANES];
            let mut scores = [T::default(); LANES];
            let atoms_p = p[atoms.clone()].iter_mut().zip(&self.inverse_norms[atoms]);
            for (((out, row), (p, norm)), score) in
                out.iter_mut().zip(row).zip(atoms_p).zip(&mut scores)
            {
                *out = row * self.scale;
                *p -= self.step * *out;
                *score = p.magnitude() * *norm;
            }
            best = larger(best, largest(&mut scores));
        }
        best
    }
}

/// [`Step::run`] as `pulp` wants it: what is inlined into [`WithSimd::with_simd`] is compiled for each vector width.
struct EveryPanel<'a, T> {
    step: Step<'a, T>,
    rows: &'a mut Rows<T>,
    p: &'a mut [T],
    best: &'a mut [T],
}

impl<T: Scalar> WithSimd for EveryPanel<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { step, rows, p, best } = self;
        for (panel, best) in best.iter_mut().enumerate() {
            // f64 needs twice the registers: half a panel at a time.
            *best = if size_of::<T>() == 4 {
                step.panel::<PANEL>(rows, panel, p)
            } else {
                step.panel::<{ PANEL / 2 }>(rows, panel, p)
            };
        }
    }
}

/// Leaves each panel's largest `|p| * inverse_norm` in `best`.
pub(super) fn score<T: Scalar>(p: &[T], inverse_norms: &[T], best: &mut [T]) {
    let panels = p.as_chunks::<PANEL>().0.iter().zip(inverse_norms.as_chunks::<PANEL>().0);
    for ((p, norms), best) in panels.zip(best) {
        let mut scores = [T::default(); PANEL];
        for ((p, norm), score) in p.iter().zip(norms).zip(&mut scores) {
            *score = p.magnitude() * *norm;
        }
        *best = largest(&mut scores);
    }
}

/// The largest, by halving: lanes against lanes.
#[inline(always)]
fn largest<T: Scalar, const LANES: usize>(scores: &mut [T; LANES]) -> T {
    let mut width = LANES / 2;
    while width > 0 {
        let (low, high) = scores.split_at_mut(width);
        for (low, high) in low.iter_mut().zip(high) {
            *low = larger(*low, *high);
        }
        width /= 2;
    }
    scores[0]
}

#[inline(always)]
fn larger<T: Scalar>(a: T, b: T) -> T {
    if b > a { b } else { a }
}

#[inline(always)]
fn lanes<T: Scalar, const LANES: usize>(values: &[T]) -> [T; LANES] {
    *lanes_of(values)
}

#[inline(always)]
pub(super) fn lanes_of<T: Scalar, const LANES: usize>(values: &[T]) -> &[T; LANES] {
    let (chunk, _) = values.as_chunks::<LANES>();
    &chunk[0]
}
