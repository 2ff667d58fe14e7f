//! Corrects settling leak: light and charge of one pattern's slot that are read in later slots.
//!
//! # Invariant
//! Correcting is the exact inverse of leaking (`tests::correcting_readings_undoes_leaking`,
//! `tests::correcting_differences_undoes_leaking_between_slots`). Correct the readings in time
//! order, before any row is dropped or reordered.
//!
//! # Model
//! With taps `r`, the reading of slot `i` is `y[i] = sum_j r[j] x[i - j]`: `r[0]` is the share of
//! its own signal `x` that a slot keeps, and `r[j]` the share that it gets from the slot `j` slots
//! before. Sweeps repeat, so the first slots get their share from the last.
//!
//! # Differential pairs
//! Pattern and complement alternate, `x[2k] = (S + h[k]) / 2` and `x[2k+1] = (S - h[k]) / 2`, where
//! `S` is the light of the pair. In `d[k] = y[2k] - y[2k+1]`, `h[k-m]` arrives in `y[2k]` through
//! the taps `2m` (from the pattern, sign +) and `2m - 1` (from the complement, sign -), and in
//! `y[2k+1]` through `2m` (complement, -) and `2m + 1` (pattern, +), each with a factor 1/2. Hence
//!
//! `d[k] = sum_m c[m] h[k - m]`, with `c[m] = r[2m] - r[2m-1] / 2 - r[2m+1] / 2` (taps outside the
//! list are 0).
//!
//! `S` cancels. A sweep that shows each complement before its pattern is the same with all signs of
//! `h` exchanged, and so are its differences. Where such sweeps follow others by turns
//! ([`Sweep::Alternating`]), `h[k - m]` of the sweep before therefore counts with the sign -.

use thiserror::Error;

/// The settling leak of an instrument, as measured by its self-test.
#[derive(Debug, Clone, PartialEq)]
pub struct Leak {
    taps: Vec<f64>,
}

/// Why a list of taps is refused.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum LeakError {
    /// No taps.
    #[error("a leak of no taps, expected at least the slot's own share")]
    Empty,
    /// A tap is NaN or infinite.
    #[error("leak tap {index} is {found}, expected a finite number")]
    NotFinite {
        /// Index of the tap.
        index: usize,
        /// The tap's value.
        found: f64,
    },
    /// The leaked share is too large: correcting it would amplify noise without bound.
    #[error(
        "leak taps 1 and up add to {leaked} (absolute values), expected at most {} of tap 0, which is {own}",
        Leak::LARGEST_SHARE
    )]
    NotDominant {
        /// The slot's own share, tap 0.
        own: f64,
        /// Sum of the absolute values of the other taps.
        leaked: f64,
    },
}

/// How a sweep of pairs follows the one before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sweep {
    /// It is the same.
    Repeating,
    /// It shows the same pairs with pattern and complement exchanged in time.
    Alternating,
}

impl Leak {
    /// Largest leaked share that is accepted, relative to the slot's own share. At this bound noise
    /// may grow a hundredfold.
    pub const LARGEST_SHARE: f64 = 0.99;

    /// A leak with these taps, in slots: `taps[0]` is a slot's own share, `taps[j]` the share from
    /// `j` slots before.
    ///
    /// # Errors
    /// [`LeakError`] if there is no tap, a tap is not finite, or the other taps together are not
    /// smaller than tap 0.
    pub fn new(taps: Vec<f64>) -> Result<Self, LeakError> {
        let Some(&own) = taps.first() else { return Err(LeakError::Empty) };
        if let Some(index) = taps.iter().position(|tap| !tap.is_finite()) {
            return Err(LeakError::NotFinite { index, found: taps[index] });
        }
        let leaked = taps[1..].iter().map(|tap| tap.abs()).sum();
        if own > 0.0 && leaked <= Self::LARGEST_SHARE * own {
            Ok(Self { taps })
        } else {
            Err(LeakError::NotDominant { own, leaked })
        }
    }

    /// The taps, in slots.
    #[must_use]
    pub fn taps(&self) -> &[f64] {
        &self.taps
    }

    /// Corrects the readings of a repeating sweep in time order, one for each slot: patterns alone, or
    /// patterns alternating with their complements.
    pub fn correct_single(&self, y: &mut [f64]) {
        undo(&self.taps, y, Sweep::Repeating);
    }

    /// Corrects the differences of a sweep, in time order and complete.
    pub fn correct_differential(&self, d: &mut [f64], sweep: Sweep) {
        undo(&self.pair_taps(), d, sweep);
    }

    /// The taps `c` of the differences, in pairs.
    fn pair_taps(&self) -> Vec<f64> {
        let tap = |j: usize| self.taps.get(j).copied().unwrap_or(0.0);
        (0..=self.taps.len() / 2)
            .map(|m| {
                let before = if m == 0 { 0.0 } else { tap(2 * m - 1) };
                tap(2 * m) - (before + tap(2 * m + 1)) / 2.0
            })
            .collect()
    }
}

/// Solves `y = taps * x` for `x`, in place. `taps[0]` is larger than the others together.
fn undo(taps: &[f64], y: &mut [f64], sweep: Sweep) {
    let count = y.len();
    if count == 0 {
        return;
    }
    // A division for each slot would be waited for by the next slot.
    let leaked: Vec<f64> = y.iter().map(|y| y / taps[0]).collect();
    let earlier: Vec<f64> = taps[1..].iter().map(|tap| tap / taps[0]).collect();
    let from_earlier = |x: &[f64], i: usize| -> f64 {
        if let Some(first) = i.checked_sub(earlier.len()) {
            return earlier.iter().zip(x[first..i].iter().rev()).map(|(tap, x)| tap * x).sum();
        }
        let history = earlier.iter().enumerate();
        history
            .map(|(j, tap)| {
                let sweeps_ago = (count + j - i) / count;
                let x = x[i + count * sweeps_ago - 1 - j];
                let is_swapped = sweep == Sweep::Alternating && sweeps_ago % 2 == 1;
                if is_swapped { -tap * x } else { tap * x }
            })
            .sum()
    };
    // The first slots depend on the last, so Gauss-Seidel passes follow each other, each of which
    // shrinks the error at least by the leaked share.
    let share: f64 = earlier.iter().map(|tap| tap.abs()).sum();
    let passes = (f64::EPSILON.ln() / share.ln()).ceil().max(1.0) as usize + 1;
    for pass in 0..passes {
        // Slots one after another that are as the pass before has left them.
        let mut settled = 0;
        for i in 0..count {
            let x = leaked[i] - from_earlier(y, i);
            settled = if x == y[i] { settled + 1 } else { 0 };
            y[i] = x;
            // What follows depends on these alone, so it is as the pass before has left it.
            if pass > 0 && settled > earlier.len() && i >= earlier.len() {
                return;
            }
        }
        if settled == count {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The readings of slots that repeat for ever.
    fn leaked(taps: &[f64], x: &[f64]) -> Vec<f64> {
        let count = x.len() as i64;
        let earlier = |i: i64| taps.iter().zip(0..).map(move |(tap, j)| (tap, i - j));
        let read = |i| earlier(i).map(|(tap, k)| tap * x[k.rem_euclid(count) as usize]).sum();
        (0..count).map(read).collect()
    }

    fn leaks() -> impl Strategy<Value = Vec<f64>> {
        (0.5..1.5, prop::collection::vec(-0.2..0.2, 0..6), 0.0..0.95).prop_map(
            |(own, mut rest, share)| {
                let total: f64 = rest.iter().map(|t: &f64| t.abs()).sum();
                if total > share * own {
                    rest.iter_mut().for_each(|t| *t *= share * own / total);
                }
                rest.insert(0, own);
                rest
            },
        )
    }

    fn close(a: &[f64], b: &[f64]) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9)
    }

    proptest! {
        #[test]
        fn correcting_readings_undoes_leaking(
            taps in leaks(), x in prop::collection::vec(-1.0..1.0, 1..80)
        ) {
            let mut y = leaked(&taps, &x);
            Leak::new(taps).unwrap().correct_single(&mut y);
            prop_assert!(close(&y, &x));
        }

        #[test]
        fn correcting_differences_undoes_leaking_between_slots(
            taps in leaks(), h in prop::collection::vec(-1.0..1.0, 1..40), sum in 1.0..3.0
        ) {
            let leak = Leak::new(taps.clone()).unwrap();
            let pairs = |sign: f64| {
                h.iter().flat_map(move |h| [(sum + sign * h) / 2.0, (sum - sign * h) / 2.0])
            };
            let differences = |y: &[f64]| -> Vec<f64> {
                y.as_chunks::<2>().0.iter().map(|[first, second]| first - second).collect()
            };
            let mut d = differences(&leaked(&taps, &pairs(1.0).collect::<Vec<_>>()));
            leak.correct_differential(&mut d, Sweep::Repeating);
            prop_assert!(close(&d, &h));

            let y = leaked(&taps, &pairs(1.0).chain(pairs(-1.0)).collect::<Vec<_>>());
            let (plain, swapped) = y.split_at(2 * h.len());
            for (sign, y) in [(1.0, plain), (-1.0, swapped)] {
                let mut d: Vec<f64> = differences(y).iter().map(|d| sign * d).collect();
                leak.correct_differential(&mut d, Sweep::Alternating);
                prop_assert!(close(&d, &h), "{sign}");
            }
        }
    }

    #[test]
    fn taps_that_cannot_be_undone_are_refused() {
        assert_eq!(Leak::new(vec![]), Err(LeakError::Empty));
        assert!(matches!(
            Leak::new(vec![1.0, f64::NAN]),
            Err(LeakError::NotFinite { index: 1, .. })
        ));
        for (own, leaked) in [(0.0, 0.0), (-1.0, 0.1), (0.5, 0.5), (1.0, 2.0)] {
            let refused = Leak::new(vec![own, leaked]);
            assert_eq!(refused, Err(LeakError::NotDominant { own, leaked }));
        }
        let taps = vec![0.5, -0.25, 0.125];
        assert_eq!(Leak::new(taps.clone()).unwrap().taps(), taps);
    }

    /// The number of passes follows from the leaked share of a slot's own light, not from the leaked
    /// light.
    #[test]
    fn the_largest_share_is_undone_however_small_the_signal() {
        for own in [0.01, 1.0, 100.0] {
            let taps = vec![own, Leak::LARGEST_SHARE * own];
            let leak = Leak::new(taps.clone()).unwrap();
            let x: Vec<f64> = (0..8).map(|i| f64::from(i * i % 5) - 2.0).collect();
            let mut y = leaked(&taps, &x);
            leak.correct_single(&mut y);
            assert!(close(&y, &x), "{own}: {y:?}");
        }
    }
}
