//! Variances of Hadamard rows, from variances of cosines.

use crate::Side;
use crate::basis::product;
use crate::omp::sampled::WalshCosines;

/// Energies of cosines in Walsh functions, for one side.
#[derive(Debug, Clone)]
pub(super) struct Spectrum {
    n: usize,
    /// Energy of cosine `u` in Walsh function `a`, at `u * n + a`, and the transposed matrix.
    energy: Vec<f32>,
    transposed: Vec<f32>,
}

impl Spectrum {
    pub fn new(side: Side) -> Self {
        let n = side.pixels();
        let cosines = WalshCosines::new(side);
        let energy: Vec<f32> =
            (0..n).flat_map(|u| cosines.cosine(u).iter().map(|t| t * t)).collect();
        let transposed = (0..n * n).map(|p| energy[p % n * n + p / n]).collect();
        Self { n, energy, transposed }
    }

    /// Variance of each row, from independent cosines with these variances.
    pub fn rows(&self, cosines: &[f32]) -> Vec<f32> {
        let (mut half, mut rows) = (vec![0.0; cosines.len()], vec![0.0; cosines.len()]);
        product(self.n, self.n, &self.transposed, cosines, &mut half);
        product(self.n, self.n, &half, &self.energy, &mut rows);
        rows
    }

    /// Side of the images.
    pub fn side(&self) -> usize {
        self.n
    }
}
