//! The noise of a mean of frames, from the differences between one frame and the next.
//!
//! Frames of one run measure the same scene again, so what differs between a frame and the next is
//! noise: [`Repeats`].

use nirspi_recon::Repeats;

/// Differences between frames, pattern by pattern.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Spread {
    last: Vec<i64>,
    last_sweeps: u64,
    /// Of two frames' means of a sweep, scaled to the variance of one sweep.
    repeats: Repeats,
}

impl Spread {
    /// Adds the sums of a frame's sweeps, one for each pattern.
    pub(super) fn add(&mut self, sums: impl ExactSizeIterator<Item = i64>, sweeps: u64) {
        if sweeps == 0 {
            return;
        }
        if self.last.len() != sums.len() {
            *self = Self { repeats: Repeats::of(sums.len()), ..Self::default() };
            (self.last, self.last_sweeps) = (sums.collect(), sweeps);
            return;
        }
        let (before, now) = (1.0 / self.last_sweeps as f64, 1.0 / sweeps as f64);
        let differences = self.last.iter_mut().zip(sums).map(|(last, sum)| {
            let difference = sum as f64 * now - *last as f64 * before;
            *last = sum;
            difference
        });
        self.repeats.add(differences, 1.0 / (before + now));
        self.last_sweeps = sweeps;
    }

    /// Standard deviation of the sum of one sweep; `None` before the second frame.
    pub(super) fn of_a_sweep(&self) -> Option<f64> {
        self.repeats.noise()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64;

    /// The estimate from frames whose sweeps have this standard deviation. `change` is added to a
    /// pattern of a frame.
    fn found(sigma: f64, sweeps: &[u64], change: impl Fn(usize, usize) -> f64) -> Option<f64> {
        let mut random = Pcg64::seed_from_u64(1);
        let mut spread = Spread::default();
        for (frame, &sweeps) in sweeps.iter().enumerate() {
            let sums: Vec<i64> = (0..1024)
                .map(|pattern| {
                    let noise = sigma * random.sample::<f64, _>(StandardNormal);
                    let scene = 1e4 - 7.0 * pattern as f64 + change(frame, pattern);
                    (sweeps as f64 * scene + (sweeps as f64).sqrt() * noise).round() as i64
                })
                .collect();
            spread.add(sums.into_iter(), sweeps);
        }
        spread.of_a_sweep()
    }

    #[test]
    fn the_noise_of_a_sweep_is_found_from_two_frames_on_and_with_unequal_sweeps() {
        for sweeps in [&[1, 1][..], &[5, 9, 2], &[1; 30], &[40; 200]] {
            let sigma = found(120.0, sweeps, |_, _| 0.0).unwrap();
            assert!((sigma / 120.0 - 1.0).abs() < 0.08, "{sweeps:?}: {sigma}");
        }
        assert_eq!(found(120.0, &[4], |_, _| 0.0), None);
        assert_eq!(found(120.0, &[0, 0], |_, _| 0.0), None);
    }

    #[test]
    fn drift_of_the_light_and_motion_in_coarse_patterns_hardly_count() {
        let drift = |frame: usize, _: usize| 20.0 * frame as f64;
        let sigma = found(120.0, &[1; 30], drift).unwrap();
        assert!((sigma / 120.0 - 1.0).abs() < 0.1, "{sigma}");
        let motion =
            |frame: usize, pattern: usize| if pattern < 200 { 900.0 * frame as f64 } else { 0.0 };
        let sigma = found(120.0, &[1; 30], motion).unwrap();
        assert!((sigma / 120.0 - 1.0).abs() < 0.25, "{sigma}");
    }
}
