//! Does items on several threads, and hands over the results in the order of the items.
//!
//! # Invariant
//! Results come in order, whichever thread is first, and a bounded number of them waits
//! (`tests::results_come_in_order_and_few_wait`). A panic of the work is a panic of the caller and
//! never a wait without end (`tests::a_panic_reaches_the_caller`).

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError, mpsc};

/// Results that may wait for an earlier one, for each job.
const AHEAD: usize = 2;

struct State {
    /// The next item to begin.
    next: usize,
    /// Items handed over.
    taken: usize,
    stop: bool,
}

struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn stop(&self) {
        self.lock().stop = true;
        self.changed.notify_all();
    }
}

/// Stops the other threads when its own thread ends in a panic.
struct StopAtPanic<'s>(&'s Shared);

impl Drop for StopAtPanic<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.stop();
        }
    }
}

/// Does `work` on every item on `jobs` threads, and calls `take` with each result in order. An error
/// of `take` ends the work after the items in hand.
pub(super) fn in_order<T: Send, E>(
    items: Range<usize>,
    jobs: usize,
    work: impl Fn(usize) -> T + Sync,
    mut take: impl FnMut(usize, T) -> Result<(), E>,
) -> Result<(), E> {
    let (end, ahead) = (items.end, AHEAD * jobs);
    let state = State { next: items.start, taken: items.start, stop: false };
    let shared = &Shared { state: Mutex::new(state), changed: Condvar::new() };
    let work = &work;
    let claim = move || {
        let mut state = shared.lock();
        loop {
            match () {
                () if state.stop || state.next >= end => return None,
                () if state.next < state.taken + ahead => {
                    state.next += 1;
                    return Some(state.next - 1);
                }
                () => state = shared.changed.wait(state).unwrap_or_else(PoisonError::into_inner),
            }
        }
    };
    let (done, results) = mpsc::channel();
    std::thread::scope(|scope| {
        for _ in 0..jobs.min(items.len()) {
            let done = done.clone();
            scope.spawn(move || {
                let _guard = StopAtPanic(shared);
                while let Some(item) = claim() {
                    if done.send((item, work(item))).is_err() {
                        break;
                    }
                }
            });
        }
        drop(done);
        let _guard = StopAtPanic(shared);
        let mut waiting = BTreeMap::new();
        let mut next = items.start;
        for (item, result) in results {
            waiting.insert(item, result);
            while let Some(result) = waiting.remove(&next) {
                if let Err(error) = take(next, result) {
                    shared.stop();
                    return Err(error);
                }
                next += 1;
                shared.lock().taken = next;
                shared.changed.notify_all();
            }
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::Duration;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn results_come_in_order_and_few_wait(
            delays in prop::collection::vec(0_u64..400, 0..60),
            jobs in 1_usize..6,
            start in 0_usize..5,
        ) {
            let start = start.min(delays.len());
            let (begun, handed) = (AtomicUsize::new(start), AtomicUsize::new(start));
            let mut order = Vec::new();
            let work = |item: usize| {
                begun.fetch_add(1, Ordering::SeqCst);
                std::thread::sleep(Duration::from_micros(delays[item]));
                item
            };
            let taken: Result<(), ()> = in_order(start..delays.len(), jobs, work, |item, result| {
                assert_eq!(item, result);
                order.push(item);
                let handed = handed.fetch_add(1, Ordering::SeqCst);
                assert!(begun.load(Ordering::SeqCst) - handed <= AHEAD * jobs);
                Ok(())
            });
            prop_assert!(taken.is_ok());
            prop_assert!(order.into_iter().eq(start..delays.len()));
        }
    }

    #[test]
    fn an_error_ends_the_work() {
        let count = AtomicUsize::new(0);
        let work = |_| count.fetch_add(1, Ordering::SeqCst);
        let ended =
            in_order(0..10_000, 3, work, |item, _| if item == 5 { Err(item) } else { Ok(()) });
        assert_eq!(ended, Err(5));
        assert!(count.load(Ordering::SeqCst) <= 6 + AHEAD * 3);
    }

    #[test]
    fn a_panic_reaches_the_caller() {
        let panicked = std::panic::catch_unwind(|| {
            let work = |item| assert_ne!(item, 7, "the deliberate panic of a test");
            let _ = in_order(0..1000, 3, work, |_, ()| Ok::<(), ()>(()));
        });
        assert!(panicked.is_err());
    }
}
