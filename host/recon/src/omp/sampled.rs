//! Some Hadamard rows of an image that is sparse in a basis: the Gram matrix without a matrix.
//!
//! The one law: everything is in orthonormal units. With `W = H / n` the measurements are `b = W x` (a recorded
//! difference over the side `n`) and atoms have unit norm, of which the rows that were measured see a part.
//!
//! A column of the Gram matrix is one atom shown, measured and seen back through the rows that were measured:
//! two basis transforms and two Walsh-Hadamard transforms, `O(n^3)` instead of `n^4` numbers in memory.
//!
//! # A prior
//! Atoms that the rows barely see fit anything with a huge coefficient. The [`Prior`]'s scale `s[j]` of each
//! coefficient (its expected size) and the noise of a measurement turn least squares into the maximum a posteriori
//! estimate under independent normal coefficients: minimise `|b - A c|^2 + noise^2 sum_j (c[j] / s[j])^2`. In
//! `z = c / s` that is plain least squares over the dictionary `[A diag(s); noise I]` and the measurement `[b; 0]`, so
//! Algorithm 1 needs no change: its Gram matrix is `diag(s) A^T A diag(s) + noise^2 I`, and an atom whose visible
//! part is under the noise no longer looks attractive.

use super::fast::Gram;
use crate::basis::{Basis, Transform, product};
use crate::fwht;

/// What is expected of the coefficients and of the measurements, in orthonormal units.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    /// Expected size of each coefficient, one an atom.
    pub scale: Vec<f32>,
    /// Standard deviation of a measurement's noise.
    pub noise: f32,
    /// Share of its energy under which an atom counts as not seen.
    pub visibility: f32,
}

impl Prior {
    /// Nothing expected: Algorithm 1 as it is, for `atoms` atoms.
    #[must_use]
    pub fn none(atoms: usize) -> Self {
        Self { scale: vec![1.0; atoms], noise: 0.0, visibility: 0.0 }
    }
}

/// The dictionary of a basis seen through some rows, with its prior.
#[derive(Debug, Clone)]
pub struct SampledHadamard<'a> {
    transform: &'a Transform,
    measured: Vec<bool>,
    prior: &'a Prior,
    diagonal: Vec<f32>,
}

impl<'a> SampledHadamard<'a> {
    /// Atoms of `transform`'s basis, seen through `rows`.
    ///
    /// # Panics
    /// If a row is not one of `0..side^2` (they are those of a [`crate::Measurements`]), or `prior` does not have
    /// one scale an atom.
    #[must_use]
    pub fn new(transform: &'a Transform, rows: &[u32], prior: &'a Prior) -> Self {
        let area = transform.side().area();
        assert_eq!(prior.scale.len(), area, "one scale an atom");
        let mut measured = vec![false; area];
        for &row in rows {
            measured[row as usize] = true;
        }
        let mut diagonal = visible_energy(transform, &measured);
        for (d, s) in diagonal.iter_mut().zip(&prior.scale) {
            *d = if *d < prior.visibility { 0.0 } else { s * s * *d + prior.noise.powi(2) };
        }
        Self { transform, measured, prior, diagonal }
    }

    /// The initial projection of measurements placed at their rows of a zero-filled `n^2` grid, in orthonormal units.
    #[must_use]
    pub fn project(&self, mut grid: Vec<f32>) -> Vec<f32> {
        self.mask(&mut grid, 1.0);
        self.see_back(&mut grid);
        for (p, s) in grid.iter_mut().zip(&self.prior.scale) {
            *p *= s;
        }
        grid
    }

    /// The measurement of every row, seen or not, that these coefficients predict, in orthonormal units. `z` are
    /// coefficients over the prior's scale, as the pursuit returns them.
    #[must_use]
    pub fn predict(&self, support: &[usize], z: &[f64]) -> Vec<f32> {
        let mut grid = vec![0.0; self.prior.scale.len()];
        for (&k, z) in support.iter().zip(z) {
            grid[k] = self.prior.scale[k] * *z as f32;
        }
        self.transform.synthesise(&mut grid);
        fwht::transform(&mut grid);
        let n = self.transform.side().pixels() as f32;
        grid.iter_mut().for_each(|v| *v /= n);
        grid
    }

    fn mask(&self, grid: &mut [f32], factor: f32) {
        for (value, &measured) in grid.iter_mut().zip(&self.measured) {
            *value *= if measured { factor } else { 0.0 };
        }
    }

    /// `Psi^T W` of a grid.
    fn see_back(&self, grid: &mut [f32]) {
        fwht::transform(grid);
        self.transform.analyse(grid);
        let n = self.transform.side().pixels() as f32;
        grid.iter_mut().for_each(|v| *v /= n);
    }
}

impl Gram for SampledHadamard<'_> {
    fn diagonal(&self) -> &[f32] {
        &self.diagonal
    }

    fn column(&self, atom: usize, out: &mut [f32]) {
        out.fill(0.0);
        out[atom] = self.prior.scale[atom];
        self.transform.synthesise(out);
        fwht::transform(out);
        self.mask(out, 1.0 / self.transform.side().pixels() as f32);
        self.see_back(out);
        for (value, s) in out.iter_mut().zip(&self.prior.scale) {
            *value *= s;
        }
        out[atom] += self.prior.noise.powi(2);
    }
}

/// Share of each atom's energy that the measured rows see.
pub(crate) fn visible_energy(transform: &Transform, measured: &[bool]) -> Vec<f32> {
    let n = transform.side().pixels();
    match transform.basis() {
        // Every pixel puts 1 / n^2 of its energy into every row.
        Basis::Pixel => {
            let seen = measured.iter().filter(|&&m| m).count();
            vec![seen as f32 / measured.len() as f32; measured.len()]
        }
        // Atoms are separable: with t the Walsh transform of the 1-D atoms, the energy of atom (u, v) in row (a, b)
        // is t[a, u]^2 t[b, v]^2, and the sum over measured rows is two matrix products.
        Basis::Dct => {
            let squared = squared_walsh_of_cosines(transform);
            let transposed: Vec<f32> = (0..n * n).map(|p| squared[(p % n) * n + p / n]).collect();
            let mask: Vec<f32> = measured.iter().map(|&m| f32::from(u8::from(m))).collect();
            let (mut half, mut energy) = (vec![0.0; n * n], vec![0.0; n * n]);
            product(n, &transposed, &mask, &mut half);
            product(n, &half, &squared, &mut energy);
            energy
        }
        // A wavelet moved by its own width changes signs of its Walsh transform, no magnitude (a shift by
        // exclusive or): one atom of each scale and direction stands for all.
        Basis::Haar => {
            let mut class_energy = std::collections::HashMap::new();
            (0..n * n)
                .map(|atom| {
                    *class_energy.entry(haar_class(n, atom)).or_insert_with(|| {
                        let mut x = vec![0.0; n * n];
                        x[atom] = 1.0;
                        transform.synthesise(&mut x);
                        fwht::transform(&mut x);
                        let seen = x.iter().zip(measured).filter(|(_, m)| **m);
                        seen.map(|(x, _)| x * x).sum::<f32>() / (n * n) as f32
                    })
                })
                .collect()
        }
    }
}

/// Energy of 1-D cosine `u` in Walsh function `a`, at `n * a + u`.
fn squared_walsh_of_cosines(transform: &Transform) -> Vec<f32> {
    let n = transform.side().pixels();
    let mut squared = vec![0.0; n * n];
    for u in 0..n {
        let mut column: Vec<f64> = (0..n).map(|pixel| crate::basis::cosine(n, u, pixel)).collect();
        fwht::transform(&mut column);
        for (a, value) in column.iter().enumerate() {
            squared[n * a + u] = (value * value / n as f64) as f32;
        }
    }
    squared
}

/// Scale of a Haar atom, and whether it varies down and across.
fn haar_class(n: usize, atom: usize) -> (u32, bool, bool) {
    let (u, v) = (atom / n, atom % n);
    let scale = u.max(v).checked_ilog2().map_or(0, |octave| octave + 1);
    let fine = |index: usize| scale > 0 && index >= 1 << (scale - 1);
    (scale, fine(u), fine(v))
}
