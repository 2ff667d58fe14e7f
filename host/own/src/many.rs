//! The images of many measurements by the same patterns.
//!
//! # Invariant
//! What depends on the patterns alone is found out once for all measurements: products of the patterns, their
//! condensed form, dictionaries. The measurements do not depend on each other
//! (`tests::many::images_are_those_of_each_alone`). The patterns of one fold at a time are prepared, so that the memory
//! does not grow with the folds.

use super::doubt::MatrixDoubt;
use super::folds::{Folds, Products};
use super::problem::{Fit, Prepared};
use super::pseudo_inverse::PseudoInverse;
use super::{
    MatrixError, MatrixMethod, MatrixReconstruction, MatrixSettings, OwnMatrix, Penalty,
    SPARSITIES, STRENGTHS, TRIED, as_good_as_the_best, complete, folds, last_as_good,
};
use nalgebra::DVector;
use nirspi_recon::Image;
use nirspi_recon::omp::Stop;
use nirspi_recon::reconstruct::HeldBack;
use rayon::prelude::*;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Measurements by the same patterns, which were checked.
pub(super) struct Many<'m> {
    own: &'m OwnMatrix,
    settings: &'m MatrixSettings,
    all: &'m [&'m [f64]],
    kept: &'m Kept,
    /// Of each, the problem of which held-back measurements choose the strength.
    folds: Vec<OnceLock<Folds<'m>>>,
}

/// What depends on the patterns alone, for settings that differ in method, strength and number of atoms at most.
#[derive(Default)]
pub(super) struct Kept {
    products: OnceLock<Option<Products>>,
    /// The patterns of no fold, as a method needs them.
    whole: Mutex<Option<(MatrixMethod, Arc<Prepared>)>>,
}

/// An image, not yet in its final form.
struct Made {
    fit: Fit,
    strength: Option<f64>,
    atoms: Option<(usize, Stop)>,
}

/// Errors on held-back measurements of each trial.
type Errors = Vec<f64>;

/// An image by OMP, with its number of atoms and why the pursuit stopped.
type Pursued = (Fit, usize, Stop);

impl<'m> Many<'m> {
    pub(super) fn new(
        own: &'m OwnMatrix,
        settings: &'m MatrixSettings,
        all: &'m [&'m [f64]],
        kept: &'m Kept,
    ) -> Self {
        let folds = all.iter().map(|_| OnceLock::new()).collect();
        Self { own, settings, all, kept, folds }
    }

    /// The image of each.
    pub(super) fn images(&self) -> Result<Vec<MatrixReconstruction>, MatrixError> {
        let every: Vec<usize> = (0..self.all.len()).collect();
        let (method, others) = match self.settings.method {
            MatrixMethod::Best => {
                let (others, tikhonov) = self.better_by_total_variation(&every)?;
                let made = self.made(MatrixMethod::Penalty(Penalty::Tikhonov), &tikhonov)?;
                let mut found: Vec<Option<MatrixReconstruction>> = vec![None; self.all.len()];
                for (at, made) in tikhonov.into_iter().zip(made) {
                    found[at] = Some(made);
                }
                let method = MatrixMethod::Penalty(Penalty::TotalVariation);
                for (at, made) in others.iter().zip(self.made(method, &others)?) {
                    found[*at] = Some(made);
                }
                return Ok(found.into_iter().flatten().collect());
            }
            method => (method, every),
        };
        self.made(method, &others)
    }

    /// The measurements for which total variation predicts held-back ones better than Tikhonov's method
    /// does, and the others.
    fn better_by_total_variation(
        &self,
        every: &[usize],
    ) -> Result<(Vec<usize>, Vec<usize>), MatrixError> {
        let is_known = self.settings.strength.is_some() || self.settings.atoms.is_some();
        if is_known || self.own.patterns.len() > TRIED || complete::is_complete(self.own) {
            return Ok((Vec::new(), every.to_vec()));
        }
        let least = |penalty| -> Result<Vec<f64>, MatrixError> {
            let errors = self.errors_of_strengths(every, penalty)?;
            Ok(errors
                .iter()
                .map(|errors| errors.iter().copied().fold(f64::INFINITY, f64::min))
                .collect())
        };
        let (varied, tikhonov) = (least(Penalty::TotalVariation)?, least(Penalty::Tikhonov)?);
        Ok(every.iter().partition(|&&at| varied[at] < tikhonov[at]))
    }

    /// The images of these measurements by one method.
    fn made(
        &self,
        method: MatrixMethod,
        which: &[usize],
    ) -> Result<Vec<MatrixReconstruction>, MatrixError> {
        if which.is_empty() {
            return Ok(Vec::new());
        }
        let settings = MatrixSettings { method, ..self.settings.clone() };
        let solve = |&at: &usize| complete::solve(self.own, (at, self.all[at]), &settings);
        let first = solve(&which[0]);
        let made: Vec<Made> = match method {
            _ if first.is_some() => {
                let found: Vec<_> = which.par_iter().filter_map(solve).collect();
                let made = |(fit, strength)| Made { fit, strength: Some(strength), atoms: None };
                found.into_iter().map(made).collect()
            }
            MatrixMethod::PseudoInverse => {
                let inverse = PseudoInverse::new(self.own, settings.dark);
                let made = |at: &usize| Made {
                    fit: inverse.fit(self.all[*at]),
                    strength: None,
                    atoms: None,
                };
                which.par_iter().map(made).collect()
            }
            MatrixMethod::Omp => self.pursued(which)?,
            MatrixMethod::Best | MatrixMethod::Penalty(Penalty::Tikhonov)
                if let Some(products) = self.products() =>
            {
                let made = |at: &usize| {
                    let (own, y) = (self.own, self.all[*at]);
                    let known = self.settings.noise.filter(|sigma| *sigma > 0.0);
                    let likeliest = || products.likeliest(own, y, known?);
                    let (fit, strength) = match self.settings.strength.or_else(likeliest) {
                        None => self.folds(products, *at).chosen(),
                        strength => products.folds(own, y, strength).chosen(),
                    };
                    Made { fit, strength: Some(strength), atoms: None }
                };
                which.iter().map(made).collect()
            }
            MatrixMethod::Best => self.penalised(Penalty::Tikhonov, which)?,
            MatrixMethod::Penalty(penalty) => self.penalised(penalty, which)?,
        };
        Ok(which.iter().zip(made).map(|(&at, made)| self.finished(method, at, made)).collect())
    }

    fn finished(&self, method: MatrixMethod, at: usize, made: Made) -> MatrixReconstruction {
        let Made { fit: Fit { pixels, dark }, strength, atoms } = made;
        let y = DVector::from_column_slice(self.all[at]).add_scalar(-dark.value());
        let left = (&y - &self.own.patterns * &pixels).norm();
        let residual = if y.norm() > 0.0 { left / y.norm() } else { 0.0 };
        let image = Image::new(self.own.size, pixels.iter().map(|&v| v as f32).collect());
        let (held_back, doubt) = self.judged(at).unzip();
        let (doubt, outliers) = (doubt.flatten(), Vec::new());
        MatrixReconstruction {
            image,
            method,
            strength,
            atoms,
            dark,
            residual,
            rank: self.own.rank,
            outliers,
            held_back,
            doubt,
        }
    }

    fn products(&self) -> Option<&'m Products> {
        self.kept.products.get_or_init(|| Products::new(self.own, self.settings)).as_ref()
    }

    /// The problem of Tikhonov's method, of which there are the products, whose strength is to be chosen.
    fn folds(&self, products: &'m Products, at: usize) -> &Folds<'m> {
        self.folds[at].get_or_init(|| products.folds(self.own, self.all[at], None))
    }

    /// What held-back measurements say of these, where that is known anyway or soon found out.
    fn judged(&self, at: usize) -> Option<(HeldBack, Option<MatrixDoubt>)> {
        let is_soon = self.folds[at].get().is_some() || self.own.patterns.len() <= TRIED;
        if !self.settings.judge || !is_soon || complete::is_complete(self.own) {
            return None;
        }
        let products = self.products()?;
        let (found, spread) = self.folds(products, at).judgement()?;
        let is_even = self.settings.noise.is_some_and(|noise| spread < HeldBack::EVEN * noise);
        let doubt = (!is_even && found.is_by_chance())
            .then(|| MatrixDoubt::of(self.own, products, self.all[at]));
        Some((found, doubt.flatten()))
    }

    fn prepared(&self, method: MatrixMethod, at: Vec<usize>) -> Result<Prepared, MatrixError> {
        let settings = MatrixSettings { method, ..self.settings.clone() };
        Prepared::new(self.own, &settings, at)
    }

    fn whole(&self, method: MatrixMethod) -> Result<Arc<Prepared>, MatrixError> {
        let mut kept = self.kept.whole.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, whole)) = kept.as_ref().filter(|(of, _)| *of == method) {
            return Ok(Arc::clone(whole));
        }
        let whole = Arc::new(self.prepared(method, (0..self.own.patterns()).collect())?);
        *kept = Some((method, Arc::clone(&whole)));
        Ok(whole)
    }

    fn penalised(&self, penalty: Penalty, which: &[usize]) -> Result<Vec<Made>, MatrixError> {
        // The list of strengths is the same as in the comparison, because iterative methods keep a part
        // of their start.
        let strengths: Vec<Vec<f64>> = match self.settings.strength {
            Some(strength) => vec![vec![strength]; which.len()],
            None => {
                let errors = self.errors_of_strengths(which, penalty)?;
                errors.iter().map(|errors| STRENGTHS[..=last_as_good(errors)].to_vec()).collect()
            }
        };
        let prepared = self.whole(MatrixMethod::Penalty(penalty))?;
        let made = |(at, strengths): (&usize, &Vec<f64>)| {
            let problem = prepared.problem(self.all[*at]);
            let fit = problem.penalised(penalty, strengths).swap_remove(strengths.len() - 1);
            Made { fit, strength: strengths.last().copied(), atoms: None }
        };
        Ok(which.par_iter().zip(&strengths).map(made).collect())
    }

    fn pursued(&self, which: &[usize]) -> Result<Vec<Made>, MatrixError> {
        let noises: Vec<f64> = match self.settings.strength {
            Some(strength) => vec![strength; which.len()],
            // A few atoms leave a residual above the noise, so the strongest of the equally good
            // strengths is used.
            None => {
                let strongest = |errors: &Errors| {
                    STRENGTHS[errors.iter().position(as_good_as_the_best(errors)).unwrap_or(0)]
                };
                let errors = self.errors_of_strengths(which, Penalty::Tikhonov)?;
                errors.iter().map(strongest).collect()
            }
        };
        let mut sparsities: Vec<Option<usize>> = vec![self.settings.sparsity; which.len()];
        if self.settings.sparsity.is_none() {
            let tried: Vec<usize> =
                SPARSITIES.into_iter().filter(|&k| k <= self.own.patterns()).collect();
            let errors = self.errors(MatrixMethod::Omp, which, |prepared| {
                self.pursuits(prepared, which, &noises, |_| tried.clone())
            })?;
            for (sparsity, errors) in sparsities.iter_mut().zip(errors) {
                *sparsity = Some(tried[last_as_good(&errors)]);
            }
        }
        let prepared = self.whole(MatrixMethod::Omp)?;
        let wanted = |k: usize| sparsities[k].into_iter().collect();
        let found = self.pursuits(&prepared, which, &noises, wanted)?;
        let made = |(mut found, noise): (Vec<Pursued>, f64)| {
            let (fit, size, stop) = found.remove(0);
            Made { fit, strength: Some(noise), atoms: Some((size, stop)) }
        };
        Ok(found.into_iter().zip(noises).map(made).collect())
    }

    /// What OMP chooses for each of these measurements: a dictionary serves all with the same noise.
    fn pursuits(
        &self,
        prepared: &Prepared,
        which: &[usize],
        noises: &[f64],
        sparsities: impl Fn(usize) -> Vec<usize> + Sync,
    ) -> Result<Vec<Vec<Pursued>>, MatrixError> {
        let mut found: Vec<Vec<Pursued>> = Vec::new();
        found.resize_with(which.len(), Vec::new);
        let mut different = noises.to_vec();
        different.sort_by(f64::total_cmp);
        different.dedup();
        for noise in different {
            let pursuit = prepared.pursuit(noise);
            let places = found.par_iter_mut().enumerate().filter(|(k, _)| noises[*k] == noise);
            places.try_for_each(|(k, place)| {
                let problem = prepared.problem(self.all[which[k]]);
                *place = problem.omp(&pursuit, &sparsities(k), self.settings.non_negative)?;
                Ok::<_, MatrixError>(())
            })?;
        }
        Ok(found)
    }

    fn errors_of_strengths(
        &self,
        which: &[usize],
        penalty: Penalty,
    ) -> Result<Vec<Errors>, MatrixError> {
        if penalty == Penalty::Tikhonov
            && let Some(products) = self.products()
        {
            return Ok(which.iter().map(|&at| self.folds(products, at).errors()).collect());
        }
        self.errors(MatrixMethod::Penalty(penalty), which, |prepared| {
            let images =
                |at: &usize| prepared.problem(self.all[*at]).penalised(penalty, &STRENGTHS);
            Ok(which.par_iter().map(images).collect())
        })
    }
}

/// An image on trial.
pub(super) trait Trial: Send + Sync {
    fn fit(&self) -> &Fit;
}

impl Trial for Fit {
    fn fit(&self) -> &Fit {
        self
    }
}

impl Trial for Pursued {
    fn fit(&self) -> &Fit {
        &self.0
    }
}

impl Many<'_> {
    /// Errors of each measurement's images, made from its other parts, on the held-back parts: sums of
    /// squares.
    pub(super) fn errors<T: Trial>(
        &self,
        method: MatrixMethod,
        which: &[usize],
        predict: impl Fn(&Prepared) -> Result<Vec<Vec<T>>, MatrixError>,
    ) -> Result<Vec<Errors>, MatrixError> {
        let mut errors: Vec<Errors> = vec![Vec::new(); which.len()];
        for (kept, held) in folds(self.own.patterns()) {
            let images = predict(&self.prepared(method, kept)?)?;
            let patterns = self.own.patterns.select_rows(&held);
            errors.par_iter_mut().zip(which).zip(images).for_each(|((errors, at), images)| {
                errors.resize(images.len(), 0.0);
                let y = DVector::from_iterator(held.len(), held.iter().map(|&k| self.all[*at][k]));
                for (error, image) in errors.iter_mut().zip(&images) {
                    let Fit { pixels, dark } = image.fit();
                    *error += (&y - &patterns * pixels).add_scalar(-dark.value()).norm_squared();
                }
            });
        }
        Ok(errors)
    }
}
