//! Cross-validation: chooses the number of atoms, and the trust in their prediction, on held-back
//! measurements.
//!
//! A prediction is compared only with rows that it was not made from.

use super::Problem;
use crate::omp::OmpError;
use crate::{Rows, order};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;

/// The number of atoms that a pursuit stops at, and what is known of their prediction.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Choice {
    pub atoms: usize,
    /// Trust: factor on the prediction for rows that were not measured.
    pub trust: f32,
    /// What was predicted for each measurement without it, if measurements were held back.
    pub held_back: Option<Vec<f32>>,
}

/// The prediction that cross-validation chose.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Chosen {
    /// Index of the candidate.
    pub at: usize,
    /// Trust: factor on the prediction for rows that were not measured.
    pub trust: f32,
    /// What the candidate predicts for each measurement without it. The all-ones row, which is never
    /// held back, has its measurement.
    pub held_back: Vec<f32>,
}

/// Values of trust to try. The grid is coarse because the error is flat around its minimum.
pub(super) const TRUST: [f32; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];
/// Number of sparsities to try, evenly spaced in their logarithm.
const SPARSITIES: usize = 10;
/// Seed of the split into folds. The split changes the result, so the seed never changes.
const SPLIT_SEED: u64 = 0x5eed;

/// Difference between a prediction and the held-back measurements.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Miss {
    absolute: f64,
    squared: f64,
}

impl Miss {
    /// One error.
    pub fn of(error: f64) -> Self {
        Self { absolute: error.abs(), squared: error * error }
    }

    /// Sum of the squared errors.
    pub fn squared(self) -> f64 {
        self.squared
    }

    pub fn add(&mut self, other: Self) {
        self.absolute += other.absolute;
        self.squared += other.squared;
    }

    /// The miss relative to zero filling's. Absolute and squared error count alike: 2 is as bad as
    /// zero filling.
    pub fn relative_to(self, zero: Self) -> f64 {
        self.absolute / zero.absolute + self.squared / zero.squared
    }
}

/// The line through the origin from predictions to held-back measurements.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Line {
    count: usize,
    /// Sums: prediction squared, prediction times measurement, measurement squared.
    predicted: f64,
    product: f64,
    measured: f64,
}

impl Line {
    /// Adds a prediction and its measurement.
    pub fn add(&mut self, prediction: f64, measurement: f64) {
        self.join(Self {
            count: 1,
            predicted: prediction * prediction,
            product: prediction * measurement,
            measured: measurement * measurement,
        });
    }

    fn join(&mut self, other: Self) {
        *self = self.and(other);
    }

    /// The line of both sets of rows.
    pub fn and(self, other: Self) -> Self {
        Self {
            count: self.count + other.count,
            predicted: self.predicted + other.predicted,
            product: self.product + other.product,
            measured: self.measured + other.measured,
        }
    }

    /// The most trust that these rows support: the factor on the prediction with the least squared
    /// error, plus some standard errors of that factor.
    pub fn most_trust(self, standard_errors: f64) -> f64 {
        self.factor()
            .map_or(1.0, |(factor, error)| (factor + standard_errors * error).clamp(0.0, 1.0))
    }

    /// The least trust that these rows support: the same factor less some standard errors.
    pub fn least_trust(self, standard_errors: f64) -> f64 {
        self.factor()
            .map_or(0.0, |(factor, error)| (factor - standard_errors * error).clamp(0.0, 1.0))
    }

    /// The factor on the prediction with the least squared error, and its standard error; `None` if
    /// the rows say nothing of it.
    fn factor(self) -> Option<(f64, f64)> {
        if self.predicted == 0.0 || self.count < 2 {
            return None;
        }
        let factor = self.product / self.predicted;
        let left = (self.measured - factor * self.product).max(0.0);
        Some((factor, (left / (self.count - 1) as f64 / self.predicted).sqrt()))
    }
}

/// The rows that limit the trust.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Trusted {
    /// All held-back rows choose the trust.
    ByAll,
    /// The finer half of the rows also sets an upper limit, this many standard errors above what
    /// fits them best: where light is nearly all scattered, a prediction that holds for coarse rows
    /// says nothing about the fine ones.
    AsFarAsFine { standard_errors: f64 },
}

/// The rows that limit the trust in a pursuit. A lower limit loses up to 0.4 dB on real measurements, a
/// higher one loses to zero filling in scattered light (scatter_tests.rs).
pub(super) const OMP_TRUSTED: Trusted = Trusted::AsFarAsFine { standard_errors: 3.0 };

/// The misses of one fold, and what each candidate predicts for its measurements.
type Fold = (Misses, Vec<Vec<f32>>);

/// The miss for each number of atoms and each trust, and the fit of the finest rows.
type Misses = Vec<([Miss; TRUST.len()], Line)>;

/// The number of atoms, up to `most` and a quarter of the measurements, and the trust with the
/// least error over `folds` held-back parts. The error is the sum of absolute and squared error,
/// each relative to zero filling's: with squares alone the few large coefficients would decide,
/// with absolute values alone the many small ones.
pub(super) fn choose(problem: &Problem, most: usize, folds: usize) -> Result<Choice, OmpError> {
    choose_sparsity(problem, most, folds, |kept, sparsities| predict(problem, kept, sparsities))
}

/// One choice for several problems.
pub(super) struct Together {
    /// Index of the candidate.
    pub at: usize,
    /// Trust: factor on the prediction for rows that were not measured.
    pub trust: f32,
    /// What the candidate predicts for each problem's measurements without them.
    pub held_back: Vec<Vec<f32>>,
}

/// As [`choose_among`], one choice for several problems of one kind, by what all of them miss.
pub(super) fn choose_together(
    problems: &[Problem<'_>],
    count: usize,
    folds: usize,
    trusted: Trusted,
    predict: impl Fn(&Problem<'_>, &[usize]) -> Result<Vec<Vec<f32>>, OmpError> + Sync,
) -> Result<Option<Together>, OmpError> {
    let folded: Result<Option<Vec<Folded>>, OmpError> = problems
        .par_iter()
        .map(|problem| Folded::new(problem, folds, |kept| predict(problem, kept)))
        .collect();
    let Some(folded) = folded? else { return Ok(None) };
    let mut total: Misses = vec![Default::default(); count];
    folded.iter().for_each(|folded| add(&mut total, &folded.total(count)));
    let (at, trust) = best(&total, trusted);
    let held_back = folded.iter().zip(problems).map(|(folded, of)| folded.held_back(of, at));
    Ok(Some(Together { at, trust, held_back: held_back.collect() }))
}

/// The numbers of atoms to try for this number of measurements.
pub(super) fn sparsities(measurements: usize, most: usize) -> Vec<usize> {
    geometric(most.min(measurements / 4).max(1))
}

/// What a pursuit predicts of all rows, from the measurements at some positions.
pub(super) fn predict(
    problem: &Problem<'_>,
    kept: &[usize],
    sparsities: &[usize],
) -> Result<Vec<Vec<f32>>, OmpError> {
    let dictionary = problem.dictionary(kept);
    let found = problem.pursue(&dictionary, kept, sparsities)?;
    Ok(found.iter().map(|f| dictionary.predict(&f.support, &f.coefficients)).collect())
}

/// [`choose`] for any dictionary. `predict` makes the prediction for each number of atoms, from the
/// measurements at some positions.
pub(super) fn choose_sparsity(
    problem: &Problem<'_>,
    most: usize,
    folds: usize,
    predict: impl Fn(&[usize], &[usize]) -> Result<Vec<Vec<f32>>, OmpError> + Sync,
) -> Result<Choice, OmpError> {
    let sparsities = sparsities(problem.rows.len(), most);
    let found = choose_among(problem, sparsities.len(), folds, OMP_TRUSTED, |kept| {
        predict(kept, &sparsities)
    })?;
    Ok(match found {
        None => Choice { atoms: sparsities[sparsities.len() - 1], trust: 0.0, held_back: None },
        Some(Chosen { at, trust, held_back }) => {
            Choice { atoms: sparsities[at], trust, held_back: Some(held_back) }
        }
    })
}

/// Chooses the prediction, of `count` predictions, and the trust with the least error over `folds`
/// held-back parts; `None` if there is nothing to hold back. `predict` makes every row of all
/// predictions, from the measurements at some positions.
pub(super) fn choose_among(
    problem: &Problem<'_>,
    count: usize,
    folds: usize,
    trusted: Trusted,
    predict: impl Fn(&[usize]) -> Result<Vec<Vec<f32>>, OmpError> + Sync,
) -> Result<Option<Chosen>, OmpError> {
    let Some(folded) = Folded::new(problem, folds, predict)? else { return Ok(None) };
    let (at, trust) = best(&folded.total(count), trusted);
    Ok(Some(Chosen { at, trust, held_back: folded.held_back(problem, at) }))
}

/// What each candidate predicts of the measurements that are held back in turn.
struct Folded {
    parts: Vec<(Vec<usize>, Vec<usize>)>,
    results: Vec<Fold>,
}

impl Folded {
    /// `None` if there is nothing to hold back.
    fn new(
        problem: &Problem<'_>,
        folds: usize,
        predict: impl Fn(&[usize]) -> Result<Vec<Vec<f32>>, OmpError> + Sync,
    ) -> Result<Option<Self>, OmpError> {
        let parts = parts(problem.rows, folds);
        if parts.is_empty() {
            return Ok(None);
        }
        let fine = finer_half(problem.rows);
        let results: Result<Vec<Fold>, OmpError> = parts
            .par_iter()
            .map(|(kept, held)| {
                let predictions = predict(kept)?;
                let misses = misses_of(problem, &predictions, held, &fine);
                let of_held = |predicted: &Vec<f32>| {
                    held.iter().map(|&k| predicted[problem.rows[k] as usize]).collect()
                };
                Ok((misses, predictions.iter().map(of_held).collect()))
            })
            .collect();
        Ok(Some(Self { parts, results: results? }))
    }

    /// The misses of `count` candidates.
    fn total(&self, count: usize) -> Misses {
        let mut total: Misses = vec![Default::default(); count];
        self.results.iter().for_each(|(misses, _)| add(&mut total, misses));
        total
    }

    /// What a candidate predicts for each measurement without it.
    fn held_back(&self, problem: &Problem<'_>, at: usize) -> Vec<f32> {
        let mut held_back = problem.values.clone();
        for ((_, held), (_, predictions)) in self.parts.iter().zip(&self.results) {
            for (&k, &predicted) in held.iter().zip(&predictions[at]) {
                held_back[k] = predicted;
            }
        }
        held_back
    }
}

fn add(total: &mut Misses, misses: &Misses) {
    for ((total, total_fine), (misses, fine)) in total.iter_mut().zip(misses) {
        total.iter_mut().zip(misses).for_each(|(total, miss)| total.add(*miss));
        total_fine.join(*fine);
    }
}

/// The candidate with the least miss, and the trust in it.
fn best(total: &Misses, trusted: Trusted) -> (usize, f32) {
    let zero_filling = total[0].0[0];
    let mut best = ((0, 0.0), 2.0);
    for (at, (misses, _)) in total.iter().enumerate() {
        for (&trust, miss) in TRUST.iter().zip(misses) {
            let relative = miss.relative_to(zero_filling);
            if relative < best.1 {
                best = ((at, trust), relative);
            }
        }
    }
    let (at, trust) = best.0;
    let limit = match trusted {
        Trusted::ByAll => 1.0,
        Trusted::AsFarAsFine { standard_errors } => total[at].1.most_trust(standard_errors) as f32,
    };
    (at, trust.min(limit))
}

/// The miss of each prediction with each trust, on the held-back measurements.
fn misses_of(
    problem: &Problem<'_>,
    predictions: &[Vec<f32>],
    held: &[usize],
    fine: &[bool],
) -> Misses {
    let fine_of = |predicted: &Vec<f32>| {
        let mut fit = Line::default();
        for &k in held.iter().filter(|&&k| fine[k]) {
            let value = f64::from(problem.values[k]);
            let guess = f64::from(predicted[problem.rows[k] as usize]);
            fit.add(guess, value);
        }
        fit
    };
    let miss_of = |predicted: &Vec<f32>| {
        TRUST.map(|trust| {
            let mut miss = Miss::default();
            for &k in held {
                let row = problem.rows[k] as usize;
                let error = f64::from(problem.values[k] - trust * predicted[row]);
                miss.add(Miss::of(error));
            }
            miss
        })
    };
    predictions.iter().map(|predicted| (miss_of(predicted), fine_of(predicted))).collect()
}

/// Whether each measurement is of the half of the rows (at least eight) with the highest sequency.
fn finer_half(rows: &Rows) -> Vec<bool> {
    let positions = order::positions_by_sequency(rows);
    let count = (positions.len() / 2).max(8).min(positions.len());
    let mut fine = vec![false; rows.len()];
    for &k in &positions[positions.len() - count..] {
        fine[k] = true;
    }
    fine
}

/// Positions that are kept and positions that are held back, for each fold that holds back any.
pub(super) fn parts(rows: &Rows, folds: usize) -> Vec<(Vec<usize>, Vec<usize>)> {
    let fold_of = split(rows, folds);
    (0..folds)
        .map(|fold| (0..rows.len()).partition(|&k| fold_of[k] != Some(fold)))
        .filter(|(kept, held): &(Vec<_>, Vec<_>)| !kept.is_empty() && !held.is_empty())
        .collect()
}

/// The fold that holds each measurement back; `None` for the all-ones row (the mean), which no
/// other row predicts. Neighbours in sequency go to different folds, so each fold lacks rows of
/// every scale.
fn split(rows: &Rows, folds: usize) -> Vec<Option<usize>> {
    let mut random = Pcg64::seed_from_u64(SPLIT_SEED);
    let mut fold_of = vec![None; rows.len()];
    let by_sequency = order::positions_by_sequency(rows);
    for group in by_sequency.chunks(folds) {
        let mut free: Vec<usize> = (0..folds).collect();
        for &k in group {
            fold_of[k] = Some(free.swap_remove(random.random_range(..free.len())));
        }
    }
    fold_of
}

/// Ratio of a normal distribution's standard deviation to its median magnitude.
pub(super) const SIGMAS_PER_MEDIAN: f32 = 1.4826;

/// Noise of `f32` transforms, in units of the largest measurement. A simulated scene may have no
/// other noise.
const ROUNDING: f32 = 1e-6;

/// Noise of a measurement: the median magnitude over the quarter of the rows (at least eight) with
/// the highest sequency. The rows also contain detail of the scene, so the result is an upper bound
/// of the noise: the level below which a coefficient cannot be distinguished from its neighbours.
pub(super) fn noise_level(rows: &Rows, values: &[f32]) -> f32 {
    let positions = order::positions_by_sequency(rows);
    let count = (positions.len() / 4).max(8).min(positions.len());
    let mut magnitudes: Vec<f32> =
        positions[positions.len() - count..].iter().map(|&k| values[k].abs()).collect();
    if magnitudes.is_empty() {
        return 0.0;
    }
    let middle = count / 2;
    let median = *magnitudes.select_nth_unstable_by(middle, f32::total_cmp).1;
    (SIGMAS_PER_MEDIAN * median).max(ROUNDING)
}

/// Numbers from 1 to `largest`, evenly spaced in their logarithm, without repetition.
fn geometric(largest: usize) -> Vec<usize> {
    let step = (largest as f64).ln() / (SPARSITIES - 1) as f64;
    let mut numbers: Vec<usize> =
        (0..SPARSITIES).map(|i| (step * i as f64).exp().round() as usize).collect();
    numbers.dedup();
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(pairs: &[(f64, f64)]) -> Line {
        let mut line = Line::default();
        pairs.iter().for_each(|&(prediction, measurement)| line.add(prediction, measurement));
        line
    }

    #[test]
    fn trust_is_the_slope_of_a_line_and_its_standard_error() {
        // Two rows that agree: slope 1/2 without an error.
        let exact = line(&[(2.0, 1.0), (4.0, 2.0)]);
        assert_eq!((exact.most_trust(9.0), exact.least_trust(9.0)), (0.5, 0.5));
        // Slope (0.2 + 0.6) / 2; what is left has the squares 0.04 + 0.04 over two predictions of 1.
        let loose = line(&[(1.0, 0.2), (1.0, 0.6)]);
        assert!((loose.most_trust(1.0) - 0.6).abs() < 1e-12, "{}", loose.most_trust(1.0));
        assert!((loose.least_trust(1.0) - 0.2).abs() < 1e-12, "{}", loose.least_trust(1.0));
        assert_eq!((loose.most_trust(5.0), loose.least_trust(5.0)), (1.0, 0.0));
        // One row, and predictions of nothing, say nothing.
        for nothing in [line(&[(1.0, 0.5)]), line(&[(0.0, 1.0), (0.0, 2.0)]), line(&[])] {
            assert_eq!((nothing.most_trust(1.0), nothing.least_trust(1.0)), (1.0, 0.0));
        }
        let both = line(&[(1.0, 0.2)]).and(line(&[(1.0, 0.6)]));
        assert_eq!(both.most_trust(1.0), loose.most_trust(1.0));
    }

    #[test]
    fn numbers_of_atoms_are_evenly_spaced_in_their_logarithm() {
        assert_eq!(geometric(1), [1]);
        assert_eq!(geometric(5), [1, 2, 3, 4, 5]);
        assert_eq!(geometric(512), [1, 2, 4, 8, 16, 32, 64, 128, 256, 512]);
    }
}
