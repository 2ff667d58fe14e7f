//! Orthogonal matching pursuit, one atom after another.
//!
//! # Invariant
//! The residual never grows from one atom to the next (`tests::each_atom_leaves_less`).

use crate::lesson::{Lesson, Made, SIDE};
use crate::{Problem, in_one_line};
use nirspi_recon::basis::Transform;
use nirspi_recon::omp::sampled::{Prior, SampledHadamard};
use nirspi_recon::omp::{Backend, Limits, Path, solve_path};
use nirspi_recon::reconstruct::OmpSettings;
use nirspi_recon::{Basis, Image, Rows, fwht};

/// A pursuit of the readings of a share of the patterns: Algorithm 1 as the paper prints it.
#[derive(Debug, Clone)]
pub struct Pursuit {
    transform: Transform,
    rows: Rows,
    prior: Prior,
    path: Path<f32>,
}

impl Pursuit {
    /// Pursues the readings of `share` of the patterns up to `atoms` atoms.
    ///
    /// # Errors
    /// If the share is not more than 0 and at most 1.
    pub fn new(lesson: &Lesson, basis: Basis, share: f64, atoms: usize) -> Result<Self, Problem> {
        let measured = lesson.measured(lesson.count(share)?)?;
        let transform = Transform::new(basis, SIDE);
        let visibility = OmpSettings::LEAST_VISIBILITY as f32;
        let prior = Prior { visibility, ..Prior::none(SIDE.area()) };
        let n = SIDE.pixels() as f64;
        let values: Vec<f32> = measured.values().iter().map(|v| (v / n) as f32).collect();
        let dictionary = SampledHadamard::new(&transform, measured.rows(), &prior);
        let path = solve_path(&dictionary, &Limits::atoms(atoms), &values, Backend::Cpu);
        let path = path.map_err(in_one_line)?;
        Ok(Self { rows: measured.rows().clone(), transform, prior, path })
    }

    /// Atoms that were found.
    #[must_use]
    pub fn atoms(&self) -> usize {
        self.path.support.len()
    }

    /// The part of the readings that is not explained, before the first atom and after each: 1 is
    /// all of them.
    #[must_use]
    pub fn residuals(&self) -> &[f64] {
        &self.path.residual_norms
    }

    /// The picture of an atom of the support, times its coefficient among the first `count` atoms.
    ///
    /// # Errors
    /// If there are not as many atoms.
    pub fn atom(&self, at: usize, count: usize) -> Result<Vec<f32>, Problem> {
        let coefficients = self.path.coefficients(count);
        let found = self.path.support.get(at).zip(coefficients.get(at));
        let (&atom, &coefficient) = found
            .ok_or_else(|| format!("atom {at} of {count}, expected one of {}", self.atoms()))?;
        let mut picture = vec![0.0; SIDE.area()];
        picture[atom] = coefficient as f32;
        self.transform.synthesise(&mut picture);
        Ok(picture)
    }

    /// The image of the first `count` atoms.
    ///
    /// # Errors
    /// Does not occur: the image is finite.
    pub fn image(&self, lesson: &Lesson, count: usize) -> Result<Made, Problem> {
        let coefficients = self.path.coefficients(count);
        let dictionary = SampledHadamard::new(&self.transform, &self.rows, &self.prior);
        let mut grid = dictionary.predict(&self.path.support[..coefficients.len()], &coefficients);
        fwht(&mut grid).map_err(in_one_line)?;
        let n = SIDE.pixels() as f32;
        grid.iter_mut().for_each(|v| *v /= n);
        lesson.compared(Image::new(SIDE, grid))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lesson::named;

    #[test]
    fn each_atom_leaves_less() {
        let mut lesson = Lesson::new(named("word:OMP").unwrap()).unwrap();
        for order in ["random:1", "cake-cutting"] {
            lesson.show_in(order).unwrap();
            for basis in Basis::ALL {
                let pursuit = Pursuit::new(&lesson, basis, 0.4, 40).unwrap();
                let residuals = pursuit.residuals();
                assert_eq!(residuals.len(), pursuit.atoms() + 1);
                assert!(residuals.windows(2).all(|two| two[1] <= two[0]), "{residuals:?}");
                assert!(residuals[0] == 1.0 && *residuals.last().unwrap() < 0.7, "{residuals:?}");
                // The image is the sum of the atoms.
                let image = pursuit.image(&lesson, 12).unwrap().image;
                let mut sum = vec![0.0; SIDE.area()];
                for at in 0..12 {
                    let atom = pursuit.atom(at, 12).unwrap();
                    sum.iter_mut().zip(atom).for_each(|(sum, atom)| *sum += atom);
                }
                let far = sum.iter().zip(image.pixels()).map(|(a, b)| (a - b).abs());
                assert!(far.fold(0.0, f32::max) < 1e-4, "{order} {basis}");
            }
        }
        let pursuit = Pursuit::new(&lesson, Basis::Haar, 0.4, 3).unwrap();
        assert!(pursuit.atom(3, 4).unwrap_err().contains("expected one of 3"));
    }
}
