//! Products of a matrix with its like and with measurements, compiled for the machine's vectors.
//!
//! The one law: entry `(i, j)` is the sum over rows from the first to the last, in that order, whatever the tile that
//! computes it; a batch gives each frame the bits that it would get alone.

use super::dictionary::padded;
use super::kernel::{PANEL, lanes_of};
use super::scalar::Scalar;
use nalgebra::DMatrix;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

/// A `measurements x atoms` matrix as `[panel][measurement][atom of the panel]`: what a tile reads is contiguous, and
/// rows do not fall into the same sets of the cache.
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

    /// One atom.
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

    /// The Gram matrix, `padded(atoms)` rows of as many numbers.
    pub(super) fn gram(&self, arch: Arch) -> Vec<T> {
        let (width, count) = (padded(self.atoms), self.count());
        let mut gram = vec![T::default(); width * width];
        // It is symmetric: panels right of the diagonal, then their mirror image.
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

/// Measurements (or atoms) that share one pass over a panel.
const GROUP: usize = 8;

/// `packed^T * panel`, a `FRAMES x PANEL` block.
struct Product<'a, T, const FRAMES: usize> {
    packed: &'a [[T; FRAMES]],
    panel: &'a [[T; PANEL]],
}

impl<T: Scalar, const FRAMES: usize> WithSimd for Product<'_, T, FRAMES> {
    type Output = [[T; PANEL]; FRAMES];

    /// Tiles of two vectors' width, as high as the registers allow; of one frame, as wide.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        let mut out = [[T::default(); PANEL]; FRAMES];
        let many_registers = S::REGISTER_COUNT >= 32;
        match (FRAMES, S::F32_LANES * 4 / size_of::<T>()) {
            (1, 4..) if size_of::<T>() == 4 => self.tiles::<1, 64>(&mut out),
            (1, _) => self.tiles::<1, 32>(&mut out),
            (_, 16..) => self.tiles::<8, 32>(&mut out),
            (_, 8..) if many_registers => self.tiles::<8, 16>(&mut out),
            (_, 8..) => self.tiles::<4, 16>(&mut out),
            (_, 4..) if many_registers => self.tiles::<8, 8>(&mut out),
            (_, 4..) => self.tiles::<4, 8>(&mut out),
            _ => self.tiles::<4, 4>(&mut out),
        }
        out
    }
}

impl<T: Scalar, const FRAMES: usize> Product<'_, T, FRAMES> {
    #[inline(always)]
    fn tiles<const HIGH: usize, const WIDE: usize>(&self, out: &mut [[T; PANEL]; FRAMES]) {
        for top in (0..FRAMES).step_by(HIGH) {
            for left in (0..PANEL).step_by(WIDE) {
                let mut sums = [[T::default(); WIDE]; HIGH];
                for (y, atoms) in self.packed.iter().zip(self.panel) {
                    let atoms: &[T; WIDE] = lanes_of(&atoms[left..]);
                    let y: &[T; HIGH] = lanes_of(&y[top..]);
                    for (sums, y) in sums.iter_mut().zip(y) {
                        for (sum, atom) in sums.iter_mut().zip(atoms) {
                            *sum += *y * *atom;
                        }
                    }
                }
                for (out, sums) in out[top..].iter_mut().zip(sums) {
                    out[left..left + WIDE].copy_from_slice(&sums);
                }
            }
        }
    }
}
