//! A dictionary for some Hadamard rows of an image that is sparse in a basis: its Gram matrix is
//! computed without storing a matrix.
//!
//! Everything is in orthonormal units. With `W = H / n` the measurements are `b = W x` (a recorded
//! difference divided by the side `n`). Atoms have unit norm, of which the measured rows see a
//! part.
//!
//! # Invariant
//! Projections and columns of the Gram matrix are those of the written-out matrix
//! (`tests::sampled::fast_transforms_stand_for_the_dictionary_and_its_prior`).
//!
//! # Columns
//! A column of the Gram matrix is computed by showing one atom, measuring it, and projecting the
//! measurements of the measured rows back onto all atoms. The cost depends on the basis:
//!
//! | basis | a column | because |
//! |---|---|---|
//! | pixel | a copy | the Gram matrix is dyadic, `G[i, j] = g[i xor j]`, and `g` is one Walsh transform of the mask |
//! | DCT | about `n^3 / 1.5` products | atoms are separable, and 1-D cosines have few Walsh coefficients |
//! | wavelets | two basis and two Walsh transforms | |
//!
//! # A prior
//! An atom that the rows barely see fits anything with a huge coefficient. The [`Prior`] has a
//! scale `s[j]` for each coefficient (its expected size) and the noise of a measurement. With them,
//! least squares becomes the maximum a posteriori estimate under independent normal coefficients:
//! minimise `|b - A c|^2 + noise^2 sum_j (c[j] / s[j])^2`. In `z = c / s` this is plain least
//! squares over the dictionary `[A diag(s); noise I]` and the measurement `[b; 0]`, so Algorithm 1
//! needs no change: its Gram matrix is `diag(s) A^T A diag(s) + noise^2 I`, and an atom whose
//! visible part is below the noise no longer has a large score.

use super::dictionary::{Atoms, Dictionary, padded};
use nirspi_patterns::basis::{Basis, Transform};
use nirspi_patterns::fwht;
use pulp::Arch;

pub use visible::visible_energy;
pub use walsh::WalshCosines;

mod visible;
mod walsh;

/// Expected size of the coefficients and noise of the measurements, in orthonormal units.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    /// Expected size of each coefficient, one for each atom.
    pub scale: Vec<f32>,
    /// Standard deviation of a measurement's noise.
    pub noise: f32,
    /// Smallest share of an atom's energy that the rows must see for the atom to count as seen.
    pub visibility: f32,
}

impl Prior {
    /// No prior: Algorithm 1 as printed, for `atoms` atoms.
    #[must_use]
    pub fn none(atoms: usize) -> Self {
        Self { scale: vec![1.0; atoms], noise: 0.0, visibility: 0.0 }
    }
}

/// The dictionary of a basis measured by some rows, with its prior.
#[derive(Debug, Clone)]
pub struct SampledHadamard<'a> {
    transform: &'a Transform,
    rows: Vec<u32>,
    /// 1 at measured rows, else 0.
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
    /// The atoms of `transform`'s basis, measured by `rows`.
    ///
    /// # Panics
    /// If a row is not one of `0..side^2` (those of `nirspi_patterns::Rows` always are), or
    /// `prior` does not have one scale for each atom.
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

    /// The measurement of every row, measured or not, that these coefficients predict, in
    /// orthonormal units. `z` are coefficients over the prior's scale, as the pursuit returns them.
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
