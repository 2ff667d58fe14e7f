//! What frames of less than four sweeps have of the faults of LEDs and lines.
//!
//! Sweeps that alternate cancel these faults in every four
//! ([`mode::ALTERNATING`](nirspi_wire::register::mode::ALTERNATING)). A frame whose number of sweeps is no multiple of
//! four holds a part of them, the same part as all frames that begin at the same place of the cycle. Where the means
//! of these frames differ by more than their noise, the difference from the mean of all places is that part.

/// Sweeps after which the lines repeat.
pub(super) const CYCLE: u64 = 4;
/// Fewer frames tell nothing.
const LEAST_FRAMES: u64 = 16;
/// The mean square of the differences, in units of what noise makes, from which they are no noise. Of 1024 patterns
/// noise alone exceeds it once in millions of runs.
const SIGNIFICANT: f64 = 1.25;

/// The sums of a run's frames by the place of their first sweep in the cycle.
#[derive(Debug, Clone, Default)]
pub(crate) struct Phases {
    places: [Place; CYCLE as usize],
    frames: u64,
}

#[derive(Debug, Clone, Default)]
struct Place {
    sums: Vec<i64>,
    sweeps: u64,
}

/// The place in the cycle of the first sweep of a frame.
pub(super) fn place_of(sequence: u32, sweeps: u32) -> usize {
    (u64::from(sequence).wrapping_mul(u64::from(sweeps)) % CYCLE) as usize
}

impl Phases {
    /// Adds a frame of sweeps that alternate. Frames in which all has cancelled are left out.
    pub(crate) fn add(
        &mut self,
        sequence: u32,
        sweeps: u32,
        sums: impl ExactSizeIterator<Item = i64>,
    ) {
        if u64::from(sweeps).is_multiple_of(CYCLE) {
            return;
        }
        let place = &mut self.places[place_of(sequence, sweeps)];
        place.sums.resize(sums.len(), 0);
        for (total, sum) in place.sums.iter_mut().zip(sums) {
            *total = total.saturating_add(sum);
        }
        place.sweeps += u64::from(sweeps);
        self.frames += 1;
    }

    /// What the frames of each place have more than all, in sums of one sweep, if that is no noise.
    /// `noise` is the standard deviation of the sum of one sweep.
    pub(crate) fn offsets(&self, noise: f64) -> Option<Offsets> {
        let held: Vec<&Place> = self.places.iter().filter(|place| place.sweeps > 0).collect();
        if self.frames < LEAST_FRAMES || held.len() < 2 {
            return None;
        }
        let mean_of = |place: &Place| -> Vec<f64> {
            place.sums.iter().map(|&sum| sum as f64 / place.sweeps as f64).collect()
        };
        let count = held.len() as f64;
        let mut all = vec![0.0; held[0].sums.len()];
        for place in &held {
            all.iter_mut().zip(mean_of(place)).for_each(|(all, mean)| *all += mean / count);
        }
        let offsets = self.places.each_ref().map(|place| -> Vec<f64> {
            match place.sweeps {
                0 => Vec::new(),
                _ => mean_of(place).iter().zip(&all).map(|(mean, all)| mean - all).collect(),
            }
        });
        let squares: f64 = offsets.iter().flatten().map(|offset| offset * offset).sum();
        // The mean of the places takes one degree of freedom of each pattern.
        let of_noise: f64 =
            held.iter().map(|place| noise.powi(2) / place.sweeps as f64).sum::<f64>()
                * (1.0 - 1.0 / count)
                * all.len() as f64;
        (squares > SIGNIFICANT * of_noise).then_some(Offsets(offsets))
    }
}

/// By the place of a frame's first sweep in the cycle: what its sweeps have more than the mean of all, pattern by
/// pattern. Empty for a place at which no frame began.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Offsets([Vec<f64>; CYCLE as usize]);

impl Offsets {
    /// Subtracts the offsets from sums of frames. `sweeps` is the number of summed sweeps by the place at which their
    /// frames began.
    pub(super) fn correct(&self, sums: &mut [f64], sweeps: [u64; CYCLE as usize]) {
        for (offsets, sweeps) in self.0.iter().zip(sweeps) {
            for (sum, offset) in sums.iter_mut().zip(offsets) {
                *sum -= offset * sweeps as f64;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64;

    const NOISE: f64 = 100.0;

    /// Frames with this fault of the places of their sweeps.
    fn run(frames: u32, sweeps: u32, fault: [f64; 4]) -> (Phases, Vec<Vec<i64>>) {
        let mut random = Pcg64::seed_from_u64(1);
        let mut phases = Phases::default();
        let frames = (0..frames)
            .map(|sequence| {
                let of_sweeps: f64 =
                    (0..sweeps).map(|at| fault[((sequence * sweeps + at) % 4) as usize]).sum();
                let sums: Vec<i64> = (0..1024)
                    .map(|pattern| {
                        let noise = NOISE * f64::from(sweeps).sqrt();
                        let noise = noise * random.sample::<f64, _>(StandardNormal);
                        let scene = f64::from(sweeps) * 7.0 * f64::from(pattern);
                        (scene + of_sweeps + noise).round() as i64
                    })
                    .collect();
                phases.add(sequence, sweeps, sums.iter().copied());
                sums
            })
            .collect();
        (phases, frames)
    }

    #[test]
    fn what_does_not_cancel_in_a_frame_is_found_and_taken_away() {
        for (sweeps, frames) in [(1, 64), (2, 32), (3, 64), (5, 33)] {
            let fault = [60.0, -60.0, 25.0, -25.0].map(|fault| fault * f64::from(sweeps));
            let (phases, sums) = run(frames, sweeps, fault);
            let Some(offsets) = phases.offsets(NOISE) else {
                // Two sweeps cancel these faults.
                assert_eq!(sweeps, 2);
                continue;
            };
            for (sequence, sums) in sums.iter().enumerate() {
                let mut sums: Vec<f64> = sums.iter().map(|&sum| sum as f64).collect();
                let mut at = [0; 4];
                at[place_of(sequence as u32, sweeps)] = u64::from(sweeps);
                offsets.correct(&mut sums, at);
                let sweeps = f64::from(sweeps);
                let left = sums.iter().zip(0..).map(|(sum, k)| sum / sweeps - 7.0 * f64::from(k));
                let left = left.sum::<f64>() / 1024.0;
                assert!(left.abs() < 10.0, "{sweeps} {sequence}: {left}");
            }
        }
    }

    #[test]
    fn noise_few_frames_and_whole_cycles_have_nothing_to_take_away() {
        assert_eq!(run(200, 1, [0.0; 4]).0.offsets(NOISE), None);
        assert_eq!(run(15, 1, [900.0, -900.0, 0.0, 0.0]).0.offsets(NOISE), None);
        assert_eq!(run(64, 4, [900.0, -900.0, 0.0, 0.0]).0.offsets(NOISE), None);
    }
}
