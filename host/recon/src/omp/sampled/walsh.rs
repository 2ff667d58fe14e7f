//! Cosines in the Walsh domain.
//!
//! The one law: the Walsh transform of a 1-D cosine of `n` samples is kept once, in `f64` accuracy, without its zeros.
//! Atom `(u, v)` is then the outer product of two of them, and seeing a grid of measurements back through all atoms is
//! two products with the same sparse matrix.
//!
//! Cosine `u` shares Walsh functions only with cosines whose lowest set bit is the same: of `n^2` numbers a third are not zero
//! (S. Venkataraman et al., *Discrete transforms via the Walsh-Hadamard transform*, 1988, has the blocks).

use crate::Side;
use crate::basis::cosine;
use crate::fwht;

/// Entries under this are the rounding of zeros.
const ZERO: f64 = 1e-12;

#[derive(Debug, Clone)]
pub(crate) struct WalshCosines {
    side: usize,
    /// Cosine `u` in Walsh function `a`, at `u * n + a`.
    dense: Vec<f32>,
    /// The same without zeros: the Walsh functions and values of cosine `u` are at `starts[u]..starts[u + 1]`.
    starts: Vec<usize>,
    walsh: Vec<usize>,
    values: Vec<f32>,
}

impl WalshCosines {
    pub(crate) fn new(side: Side) -> Self {
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

    /// Cosine `u` in every Walsh function.
    pub(crate) fn cosine(&self, u: usize) -> &[f32] {
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
    pub(super) fn see_back(&self, grid: &mut [f32]) {
        let n = self.side;
        let mut half = vec![0.0; grid.len()];
        self.gather(grid, &mut half);
        for (r, row) in half.chunks_exact(n).enumerate() {
            for (c, value) in row.iter().enumerate() {
                grid[c * n + r] = *value;
            }
        }
        half.fill(0.0);
        self.gather(grid, &mut half);
        for (r, row) in half.chunks_exact(n).enumerate() {
            for (c, value) in row.iter().enumerate() {
                grid[c * n + r] = *value;
            }
        }
    }

    /// Adds to row `u` of `out` what cosine `u` sees in each column of `grid`.
    fn gather(&self, grid: &[f32], out: &mut [f32]) {
        let n = self.side;
        for (out, bounds) in out.chunks_exact_mut(n).zip(self.starts.windows(2)) {
            let entries = bounds[0]..bounds[1];
            for (&a, value) in self.walsh[entries.clone()].iter().zip(&self.values[entries]) {
                for (out, grid) in out.iter_mut().zip(&grid[a * n..(a + 1) * n]) {
                    *out += value * grid;
                }
            }
        }
    }
}
