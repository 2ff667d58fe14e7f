//! Products of a matrix with itself and with measurements, compiled for the machine's vectors.
//!
//! # Invariant
//! Entry `(i, j)` is the sum over rows from the first to the last, in that order, whichever tile
//! computes it. So a batch gives each frame the same bits as a single solution
//! (`tests::batch::a_batch_is_a_loop`).

use super::dictionary::padded;
use super::kernel::{PANEL, first_of};
use super::scalar::Scalar;
use nalgebra::DMatrix;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

/// A `measurements x atoms` matrix as `[panel][measurement][atom of the panel]`. A tile reads
/// contiguous memory, and rows do not fall into the same sets of the cache.
#[derive(Debug, Clone)]
pub(super) struct Panels<T> {
    values: Vec<T>,
    measurements: usize,
    atoms: usize,
}

impl<T: Scalar> Panels<T> {
    pub(super) fn new(matrix: &DMatrix<T>) -> Self {
        let (measurements, atoms) = matrix.shape();
        let mut values = vec![T::default(); padded(atoms) * measurements];
        if measurements > 0 {
            let panels = values.chunks_exact_mut(measurements * PANEL).enumerate();
            for (panel, values) in panels {
                let columns = panel * PANEL..atoms.min((panel + 1) * PANEL);
                for (lane, atom) in columns.enumerate() {
                    let column = matrix.column(atom);
                    for (m, value) in column.iter().enumerate() {
                        values[m * PANEL + lane] = *value;
                    }
                }
            }
        }
        Self { values, measurements, atoms }
    }

    pub(super) fn measurements(&self) -> usize {
        self.measurements
    }

    /// The column of one atom.
    pub(super) fn column(&self, atom: usize) -> Vec<T> {
        let (panel, lane) = (atom / PANEL, atom % PANEL);
        self.panel(panel).iter().map(|row| row[lane]).collect()
    }

    fn panel(&self, panel: usize) -> &[[T; PANEL]] {
        let size = self.measurements * PANEL;
        self.values[panel * size..(panel + 1) * size].as_chunks().0
    }

    fn count(&self) -> usize {
        padded(self.atoms) / PANEL
    }

    /// Inner product of each measurement in `y` with each atom: `frames x padded(atoms)` numbers.
    pub(super) fn products(&self, arch: Arch, y: &[T], out: &mut [T]) {
        let width = padded(self.atoms);
        if self.measurements == 0 {
            return out.fill(T::default());
        }
        let frames: Vec<&[T]> = y.chunks_exact(self.measurements).collect();
        for (frames, out) in frames.chunks(GROUP).zip(out.chunks_mut(GROUP * width)) {
            match frames {
                [y] => self.project::<1>(arch, y.as_chunks().0, out),
                _ => {
                    let of = |f: usize, m: usize| frames.get(f).map_or(T::default(), |y| y[m]);
                    let packed: Vec<[T; GROUP]> =
                        (0..self.measurements).map(|m| std::array::from_fn(|f| of(f, m))).collect();
                    self.project(arch, &packed, out);
                }
            }
        }
    }

    fn project<const FRAMES: usize>(&self, arch: Arch, packed: &[[T; FRAMES]], out: &mut [T]) {
        for panel in 0..self.count() {
            let block = arch.dispatch(Product { packed, panel: self.panel(panel) });
            for (block, out) in block.iter().zip(out.chunks_exact_mut(padded(self.atoms))) {
                out[panel * PANEL..(panel + 1) * PANEL].copy_from_slice(block);
            }
        }
    }

    /// The Gram matrix: `padded(atoms)` rows of `padded(atoms)` numbers.
    pub(super) fn gram(&self, arch: Arch) -> Vec<T> {
        let (width, count) = (padded(self.atoms), self.count());
        let mut gram = vec![T::default(); width * width];
        // The matrix is symmetric: the panels right of the diagonal are computed, then mirrored.
        gram.par_chunks_exact_mut(PANEL * width).enumerate().for_each(|(i, rows)| {
            let left = self.panel(i);
            for start in (0..PANEL).step_by(GROUP) {
                let packed: Vec<[T; GROUP]> =
                    left.iter().map(|row| std::array::from_fn(|f| row[start + f])).collect();
                for j in i..count {
                    let block = arch.dispatch(Product { packed: &packed, panel: self.panel(j) });
                    for (f, block) in block.iter().enumerate() {
                        let at = (start + f) * width + j * PANEL;
                        rows[at..at + PANEL].copy_from_slice(block);
                    }
                }
            }
        });
        for i in 0..count {
            let (above, below) = gram.split_at_mut((i + 1) * PANEL * width);
            let source = &above[i * PANEL * width..];
            below.par_chunks_exact_mut(width).enumerate().for_each(|(k, row)| {
                let column = (i + 1) * PANEL + k;
                for lane in 0..PANEL {
                    row[i * PANEL + lane] = source[lane * width + column];
                }
            });
        }
        gram
    }
}

/// Number of measurements (or atoms) that share one pass over a panel.
const GROUP: usize = 8;

/// `packed^T * panel`, a `FRAMES x PANEL` block.
struct Product<'a, T, const FRAMES: usize> {
    packed: &'a [[T; FRAMES]],
    panel: &'a [[T; PANEL]],
}

impl<T: Scalar, const FRAMES: usize> WithSimd for Product<'_, T, FRAMES> {
    type Output = [[T; PANEL]; FRAMES];

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let mut out = [[T::default(); PANEL]; FRAMES];
        if FRAMES == 1 {
            self.alone(&mut out[0]);
        } else if S::F32_LANES == 1 {
            // Without known vectors, four numbers at a time suit baseline x86-64 and cost nothing
            // elsewhere.
            self.tiles::<_, 4>(pulp::Scalar128b, &mut out);
        } else if S::REGISTER_COUNT >= 32 {
            self.tiles::<S, 8>(simd, &mut out);
        } else {
            self.tiles::<S, 4>(simd, &mut out);
        }
        out
    }
}

impl<T: Scalar, const FRAMES: usize> Product<'_, T, FRAMES> {
    /// One frame: the panel is read once, and its sums stay in registers.
    #[inline(always)]
    fn alone(&self, sums: &mut [T; PANEL]) {
        for (y, atoms) in self.packed.iter().zip(self.panel) {
            for (sum, atom) in sums.iter_mut().zip(atoms) {
                *sum += y[0] * *atom;
            }
        }
    }

    /// Tiles two vectors wide and `HIGH` frames high. A tile and its operands fill the registers.
    #[inline(always)]
    fn tiles<S: Simd, const HIGH: usize>(&self, simd: S, out: &mut [[T; PANEL]; FRAMES]) {
        let vectors = T::vectors::<S>(&self.panel[0]).len();
        for top in (0..FRAMES).step_by(HIGH) {
            for left in (0..vectors).step_by(2) {
                let mut sums = [[T::splat(simd, T::default()); 2]; HIGH];
                for (y, atoms) in self.packed.iter().zip(self.panel) {
                    let atoms = &T::vectors::<S>(atoms)[left..left + 2];
                    let y: &[T; HIGH] = first_of(&y[top..top + HIGH]);
                    for f in 0..HIGH {
                        let y = T::splat(simd, y[f]);
                        sums[f][0] = T::accumulate(simd, sums[f][0], y, atoms[0]);
                        sums[f][1] = T::accumulate(simd, sums[f][1], y, atoms[1]);
                    }
                }
                for (out, sums) in out[top..top + HIGH].iter_mut().zip(&sums) {
                    T::vectors_mut::<S>(out)[left..left + 2].copy_from_slice(sums);
                }
            }
        }
    }
}
