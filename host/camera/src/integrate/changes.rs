//! Whether readings change while they are taken, because the scene moves or its light drifts.
//!
//! The variance of a run's readings beyond their noise is that of the scene, pattern by pattern. Noise is what differs
//! between a frame and the next ([`Spread`](super::spread::Spread)), in the median over the patterns: motion is seen in
//! coarse patterns first.

use super::phases::CYCLE;

/// Fewer groups of frames tell nothing.
const LEAST_GROUPS: u64 = 4;
/// The scene's variance must exceed the noise of its estimate by this many standard deviations, ...
const SIGMAS: f64 = 6.0;
/// ... and this share of the noise of a group of frames, because the noise itself is an estimate.
const OF_NOISE: f64 = 0.1;
/// A change of less than this share of the readings' own variation is not seen in a picture.
const LEAST_SHARE: f64 = 0.01;

/// The readings of a run's frames and their squares, pattern by pattern.
#[derive(Debug, Clone, Default)]
pub(crate) struct Changes {
    /// Frames that are not yet a whole cycle of sweeps that alternate: what cancels in four sweeps is no change.
    waiting: Vec<i64>,
    waiting_sweeps: u64,
    sums: Vec<f64>,
    /// Of a group's sums, divided by the number of its sweeps.
    squares: Vec<f64>,
    sweeps: u64,
    groups: u64,
}

impl Changes {
    /// Adds the sums of a frame's sweeps.
    pub(crate) fn add(&mut self, sums: impl ExactSizeIterator<Item = i64>, sweeps: u32) {
        for values in [&mut self.sums, &mut self.squares] {
            values.resize(sums.len(), 0.0);
        }
        self.waiting.resize(sums.len(), 0);
        self.waiting.iter_mut().zip(sums).for_each(|(waiting, sum)| *waiting += sum);
        self.waiting_sweeps += u64::from(sweeps);
        if !self.waiting_sweeps.is_multiple_of(CYCLE) {
            return;
        }
        let per_sweep = 1.0 / self.waiting_sweeps as f64;
        let totals = self.sums.iter_mut().zip(&mut self.squares).zip(&mut self.waiting);
        for ((sum, square), waiting) in totals {
            let value = std::mem::take(waiting) as f64;
            *sum += value;
            *square += value * value * per_sweep;
        }
        self.sweeps += std::mem::take(&mut self.waiting_sweeps);
        self.groups += 1;
    }

    /// The variance of the scene's readings over the run, as a share of their variation from pattern to pattern; `None`
    /// where it is not above the noise, or not seen in a picture. `noise` is the standard deviation of the sum of one
    /// sweep. The first pattern, which may be the light of the whole scene, is left out.
    pub(crate) fn share(&self, noise: f64) -> Option<f64> {
        if self.groups < LEAST_GROUPS || self.sums.len() < 2 {
            return None;
        }
        let (sweeps, freedom) = (self.sweeps as f64, self.groups as f64 - 1.0);
        let patterns = self.sums.len() as f64 - 1.0;
        let mean = |of: &dyn Fn(f64, f64) -> f64| {
            let pairs = self.sums.iter().zip(&self.squares).skip(1);
            pairs.map(|(&sum, &square)| of(sum, square)).sum::<f64>() / patterns
        };
        let of_noise = noise * noise;
        let excess = mean(&|sum, square| (square - sum * sum / sweeps) / freedom) - of_noise;
        let certain = (SIGMAS * (2.0 / (patterns * freedom)).sqrt()).max(OF_NOISE) * of_noise;
        // Of a group's mean sweep, the noise is less by its number of sweeps, the scene's variance is not.
        let scene = excess * self.groups as f64 / sweeps;
        let variation = mean(&|sum, _| (sum / sweeps).powi(2)) - of_noise / sweeps;
        let share = scene / variation.max(0.0);
        (excess > certain && share > LEAST_SHARE).then_some(share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64;

    /// The share for frames whose patterns have these readings in a sweep.
    fn share(frames: u32, sweeps: u32, reading: impl Fn(u32, u32) -> f64) -> Option<f64> {
        const NOISE: f64 = 100.0;
        let mut random = Pcg64::seed_from_u64(1);
        let mut changes = Changes::default();
        for frame in 0..frames {
            let sums: Vec<i64> = (0..1024)
                .map(|pattern| {
                    let noise = NOISE * random.sample::<f64, _>(StandardNormal);
                    let sum = f64::from(sweeps) * reading(frame, pattern);
                    (sum + f64::from(sweeps).sqrt() * noise).round() as i64
                })
                .collect();
            changes.add(sums.into_iter(), sweeps);
        }
        changes.share(NOISE)
    }

    fn still(pattern: u32) -> f64 {
        3e4 / (1.0 + f64::from(pattern)) * if pattern.is_multiple_of(3) { -1.0 } else { 1.0 }
    }

    #[test]
    fn a_scene_that_moves_is_seen_and_one_at_rest_is_not() {
        for (frames, sweeps) in [(16, 1), (64, 1), (5, 4), (40, 37), (8, 500)] {
            assert_eq!(share(frames, sweeps, |_, k| still(k)), None, "{frames} {sweeps}");
            let turns = |frame: u32, k: u32| {
                let angle = f64::from(frame) / f64::from(frames) * f64::from(k % 30) * 0.4;
                still(k) * angle.cos()
            };
            let found = share(frames, sweeps, turns);
            assert!(found.is_some_and(|found| found > 0.1), "{frames} {sweeps}: {found:?}");
        }
    }

    #[test]
    fn too_few_frames_tell_nothing_and_what_cancels_in_four_sweeps_is_no_change() {
        let jumps = |frame: u32, k: u32| if frame.is_multiple_of(2) { still(k) } else { 0.0 };
        assert_eq!(share(3, 4, jumps), None);
        let cancels =
            |frame: u32, k: u32| still(k) + if frame.is_multiple_of(2) { 900.0 } else { -900.0 };
        assert_eq!(share(64, 1, cancels), None);
        assert!(share(64, 4, cancels).is_some());
    }
}
