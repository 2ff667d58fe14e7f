//! The camera as a chain of formulas: blur, scatter, sampling by patterns, leak, noise,
//! quantisation.
//!
//! Degradations come in the order of the real camera. Noise is added to the pattern readings, so
//! partial sampling and leak affect it as in the real camera.

use super::{DEPTH_SIDE, Degrade, DegradeError, Depth, READING_PX, Reading, sampled};
use crate::blur::Blur;
use crate::data::{AREA_PX, SIDE_PX};
use nirspi_recon::{Order, Rows, Side, fwht};
use rand::RngExt;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use std::ops::RangeInclusive;

/// Limits of the degradations, from which each picture draws.
#[derive(Debug, Clone, PartialEq)]
pub struct Limits {
    /// Standard deviation of a Gaussian blur, in pixels of the 64 x 64 grid.
    pub sigma_px: RangeInclusive<f32>,
    /// Noise of a fully sampled image.
    pub noise_std: RangeInclusive<f32>,
    /// Share of the patterns that are shown, for a partially sampled picture.
    pub sampling: RangeInclusive<f32>,
    /// Share of the pictures that are partially sampled.
    pub partial: f32,
    /// Largest share of the light that is scattered forward.
    pub scattered: f32,
    /// Largest share of the previous pattern's reading in a reading.
    pub leak: f32,
    /// Largest error of the brightness scale and of its zero.
    pub scale_error: f32,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            sigma_px: 0.3..=4.0,
            noise_std: 0.0..=0.08,
            sampling: 0.25..=1.0,
            partial: 0.3,
            scattered: 0.1,
            leak: 0.02,
            scale_error: 0.03,
        }
    }
}

impl Limits {
    fn validate(&self) -> Result<(), DegradeError> {
        let ranges = [
            ("blur", &self.sigma_px, 8.0, "0 to 8 pixels"),
            ("noise", &self.noise_std, 1.0, "0 to 1"),
            ("sampling", &self.sampling, 1.0, "0 to 1"),
        ];
        for (name, range, most, expected) in ranges {
            let (from, to) = (*range.start(), *range.end());
            if !(from >= 0.0 && from <= to && to <= most) {
                let (from, to) = (from.to_string(), to.to_string());
                return Err(DegradeError::Limit { name, from, to, expected });
            }
        }
        Ok(())
    }
}

/// Distance over which scattered light spreads, in pixels.
const SCATTER_PX: RangeInclusive<f32> = 6.0..=14.0;
/// Bits of a pattern's reading: 14 of the ADC, less the range for daylight and headroom, plus the
/// gain of summing.
const BITS: RangeInclusive<f32> = 10.0..=16.0;
/// Share of the pictures without depth, and share of the zones without depth in the others.
const NO_DEPTH: f32 = 0.3;
const INVALID_ZONES: f32 = 0.1;
/// Noise of a zone, in metres.
const DEPTH_NOISE_M: f32 = 0.005;

/// A camera made of formulas.
#[derive(Debug, Clone)]
pub struct AnalyticCamera {
    limits: Limits,
    /// Rows of the orders whose first patterns contain most of a scene.
    orders: Vec<Rows>,
}

impl AnalyticCamera {
    /// A camera that degrades within these limits.
    ///
    /// # Errors
    /// [`DegradeError::Limit`] names the range that is not valid.
    pub fn new(limits: Limits) -> Result<Self, DegradeError> {
        limits.validate()?;
        let orders = [Order::CakeCutting, Order::ZigZag, Order::Sequency, Order::TotalVariation]
            .iter()
            .map(|order| order.rows(Side::INSTRUMENT))
            .collect::<Result<_, _>>()
            .map_err(|error| DegradeError::Camera(error.to_string()))?;
        Ok(Self { limits, orders })
    }
}

impl Degrade for AnalyticCamera {
    fn degrade(&self, scene: &[f32], rng: &mut Pcg64Mcg) -> Result<Reading, DegradeError> {
        if scene.len() != AREA_PX {
            return Err(DegradeError::Shape { found: scene.len() });
        }
        let limits = &self.limits;
        let sigma_px = rng.random_range(limits.sigma_px.clone());
        let blurred = |sigma_px| Blur::new(SIDE_PX, SIDE_PX, sigma_px).apply(scene);
        let mut optical = blurred(sigma_px);
        if rng.random() {
            let share = limits.scattered * rng.random::<f32>();
            let veil = blurred(rng.random_range(SCATTER_PX));
            optical.iter_mut().zip(veil).for_each(|(v, wide)| *v += share * (wide - *v));
        }

        let noise = rng.random_range(limits.noise_std.clone());
        let partial = rng.random::<f32>() < limits.partial;
        let sampling = if partial { rng.random_range(limits.sampling.clone()) } else { 1.0 };
        let image = self.read(&sampled(&optical), noise, sampling, rng)?;
        let gain = 1.0 + limits.scale_error * rng.random_range(-1.0..=1.0_f32);
        let zero = limits.scale_error * rng.random_range(-1.0..=1.0_f32);
        Ok(Reading {
            image: image.iter().map(|v| (gain * v + zero).clamp(0.0, 1.0)).collect(),
            optical,
            sigma_px,
            // Patterns that are not shown add no noise.
            noise_std: noise * sampling.sqrt(),
            sampling,
            depth: depth(rng),
        })
    }
}

impl AnalyticCamera {
    /// The image through patterns: Hadamard readings in the order shown, with leak, noise and
    /// rounding, transformed back with zeros for the patterns that were not shown.
    fn read(
        &self,
        image: &[f32],
        noise: f32,
        sampling: f32,
        rng: &mut Pcg64Mcg,
    ) -> Result<Vec<f32>, DegradeError> {
        let area = READING_PX * READING_PX;
        let mut readings = image.to_vec();
        transform(&mut readings)?;
        let order = &self.orders[rng.random_range(0..self.orders.len())];
        let shown = ((sampling * area as f32).round() as usize).clamp(1, area);
        let leak = self.limits.leak * rng.random_range(-1.0..=1.0_f32);
        // The pattern of all ones has the largest reading, the sum of `area` pixels.
        let step = area as f32 / rng.random_range(BITS).exp2();
        // White noise of the pixels is white noise of the readings, larger by the square root of
        // their number.
        let noise = noise * (area as f32).sqrt();
        let mut measured = vec![0.0; area];
        // Differences of a repeating sweep: the last pattern leaks into the first.
        let mut before = readings[order[shown - 1] as usize];
        for &row in &order[..shown] {
            let own = readings[row as usize];
            let normal: f32 = rng.sample(StandardNormal);
            let value = own + leak * before + noise * normal;
            measured[row as usize] = (value / step).round() * step;
            before = own;
        }
        transform(&mut measured)?;
        Ok(measured.iter().map(|v| v / area as f32).collect())
    }
}

fn transform(values: &mut [f32]) -> Result<(), DegradeError> {
    fwht(values).map_err(|error| DegradeError::Camera(error.to_string()))
}

/// Depth of a plane before the camera, tilted a little, with zones without depth; sometimes no
/// depth at all.
fn depth(rng: &mut Pcg64Mcg) -> Option<Depth> {
    if rng.random::<f32>() < NO_DEPTH {
        return None;
    }
    let middle: f32 = rng.random_range(0.1..2.5);
    let slope = [(); 2].map(|()| 0.2 * middle * rng.random_range(-1.0..=1.0_f32));
    let mut depth = Depth { metres: [0.0; _], valid: [true; _] };
    for (zone, (metres, valid)) in depth.metres.iter_mut().zip(&mut depth.valid).enumerate() {
        let part = |at: usize| at as f32 / DEPTH_SIDE as f32 - 0.5;
        let normal: f32 = rng.sample(StandardNormal);
        let plane = slope[0] * part(zone % DEPTH_SIDE) + slope[1] * part(zone / DEPTH_SIDE);
        *metres = (middle + plane + DEPTH_NOISE_M * normal).max(0.0);
        *valid = rng.random::<f32>() >= INVALID_ZONES;
    }
    Some(depth)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Purpose, shapes::Shape, stream};
    use proptest::prelude::*;

    fn still() -> Limits {
        Limits {
            sigma_px: 0.0..=0.0,
            noise_std: 0.0..=0.0,
            partial: 0.0,
            scattered: 0.0,
            leak: 0.0,
            scale_error: 0.0,
            ..Limits::default()
        }
    }

    fn star() -> Vec<f32> {
        Shape::Star.draw(&mut stream(1, Purpose::Training, 0))
    }

    fn reading(limits: Limits, scene: &[f32], seed: u64) -> Reading {
        let camera = AnalyticCamera::new(limits).unwrap();
        camera.degrade(scene, &mut stream(seed, Purpose::Training, 1)).unwrap()
    }

    fn deviation(a: &[f32], b: &[f32]) -> f32 {
        let squared: f32 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
        (squared / a.len() as f32).sqrt()
    }

    #[test]
    fn without_faults_it_is_the_scene_sampled() {
        let read = reading(still(), &star(), 1);
        // Readings are rounded to 10 to 16 bits.
        assert!(deviation(&read.image, &sampled(&star())) < 0.01);
        assert_eq!(read.optical, star());
    }

    #[test]
    fn noise_is_as_large_as_it_says() {
        let grey = vec![0.5; AREA_PX];
        for (sampling, share) in [(1.0..=1.0, 1.0_f32), (0.25..=0.25, 0.5)] {
            let limits = Limits { noise_std: 0.05..=0.05, partial: 1.0, sampling, ..still() };
            let read = reading(limits, &grey, 3);
            let found = deviation(&read.image, &[0.5; 1024]);
            // From 256 readings the deviation is known to 1/sqrt(2 * 256) = 4.4 %.
            assert!((found / (0.05 * share) - 1.0).abs() < 0.15, "{found}");
            assert!((read.noise_std - 0.05 * share).abs() < 1e-6);
        }
    }

    #[test]
    fn leak_and_fewer_patterns_each_cost_quality() {
        let truth = sampled(&star());
        let of = |limits| deviation(&reading(limits, &star(), 5).image, &truth);
        let clean = of(still());
        assert!(of(Limits { leak: 0.2, ..still() }) > clean + 0.002);
        let quarter = of(Limits { partial: 1.0, sampling: 0.25..=0.25, ..still() });
        let half = of(Limits { partial: 1.0, sampling: 0.5..=0.5, ..still() });
        assert!(quarter > half && half > clean + 0.02, "{quarter} {half} {clean}");
    }

    #[test]
    fn ranges_that_cannot_be_are_named() {
        let limits = Limits { sigma_px: 3.0..=1.0, ..still() };
        let error = AnalyticCamera::new(limits).unwrap_err().to_string();
        assert_eq!(error, "blur from 3 to 1, expected 0 to 8 pixels");
        let camera = AnalyticCamera::new(still()).unwrap();
        let short = camera.degrade(&[0.0; 9], &mut stream(1, Purpose::Training, 0));
        assert_eq!(short, Err(DegradeError::Shape { found: 9 }));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn a_picture_is_in_range_within_its_limits_and_of_its_seed_alone(seed: u64) {
            let first = reading(Limits::default(), &star(), seed);
            prop_assert!(first.image.iter().all(|v| (0.0..=1.0).contains(v)));
            prop_assert!((0.3..=4.0).contains(&first.sigma_px));
            prop_assert!((0.0..=0.08).contains(&first.noise_std));
            prop_assert!((0.25..=1.0).contains(&first.sampling));
            prop_assert_eq!(&first, &reading(Limits::default(), &star(), seed));
            prop_assert_ne!(first.image, reading(Limits::default(), &star(), !seed).image);
        }
    }
}
