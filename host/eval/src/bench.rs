//! Speed of the host: generated problems, and loops that time their solution.

pub mod enhance;
pub mod omp;
pub mod pipeline;
pub mod scenes;

use serde::Serialize;
use std::time::Instant;

/// Sweeps a second that the patterns' clock allows, the largest rate of sweeps to reconstruct.
pub const FASTEST_SWEEPS_HZ: f64 = nirspi_wire::PATTERN_HZ as f64 / nirspi_wire::PATTERNS as f64;

/// The time of several runs of the same work.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Times {
    /// Median time.
    pub median_ms: f64,
    /// The shortest run.
    pub fastest_ms: f64,
    /// The longest run.
    pub slowest_ms: f64,
}

impl Times {
    /// Runs `work` `repeats` times, at least once.
    pub fn of<T>(repeats: u32, mut work: impl FnMut() -> T) -> Self {
        let times = (0..repeats.max(1)).map(|_| {
            let start = Instant::now();
            std::hint::black_box(work());
            milliseconds(start)
        });
        Self::from_ms(times.collect())
    }

    /// The statistics of measured times, at least one.
    fn from_ms(mut times_ms: Vec<f64>) -> Self {
        times_ms.sort_by(f64::total_cmp);
        Self {
            median_ms: times_ms[times_ms.len() / 2],
            fastest_ms: times_ms[0],
            slowest_ms: times_ms[times_ms.len() - 1],
        }
    }
}

/// Number of CPU threads for many frames.
#[must_use]
pub fn threads() -> usize {
    rayon::current_num_threads()
}

fn milliseconds(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_in_order_and_the_work_is_done_as_often_as_asked() {
        let mut runs = 0;
        let times = Times::of(4, || runs += 1);
        assert_eq!(runs, 4);
        assert!(0.0 <= times.fastest_ms && times.fastest_ms <= times.median_ms);
        assert!(times.median_ms <= times.slowest_ms);
        Times::of(0, || runs += 1);
        assert_eq!(runs, 5);
        let known = Times::from_ms(vec![3.0, 1.0, 2.0]);
        assert_eq!(known, Times { median_ms: 2.0, fastest_ms: 1.0, slowest_ms: 3.0 });
    }
}
