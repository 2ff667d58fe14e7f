//! The image of least norm, and the dark level.

use super::problem::Fit;
use super::{DarkLevel, OwnMatrix, SAME_SUM, UNEXPLAINED, solvers};
use nalgebra::DVector;

/// The inverse of some patterns, with what a dark level looks like.
pub(super) struct PseudoInverse<'o> {
    own: &'o OwnMatrix,
    level: Level,
}

/// How the dark level is found.
enum Level {
    /// It is left out.
    LeftOut,
    /// An even image explains what all measurements have in common: the sum of weights of every pattern.
    Even(f64),
    /// The image that a dark level of 1 looks like, and what no image explains of the level.
    Ghost { ghost: DVector<f64>, unexplained: DVector<f64> },
}

impl<'o> PseudoInverse<'o> {
    pub(super) fn new(own: &'o OwnMatrix, fits_dark: bool) -> Self {
        let sums = own.patterns.column_sum();
        let weight = sums.mean();
        let is_same = |sum: &f64| (sum - weight).abs() <= SAME_SUM * weight.abs();
        let level = match fits_dark {
            false => Level::LeftOut,
            true if weight != 0.0 && sums.iter().all(is_same) => Level::Even(weight),
            true => {
                let ones = DVector::from_element(own.patterns(), 1.0);
                let ghost = invert(own, &ones);
                let unexplained = ones - &own.patterns * &ghost;
                Level::Ghost { ghost, unexplained }
            }
        };
        Self { own, level }
    }

    pub(super) fn fit(&self, y: &[f64]) -> Fit {
        let y = DVector::from_column_slice(y);
        match &self.level {
            Level::LeftOut => Fit { pixels: invert(self.own, &y), dark: DarkLevel::LeftOut },
            Level::Even(weight) => {
                let level = y.mean();
                let pixels = invert(self.own, &y.add_scalar(-level)).add_scalar(level / weight);
                Fit { pixels, dark: DarkLevel::Unknown }
            }
            Level::Ghost { ghost, unexplained } => {
                let pixels = invert(self.own, &y);
                let dark = if unexplained.norm_squared() > UNEXPLAINED * y.len() as f64 {
                    DarkLevel::Fitted(unexplained.dot(&y) / unexplained.norm_squared())
                } else {
                    match solvers::smoothest(self.own.size, &pixels, ghost) {
                        Some(level) => DarkLevel::Smoothest(level),
                        None => DarkLevel::Unknown,
                    }
                };
                Fit { pixels: pixels - ghost * dark.value(), dark }
            }
        }
    }
}

fn invert(own: &OwnMatrix, y: &DVector<f64>) -> DVector<f64> {
    match &own.orthogonal {
        Some(energies) => own.patterns.tr_mul(&y.component_div(energies)),
        None => solvers::least_squares(&own.patterns, y),
    }
}
