//! The times of the last seconds as counts in classes: percentiles in a fixed amount of memory.
//!
//! # Invariant
//! A percentile is never below the exact one, and at most 1/16 and a microsecond above
//! (`tests::a_percentile_is_never_below_the_exact_one_and_at_most_a_sixteenth_above`). A time is
//! forgotten after [`Window::LENGTH`] (`tests::times_are_forgotten_after_the_window`).

#![expect(clippy::expect_used, reason = "the bounds are constants and all slices have the same")]

use hdrhistogram::Histogram;
use nirspi::clock::Instant;
use serde::Serialize;
use std::time::Duration;

/// Time that one slice of the window counts.
const SLICE: Duration = Duration::from_secs(1);
/// Slices of a window.
const SLICES: usize = 10;
/// The longest time that is told apart from longer ones, in microseconds.
const MOST_US: u64 = 60_000_000;
/// Decimal digits of a time: classes are at most 1/16 wide.
const DIGITS: u8 = 1;

/// How long something took in the last seconds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Percentiles {
    /// Number of times in the window.
    pub count: u64,
    /// Half of the times are at most this long, in milliseconds.
    pub p50_ms: f64,
    /// 99 of 100 times are at most this long, in milliseconds.
    pub p99_ms: f64,
}

/// The times of the last [`Window::LENGTH`].
#[derive(Debug)]
pub struct Window {
    slices: [Histogram<u32>; SLICES],
    newest: usize,
    /// When the newest slice began.
    since: Instant,
}

impl Window {
    /// A time is forgotten after this, and after one second less at the earliest.
    pub const LENGTH: Duration = SLICE.saturating_mul(SLICES as u32);

    /// A window without times.
    pub fn new(now: Instant) -> Self {
        let empty = || Histogram::new_with_max(MOST_US, DIGITS).expect("bounds of a histogram");
        Self { slices: std::array::from_fn(|_| empty()), newest: 0, since: now }
    }

    /// Adds a time that ended now.
    pub fn add(&mut self, now: Instant, took: Duration) {
        self.forget(now);
        let us = took.as_nanos().div_ceil(1000);
        self.slices[self.newest].saturating_record(u64::try_from(us).unwrap_or(u64::MAX));
    }

    /// Half and 99 of 100 times are at most this long; `None` without times.
    pub fn percentiles(&mut self, now: Instant) -> Option<Percentiles> {
        self.forget(now);
        let mut all = Histogram::<u32>::new_from(&self.slices[0]);
        for slice in &self.slices {
            all.add(slice).expect("slices of the same bounds");
        }
        let percentile = |percent| all.value_at_percentile(percent) as f64 * 1e-3;
        let (count, p50_ms, p99_ms) = (all.len(), percentile(50.0), percentile(99.0));
        (count > 0).then_some(Percentiles { count, p50_ms, p99_ms })
    }

    fn forget(&mut self, now: Instant) {
        let passed = now.saturating_duration_since(self.since).as_secs() / SLICE.as_secs();
        for _ in 0..passed.min(SLICES as u64) {
            self.newest = (self.newest + 1) % SLICES;
            self.slices[self.newest].reset();
        }
        self.since += SLICE.saturating_mul(u32::try_from(passed).unwrap_or(u32::MAX));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_percentile_is_never_below_the_exact_one_and_at_most_a_sixteenth_above(
            mut times_us in prop::collection::vec(0u64..30_000_000, 1..400)
        ) {
            let now = Instant::now();
            let mut window = Window::new(now);
            for &us in &times_us {
                window.add(now, Duration::from_micros(us));
            }
            times_us.sort_unstable();
            let exact = |percent: usize| times_us[(times_us.len() * percent).div_ceil(100) - 1] as f64 * 1e-3;
            let found = window.percentiles(now).unwrap();
            prop_assert_eq!(found.count, times_us.len() as u64);
            for (found, exact) in [(found.p50_ms, exact(50)), (found.p99_ms, exact(99))] {
                prop_assert!(found >= exact && found <= exact * (17.0 / 16.0) + 1e-3, "{found} {exact}");
            }
        }
    }

    #[test]
    fn times_are_forgotten_after_the_window() {
        let start = Instant::now();
        let after = |ms| start + Duration::from_millis(ms);
        let mut window = Window::new(start);
        window.add(after(100), Duration::from_millis(500));
        window.add(after(5_000), Duration::from_millis(2));
        assert!(window.percentiles(after(9_000)).unwrap().p99_ms > 500.0);
        let later = window.percentiles(after(10_100)).unwrap();
        assert!(later.count == 1 && later.p99_ms < 3.0, "{later:?}");
        assert_eq!(window.percentiles(after(15_100)), None);
        // A long silence is one step.
        window.add(after(1 << 40), Duration::ZERO);
        assert_eq!(window.percentiles(after(1 << 40)).unwrap().count, 1);
    }
}
