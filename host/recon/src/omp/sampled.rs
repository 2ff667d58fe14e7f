//! Some Hadamard rows of an image that is sparse in a basis: the Gram matrix without a matrix.
//!
//! The one law: everything is in orthonormal units. With `W = H / n` the measurements are `b = W x` (a recorded
//! difference over the side `n`) and atoms have unit norm, of which the rows that were measured see a part.
//!
//! A column of the Gram matrix is one atom shown, measured and seen back through the rows that were measured. What that
//! takes depends on the basis:
//!
//! | basis | a column | because |
//! |---|---|---|
//! | pixel | a copy | the Gram matrix is dyadic, `G[i, j] = g[i xor j]`, and `g` is one Walsh transform of the mask |
//! | DCT | about `n^3 / 1.5` products | atoms are separable, and 1-D cosines have few Walsh coefficients |
//! | wavelets | two basis and two Walsh transforms | |
//!
//! # A prior
//! Atoms that the rows barely see fit anything with a huge coefficient. The [`Prior`]'s scale `s[j]` of each
//! coefficient (its expected size) and the noise of a measurement turn least squares into the maximum a posteriori
//! estimate under independent normal coefficients: minimise `|b - A c|^2 + noise^2 sum_j (c[j] / s[j])^2`. In
//! `z = c / s` that is plain least squares over the dictionary `[A diag(s); noise I]` and the measurement `[b; 0]`, so
//! Algorithm 1 needs no change: its Gram matrix is `diag(s) A^T A diag(s) + noise^2 I`, and an atom whose visible
//! part is under the noise no longer looks attractive.

use super::dictionary::{Atoms, Dictionary, padded};
use crate::basis::{Basis, Transform};
use crate::fwht;
use pulp::Arch;
use walsh::WalshCosines;

pub(crate) use visible::visible_energy;

mod visible;
mod walsh;

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
    rows: Vec<u32>,
    /// 1 at rows that were measured, else 0.
    mask: Vec<f32>,
    prior: &'a Prior,
    atoms: Atoms<f32>,
    structure: Structure,
    arch: Arch,
}

/// How columns of the Gram matrix are found.
#[derive(Debug, Clone)]
enum Structure {
    /// `g` of `G[i, j] = g[i xor j]`.
    Dyadic(Vec<f32>),
    Cosines(WalshCosines),
    Transforms,
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
        let mut mask = vec![0.0; area];
        for &row in rows {
            mask[row as usize] = 1.0;
        }
        let mut energies = visible_energy(transform, &mask);
        for (energy, s) in energies.iter_mut().zip(&prior.scale) {
            let seen = *energy >= prior.visibility;
            *energy = if seen { s * s * *energy + prior.noise.powi(2) } else { 0.0 };
        }
        let structure = match transform.basis() {
            Basis::Pixel => {
                let mut g = mask.clone();
                fwht::transform(&mut g);
                g.iter_mut().for_each(|g| *g /= area as f32);
                Structure::Dyadic(g)
            }
            Basis::Dct => Structure::Cosines(WalshCosines::new(transform.side())),
            Basis::Haar | Basis::Daubechies4 => Structure::Transforms,
        };
        let (rows, atoms) = (rows.to_vec(), Atoms::new(energies));
        Self { transform, rows, mask, prior, atoms, structure, arch: Arch::new() }
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

    /// `Psi^T W` of a grid of measurements.
    fn see_back(&self, grid: &mut [f32]) {
        if let Structure::Cosines(cosines) = &self.structure {
            return cosines.see_back(self.arch, grid);
        }
        fwht::transform(grid);
        self.transform.analyse(grid);
        let n = self.transform.side().pixels() as f32;
        grid.iter_mut().for_each(|v| *v /= n);
    }
}

impl Dictionary<f32> for SampledHadamard<'_> {
    fn measurements(&self) -> usize {
        self.rows.len()
    }

    fn atoms(&self) -> &Atoms<f32> {
        &self.atoms
    }

    fn project(&self, y: &[f32], p0: &mut [f32]) {
        p0.fill(0.0);
        for (&row, y) in self.rows.iter().zip(y) {
            p0[row as usize] = *y;
        }
        let p0 = &mut p0[..self.mask.len()];
        self.see_back(p0);
        for (p, s) in p0.iter_mut().zip(&self.prior.scale) {
            *p *= s;
        }
    }

    fn gram_column(&self, atom: usize, out: &mut [f32]) {
        let area = self.mask.len();
        debug_assert_eq!(out.len(), padded(area));
        let (out, rest) = out.split_at_mut(area);
        rest.fill(0.0);
        match &self.structure {
            Structure::Dyadic(g) => {
                for (j, out) in out.iter_mut().enumerate() {
                    *out = g[j ^ atom];
                }
            }
            Structure::Cosines(cosines) => {
                cosines.show(atom, &self.mask, out);
                cosines.see_back(self.arch, out);
            }
            Structure::Transforms => {
                out.fill(0.0);
                out[atom] = 1.0 / self.transform.side().pixels() as f32;
                self.transform.synthesise(out);
                fwht::transform(out);
                out.iter_mut().zip(&self.mask).for_each(|(v, mask)| *v *= mask);
                self.see_back(out);
            }
        }
        let own = self.prior.scale[atom];
        for (value, s) in out.iter_mut().zip(&self.prior.scale) {
            *value *= own * s;
        }
        out[atom] += self.prior.noise.powi(2);
    }
}
