//! A drift in readings of patterns alone.
//!
//! Half of the pixels are lit in each pattern but the all-on one, so readings lie on both sides of one level, whatever the
//! scene: half the light of all pixels, and the dark level. Under a steady lamp their median is the same from the beginning to
//! the end of a sweep.

use super::robust::median;
use super::{Lamp, Witness};

/// Fewest readings that say something.
const FEWEST: usize = 64;

/// The least part of the drift that each half of the sweep has to show in its own slope. The first patterns of some orders are
/// lit by coarse parts of the scene, and have a level of their own.
const OF_EACH_HALF: f64 = 0.3;

/// A drift of at least this many standard errors does not come by chance.
const SIGMAS: f64 = 8.0;

/// The least error that is told, as a share of the signal.
const LEAST: f64 = 0.03;

/// Passes in which readings far from the line lose weight.
const PASSES: usize = 30;

/// The lamp during readings in time order, if their level drifts so that it limits the image.
pub(super) fn lamp(y: &[f64]) -> Option<Lamp> {
    if y.len() < FEWEST {
        return None;
    }
    let line = Line::of(y);
    let (first, second) = y.split_at(y.len() / 2);
    let is_steady = [first, second].iter().all(|half| {
        // Of half the length.
        2.0 * Line::of(half).slope * line.slope.signum() > OF_EACH_HALF * line.slope.abs()
    });
    if !is_steady || line.slope.abs() < SIGMAS * line.error || line.level <= 0.0 {
        return None;
    }
    let left = y.iter().enumerate().map(|(at, value)| value - line.at(at, y.len()));
    let signal = (left.map(|v| v * v).sum::<f64>() / y.len() as f64).sqrt();
    // The level moves by the slope, so its deviation is that of an even distribution.
    let is_told = line.slope.abs() / 12.0_f64.sqrt() > LEAST * signal;
    let (spread, drift) = (line.spread / line.level, line.slope.abs() / line.level);
    is_told.then_some(Lamp { by: Witness::Level, spread, drift, limits: true })
}

/// The line near which most readings lie.
struct Line {
    /// In the middle of the readings.
    level: f64,
    /// From the first to the last reading.
    slope: f64,
    /// Standard error of the slope.
    error: f64,
    /// Deviation of most readings from the line.
    spread: f64,
}

impl Line {
    /// By least squares with Cauchy's weights (P. J. Huber, *Robust Statistics*, 1981, 7): readings of coarse patterns, which
    /// are far from the line, hardly count.
    fn of(y: &[f64]) -> Self {
        let count = y.len();
        let mut line = Self { level: median(y.to_vec()), slope: 0.0, error: 0.0, spread: 0.0 };
        for _ in 0..PASSES {
            let off = |at: usize| y[at] - line.at(at, count);
            let spread = 1.4826 * median((0..count).map(|at| off(at).abs()).collect());
            let (mut sums, mut weights) = ([0.0; 4], 0.0);
            for (at, y) in y.iter().enumerate() {
                let far = if spread > 0.0 { off(at) / (2.0 * spread) } else { 0.0 };
                let (weight, x) = (1.0 / (1.0 + far * far), place(at, count));
                weights += weight;
                let terms = [x, x * x, *y, x * y];
                sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += weight * term);
            }
            let [x, xx, y, xy] = sums.map(|sum| sum / weights);
            let across = xx - x * x;
            let slope = (xy - x * y) / across;
            let error = spread / (weights * across).sqrt();
            line = Self { level: y - slope * x, slope, error, spread };
        }
        line
    }

    fn at(&self, at: usize, count: usize) -> f64 {
        self.level + self.slope * place(at, count)
    }
}

/// The place of a reading, from -1/2 to 1/2.
fn place(at: usize, count: usize) -> f64 {
    (at as f64 + 0.5) / count as f64 - 0.5
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::law::{Form, read};
    use crate::testing::{Noise, readings, scene, side};
    use crate::{Order, Rows};

    /// Readings of patterns alone, in shares of the all-on reading, under a lamp that drifts by this share.
    fn single(rows: &Rows, kind: u8, drift: f64, noise: f64) -> Vec<f64> {
        let image = scene(rows.side(), kind);
        let total: f64 = image.iter().sum();
        let noise = Noise::Normal { sigma: noise, seed: 3 };
        let count = rows.len() as f64;
        let all = readings(rows.side(), rows, &image);
        let of = |(at, y): (usize, &f64)| {
            noise.of(y / total * (1.0 + drift * at as f64 / count), at as u64) + 0.01
        };
        all.iter().step_by(2).enumerate().map(of).collect()
    }

    fn found(rows: &Rows, y: &[f64]) -> Option<Lamp> {
        read(rows, y, Form::Single.into()).unwrap().lamp
    }

    #[test]
    fn a_drift_is_told_where_it_limits_and_not_under_a_steady_lamp() {
        for order in ["natural", "walsh-2d", "zig-zag", "cake-cutting", "random:3"] {
            let order: Order = order.parse().unwrap();
            for n in [16, 32] {
                let rows = order.rows(side(n)).unwrap();
                for kind in 0..5 {
                    for noise in [0.0, 1e-3, 0.05] {
                        let y = single(&rows, kind, 0.0, noise);
                        assert_eq!(found(&rows, &y), None, "{order} {n} {kind} {noise}");
                    }
                }
                for (kind, drift) in [(1, 0.1), (2, -0.1), (1, 0.3)] {
                    // Readings of a figure with hard edges have no level on 16 x 16 pixels: few are near each other.
                    if (n, kind) == (16, 2) {
                        continue;
                    }
                    let lamp = found(&rows, &single(&rows, kind, drift, 1e-3)).unwrap();
                    let share = lamp.drift / f64::abs(drift);
                    assert!((0.8..1.1).contains(&share), "{order} {n} {kind}: {lamp:?}");
                    assert!(lamp.by == Witness::Level && lamp.limits);
                }
                // Less than the noise.
                assert_eq!(found(&rows, &single(&rows, 1, 0.01, 0.05)), None, "{order} {n}");
            }
        }
    }
}
