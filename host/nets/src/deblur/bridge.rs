//! The bridge from the degraded image to the sharp one: InDI (Delbracio, Milanfar, TMLR 2023).
//!
//! x_t = (1 - t) x_0 + t y joins the sharp image x_0 to the start y. At any t the network estimates
//! x_0; a step from t to t - d goes to (d / t) x_0 + (1 - d / t) x_t. One step, from t = 1, gives
//! the estimate itself and minimises the error; more steps give more sharpness with more error.

use std::num::NonZeroU32;

use super::sharpen::checked;
use super::{Blurred, DataConstraint, Job, Sharpen, SharpenError};

pub(super) fn run(
    network: &dyn Sharpen,
    steps: NonZeroU32,
    job: &Job<'_>,
    constraint: &DataConstraint<'_>,
) -> Result<Vec<f32>, SharpenError> {
    let Job { start, seen: readings, estimates, .. } = *job;
    let mut x = start.to_vec();
    for left in (1..=steps.get()).rev() {
        let time = left as f32 / steps.get() as f32;
        let batch = Blurred { start, current: &x, readings, estimates, time };
        let mut guess = checked(network, batch)?;
        constraint.correct(&mut guess);
        // d / t, with d = 1 / steps.
        let share = 1.0 / left as f32;
        x.iter_mut().zip(&guess).for_each(|(x, guess)| *x += share * (guess - *x));
    }
    Ok(x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::consistency::{Binding, MeasuredRows};
    use crate::estimate::Estimate;
    use crate::grid::AREA;
    use std::sync::Mutex;

    /// A network that gives the same correction at any time, and records its inputs.
    #[derive(Default)]
    struct Constant {
        correction: f32,
        asked: Mutex<Vec<(f32, f32)>>,
    }

    impl Sharpen for Constant {
        fn guess(&self, batch: Blurred<'_>) -> Vec<f32> {
            self.asked.lock().unwrap().push((batch.time, batch.current[0]));
            batch.start.iter().map(|v| v + self.correction).collect()
        }
    }

    /// `run` from 0.2 everywhere, with a constraint without effect.
    fn walk(network: &dyn Sharpen, steps: u32) -> Result<Vec<f32>, SharpenError> {
        let start = vec![0.2; AREA];
        let estimates = [Estimate { sigma_px: 2.0, noise: 0.01 }];
        let job = Job { start: &start, seen: &start, estimates: &estimates, seed: 0, first: 0 };
        let constraint =
            DataConstraint::new(&start, 64, &estimates, &MeasuredRows::All, Binding::Off).unwrap();
        run(network, NonZeroU32::new(steps).unwrap(), &job, &constraint)
    }

    #[test]
    fn every_number_of_steps_ends_at_the_guess_and_walks_the_straight_path() {
        for steps in [1, 2, 4] {
            let network = Constant { correction: 0.4, ..Constant::default() };
            let sharp = walk(&network, steps).unwrap();
            assert!(sharp.iter().all(|v| (v - 0.6).abs() < 1e-6), "{}", sharp[0]);
            let asked = network.asked.into_inner().unwrap();
            assert_eq!(asked.len(), steps as usize);
            for (t, x) in asked {
                assert!((x - (0.2 * t + 0.6 * (1.0 - t))).abs() < 1e-6, "{t} {x}");
            }
        }
    }

    #[test]
    fn a_guess_that_is_no_image_is_refused() {
        struct Broken(Vec<f32>);
        impl Sharpen for Broken {
            fn guess(&self, _: Blurred<'_>) -> Vec<f32> {
                self.0.clone()
            }
        }
        let refused = |guess| walk(&Broken(guess), 1).unwrap_err();
        assert_eq!(refused(vec![0.5; 100]), SharpenError::Pixels { found: 100, images: 1 });
        let mut nan = vec![0.5; AREA];
        nan[7] = f32::NAN;
        assert!(matches!(refused(nan), SharpenError::NotFinite { value } if value.is_nan()));
    }
}
