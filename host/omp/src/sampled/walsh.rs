//! Cosines in the Walsh domain.
//!
//! The Walsh transform of each 1-D cosine of `n` samples is stored once, computed in `f64`, without
//! its zeros. Atom `(u, v)` is the outer product of two of them, and projecting a grid of
//! measurements onto all atoms is two products with the same sparse matrix.
//!
//! Cosine `u` shares Walsh functions only with cosines that have the same lowest set bit. A third
//! of the `n^2` numbers is not zero (S. Venkataraman et al., *Discrete transforms via the
//! Walsh-Hadamard transform*, 1988, describes the blocks).

use crate::kernel::first_of;
use nirspi_patterns::Side;
use nirspi_patterns::basis::cosine;
use nirspi_patterns::fwht;
use pulp::{Arch, Simd, WithSimd};

/// Entries below this are rounding of zeros.
const ZERO: f64 = 1e-12;

/// The cosines of the DCT in the Walsh functions of the same length: how much of each pattern each cosine sees.
#[derive(Debug, Clone)]
pub struct WalshCosines {
    side: usize,
    /// Cosine `u` in Walsh function `a`, at `u * n + a`.
    dense: Vec<f32>,
    /// The numbers of `dense` without zeros: Walsh functions and values of cosine `u` are at
    /// `starts[u]..starts[u + 1]`.
    starts: Vec<usize>,
    walsh: Vec<usize>,
    values: Vec<f32>,
}

impl WalshCosines {
    /// The cosines of images of this side.
    #[must_use]
    pub fn new(side: Side) -> Self {
        let n = side.pixels();
        let (mut dense, mut starts) = (Vec::with_capacity(n * n), vec![0]);
        let (mut walsh, mut values) = (Vec::new(), Vec::new());
        for u in 0..n {
            let mut column: Vec<f64> = (0..n).map(|pixel| cosine(n, u, pixel)).collect();
            fwht::transform(&mut column);
            for (a, value) in column.iter().enumerate() {
                let value = value / (n as f64).sqrt();
                let kept = if value.abs() > ZERO { value as f32 } else { 0.0 };
                dense.push(kept);
                if kept != 0.0 {
                    walsh.push(a);
                    values.push(kept);
                }
            }
            starts.push(values.len());
        }
        Self { side: n, dense, starts, walsh, values }
    }

    /// Cosine `u` in every Walsh function: `n` numbers.
    pub fn cosine(&self, u: usize) -> &[f32] {
        &self.dense[u * self.side..(u + 1) * self.side]
    }

    /// Writes the measurements of atom `atom` by the rows of `mask`, transposed.
    pub(super) fn show(&self, atom: usize, mask: &[f32], out: &mut [f32]) {
        let n = self.side;
        let (down, across) = (self.cosine(atom / n), self.cosine(atom % n));
        let rows = out.chunks_exact_mut(n).zip(mask.chunks_exact(n));
        for ((out, mask), down) in rows.zip(down) {
            for ((out, mask), across) in out.iter_mut().zip(mask).zip(across) {
                *out = mask * (down * across);
            }
        }
    }

    /// Replaces measurements by their inner products with all atoms.
    pub(super) fn see_back(&self, arch: Arch, grid: &mut [f32]) {
        let mut half = vec![0.0; grid.len()];
        for _ in 0..2 {
            arch.dispatch(Gather { cosines: self, grid, out: &mut half });
            transpose(self.side, &half, grid);
        }
    }
}

/// Row `u` of `out` is the product of cosine `u` with each column of `grid`, compiled for each
/// vector width.
struct Gather<'a> {
    cosines: &'a WalshCosines,
    grid: &'a [f32],
    out: &'a mut [f32],
}

impl WithSimd for Gather<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        match self.cosines.side {
            2 => self.of_columns::<2>(),
            4 => self.of_columns::<4>(),
            8 => self.of_columns::<8>(),
            16 => self.of_columns::<16>(),
            _ => self.of_columns::<32>(),
        }
    }
}

impl Gather<'_> {
    /// `LANES` columns at a time, whose sums stay in registers.
    #[inline(always)]
    fn of_columns<const LANES: usize>(self) {
        let WalshCosines { side: n, starts, walsh, values, .. } = self.cosines;
        for (out, bounds) in self.out.chunks_exact_mut(*n).zip(starts.windows(2)) {
            let (walsh, values) = (&walsh[bounds[0]..bounds[1]], &values[bounds[0]..bounds[1]]);
            for (block, out) in out.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
                let mut sums = [0.0; LANES];
                for (a, value) in walsh.iter().zip(values) {
                    let grid: &[f32; LANES] = first_of(&self.grid[a * n + block * LANES..]);
                    for (sum, grid) in sums.iter_mut().zip(grid) {
                        *sum += value * grid;
                    }
                }
                *out = sums;
            }
        }
    }
}

fn transpose(n: usize, from: &[f32], to: &mut [f32]) {
    for (c, to) in to.chunks_exact_mut(n).enumerate() {
        for (r, to) in to.iter_mut().enumerate() {
            *to = from[r * n + c];
        }
    }
}
