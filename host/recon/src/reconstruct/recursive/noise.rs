//! The noise of a reading, from one frame and from what the frames before predict.
//!
//! Readings of one frame contain detail of the scene, and what a prediction misses contains change
//! of the scene. Noise alone is the same in every row and in every pixel, so each part of the rows
//! and the image of the rows gives an upper bound of the noise, and the smallest bound counts.

use crate::order::positions_by_sequency;
use crate::reconstruct::Problem;
use crate::reconstruct::selection::{SIGMAS_PER_MEDIAN, noise_level};
use crate::{Rows, Side};

/// How much smaller an estimate of the noise must be to replace another one: the smaller of two
/// equal estimates would be too small on average.
const CLEARLY: f32 = 0.75;

/// The fewest rows that give an estimate of the noise.
const LEAST_ROWS: usize = 32;

/// The fewest rows of which an image, or one part of several, gives an estimate of the noise.
const LEAST_OF_A_PART: usize = 128;

/// Parts into which rows are divided by their sequency.
const PARTS: usize = 4;

/// Readings, or what a prediction misses of them, by row.
#[derive(Debug, Default)]
pub(super) struct Missed {
    pub rows: Vec<u32>,
    pub values: Vec<f32>,
}

/// The noise of a reading by one frame alone.
pub(super) fn of_frame(problem: &Problem<'_>) -> f32 {
    let side = problem.side;
    let n = side.pixels() as u32;
    // These rows change sign from each pixel to the next in both directions. Together they are the
    // diagonal detail of 2 x 2 pixels, which only corners and slanted edges have.
    let readings = problem.rows.iter().zip(&problem.values);
    let diagonal = readings.filter(|(row, _)| *row % 2 == 1 && *row / n % 2 == 1);
    let (rows, values) = diagonal.map(|(&row, &value)| (row, value)).unzip();
    smallest(problem.prior.noise, in_pixels(side, &Missed { rows, values }))
}

/// The noise, if it is clearly less than `noise` by what a prediction misses.
pub(super) fn of_missed(side: Side, missed: Missed, noise: f32) -> f32 {
    if missed.rows.len() < LEAST_ROWS {
        return noise;
    }
    let pixels = in_pixels(side, &missed);
    let rows = Rows::trusted(side, missed.rows);
    let mut noise = smallest(noise, Some(noise_level(&rows, &missed.values)));
    let positions = positions_by_sequency(&rows);
    let size = (positions.len() / PARTS).max(LEAST_OF_A_PART);
    // Detail that moved by parts of a pixel is missed in fine rows, detail that changed in coarse
    // ones.
    for part in positions.rchunks_exact(size) {
        noise = smallest(noise, deviation(part.iter().map(|&at| missed.values[at])));
    }
    smallest(noise, pixels)
}

fn smallest(noise: f32, other: Option<f32>) -> f32 {
    other.filter(|other| *other < CLEARLY * noise).unwrap_or(noise)
}

/// The noise by the pixels of the image of these rows: detail and change are in some pixels, noise
/// is in all.
fn in_pixels(side: Side, missed: &Missed) -> Option<f32> {
    let count = missed.rows.len();
    if count < LEAST_OF_A_PART {
        return None;
    }
    let mut grid = vec![0.0; side.area()];
    for (&row, value) in missed.rows.iter().zip(&missed.values) {
        grid[row as usize] = *value;
    }
    super::walsh(side, &mut grid);
    // The noise of some rows is spread over all pixels.
    let share = (count as f32 / side.area() as f32).sqrt();
    deviation(grid.into_iter()).map(|noise| noise / share)
}

/// Standard deviation of normal values around 0, by their median magnitude.
fn deviation(values: impl Iterator<Item = f32>) -> Option<f32> {
    let mut magnitudes: Vec<f32> = values.map(f32::abs).collect();
    let middle = magnitudes.len() / 2;
    if magnitudes.is_empty() {
        return None;
    }
    Some(SIGMAS_PER_MEDIAN * *magnitudes.select_nth_unstable_by(middle, f32::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Order;
    use crate::testing::{normal, side};
    use rand::SeedableRng;
    use rand_pcg::Pcg64;

    /// Normal values for the lowest rows of an image, each with the deviation that its place has.
    fn missed(count: usize, deviation_at: impl Fn(usize) -> f64) -> Missed {
        let mut random = Pcg64::seed_from_u64(4);
        let rows = Order::ZigZag.rows(side(32)).unwrap().first(count);
        let values = (0..count).map(|at| (deviation_at(at) * normal(&mut random)) as f32);
        Missed { values: values.collect(), rows: rows.to_vec() }
    }

    #[test]
    fn few_rows_give_no_estimate_and_an_image_needs_more() {
        let side = side(32);
        assert_eq!(of_missed(side, missed(LEAST_ROWS - 1, |_| 0.01), 1.0), 1.0);
        assert!(of_missed(side, missed(LEAST_ROWS, |_| 0.01), 1.0) < 0.03);
        assert_eq!(of_missed(side, missed(1, |_| 0.01), 1.0), 1.0);
        assert_eq!(in_pixels(side, &missed(LEAST_OF_A_PART - 1, |_| 0.3)), None);
        let found = in_pixels(side, &missed(LEAST_OF_A_PART, |_| 0.3)).unwrap();
        assert!((0.25..0.35).contains(&found), "{found}");
    }

    #[test]
    fn the_part_of_the_rows_that_nothing_has_changed_in_tells_the_noise() {
        // Coarse rows, fine rows, or those between.
        for quiet in [0..150, 150..300, 450..600] {
            let deviation_at = |at: usize| if quiet.contains(&at) { 0.1 } else { 5.0 };
            let found = of_missed(side(32), missed(600, deviation_at), 10.0);
            assert!((0.08..0.12).contains(&found), "{quiet:?}: {found}");
        }
        // An estimate that is hardly smaller changes nothing.
        assert_eq!(of_missed(side(32), missed(600, |_| 0.9), 1.0), 1.0);
    }
}
