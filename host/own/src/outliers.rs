//! Measurements that no scene can have given beside the others.
//!
//! A pattern without a form of its own, such as a random one, collects light from everywhere. So its measurement is a sum of many
//! parts and lies about that of an even image as a normal number does, whatever the scene. One that lies far outside, such as a
//! reading with a wrong digit, is not of the scene. A pattern with a form, as a wave or a single pixel, may meet a scene of the
//! same form: its measurement is never called wrong.

use super::{OwnMatrix, energies};
use nalgebra::DVector;
use nirspi_recon::basis::{Basis, Transform};
use nirspi_recon::law::few;

/// A measurement at least this many standard deviations from the others is not of their scene. A normal number lies there with
/// a probability of 1e-15.
const FAR: f64 = 8.0;

/// Fewest measurements whose spread says something.
const FEWEST: usize = 32;

/// The largest energy of a formless pattern in one pixel or in one wave, as a multiple of the mean energy. Measurements of
/// a scene that is this pixel or wave alone then lie within 6.4 standard deviations. Of random patterns, the largest of 4096
/// such energies is about 16.
const LARGEST: f32 = 40.0;

/// Passes in which patterns with a form are found and set aside.
const PASSES: usize = 8;

/// What the patterns say of all measurements.
pub(super) struct Expected {
    /// Sum of the weights of each pattern: its measurement of an even image.
    sums: DVector<f64>,
    /// Norm of each pattern around its mean.
    contrasts: DVector<f64>,
}

impl Expected {
    pub(super) fn new(own: &OwnMatrix) -> Self {
        let area = own.size.area() as f64;
        let sums = own.patterns.column_sum();
        let contrast = |energy: f64, sum: f64| (energy - sum * sum / area).max(0.0).sqrt();
        let contrasts = energies(&own.patterns).zip_map(&sums, contrast);
        Self { sums, contrasts }
    }

    /// Numbers of the measurements that no scene can have given: a few at most. `dark`: a constant is part of each.
    pub(super) fn outliers(&self, own: &OwnMatrix, y: &[f64], dark: bool) -> Vec<usize> {
        let least = 1e-6 * self.contrasts.max();
        let mut judged: Vec<usize> = (0..y.len()).filter(|&k| self.contrasts[k] > least).collect();
        for _ in 0..PASSES {
            if judged.len() < FEWEST {
                break;
            }
            let far = self.far(y, &judged, dark);
            let (formless, formed): (Vec<usize>, Vec<usize>) =
                far.into_iter().partition(|&k| is_formless(own, k));
            if formed.is_empty() {
                return formless;
            }
            judged.retain(|k| !formed.contains(k));
        }
        Vec::new()
    }

    /// Those of the measurements with these numbers that lie far from the others.
    fn far(&self, y: &[f64], judged: &[usize], dark: bool) -> Vec<usize> {
        let most = few(judged.len());
        let mut order = judged.to_vec();
        let mut off = vec![0.0; y.len()];
        // The image is fitted without those that lie farthest from the image before.
        for inner in [0, most, most] {
            let (constant, even) = self.even_image(y, &order[inner..], dark);
            for &k in judged {
                off[k] = ((y[k] - constant - even * self.sums[k]) / self.contrasts[k]).abs();
            }
            order.sort_by(|&a, &b| off[b].total_cmp(&off[a]));
        }
        let (outer, inner) = order.split_at(most);
        let squares: f64 = inner.iter().map(|&k| off[k].powi(2)).sum();
        let far = FAR * (squares / inner.len() as f64).sqrt();
        let mut far: Vec<usize> = outer.iter().copied().filter(|&k| off[k] > far).collect();
        far.sort_unstable();
        far
    }

    /// The constant and the even image that fit the measurements with these numbers best.
    fn even_image(&self, y: &[f64], which: &[usize], dark: bool) -> (f64, f64) {
        let mean = |of: &dyn Fn(usize) -> f64| {
            which.iter().map(|&k| of(k)).sum::<f64>() / which.len() as f64
        };
        let (level, sum) = match dark {
            true => (mean(&|k| y[k]), mean(&|k| self.sums[k])),
            false => (0.0, 0.0),
        };
        let shared = mean(&|k| (y[k] - level) * (self.sums[k] - sum));
        let energy = mean(&|k| (self.sums[k] - sum).powi(2));
        // Patterns that see an even image alike do not tell it from the constant.
        let seen = energy > 1e-12 * mean(&|k| self.sums[k].powi(2));
        let even = if seen { shared / energy } else { 0.0 };
        (level - even * sum, even)
    }
}

/// Whether a pattern has no form: no pixel and no wave has much of its contrast.
fn is_formless(own: &OwnMatrix, k: usize) -> bool {
    let row = own.patterns.row(k);
    let largest = row.amax();
    let mut pattern: Vec<f32> = row.iter().map(|weight| (weight / largest) as f32).collect();
    let area = pattern.len();
    let mean = pattern.iter().sum::<f32>() / area as f32;
    pattern.iter_mut().for_each(|weight| *weight -= mean);
    let is_even = |pattern: &[f32]| {
        let energy: f32 = pattern.iter().map(|value| value * value).sum();
        pattern.iter().all(|value| value * value * area as f32 <= LARGEST * energy)
    };
    if !is_even(&pattern) {
        return false;
    }
    let Some(transform) = Transform::of_size(Basis::Dct, own.size) else { return false };
    transform.analyse(&mut pattern);
    is_even(&pattern)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::LiveMatrix;
    use crate::testing::{binary_patterns, scene, side};
    use nirspi_recon::reconstruct::{MatrixMethod, MatrixSettings};
    use nirspi_recon::{Image, Side};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    fn correlation(image: &Image<nirspi_recon::Size>, truth: &[f64]) -> f64 {
        let truth: Vec<f32> = truth.iter().map(|&v| v as f32).collect();
        nirspi_recon::metrics::correlation(image.pixels(), &truth, 16, 16).unwrap()
    }

    #[test]
    fn a_reading_with_a_wrong_digit_is_left_out_and_named() {
        let mut random = Pcg64::seed_from_u64(2);
        for kind in [1, 2] {
            let truth = scene(side(16), kind);
            let (weights, mut y) = binary_patterns(200, &truth, 0.05, 3);
            let signs: Vec<f64> = weights.iter().map(|w| 2.0 * w - 1.0).collect();
            let own = OwnMatrix::new(side(16), &weights).unwrap();
            let clear = y.clone();
            y[17] *= 8.0;
            y[130] = 0.0;
            let settings = MatrixSettings::new(MatrixMethod::Best);
            let found = own.reconstruct(&y, &settings).unwrap();
            assert_eq!(found.outliers, [17, 130], "scene {kind}");
            let live = LiveMatrix::new(own.clone(), settings.clone(), 3).image(&y).unwrap();
            assert_eq!(live, found, "a live view leaves them out as well");
            let right = own.reconstruct(&clear, &settings).unwrap();
            assert!(right.outliers.is_empty());
            let [found, right] = [found, right].map(|made| correlation(&made.image, &truth));
            assert!(found > right - 0.02, "scene {kind}: {found}, {right}");
            // Patterns of both signs have measurements about 0.
            let own = OwnMatrix::new(side(16), &signs).unwrap();
            let mut y: Vec<f64> = signs
                .chunks(256)
                .map(|row| row.iter().zip(&truth).map(|(w, v)| w * v).sum::<f64>())
                .collect();
            assert!(own.reconstruct(&y, &settings).unwrap().outliers.is_empty());
            let spread = (y.iter().map(|y| y * y).sum::<f64>() / 200.0).sqrt();
            y[40] += 12.0 * spread * if random.random::<bool>() { 1.0 } else { -1.0 };
            assert_eq!(own.reconstruct(&y, &settings).unwrap().outliers, [40], "scene {kind}");
        }
    }

    fn waves(side: Side) -> Vec<f64> {
        let transform = Transform::of_size(Basis::Dct, side.into()).unwrap();
        (0..side.area())
            .flat_map(|j| {
                let mut wave = vec![0.0; side.area()];
                wave[j] = 1.0;
                transform.synthesise(&mut wave);
                wave.into_iter().map(f64::from)
            })
            .collect()
    }

    #[test]
    fn patterns_with_a_form_may_meet_a_scene_of_that_form() {
        let side = side(16);
        let waves = waves(side);
        // A scene that is one wave, pixel by pixel and wave by wave; a point; few lit pixels in patterns that light few.
        let wave: Vec<f64> = waves[37 * 256..38 * 256].iter().map(|w| 1.0 + w).collect();
        let pixels: Vec<f64> = (0..256 * 256).map(|at| f64::from(at / 256 == at % 256)).collect();
        let mut random = Pcg64::seed_from_u64(3);
        let sparse: Vec<f64> =
            (0..200 * 256).map(|_| f64::from(u8::from(random.random_bool(0.06)))).collect();
        for patterns in [&waves, &pixels, &sparse] {
            let own = OwnMatrix::new(side, patterns).unwrap();
            for truth in [&wave, &scene(side, 3), &scene(side, 2), &scene(side, 4)] {
                let y: Vec<f64> = patterns
                    .chunks(256)
                    .map(|row| row.iter().zip(truth).map(|(w, v)| w * v).sum::<f64>())
                    .collect();
                for dark in [true, false] {
                    let found = Expected::new(&own).outliers(&own, &y, dark);
                    assert!(found.is_empty(), "{found:?}");
                }
            }
        }
    }
}
