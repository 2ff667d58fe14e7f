//! Whether measurements belong to a user's own patterns.
//!
//! Measurements of a scene predict each other, as far as the patterns overlap. How far, a made-up scene says. Where that is
//! predicted well and the measurements no better than chance, they are noise, or belong to other patterns.

use super::OwnMatrix;
use super::folds::Products;
use nirspi_recon::reconstruct::Explanation;
use nirspi_recon::reconstruct::HeldBack;
use std::fmt;

/// Agreement in sign of a made-up scene's measurements with their predictions, in standard errors, from which the patterns
/// overlap enough to judge.
const ENOUGH: f64 = 8.0;

/// Why measurements do not predict each other.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum MatrixDoubt {
    /// They belong to patterns some places later or earlier.
    Explained(Explanation),
    /// They are noise, or belong to other patterns.
    Unexplained,
}

impl fmt::Display for MatrixDoubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Explained(explanation) => write!(f, "they fit {explanation}"),
            Self::Unexplained => f.write_str("they are noise, or belong to other patterns"),
        }
    }
}

impl MatrixDoubt {
    /// The doubt about measurements that predict each other by chance alone; `None` if those of a made-up scene would not do
    /// better.
    pub(super) fn of(own: &OwnMatrix, products: &Products, y: &[f64]) -> Option<Self> {
        let score = |products: &Products, y: &[f64]| {
            Some(products.folds(own, y, None).judgement()?.0.score)
        };
        if score(products, &products.of_a_scene(own))? < ENOUGH {
            return None;
        }
        let most = Explanation::MOST_READINGS.min(y.len() / 2);
        let shifts = (1..=most).flat_map(|by| {
            let (first, last) = (0..y.len() - by, by..y.len());
            let late = (by as i32, last.clone(), first.clone());
            [late, (-(by as i32), first, last)]
        });
        let tried = shifts.filter_map(|(by, patterns, readings)| {
            Some((by, score(&products.of_some(patterns), &y[readings])?))
        });
        let best = tried.max_by(|(_, a), (_, b)| a.total_cmp(b));
        let best = best.filter(|(_, score)| *score >= HeldBack::AMONG_MANY);
        Some(best.map_or(Self::Unexplained, |(by, _)| Self::Explained(Explanation::Shift(by))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{binary_patterns, normal, scene, side};
    use nirspi_recon::reconstruct::{MatrixMethod, MatrixSettings, Penalty};
    use rand::SeedableRng;
    use rand_pcg::Pcg64;

    fn judged(own: &OwnMatrix, y: &[f64], method: MatrixMethod) -> Option<MatrixDoubt> {
        let found = own.reconstruct(y, &MatrixSettings::new(method)).unwrap();
        println!("{method:?}: {:?}, {:?}", found.held_back, found.doubt);
        found.doubt
    }

    #[test]
    fn measurements_of_other_patterns_are_doubted_and_right_ones_are_not() {
        let later = |by: i32| Some(MatrixDoubt::Explained(Explanation::Shift(by)));
        for (count, kind) in [(120, 1), (200, 2), (256, 1)] {
            let (weights, y) = binary_patterns(count + 1, &scene(side(16), kind), 0.3, 3);
            let (early, late) = (&weights[..count * 256], &weights[256..]);
            let own = OwnMatrix::new(side(16), early).unwrap();
            for method in [
                MatrixMethod::Best,
                MatrixMethod::Penalty(Penalty::Tikhonov),
                MatrixMethod::PseudoInverse,
            ] {
                println!("{count} patterns, scene {kind}");
                assert_eq!(judged(&own, &y[..count], method), None);
                assert_eq!(judged(&own, &y[1..], method), later(1));
                let own = OwnMatrix::new(side(16), late).unwrap();
                assert_eq!(judged(&own, &y[..count], method), later(-1));
                let (_, others) = binary_patterns(count, &scene(side(16), kind), 0.3, 8);
                assert_eq!(judged(&own, &others, method), Some(MatrixDoubt::Unexplained));
            }
        }
    }

    #[test]
    fn a_scene_that_few_patterns_see_is_not_doubted() {
        // A square on the grid of the patterns, seen by 16 of 256 of them, of which some are left out.
        let lit = |p: usize| (4..12).contains(&(p / 16)) && (4..12).contains(&(p % 16));
        let sign = |k: usize, p: usize| 1.0 - 2.0 * f64::from((k & p).count_ones() % 2);
        for count in [150, 200, 240] {
            for noise in [0.0, 0.1] {
                let mut random = Pcg64::seed_from_u64(1);
                let (mut weights, mut y) = (Vec::new(), Vec::new());
                for k in (0..count).map(|k| (k * 77) % 256) {
                    let row: Vec<f64> = (0..256).map(|p| sign(k, p)).collect();
                    let light = row.iter().enumerate().filter(|(p, _)| lit(*p)).map(|(_, w)| w);
                    y.push(light.sum::<f64>() + noise * normal(&mut random));
                    weights.extend(row);
                }
                let own = OwnMatrix::new(side(16), &weights).unwrap();
                for method in [MatrixMethod::Best, MatrixMethod::Penalty(Penalty::Tikhonov)] {
                    assert_eq!(judged(&own, &y, method), None, "{count} patterns, noise {noise}");
                }
            }
        }
    }
}
