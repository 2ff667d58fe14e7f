//! What one sweep says of itself: the noise of a reading, and how fast the scene's amplitudes fall
//! with the frequency.
//!
//! Fine measured rows hold noise and detail of the scene. Their size alone is an upper bound of the
//! noise: 17 % of white for a natural scene without any noise, of which the coarsest tenth of the
//! patterns was measured. What tells the two apart is that detail of a scene can be predicted from
//! other rows, and noise cannot. The model is the one of Tikhonov's method: the scene's cosines are
//! independent and normal, with amplitudes `s[j]` that fall as a power of the frequency, so that the
//! measured rows have the covariance `a K + sigma^2 I`, `K = A diag(s^2) A^T`. Powers and noises are
//! weighted by how likely they make the readings (D. J. C. MacKay, *Bayesian Interpolation*, 1992).
//! The estimate is cautious: the noise is larger than that with a probability of 9 in 10. Few
//! readings do not tell one noise from another, and too small an estimate keeps some noise, but too
//! large a one throws readings away.
//!
//! Where patterns were shown with their complements, the sums of pairs say what the noise is at most
//! (`law::pairs`). Then the estimate is the largest noise that both the sums and the readings allow:
//! 200 of 1024 photon counts, which alone fit a scene without noise as well, have the noise that all
//! of them have.
//!
//! With `l = sigma^2 / a` the logarithm of the likelihood of the best `a` is, up to a constant,
//! `-(M ln(y^T (K + l I)^-1 y) + ln det(K + l I)) / 2`. Both terms are sums over the eigenvalues of
//! `K`, which [`quadrature`](crate::quadrature) finds for every `l` at once: from `y` for the first, from random signs for the
//! second.

use crate::basis::{Basis, Transform};
use crate::measurements::Kind;
use crate::quadrature::{Quadrature, quadrature, signs};
use crate::{Measurements, Rows, fwht, order};

/// The fewest rows that are held against the model. Of fewer, any noise is as likely as any other.
const LEAST_ROWS: usize = 32;

/// Powers of the frequency with which amplitudes may fall.
const FALLOFFS: [f32; 4] = [0.75, 1.0, 1.25, 1.5];

/// Probability that the noise is smaller than the estimate.
const CAUTION: f64 = 0.1;

/// Noise over that of the quiet rows and pixels that is allowed: bright, coarse patterns may have more
/// noise than fine ones, as photons do.
const SLACK: f32 = 1.25;

/// Ratios of noise to scene to try: powers of ten, this many a decade, as variances.
const RATIOS: (i32, i32, i32) = (-6, 2, 4);

/// Standard deviation of the noise of one value of a measurement, in the values' units: what the
/// camera measured ([`Measurements::noise`]), else an estimate from the values.
///
/// The estimate takes texture for noise where both look alike, as in a tenth of the patterns or
/// fewer. With fewer than 32 rows it is 0.
#[must_use]
pub fn estimated_noise(measurements: &Measurements) -> f64 {
    let known = measurements.noise().or(measurements.kind().map(|kind| kind.noise));
    known.unwrap_or_else(|| estimated(measurements).noise)
}

/// What one measurement says of itself.
pub(super) fn estimated(measurements: &Measurements) -> Kind {
    let largest = measurements.values().iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    if largest == 0.0 {
        return Kind { noise: 0.0, falloff: 1.0 };
    }
    let values: Vec<f32> = measurements.values().iter().map(|v| (v / largest) as f32).collect();
    let most = measurements.most_noise().map(|most| most / largest);
    let Statistics { noise, falloff } = Statistics::of(measurements.rows(), &values, most);
    Kind { noise: f64::from(noise) * largest, falloff }
}

/// An upper bound of the noise of one measurement.
pub(super) fn most(measurements: &Measurements) -> f64 {
    // Such values are far from the limits of 32-bit floats, as in `estimated`.
    let largest = measurements.values().iter().fold(f64::MIN_POSITIVE, |m, v| m.max(v.abs()));
    let values: Vec<f32> = measurements.values().iter().map(|v| (v / largest) as f32).collect();
    f64::from(SLACK * of_the_quiet(measurements.rows(), &values)) * largest
}

/// What readings say of their noise and of the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Statistics {
    /// Standard deviation of the noise of a reading, in the readings' units.
    pub noise: f32,
    /// Power of the frequency with which amplitudes fall.
    pub falloff: f64,
}

impl Statistics {
    /// The statistics of readings of which the largest is about 1. `most` is what the noise is at most by
    /// other evidence.
    pub fn of(rows: &Rows, values: &[f32], most: Option<f64>) -> Self {
        let mut tried = Vec::new();
        for falloff in FALLOFFS {
            let Some(evidence) = Evidence::new(rows, values, falloff) else {
                return Self { noise: 0.0, falloff: 1.0 };
            };
            tried.extend(evidence.all().map(|likelihood| (likelihood, f64::from(falloff))));
        }
        let highest = tried.iter().fold(f64::NEG_INFINITY, |most, (l, _)| most.max(l.logarithm));
        let weight = |likelihood: &Likelihood| (likelihood.logarithm - highest).exp();
        let sum: f64 = tried.iter().map(|(likelihood, _)| weight(likelihood)).sum();
        let falloff = tried.iter().map(|(l, falloff)| weight(l) * falloff).sum::<f64>() / sum;
        tried.sort_by(|(a, _), (b, _)| a.variance.total_cmp(&b.variance));
        // The true noise is smaller than this with the probability.
        let at = |probability: f64| {
            let mut below = 0.0;
            let found = tried.iter().find(|(likelihood, _)| {
                below += weight(likelihood);
                below >= probability * sum
            });
            found.map_or(0.0, |(l, _)| l.variance.sqrt())
        };
        let least = at(CAUTION);
        let noise = most.map_or(least, |most| most.min(at(1.0 - CAUTION))) as f32;
        Self { noise: noise.min(SLACK * of_the_quiet(rows, values)), falloff }
    }
}

/// An upper bound of the noise of a reading: the quiet ones of the finer half of the rows, and the
/// quiet pixels of their image. Noise is in all rows and in all pixels. Edges of a scene, which no
/// power of the frequency expects, are in few rows or in few pixels.
fn of_the_quiet(rows: &Rows, values: &[f32]) -> f32 {
    let positions = order::positions_by_sequency(rows);
    let fine = &positions[positions.len() / 2..];
    let by_rows = deviation(fine.iter().map(|&k| values[k]), 0.25, 0.318_639);
    let mut grid = vec![0.0; rows.side().area()];
    for &k in fine {
        grid[rows[k] as usize] = values[k];
    }
    fwht::transform(&mut grid);
    // The transform of `fine.len()` values of equal deviation has that many times their variance.
    let by_pixels = deviation(grid.into_iter(), 0.1, 0.125_661) / (fine.len().max(1) as f32).sqrt();
    by_rows.min(by_pixels)
}

/// Standard deviation of normal values by a quantile of their magnitudes, `expected` being that
/// quantile for a deviation of 1.
fn deviation(values: impl Iterator<Item = f32>, quantile: f64, expected: f32) -> f32 {
    let mut magnitudes: Vec<f32> = values.map(f32::abs).collect();
    let at = (quantile * magnitudes.len() as f64) as usize;
    if magnitudes.is_empty() {
        return 0.0;
    }
    *magnitudes.select_nth_unstable_by(at, f32::total_cmp).1 / expected
}

/// How likely a noise makes the readings.
struct Likelihood {
    /// Variance of the noise.
    variance: f64,
    /// Logarithm of the likelihood, up to a constant.
    logarithm: f64,
}

/// What is known of the readings of some rows, the mean left out.
struct Evidence {
    count: f64,
    readings: Quadrature,
    probes: Vec<Quadrature>,
}

impl Evidence {
    fn new(rows: &Rows, values: &[f32], falloff: f32) -> Option<Self> {
        let covariance = Covariance::new(rows, falloff);
        if covariance.count < LEAST_ROWS {
            return None;
        }
        let mut readings = vec![0.0; covariance.mask.len()];
        for (&row, &value) in rows.iter().zip(values) {
            readings[row as usize] = value * covariance.mask[row as usize];
        }
        let of = |start| quadrature(start, covariance.count, |rows| covariance.times(rows));
        let (readings, probes) = (of(readings)?, signs(&covariance.mask).filter_map(of).collect());
        Some(Self { count: covariance.count as f64, readings, probes })
    }

    /// One ratio of noise to scene, with the likeliest scene.
    fn of(&self, ratio: f64) -> Likelihood {
        let scene = self.readings.energy * self.readings.mean(|v| 1.0 / (v + ratio)) / self.count;
        let determinants: f64 =
            self.probes.iter().map(|probe| probe.mean(|v| (v + ratio).ln())).sum();
        let determinant = self.count * determinants / self.probes.len() as f64;
        Likelihood {
            variance: ratio * scene,
            logarithm: -0.5 * (self.count * scene.ln() + determinant),
        }
    }

    fn all(self) -> impl Iterator<Item = Likelihood> {
        let (lowest, highest, a_decade) = RATIOS;
        (lowest * a_decade..=highest * a_decade)
            .map(move |step| self.of(10.0_f64.powf(f64::from(step) / f64::from(a_decade))))
    }
}

/// The covariance `K` of the measured rows of a scene, with a mean diagonal of 1.
struct Covariance {
    side: usize,
    transform: Transform,
    /// 1 at measured rows except the mean, else 0.
    mask: Vec<f32>,
    count: usize,
    /// Expected square of each cosine.
    variance: Vec<f32>,
}

impl Covariance {
    fn new(rows: &Rows, falloff: f32) -> Self {
        let side = rows.side();
        let transform = Transform::new(Basis::Dct, side);
        let mut mask = vec![0.0; side.area()];
        for &row in rows.iter().filter(|row| **row != 0) {
            mask[row as usize] = 1.0;
        }
        let count = rows.iter().filter(|row| **row != 0).count();
        let frequencies = Basis::Dct.frequencies(side);
        let mut variance: Vec<f32> =
            frequencies.iter().map(|f| f.max(1.0).powf(-2.0 * falloff)).collect();
        let seen = crate::omp::sampled::visible_energy(&transform, &mask);
        let diagonal: f32 = seen.iter().zip(&variance).map(|(seen, v)| seen * v).sum();
        if diagonal > 0.0 {
            let scale = count as f32 / diagonal;
            variance.iter_mut().for_each(|v| *v *= scale);
        }
        Self { side: side.pixels(), transform, mask, count, variance }
    }

    /// `K` times a vector, by row.
    fn times(&self, rows: &[f32]) -> Vec<f32> {
        let n = self.side as f32;
        let walsh = |grid: &mut Vec<f32>| {
            fwht::transform(grid);
            grid.iter_mut().for_each(|v| *v /= n);
        };
        let mut grid = rows.to_vec();
        walsh(&mut grid);
        self.transform.analyse(&mut grid);
        grid.iter_mut().zip(&self.variance).for_each(|(v, variance)| *v *= variance);
        self.transform.synthesise(&mut grid);
        walsh(&mut grid);
        grid.iter_mut().zip(&self.mask).for_each(|(v, mask)| *v *= mask);
        grid
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Order;
    use crate::testing::{noisy, scene, side};

    /// The estimate for a scene's readings by a share of the patterns. The noise is that of a pixel
    /// of the image of all patterns.
    fn estimate(kind: u8, noise: f64, share: f64) -> f64 {
        let rows = Order::ZigZag.rows(side(32)).unwrap();
        let all = noisy(&rows, &scene(side(32), kind), 32.0 * noise, 3);
        estimated_noise(&all.take(None, share).unwrap()) / 32.0
    }

    fn of_noise_alone(factor: f64) -> Measurements {
        let rows = Order::ZigZag.rows(side(16)).unwrap();
        let values: Vec<f64> =
            noisy(&rows, &[0.0; 256], 3.0, 1).values().iter().map(|v| v * factor).collect();
        Measurements::from_differential(&rows, &values).unwrap()
    }

    #[test]
    fn noise_is_found_and_texture_is_not_called_noise() {
        for kind in [1, 2] {
            for share in [0.1, 0.3, 0.5, 1.0] {
                let quiet = estimate(kind, 0.0, share);
                assert!(quiet < 0.01, "kind {kind}, {share}: {quiet}");
                for noise in [0.05, 0.2] {
                    // Few readings tell little, and edges hide noise: the estimate is cautious, or has
                    // some of the edges in it.
                    let tells = kind == 1 && share == 1.0;
                    let (least, most) = if tells { (0.7, 1.4) } else { (0.0, 2.6) };
                    let found = estimate(kind, noise, share) / noise;
                    assert!(
                        (least..most).contains(&found),
                        "kind {kind}, {share}, {noise}: {found}"
                    );
                }
            }
        }
    }

    #[test]
    fn sums_of_pairs_tell_the_noise_of_few_patterns() {
        let rows = Order::ZigZag.rows(side(32)).unwrap();
        for (kind, share, least) in [(1, 0.15, 0.3), (1, 0.3, 0.15), (2, 0.3, 0.6), (2, 0.5, 1.0)] {
            for noise in [0.05, 0.1] {
                let readings = noisy(&rows, &scene(side(32), kind), 32.0 * noise, 3);
                let part = readings.take(None, share).unwrap();
                let told = part.clone().with_most_noise(Some(1.2 * 32.0 * noise));
                let [alone, told] = [part, told].map(|part| estimated_noise(&part) / 32.0 / noise);
                let said = format!("kind {kind}, {share}, {noise}: {alone}, {told}");
                assert!((least..1.21).contains(&told), "{said}");
                // Edges that alone look like noise are not more than the sums allow.
                assert!(told >= alone.min(1.2), "{said}");
            }
        }
        // What the readings do not allow, a lamp that flickers does not make noise.
        let quiet = noisy(&rows, &scene(side(32), 1), 0.0, 3);
        let flickers = quiet.with_most_noise(Some(32.0 * 0.2));
        assert!(estimated_noise(&flickers) < 32.0 * 0.02, "{}", estimated_noise(&flickers));
    }

    #[test]
    fn readings_of_nothing_are_all_noise() {
        let found = estimated_noise(&of_noise_alone(1.0));
        assert!((2.5..3.5).contains(&found), "{found}");
    }

    #[test]
    fn what_the_camera_measured_counts_and_units_do_not_matter() {
        let part = of_noise_alone(1.0);
        assert_eq!(estimated_noise(&part.clone().with_noise(0.25).unwrap()), 0.25);
        let ratio = estimated_noise(&of_noise_alone(1e9)) / estimated_noise(&part) / 1e9;
        assert!((ratio - 1.0).abs() < 1e-3, "{ratio}");
        let few = part.take(None, 0.1).unwrap();
        assert_eq!(estimated_noise(&few), 0.0);
        let dark = Measurements::from_differential(part.rows(), &[0.0; 256]).unwrap();
        assert_eq!(estimated_noise(&dark), 0.0);
    }
}
