//! What a measured row is worth: the mean of its reading and of its prediction, weighted by what is
//! known of each.
//!
//! A method predicts every row, the measured ones too. A reading of noise `s` and a prediction of
//! standard error `e` have the mean `w y + (1 - w) p` with `w = e^2 / (e^2 + s^2)`: with much light
//! the reading counts, with little light the prediction. The error of the predictions is not known,
//! but the mean square of what they miss is `e^2 + s^2`, in bands of rows of like fineness, whose
//! predictions are about equally good. So `w = max(0, 1 - s^2 / mean((y - p)^2))` in each band (W.
//! James and C. Stein, *Estimation with quadratic loss*, 1961). Few rows of a sparse scene are far
//! from what the others predict. Such a row counts by its own miss where that is beyond noise:
//! `w = 1 - WITHIN^2 s^2 / (y - p)^2` if that is more.
//!
//! # Invariant
//! A measured row differs from its reading by at most [`WITHIN`] times the noise, whatever the
//! prediction (`tests::a_row_stays_within_its_noise`), and a reading without noise is kept
//! (`tests::readings_without_noise_stay_as_they_are`).

use crate::{Rows, order};

/// Distance of a measured row from its reading that is allowed, in standard deviations of the
/// reading's noise. Of 80 readings one is as far off by noise alone: with all 1024 patterns shown, a
/// smaller distance lets so many of them keep their noise that the image is worse than that of half of
/// the patterns.
pub const WITHIN: f32 = 2.5;

/// The fewest rows of a band: the mean of 32 squares is known to a quarter.
const LEAST_OF_A_BAND: usize = 32;

/// The most bands.
const MOST_BANDS: usize = 8;

/// Replaces the measured rows of `grid`, a prediction of all rows, by the weighted means of
/// readings and predictions, and gives the mean weight of the readings. `noise` is that of a
/// reading, in the units of `values`. The all-ones row, which no other row predicts, keeps its
/// reading.
pub(super) fn weigh(rows: &Rows, values: &[f32], noise: f32, grid: &mut [f32]) -> f64 {
    weigh_each(rows, |k| (values[k], noise), grid)
}

/// [`weigh`] with a noise for each reading; `reading` gives value and noise of the k-th row.
pub(super) fn weigh_each(
    rows: &Rows,
    reading: impl Fn(usize) -> (f32, f32),
    grid: &mut [f32],
) -> f64 {
    Bands::new(rows).weigh_alone(rows, reading, grid)
}

/// Rows of like fineness together, the all-ones row left out.
struct Bands {
    /// Positions of the rows, the coarsest first.
    positions: Vec<usize>,
    /// Number of rows of each band but the last, which may have fewer.
    each: usize,
    /// Position of the all-ones row, which no other row predicts.
    all_ones: Option<usize>,
}

/// What predictions miss of the readings of a band, and what noise alone would miss: sums of squares.
#[derive(Debug, Clone, Copy, Default)]
struct Miss {
    missed: f64,
    noise: f64,
}

impl Miss {
    fn add(&mut self, other: Self) {
        self.missed += other.missed;
        self.noise += other.noise;
    }

    /// The weight of a reading of this band.
    fn weight(&self) -> f32 {
        match self.noise < self.missed {
            true => (1.0 - self.noise / self.missed) as f32,
            // Without noise and without a miss, reading and prediction are one.
            false => f32::from(u8::from(self.noise == 0.0)),
        }
    }
}

impl Bands {
    fn new(rows: &Rows) -> Self {
        let positions = order::positions_by_sequency(rows);
        let count = (positions.len() / LEAST_OF_A_BAND).clamp(1, MOST_BANDS);
        let each = positions.len().div_ceil(count).max(1);
        Self { positions, each, all_ones: rows.iter().position(|row| *row == 0) }
    }

    /// What `predicted` misses of the readings of each band.
    fn misses(
        &self,
        reading: impl Fn(usize) -> (f32, f32),
        predicted: impl Fn(usize) -> f32,
    ) -> Vec<Miss> {
        let of_band = |band: &[usize]| {
            band.iter().fold(Miss::default(), |mut sum, &k| {
                let (value, sigma) = reading(k);
                let missed = f64::from(value - predicted(k)).powi(2);
                sum.add(Miss { missed, noise: f64::from(sigma).powi(2) });
                sum
            })
        };
        self.positions.chunks(self.each).map(of_band).collect()
    }

    /// Replaces the measured rows of `grid` by weighted means, by what this prediction misses.
    fn weigh_alone(
        &self,
        rows: &Rows,
        reading: impl Fn(usize) -> (f32, f32),
        grid: &mut [f32],
    ) -> f64 {
        let misses = self.misses(&reading, |k: usize| grid[rows[k] as usize]);
        let weights = misses.iter().map(|miss| Weight { reading: miss.weight(), follows: 1.0 });
        self.weigh(rows, weights, reading, grid)
    }

    /// Replaces the measured rows of `grid` by weighted means, and gives the mean weight of the readings,
    /// as it were beside predictions without them.
    fn weigh(
        &self,
        rows: &Rows,
        weights: impl IntoIterator<Item = Weight>,
        reading: impl Fn(usize) -> (f32, f32),
        grid: &mut [f32],
    ) -> f64 {
        let mut sum = 0.0;
        for (band, of_band) in self.positions.chunks(self.each).zip(weights) {
            for &k in band {
                let (value, sigma) = reading(k);
                let predicted = &mut grid[rows[k] as usize];
                let missed = (value - *predicted) * of_band.follows;
                let weight = match (WITHIN * sigma).powi(2) / missed.powi(2) {
                    beyond if beyond < 1.0 => of_band.reading.max(1.0 - beyond),
                    _ => of_band.reading,
                };
                *predicted = value - (1.0 - weight) * missed;
                sum += f64::from(weight);
            }
        }
        if let Some(k) = self.all_ones {
            grid[0] = reading(k).0;
        }
        if self.positions.is_empty() { 1.0 } else { sum / self.positions.len() as f64 }
    }
}

/// The weight of the readings of a band.
#[derive(Debug, Clone, Copy)]
struct Weight {
    /// Beside a prediction that was made without the reading.
    reading: f32,
    /// How many times farther such a prediction is from the reading than the one at hand, which may have
    /// been made with the reading and follow it, noise and all. 1: it was made without.
    follows: f32,
}

/// The weights of readings of one kind, by what is predicted of some of them with and without each
/// reading. A prediction that was made with a reading follows its noise. So it is first moved away from
/// the reading, by as much as the sample's predictions follow.
pub(super) struct KindWeights {
    bands: Bands,
    misses: Vec<Miss>,
    own: Vec<Own>,
    /// Whether a measurement was [added](Self::add). If none was, each is weighed by its own misses.
    is_found: bool,
}

/// What predictions with a reading miss, in a band: times what those without it miss, and squared.
#[derive(Debug, Clone, Copy, Default)]
struct Own {
    both: f64,
    with: f64,
}

impl Own {
    fn follows(&self) -> f32 {
        if self.with > 0.0 { (self.both / self.with).max(1.0) as f32 } else { 1.0 }
    }
}

impl KindWeights {
    pub fn new(rows: &Rows) -> Self {
        let bands = Bands::new(rows);
        let count = bands.positions.len().div_ceil(bands.each);
        let (misses, own) = (vec![Miss::default(); count], vec![Own::default(); count]);
        Self { bands, misses, own, is_found: false }
    }

    /// Adds a measurement of the kind: `reading` gives value and noise of the k-th row, `without` and
    /// `with` what is predicted without and with it.
    pub fn add(
        &mut self,
        reading: impl Fn(usize) -> (f32, f32),
        without: impl Fn(usize) -> f32,
        with: impl Fn(usize) -> f32,
    ) {
        self.is_found = true;
        let bands = self.bands.positions.chunks(self.bands.each);
        for ((band, miss), own) in bands.zip(&mut self.misses).zip(&mut self.own) {
            for &k in band {
                let (value, sigma) = reading(k);
                let [without, with] = [without(k), with(k)].map(|p| f64::from(value - p));
                miss.add(Miss { missed: without * without, noise: f64::from(sigma).powi(2) });
                own.both += without * with;
                own.with += with * with;
            }
        }
    }

    /// Replaces the measured rows of `grid`, a prediction with the readings, by weighted means, and gives
    /// the mean weight.
    pub fn weigh(
        &self,
        rows: &Rows,
        reading: impl Fn(usize) -> (f32, f32),
        grid: &mut [f32],
    ) -> f64 {
        if !self.is_found {
            return self.bands.weigh_alone(rows, reading, grid);
        }
        let of_band =
            |(miss, own): (&Miss, &Own)| Weight { reading: miss.weight(), follows: own.follows() };
        let weights = self.misses.iter().zip(&self.own).map(of_band);
        self.bands.weigh(rows, weights, reading, grid)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Order;
    use crate::testing::{normal, side};
    use proptest::prelude::*;
    use rand::SeedableRng;
    use rand_pcg::Pcg64;

    fn rows() -> Rows {
        Order::ZigZag.rows(side(32)).unwrap()
    }

    /// A scene of normal rows, readings with noise, and predictions with errors: the mean squared
    /// error after weighing, and the mean weight.
    fn error(noise: f64, wrong: f64, seed: u64) -> (f64, f64) {
        let mut random = Pcg64::seed_from_u64(seed);
        let rows = rows();
        let truth: Vec<f64> = rows.iter().map(|_| 10.0 * normal(&mut random)).collect();
        let values: Vec<f32> =
            truth.iter().map(|t| (t + noise * normal(&mut random)) as f32).collect();
        let mut grid = vec![0.0; 1024];
        for (&row, t) in rows.iter().zip(&truth) {
            grid[row as usize] = (t + wrong * normal(&mut random)) as f32;
        }
        let weight = weigh(&rows, &values, noise as f32, &mut grid);
        let missed = rows.iter().zip(&truth).skip(1);
        let missed = missed.map(|(&row, t)| (f64::from(grid[row as usize]) - t).powi(2));
        (missed.sum::<f64>() / 1023.0, weight)
    }

    #[test]
    fn the_mean_of_reading_and_prediction_is_better_than_either() {
        for (noise, wrong) in [(1.0, 0.3), (1.0, 1.0), (0.3, 1.0)] {
            let (found, weight) = error(noise, wrong, 1);
            let best = (noise * wrong).powi(2) / (noise * noise + wrong * wrong);
            // Rows that are far off by chance cost some of the gain.
            assert!(
                found < 1.5 * best && found < noise * noise,
                "{noise} {wrong}: {found}, {best}"
            );
            let expected = wrong * wrong / (noise * noise + wrong * wrong);
            assert!((weight - expected).abs() < 0.15, "{noise} {wrong}: {weight}, {expected}");
        }
    }

    #[test]
    fn a_prediction_that_follows_its_readings_counts_as_one_made_without_them() {
        let mut random = Pcg64::seed_from_u64(3);
        let rows = rows().first(512);
        let truth: Vec<f64> = rows.iter().map(|_| 10.0 * normal(&mut random)).collect();
        let mut values = || -> Vec<f32> {
            truth.iter().map(|t| (t + 2.0 * normal(&mut random)) as f32).collect()
        };
        let (readings, without) = (values(), values());
        let follows = |k: usize| readings[k] - 0.4 * (readings[k] - without[k]);
        let reading = |k: usize| (readings[k], 2.0);
        let mut weights = KindWeights::new(&rows);
        weights.add(reading, |k| without[k], follows);
        let (mut with_own, mut alone) = (vec![0.0; 1024], vec![0.0; 1024]);
        for (k, &row) in rows.iter().enumerate() {
            (with_own[row as usize], alone[row as usize]) = (follows(k), without[k]);
        }
        let found = weights.weigh(&rows, reading, &mut with_own);
        let expected = weigh(&rows, &readings, 2.0, &mut alone);
        assert!((found - expected).abs() < 1e-4, "{found} {expected}");
        let apart = with_own.iter().zip(&alone).map(|(a, b)| (a - b).abs());
        assert!(apart.fold(0.0, f32::max) < 1e-3);
    }

    #[test]
    fn readings_without_noise_stay_as_they_are() {
        let (found, weight) = error(0.0, 3.0, 2);
        assert!(found < 1e-9 && weight == 1.0, "{found} {weight}");
    }

    proptest! {
        #[test]
        fn a_row_stays_within_its_noise(
            noise in 0.0_f32..2.0,
            count in 1_usize..200,
            seed: u64,
        ) {
            let mut random = Pcg64::seed_from_u64(seed);
            let rows = rows().first(count);
            let mut draw = || 5.0 * normal(&mut random) as f32;
            let values: Vec<f32> = rows.iter().map(|_| draw()).collect();
            let mut grid: Vec<f32> = (0..1024).map(|_| draw()).collect();
            let before = grid.clone();
            let weight = weigh(&rows, &values, noise, &mut grid);
            prop_assert!((0.0..=1.0).contains(&weight));
            for (&row, value) in rows.iter().zip(&values) {
                prop_assert!((grid[row as usize] - value).abs() <= 1.001 * WITHIN * noise + 1e-5);
            }
            // Rows that were not measured stay as predicted.
            let measured: Vec<u32> = rows.to_vec();
            for (row, (after, before)) in grid.iter().zip(&before).enumerate() {
                prop_assert!(measured.contains(&(row as u32)) || after == before);
            }
        }
    }
}
