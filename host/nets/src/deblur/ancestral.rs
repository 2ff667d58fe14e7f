//! The 500-step diffusion of the paper (section 3), sampled backwards: DDPM (Ho et al., NeurIPS
//! 2020). With fewer steps it uses DDIM's sub-sequences at eta = 1 (Song et al., ICLR 2021), which
//! equal DDPM if no step is left out.
//!
//! Images are 2 x - 1 here. The network estimates the noise in x_t = sqrt(abar_t) x_0 + sqrt(1 -
//! abar_t) eps.

use std::num::NonZeroU32;

use super::{AREA, DataConstraint, Job, SIDE};
use crate::network::RunUNet;
use crate::random::Noise;
use crate::weights::{Weights, WeightsError};

/// The schedule: the share of the image left after each of the T steps of noise.
///
/// Twice the betas of Ho, Jain and Abbeel (NeurIPS 2020: 1e-4 to 0.02 in 1000 steps) would end at
/// 0.04, with abar at 4e-5. The shipped weights were trained with betas up to 0.025, where abar
/// ends at 0.0017.
#[derive(Debug, Clone, PartialEq)]
pub struct Schedule {
    /// abar_t, the products of 1 - beta.
    left: Vec<f64>,
}

impl Schedule {
    /// The schedule that the weights were trained with: metadata `steps`, `beta_start`, `beta_end`.
    ///
    /// # Errors
    /// [`WeightsError::Number`] if one of them is missing, or is not a number of steps or a share
    /// of noise.
    pub fn of(weights: &Weights) -> Result<Self, WeightsError> {
        let steps = weights.number_that("steps", "a whole number from 1 to 10000", |steps| {
            (1.0..=10_000.0).contains(&steps) && steps.fract() == 0.0
        })?;
        let share = |key| {
            weights.number_that(key, "a number between 0 and 1", |beta| beta > 0.0 && beta < 1.0)
        };
        Ok(Self::linear(steps as usize, share("beta_start")?, share("beta_end")?))
    }

    /// Betas from `start` to `end` in equal steps.
    pub fn linear(steps: usize, start: f64, end: f64) -> Self {
        let beta = |t: usize| start + (end - start) * t as f64 / (steps.max(2) - 1) as f64;
        let left = (0..steps).scan(1.0, |product, t| {
            *product *= 1.0 - beta(t);
            Some(*product)
        });
        Self { left: left.collect() }
    }

    /// abar at `count` of the steps, evenly spaced, the noisiest first.
    fn visited(&self, count: NonZeroU32) -> Vec<f64> {
        let all = self.left.len();
        let count = (count.get() as usize).clamp(1, all);
        (1..=count).rev().map(|k| self.left[k * all / count - 1]).collect()
    }
}

pub(super) fn run(
    network: &dyn RunUNet,
    schedule: &Schedule,
    steps: NonZeroU32,
    job: &Job<'_>,
    constraint: &DataConstraint<'_>,
) -> Vec<f32> {
    let images = job.first..job.first + job.estimates.len();
    let mut noise: Vec<Noise> = images.map(|index| Noise::of(job.seed, index)).collect();
    let mut draw_all = || -> Vec<f32> {
        noise
            .iter_mut()
            .flat_map(|image| (0..AREA).map(|_| image.draw()).collect::<Vec<_>>())
            .collect()
    };
    let seen: Vec<f32> = job.seen.iter().map(|v| 2.0 * v - 1.0).collect();
    let mut x = draw_all();
    let visited = schedule.visited(steps);
    for (k, &now) in visited.iter().enumerate() {
        let next = visited.get(k + 1).copied().unwrap_or(1.0);
        let (signal, sigma) = (now.sqrt() as f32, (1.0 - now).sqrt() as f32);
        let conditions: Vec<_> =
            job.estimates.iter().map(|e| e.conditions([signal, sigma])).collect();
        let epsilon = network.run(SIDE, &x, &seen, &conditions);
        let mut guess: Vec<f32> = x
            .iter()
            .zip(&epsilon)
            .map(|(x, epsilon)| 0.5 * ((x - sigma * epsilon) / signal + 1.0))
            .collect();
        constraint.correct(&mut guess);
        // Variance of the reverse step, and the share of the noise that is kept.
        let variance = (1.0 - next) / (1.0 - now) * (1.0 - now / next);
        let kept = (1.0 - next - variance).max(0.0).sqrt() as f32;
        let (to, fresh) = (next.sqrt() as f32, variance.sqrt() as f32);
        let draw = if fresh > 0.0 { draw_all() } else { vec![0.0; x.len()] };
        for ((x, guess), draw) in x.iter_mut().zip(&guess).zip(draw) {
            let clean = 2.0 * guess - 1.0;
            // The noise that belongs to the corrected guess.
            let epsilon = (*x - signal * clean) / sigma;
            *x = to * clean + kept * epsilon + fresh * draw;
        }
    }
    x.iter().map(|v| (0.5 * (v + 1.0)).clamp(0.0, 1.0)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::consistency::{Binding, MeasuredRows};
    use crate::estimate::Estimate;
    use crate::schema::Conditions;

    /// A network that knows the sharp image: 0.75 everywhere.
    struct Oracle;

    impl RunUNet for Oracle {
        fn run(&self, _: usize, x: &[f32], _: &[f32], conditions: &[Conditions]) -> Vec<f32> {
            let area = x.len() / conditions.len();
            let of = |(image, c): (&[f32], &Conditions)| -> Vec<f32> {
                image.iter().map(|x| (x - c[0] * 0.5) / c[1]).collect()
            };
            x.chunks(area).zip(conditions).flat_map(of).collect()
        }
    }

    fn job<'a>(images: &'a [f32], estimates: &'a [Estimate], first: usize) -> Job<'a> {
        Job { start: images, seen: images, estimates, seed: 3, first }
    }

    /// A constraint without effect.
    fn free<'a>(job: &Job<'a>) -> DataConstraint<'a> {
        let (readings, all) = (job.seen, &MeasuredRows::All);
        DataConstraint::new(readings, SIDE, job.estimates, all, Binding::Off).unwrap()
    }

    #[test]
    fn the_schedule_is_that_of_pytorch() {
        // torch.cumprod(1 - torch.linspace(2e-4, 0.025, 500), 0)[[0, 249, 499]]
        let schedule = Schedule::linear(500, 2e-4, 0.025);
        for (t, expected) in [(0, 0.9998), (249, 0.201_162_029_7), (499, 0.001_741_127_6)] {
            assert!((schedule.left[t] - expected).abs() < 1e-6 * expected, "{t}");
        }
        let steps = |count| schedule.visited(NonZeroU32::new(count).unwrap());
        assert_eq!(steps(1), [schedule.left[499]]);
        assert_eq!(steps(2), [schedule.left[499], schedule.left[249]]);
        assert_eq!(steps(500).len(), 500);
        assert_eq!(steps(900).len(), 500);
    }

    #[test]
    fn the_embedded_weights_have_the_schedule_of_both_trainers() {
        let weights = Weights::embedded("ancestral").unwrap();
        let trainers = [
            include_str!("../../training/train_unet.py"),
            include_str!("../../../python/python/nirspi/train/tasks.py"),
        ];
        for trainer in trainers {
            let line = trainer.lines().find(|line| line.starts_with("STEPS, BETA_START, BETA_END"));
            let (_, values) = line.unwrap().split_once('=').unwrap();
            let values: Vec<f64> = values.split(',').map(|v| v.trim().parse().unwrap()).collect();
            let [steps, start, end] = values[..] else { panic!("{values:?}") };
            let trained = Schedule::linear(steps as usize, start, end);
            assert_eq!(Schedule::of(&weights).unwrap(), trained);
        }
    }

    #[test]
    fn a_schedule_of_no_steps_is_refused() {
        for (key, text, words) in [
            ("steps", "NaN", "steps is NaN, expected a whole number from 1 to 10000"),
            ("steps", "0", "steps is 0, expected a whole number"),
            ("beta_end", "1.5", "beta_end is 1.5, expected a number between 0 and 1"),
        ] {
            let mut weights = Weights::new("altered");
            let schedule = [("steps", "500"), ("beta_start", "0.01"), ("beta_end", "0.02")];
            for (key, text) in schedule.into_iter().chain([(key, text)]) {
                weights.set_metadata(key, text);
            }
            let line = Schedule::of(&weights).unwrap_err().to_string();
            assert!(line.contains(words), "{line}");
        }
    }

    #[test]
    fn with_an_oracle_any_number_of_steps_ends_at_the_image() {
        let schedule = Schedule::linear(500, 2e-4, 0.025);
        let images = vec![0.5; 2 * AREA];
        let estimates = [Estimate { sigma_px: 2.0, noise: 0.01 }; 2];
        let job = job(&images, &estimates, 0);
        for steps in [1, 10, 500] {
            let steps = NonZeroU32::new(steps).unwrap();
            let sharp = run(&Oracle, &schedule, steps, &job, &free(&job));
            assert!(sharp.iter().all(|v| (v - 0.75).abs() < 1e-4), "{steps}");
        }
    }

    #[test]
    fn a_sample_is_of_the_image_not_of_its_batch() {
        /// A network that leaves the noise in the image.
        struct Idle;
        impl RunUNet for Idle {
            fn run(&self, _: usize, x: &[f32], _: &[f32], _: &[Conditions]) -> Vec<f32> {
                x.iter().map(|x| 0.9 * x).collect()
            }
        }
        let schedule = Schedule::linear(500, 2e-4, 0.025);
        let images = vec![0.5; 2 * AREA];
        let estimates = [Estimate { sigma_px: 2.0, noise: 0.01 }; 2];
        let sample = |job: &Job<'_>| {
            let steps = NonZeroU32::new(3).unwrap();
            run(&Idle, &schedule, steps, job, &free(job))
        };
        let both = sample(&job(&images, &estimates, 6));
        let second = sample(&job(&images[AREA..], &estimates[1..], 7));
        assert_eq!(both[AREA..], second);
        assert_ne!(both[..AREA], second);
    }
}
