//! The times of the last seconds as counts in classes: percentiles in a fixed amount of memory.
//!
//! # Invariant
//! A percentile is never below the exact one, and at most 1/16 and a microsecond above
//! (`tests::a_percentile_is_never_below_the_exact_one_and_at_most_a_sixteenth_above`). A time is
//! forgotten after [`Window::LENGTH`] (`tests::times_are_forgotten_after_the_window`).

use crate::clock::Instant;
use serde::Serialize;
use std::time::Duration;

/// Time that one slice of the window counts.
const SLICE: Duration = Duration::from_secs(1);
/// Slices of a window.
const SLICES: usize = 10;
/// Classes of an octave: a class is at most 1/16 wide.
const CLASSES: u64 = 16;
/// The longest time that is told apart from longer ones, in microseconds: 67 s.
const MOST_US: u64 = (1 << 26) - 1;
/// Number of classes: times below 16 us one by one, then 16 classes for each of 22 octaves.
const COUNTS: usize = class(MOST_US) + 1;

/// The class of a time.
const fn class(us: u64) -> usize {
    let us = if us < MOST_US { us } else { MOST_US };
    if us < CLASSES {
        return us as usize;
    }
    let octave = us.ilog2() - CLASSES.ilog2();
    (CLASSES * octave as u64 + (us >> octave)) as usize
}

/// The longest time of a class, in microseconds.
const fn longest(class: usize) -> u64 {
    let class = class as u64;
    if class < CLASSES {
        return class;
    }
    let octave = class / CLASSES - 1;
    ((class % CLASSES + CLASSES + 1) << octave) - 1
}

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

/// The times of the last [`Window::LENGTH`], at most 16 kB.
#[derive(Debug)]
pub struct Window {
    slices: Vec<[u32; COUNTS]>,
    /// The sum of all slices.
    all: [u32; COUNTS],
    newest: usize,
    /// When the newest slice began.
    since: Instant,
}

impl Window {
    /// A time is forgotten after this, and after one second less at the earliest.
    pub const LENGTH: Duration = SLICE.saturating_mul(SLICES as u32);

    /// A window without times.
    pub fn new(now: Instant) -> Self {
        Self { slices: vec![[0; COUNTS]; SLICES], all: [0; COUNTS], newest: 0, since: now }
    }

    /// Adds a time that ended now.
    pub fn add(&mut self, now: Instant, took: Duration) {
        self.forget(now);
        let us = took.as_nanos().div_ceil(1000);
        let class = class(u64::try_from(us).unwrap_or(u64::MAX));
        for counts in [&mut self.slices[self.newest], &mut self.all] {
            counts[class] = counts[class].saturating_add(1);
        }
    }

    /// Half and 99 of 100 times are at most this long; `None` without times.
    pub fn percentiles(&mut self, now: Instant) -> Option<Percentiles> {
        self.forget(now);
        let count = self.all.iter().map(|&n| u64::from(n)).sum();
        let p = |percent| self.percentile(count, percent);
        (count > 0).then(|| Percentiles { count, p50_ms: p(50), p99_ms: p(99) })
    }

    /// The time that `percent` of these `count` times do not exceed, in milliseconds.
    fn percentile(&self, count: u64, percent: u64) -> f64 {
        let rank = (count * percent).div_ceil(100);
        let mut counted = 0;
        let found = self.all.iter().position(|&n| {
            counted += u64::from(n);
            counted >= rank
        });
        longest(found.unwrap_or(COUNTS - 1)) as f64 * 1e-3
    }

    fn forget(&mut self, now: Instant) {
        let passed = now.saturating_duration_since(self.since).as_secs() / SLICE.as_secs();
        for _ in 0..passed.min(SLICES as u64) {
            self.newest = (self.newest + 1) % SLICES;
            for (all, old) in self.all.iter_mut().zip(&mut self.slices[self.newest]) {
                *all = all.saturating_sub(std::mem::take(old));
            }
        }
        self.since += SLICE.saturating_mul(u32::try_from(passed).unwrap_or(u32::MAX));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn every_time_is_in_one_class_and_longer_times_are_in_later_ones() {
        let mut before = 0;
        for us in (0..5_000).chain((0..26).flat_map(|e| [(1 << e) - 1, 1 << e, (1 << e) + 1])) {
            let class = class(us);
            assert!(longest(class) >= us, "{us}");
            assert!(class == 0 || longest(class - 1) < us, "{us}");
        }
        for class in 1..COUNTS {
            assert!(longest(class) > before);
            before = longest(class);
        }
        assert_eq!((before, class(u64::MAX)), (MOST_US, COUNTS - 1));
    }

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
