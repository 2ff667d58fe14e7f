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
/// reading's noise.
pub const WITHIN: f32 = 2.0;

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
    let positions = order::positions_by_sequency(rows);
    let bands = (positions.len() / LEAST_OF_A_BAND).clamp(1, MOST_BANDS);
    let mut weights = 0.0;
    for band in positions.chunks(positions.len().div_ceil(bands).max(1)) {
        let (mut missed, mut noise) = (0.0, 0.0);
        for &k in band {
            let (value, sigma) = reading(k);
            missed += f64::from(value - grid[rows[k] as usize]).powi(2);
            noise += f64::from(sigma).powi(2);
        }
        let weight = match noise < missed {
            true => (1.0 - noise / missed) as f32,
            // Without noise and without a miss, reading and prediction are one.
            false => f32::from(u8::from(noise == 0.0)),
        };
        for &k in band {
            let (value, sigma) = reading(k);
            let predicted = &mut grid[rows[k] as usize];
            let missed = value - *predicted;
            let weight = match (WITHIN * sigma).powi(2) / missed.powi(2) {
                beyond if beyond < 1.0 => weight.max(1.0 - beyond),
                _ => weight,
            };
            *predicted = value - (1.0 - weight) * missed;
            weights += f64::from(weight);
        }
    }
    if let Some(k) = rows.iter().position(|row| *row == 0) {
        grid[0] = reading(k).0;
    }
    if positions.is_empty() { 1.0 } else { weights / positions.len() as f64 }
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
