//! The noise of measurements by a user's own patterns, where they tell it: by patterns that the matrix holds several times,
//! or by measurements of one scene.
//!
//! What differs between two measurements of one scene is noise, and no image explains it. So a difference that coarse images
//! explain better than noise would be is one of scenes, and says nothing of the noise.

use super::OwnMatrix;
use nalgebra::{DMatrix, DVector};
use nirspi_recon::basis::{Basis, Transform};
use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};

/// What is known of the noise of a measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownNoise {
    /// Its standard deviation, in the measurements' units.
    pub sigma: f64,
    /// What says so.
    pub from: NoiseFrom,
}

/// What says how large the noise of a measurement is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoiseFrom {
    /// Who took the measurement.
    Stated,
    /// Patterns that are in the matrix several times.
    SamePatterns,
    /// Several measurements of one scene.
    SameScene,
}

impl NoiseFrom {
    /// The source in a few words.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Stated => "stated with the readings",
            Self::SamePatterns => "patterns shown several times",
            Self::SameScene => "measurements of one scene",
        }
    }
}

/// Fewest degrees of freedom that tell a noise: to a quarter.
const LEAST_FREEDOM: usize = 8;

/// Coarsest images that tell a change of the scene.
const COARSE: usize = 16;

/// Patterns for each of them, at least.
const PATTERNS_EACH: usize = 4;

/// How many times more of a difference a coarse image may explain than noise would. Noise alone passes this with a
/// probability of 1 in 10 000.
const MOST_EXPLAINED: f64 = 3.0;

/// How many times brighter one measurement of a scene may be than the next.
const MOST_GAIN: f64 = 2.0;

impl OwnMatrix {
    /// The noise of these measurements, if they tell it; each has one number for each pattern. It is the same for all.
    ///
    /// # Panics
    /// If a measurement has another length.
    #[must_use]
    pub fn known_noise(&self, all: &[&[f64]]) -> Option<KnownNoise> {
        let of = |from| move |variance: f64| KnownNoise { sigma: variance.sqrt(), from };
        let by_patterns = || self.variance_of_same_patterns(all).map(of(NoiseFrom::SamePatterns));
        by_patterns().or_else(|| self.variance_of_same_scene(all).map(of(NoiseFrom::SameScene)))
    }

    fn variance_of_same_patterns(&self, all: &[&[f64]]) -> Option<f64> {
        let same = self.same_patterns();
        let freedom: usize = same.iter().map(|places| places.len() - 1).sum();
        if freedom * all.len() < LEAST_FREEDOM {
            return None;
        }
        let squares = |y: &&[f64]| -> f64 {
            let of = |places: &Vec<usize>| {
                let mean = places.iter().map(|&k| y[k]).sum::<f64>() / places.len() as f64;
                places.iter().map(|&k| (y[k] - mean).powi(2)).sum::<f64>()
            };
            same.iter().map(of).sum()
        };
        Some(all.iter().map(squares).sum::<f64>() / (freedom * all.len()) as f64)
    }

    /// The places of each pattern that is in the matrix several times.
    fn same_patterns(&self) -> Vec<Vec<usize>> {
        let mut hashes: Vec<DefaultHasher> = Vec::new();
        hashes.resize_with(self.patterns(), DefaultHasher::new);
        for column in self.patterns.column_iter() {
            for (hash, weight) in hashes.iter_mut().zip(column.iter()) {
                // 0 and -0 are one weight.
                (weight + 0.0).to_bits().hash(hash);
            }
        }
        let mut places: HashMap<u64, Vec<usize>> = HashMap::new();
        for (place, hash) in hashes.iter().enumerate() {
            places.entry(hash.finish()).or_default().push(place);
        }
        let mut same: Vec<Vec<usize>> =
            places.into_values().filter(|places| places.len() > 1).collect();
        same.sort_unstable();
        same
    }

    fn variance_of_same_scene(&self, all: &[&[f64]]) -> Option<f64> {
        let pairs = all.len().checked_sub(1).filter(|pairs| *pairs > 0)?;
        let coarse = self.seen_of_coarse_images()?;
        let variances: Vec<f64> =
            all.windows(2).filter_map(|two| variance_of_change(&coarse, two[0], two[1])).collect();
        let count = variances.len();
        (2 * count >= pairs).then(|| variances.iter().sum::<f64>() / count as f64)
    }

    /// Orthonormal directions of the measurements of an even image, of the coarsest images and of a dark level; `None` for
    /// too few patterns.
    fn seen_of_coarse_images(&self) -> Option<DMatrix<f64>> {
        if self.patterns() < PATTERNS_EACH * (COARSE + 1) {
            return None;
        }
        let transform = Transform::of_size(Basis::Dct, self.size)?;
        let frequencies = Basis::Dct.frequencies(self.size);
        let mut coarse: Vec<usize> = (0..frequencies.len()).collect();
        coarse.sort_by(|&a, &b| frequencies[a].total_cmp(&frequencies[b]));
        let mut seen = DMatrix::from_element(self.patterns(), COARSE + 1, 1.0);
        for (at, &j) in coarse.iter().take(COARSE).enumerate() {
            let mut image = vec![0.0_f32; frequencies.len()];
            image[j] = 1.0;
            transform.synthesise(&mut image);
            let image = DVector::from_iterator(image.len(), image.into_iter().map(f64::from));
            seen.set_column(at + 1, &(&self.patterns * image));
        }
        Some(seen.qr().q())
    }
}

/// The variance of a measurement, by the next one of the same scene; `None` if the scenes differ.
fn variance_of_change(coarse: &DMatrix<f64>, one: &[f64], next: &[f64]) -> Option<f64> {
    let without_mean = |y: &[f64]| {
        let y = DVector::from_column_slice(y);
        let mean = y.mean();
        y.add_scalar(-mean)
    };
    let (one, next) = (without_mean(one), without_mean(next));
    // Another lamp is no noise. By the norms, noise does not change the gain as it changes a slope.
    let gain = next.norm() / one.norm();
    if !(MOST_GAIN.recip()..=MOST_GAIN).contains(&gain) {
        return None;
    }
    let change = next - &one * gain;
    let explained = coarse.tr_mul(&change).norm_squared();
    let left = (change.norm_squared() - explained).max(0.0) / (change.len() - COARSE - 1) as f64;
    (explained <= MOST_EXPLAINED * COARSE as f64 * left).then(|| left / (1.0 + gain * gain))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{normal, scene, side};
    use nirspi_recon::reconstruct::{MatrixMethod, MatrixSettings, Penalty};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    const COUNT: usize = 150;

    fn patterns(random: &mut Pcg64) -> Vec<f64> {
        (0..COUNT * 256).map(|_| f64::from(u8::from(random.random::<bool>()))).collect()
    }

    fn see(weights: &[f64], image: &[f64], noise: f64, random: &mut Pcg64) -> Vec<f64> {
        let reading = |row: &[f64]| row.iter().zip(image).map(|(w, v)| w * v).sum::<f64>();
        weights.chunks(256).map(|row| 5.0 + reading(row) + noise * normal(random)).collect()
    }

    #[test]
    fn measurements_of_one_scene_tell_their_noise_and_other_scenes_do_not() {
        let mut random = Pcg64::seed_from_u64(4);
        let weights = patterns(&mut random);
        let own = OwnMatrix::new(side(16), &weights).unwrap();
        for noise in [0.3, 3.0, 30.0] {
            let mut all: Vec<Vec<f64>> =
                (0..6).map(|_| see(&weights, &scene(side(16), 1), noise, &mut random)).collect();
            // A lamp that has become brighter.
            all[4].iter_mut().for_each(|y| *y *= 1.3);
            let all: Vec<&[f64]> = all.iter().map(Vec::as_slice).collect();
            let found = own.known_noise(&all).unwrap();
            assert_eq!(found.from, NoiseFrom::SameScene);
            assert!((found.sigma / noise - 1.0).abs() < 0.15, "{noise}: {}", found.sigma);
            assert_eq!(own.known_noise(&all[..1]), None);
        }
        let others: Vec<Vec<f64>> =
            (0..4).map(|kind| see(&weights, &scene(side(16), kind), 0.3, &mut random)).collect();
        let others: Vec<&[f64]> = others.iter().map(Vec::as_slice).collect();
        assert_eq!(own.known_noise(&others), None);
        let few = OwnMatrix::new(side(16), &weights[..60 * 256]).unwrap();
        let short: Vec<&[f64]> = others.iter().map(|y| &y[..60]).collect();
        assert_eq!(few.known_noise(&short), None);
    }

    #[test]
    fn patterns_that_are_shown_several_times_tell_the_noise_of_one_measurement() {
        let mut random = Pcg64::seed_from_u64(5);
        let mut weights = patterns(&mut random);
        for k in 0..20 {
            weights.copy_within(3 * k * 256..(3 * k + 1) * 256, (100 + k) * 256);
        }
        let own = OwnMatrix::new(side(16), &weights).unwrap();
        let y = see(&weights, &scene(side(16), 1), 2.0, &mut random);
        let found = own.known_noise(&[&y]).unwrap();
        assert_eq!(found.from, NoiseFrom::SamePatterns);
        assert!((found.sigma / 2.0 - 1.0).abs() < 0.4, "{}", found.sigma);
        let few = OwnMatrix::new(side(16), &weights[..105 * 256]).unwrap();
        assert_eq!(few.known_noise(&[&y[..105]]), None);
    }

    /// Mean squared error of the images of a scene with this noise, without and with its being known.
    fn errors(method: MatrixMethod, noise: f64) -> [f64; 2] {
        let mut random = Pcg64::seed_from_u64(6);
        let mut sums = [0.0; 2];
        for kind in 0..3 {
            let (weights, image) = (patterns(&mut random), scene(side(16), kind));
            let own = OwnMatrix::new(side(16), &weights).unwrap();
            let clear = see(&weights, &image, 0.0, &mut random);
            let mean = clear.iter().sum::<f64>() / COUNT as f64;
            let spread = clear.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / COUNT as f64;
            let sigma = noise * spread.sqrt();
            let y: Vec<f64> = clear.iter().map(|y| y + sigma * normal(&mut random)).collect();
            for (sum, noise) in sums.iter_mut().zip([None, Some(sigma)]) {
                let settings = MatrixSettings { noise, ..MatrixSettings::new(method) };
                let found = own.reconstruct(&y, &settings).unwrap();
                let missed = found.image.pixels().iter().zip(&image);
                *sum += missed.map(|(a, b)| (f64::from(*a) - b).powi(2)).sum::<f64>();
            }
        }
        sums
    }

    #[test]
    fn readings_of_little_light_count_less_where_their_noise_is_known() {
        let method = MatrixMethod::Penalty(Penalty::Tikhonov);
        for (noise, most) in [(1.0, 0.9), (0.3, 0.95), (0.02, 1.05)] {
            let [unknown, known] = errors(method, noise);
            assert!(known < most * unknown, "{noise}: {known}, {unknown}");
        }
        // The noise of a method that does not weigh it changes nothing.
        let [unknown, known] = errors(MatrixMethod::Penalty(Penalty::TotalVariation), 1.0);
        assert_eq!(known, unknown);
        let weights = patterns(&mut Pcg64::seed_from_u64(6));
        let own = OwnMatrix::new(side(16), &weights).unwrap();
        for (method, weighs) in
            [(method, true), (MatrixMethod::Best, true), (MatrixMethod::Omp, false)]
        {
            assert_eq!(own.weighs_noise(&MatrixSettings::new(method)), weighs, "{method:?}");
        }
    }
    /// As many orthogonal patterns as pixels have a way of their own. Whatever the size of the weights, the known noise chooses
    /// a strength about as good as the best of all, which only the truth tells.
    #[test]
    fn a_known_noise_is_as_good_for_complete_sets_as_the_best_strength() {
        let mut random = Pcg64::seed_from_u64(7);
        let method = MatrixMethod::Penalty(Penalty::Tikhonov);
        for weight in [1.0, 3.0] {
            let sign = |at: usize| ((at / 256) & (at % 256)).count_ones().is_multiple_of(2);
            let weights: Vec<f64> =
                (0..256 * 256).map(|at| if sign(at) { weight } else { -weight }).collect();
            let own = OwnMatrix::new(side(16), &weights).unwrap();
            for (kind, noise) in [(0, 4.0), (1, 12.0), (2, 12.0)] {
                let image = scene(side(16), kind);
                let sigma = noise * weight;
                let y = see(&weights, &image, sigma, &mut random);
                let error = |noise: Option<f64>, strength: Option<f64>| {
                    let settings =
                        MatrixSettings { noise, strength, ..MatrixSettings::new(method) };
                    let found = own.reconstruct(&y, &settings).unwrap();
                    let missed = found.image.pixels().iter().zip(&image);
                    missed.map(|(a, b)| (f64::from(*a) - b).powi(2)).sum::<f64>()
                };
                let known = error(Some(sigma), None);
                let strengths = (-24..=12).map(|power| 10_f64.powf(f64::from(power) / 4.0));
                let best = strengths.map(|strength| error(None, Some(strength)));
                let best = best.fold(f64::INFINITY, f64::min);
                println!("weights {weight}, scene {kind}, noise {noise}: {:.3}", known / best);
                assert!(known < 1.5 * best, "{weight}, {kind}, {noise}: {known}, {best}");
            }
        }
    }
}
