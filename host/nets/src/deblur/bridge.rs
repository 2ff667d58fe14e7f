//! The bridge from the degraded image to the sharp one: InDI (Delbracio, Milanfar, TMLR 2023).
//!
//! x_t = (1 - t) x_0 + t y joins the sharp image x_0 to the start y. At any t the network guesses x_0; a
//! step from t to t - d goes to (d / t) x_0 + (1 - d / t) x_t. One step, from t = 1, is the guess itself
//! and minimises the error; more steps trade error for sharpness.

use std::num::NonZeroU32;

use super::{Job, Truth};
use crate::network::RunUNet;

pub(super) fn run(
    network: &dyn RunUNet,
    steps: NonZeroU32,
    job: &Job<'_>,
    truth: &Truth<'_>,
) -> Vec<f32> {
    let mut x = job.start.to_vec();
    for left in (1..=steps.get()).rev() {
        let t = left as f32 / steps.get() as f32;
        let conditions: Vec<_> = job.estimates.iter().map(|e| e.conditions([t, t * t])).collect();
        let mut guess = network.run(super::SIDE, &x, job.seen, &conditions);
        guess.iter_mut().zip(job.start).for_each(|(guess, start)| *guess += start);
        truth.correct(&mut guess);
        // d / t, with d = 1 / steps.
        let share = 1.0 / left as f32;
        x.iter_mut().zip(&guess).for_each(|(x, guess)| *x += share * (guess - *x));
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deblur::AREA;
    use crate::estimate::Estimate;
    use crate::network::Conditions;
    use std::sync::Mutex;

    /// Says the same correction at any time, and keeps what it was asked.
    #[derive(Default)]
    struct Constant {
        correction: f32,
        asked: Mutex<Vec<(f32, f32)>>,
    }

    impl RunUNet for Constant {
        fn run(&self, _: usize, current: &[f32], _: &[f32], c: &[Conditions]) -> Vec<f32> {
            self.asked.lock().unwrap().push((c[0][0], current[0]));
            vec![self.correction; current.len()]
        }
    }

    #[test]
    fn every_number_of_steps_ends_at_the_guess_and_walks_the_straight_path() {
        let start = vec![0.2; AREA];
        let estimates = [Estimate { sigma_px: 2.0, noise: 0.01 }];
        let job = Job {
            start: &start,
            seen: &start,
            readings: &start,
            readings_side: 64,
            estimates: &estimates,
            measured: None,
            consistency: false,
            seed: 0,
            first: 0,
        };
        for steps in [1, 2, 4] {
            let network = Constant { correction: 0.4, ..Constant::default() };
            let steps = NonZeroU32::new(steps).unwrap();
            let sharp = run(&network, steps, &job, &Truth::new(&job));
            assert!(sharp.iter().all(|v| (v - 0.6).abs() < 1e-6), "{}", sharp[0]);
            for (t, x) in network.asked.into_inner().unwrap() {
                assert!((x - (0.2 * t + 0.6 * (1.0 - t))).abs() < 1e-6, "{t} {x}");
            }
        }
    }
}
