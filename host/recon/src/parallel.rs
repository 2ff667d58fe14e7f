//! Work on all processors. A function that takes a closure is compiled anew for each; what rayon does for one is thousands of
//! lines, so it is compiled here once, for all.

use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Calls `work` once with each number below `count`.
fn each(count: usize, work: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().for_each(work);
}

/// What `work` makes of each item, in their order.
pub(crate) fn map<A: Sync, T: Send>(items: &[A], work: impl Fn(&A) -> T + Sync) -> Vec<T> {
    let made: Vec<Mutex<Option<T>>> = items.iter().map(|_| Mutex::new(None)).collect();
    each(items.len(), &|k| {
        let value = work(&items[k]);
        *made[k].lock().unwrap_or_else(PoisonError::into_inner) = Some(value);
    });
    made.into_iter()
        .filter_map(|v| v.into_inner().unwrap_or_else(PoisonError::into_inner))
        .collect()
}

/// As [`map`]; after a failure no item behind it is begun.
///
/// # Errors
/// That of the first item, in their order, that failed.
pub(crate) fn try_map<A: Sync, T: Send, E: Send>(
    items: &[A],
    work: impl Fn(&A) -> Result<T, E> + Sync,
) -> Result<Vec<T>, E> {
    let failed = AtomicUsize::new(usize::MAX);
    let numbered: Vec<(usize, &A)> = items.iter().enumerate().collect();
    let made = map(&numbered, |&(k, item)| {
        // The error of an item before this one will be returned.
        if failed.load(Ordering::Relaxed) < k {
            return None;
        }
        let made = work(item);
        if made.is_err() {
            failed.fetch_min(k, Ordering::Relaxed);
        }
        Some(made)
    });
    made.into_iter().flatten().collect()
}

/// Calls `work` with each part of `data` of this length, and its number; the last part may be shorter.
pub(crate) fn chunks<T: Send>(
    data: &mut [T],
    length: usize,
    work: impl Fn(usize, &mut [T]) + Sync,
) {
    let parts: Vec<Mutex<&mut [T]>> = data.chunks_mut(length).map(Mutex::new).collect();
    each(parts.len(), &|k| {
        work(k, &mut parts[k].lock().unwrap_or_else(PoisonError::into_inner));
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_item_is_worked_on_once_and_its_result_stands_at_its_place() {
        let calls = AtomicUsize::new(0);
        let items: Vec<usize> = (0..1000).rev().collect();
        let made = map(&items, |k| {
            calls.fetch_add(1, Ordering::Relaxed);
            k * k
        });
        assert_eq!(made, items.iter().map(|k| k * k).collect::<Vec<_>>());
        assert_eq!(calls.into_inner(), 1000);
        assert!(map(&[], |k: &usize| *k).is_empty());
    }

    #[test]
    fn the_first_item_that_fails_gives_the_error() {
        let items: Vec<usize> = (0..500).collect();
        for _ in 0..20 {
            let made = try_map(&items, |&k| if k % 7 == 6 { Err(k) } else { Ok(k) });
            assert_eq!(made, Err(6));
        }
        assert_eq!(try_map(&[0, 1, 2], |&k| Ok::<_, ()>(k)), Ok(vec![0, 1, 2]));
    }

    #[test]
    fn nothing_is_begun_behind_an_item_that_has_failed() {
        let (calls, items) = (AtomicUsize::new(0), vec![(); 1000]);
        let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let made = alone.install(|| {
            try_map(&items, |()| {
                calls.fetch_add(1, Ordering::Relaxed);
                Err::<(), _>(())
            })
        });
        assert_eq!((made, calls.into_inner()), (Err(()), 1));
    }

    #[test]
    fn parts_are_of_the_length_and_the_last_is_what_is_left() {
        let mut data = vec![0; 10];
        chunks(&mut data, 4, |k, part| {
            let length = part.len();
            part.iter_mut().for_each(|value| *value = 10 * k + length);
        });
        assert_eq!(data, [4, 4, 4, 4, 14, 14, 14, 14, 22, 22]);
    }
}
