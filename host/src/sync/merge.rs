//! Brings what comes from several cameras into the order of time.
//!
//! An item goes out when no camera can still bring an earlier one: every other camera has brought a
//! later item, has ended, or has been silent for the patience. An item also goes out when it has
//! waited for the patience, so a camera that lags behind holds nothing up for longer.
//!
//! # Invariant
//! Every item goes out once, and the items that are not marked as late are in the order of time
//! (`tests::every_item_goes_out_once_and_in_order`). A silent camera delays the others by no more
//! than the patience (`tests::a_silent_camera_holds_the_others_up_for_the_patience_and_no_longer`).

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::time::Duration;

/// An item of a camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Merged<T> {
    /// Number of the camera, from 0.
    pub camera: usize,
    /// The item's time in ns.
    pub time_ns: u64,
    /// Whether an item with a later time went out before.
    pub late: bool,
    /// The item.
    pub item: T,
}

/// What is known of a camera.
#[derive(Debug, Clone, Copy)]
struct Source {
    /// The latest time that the camera has brought.
    reached_ns: Option<u64>,
    /// When the camera brought its last item, or began.
    heard_ns: Option<u64>,
    ended: bool,
}

/// An item that waits. Items of one time go out in the order in which they came.
#[derive(Debug)]
struct Waiting<T> {
    key: (u64, u64),
    camera: usize,
    since_ns: u64,
    item: T,
}

impl<T> PartialEq for Waiting<T> {
    fn eq(&self, other: &Self) -> bool {
        self.key == other.key
    }
}

impl<T> Eq for Waiting<T> {}

impl<T> PartialOrd for Waiting<T> {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl<T> Ord for Waiting<T> {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.key.cmp(&other.key)
    }
}

/// Items of several cameras on their way into one order.
#[derive(Debug)]
pub struct Merge<T> {
    sources: Vec<Source>,
    waiting: BinaryHeap<Reverse<Waiting<T>>>,
    patience_ns: u64,
    pushed: u64,
    /// The latest time that has gone out.
    out_ns: u64,
    late: u64,
}

impl<T> Merge<T> {
    /// A merge of this many cameras.
    #[must_use]
    pub fn new(cameras: usize, patience: Duration) -> Self {
        let source = Source { reached_ns: None, heard_ns: None, ended: false };
        Self {
            sources: vec![source; cameras],
            waiting: BinaryHeap::new(),
            patience_ns: u64::try_from(patience.as_nanos()).unwrap_or(u64::MAX),
            pushed: 0,
            out_ns: 0,
            late: 0,
        }
    }

    /// Takes an item of this time from a camera. `now_ns` is the present time.
    ///
    /// # Panics
    /// If there is no such camera.
    pub fn push(&mut self, camera: usize, time_ns: u64, now_ns: u64, item: T) {
        let source = &mut self.sources[camera];
        source.reached_ns = source.reached_ns.max(Some(time_ns));
        source.heard_ns = Some(now_ns);
        source.ended = false;
        let key = (time_ns, self.pushed);
        self.pushed += 1;
        self.waiting.push(Reverse(Waiting { key, camera, since_ns: now_ns, item }));
    }

    /// The camera brings nothing more, until it brings something again.
    ///
    /// # Panics
    /// If there is no such camera.
    pub fn end(&mut self, camera: usize) {
        self.sources[camera].ended = true;
    }

    /// The next item in the order of time, if it need not wait at the present time.
    pub fn next(&mut self, now_ns: u64) -> Option<Merged<T>> {
        let Reverse(first) = self.waiting.peek()?;
        let (time_ns, patience_ns) = (first.key.0, self.patience_ns);
        let has_waited = now_ns.saturating_sub(first.since_ns) >= patience_ns;
        let waits_for = |source: &Source| {
            // A camera that has not begun is waited for from the first item on.
            let heard_ns = source.heard_ns.unwrap_or(first.since_ns);
            !source.ended
                && source.reached_ns.is_none_or(|reached| reached < time_ns)
                && now_ns.saturating_sub(heard_ns) < patience_ns
        };
        if !has_waited && self.sources.iter().any(waits_for) {
            return None;
        }
        let Reverse(Waiting { camera, item, .. }) = self.waiting.pop()?;
        let late = time_ns < self.out_ns;
        self.late += u64::from(late);
        self.out_ns = self.out_ns.max(time_ns);
        Some(Merged { camera, time_ns, late, item })
    }

    /// Number of items that wait.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// Number of items that went out late.
    #[must_use]
    pub fn late(&self) -> u64 {
        self.late
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const MS: u64 = 1_000_000;

    proptest! {
        #[test]
        fn every_item_goes_out_once_and_in_order(
            // For each camera: the period of its items and, for each item, its delay.
            cameras in prop::collection::vec((1..20_u64, prop::collection::vec(0..30_u64, 0..60)), 1..4),
            patience in 1..100_u64,
        ) {
            let mut coming: Vec<(u64, usize, u64)> = Vec::new();
            for (camera, (period, delays)) in cameras.iter().enumerate() {
                let mut last = 0;
                for (n, delay) in (0..).zip(delays) {
                    // One camera's items come in order.
                    last = last.max(n * period + delay);
                    coming.push((last, camera, n * period));
                }
            }
            coming.sort();
            let mut merge = Merge::new(cameras.len(), Duration::from_millis(patience));
            let mut out: Vec<Merged<(usize, u64)>> = Vec::new();
            let mut waited = 0;
            for &(now, camera, time) in &coming {
                while let Some(next) = merge.next(now * MS) { out.push(next); }
                merge.push(camera, time * MS, now * MS, (camera, time));
                while let Some(next) = merge.next(now * MS) {
                    waited = waited.max(now - next.item.1);
                    out.push(next);
                }
            }
            for camera in 0..cameras.len() { merge.end(camera); }
            let end = coming.last().map_or(0, |last| last.0);
            while let Some(next) = merge.next(end * MS) { out.push(next); }
            prop_assert_eq!(merge.waiting(), 0);
            let mut seen: Vec<(usize, u64)> = out.iter().map(|merged| merged.item).collect();
            let mut pushed: Vec<(usize, u64)> = coming.iter().map(|&(_, c, t)| (c, t)).collect();
            seen.sort();
            pushed.sort();
            prop_assert_eq!(seen, pushed);
            let on_time: Vec<u64> = out.iter().filter(|m| !m.late).map(|m| m.time_ns).collect();
            prop_assert!(on_time.is_sorted());
            prop_assert_eq!(merge.late(), (out.len() - on_time.len()) as u64);
            // A delay is at most 30 ms, and a silence of a camera at most 20 + 30 ms.
            if patience > 60 { prop_assert_eq!(merge.late(), 0); }
        }
    }

    #[test]
    fn a_silent_camera_holds_the_others_up_for_the_patience_and_no_longer() {
        let mut merge = Merge::new(2, Duration::from_millis(50));
        merge.push(0, 0, 0, "a");
        merge.push(1, 1, 0, "b");
        assert_eq!(merge.next(0).map(|m| m.item), Some("a"));
        // Camera 0 may bring something before b.
        assert_eq!(merge.next(49 * MS), None);
        assert_eq!(merge.next(50 * MS).map(|m| m.item), Some("b"));
        // Silent for longer than the patience, it is not waited for at all.
        merge.push(1, 60 * MS, 61 * MS, "c");
        assert_eq!(merge.next(61 * MS).map(|m| m.item), Some("c"));
        // It is there again: its old item is late and not lost.
        merge.push(0, 2 * MS, 70 * MS, "old");
        let late = merge.next(70 * MS).unwrap();
        assert!(late.late && late.item == "old" && merge.late() == 1);
        // From now on it is waited for again.
        merge.push(1, 72 * MS, 73 * MS, "d");
        assert_eq!(merge.next(73 * MS), None);
        merge.end(0);
        assert_eq!(merge.next(73 * MS).map(|m| m.item), Some("d"));
    }

    #[test]
    fn a_camera_that_lags_far_behind_delays_no_item_for_longer_than_the_patience() {
        let mut merge = Merge::new(2, Duration::from_millis(50));
        merge.push(0, 0, 0, 0);
        for now in 1..200 {
            merge.push(0, now * MS, now * MS, now);
            // Ten seconds late, always.
            merge.push(1, 1, now * MS, u64::MAX);
            while merge.next(now * MS).is_some() {}
            assert!(merge.waiting() <= 51, "{now}: {}", merge.waiting());
        }
    }
}
