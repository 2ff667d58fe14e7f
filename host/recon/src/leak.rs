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
//! before. A repeating sweep is preceded by itself (cyclic); a single sweep is preceded by
//! darkness.
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
//! `S` cancels in a repeating sweep. In a sweep that starts from darkness, pair `k` also has the
//! term `-S r[2k+1] / 2`: the light that its complement got from the first pattern, while its
//! pattern got none.

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

/// What came before the first slot of the readings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sweep {
    /// The same sweep, because sweeps repeat.
    Repeating,
    /// No light.
    FromDark,
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

    /// Corrects readings in time order, one for each slot: patterns alone, or patterns alternating
    /// with their complements.
    pub fn correct_single(&self, y: &mut [f64], sweep: Sweep) {
        undo(&self.taps, y, sweep);
    }

    /// Corrects the differences of a repeating sweep, in time order and complete.
    pub fn correct_differential(&self, d: &mut [f64]) {
        undo(&self.pair_taps(), d, Sweep::Repeating);
    }

    /// Corrects the differences of a sweep that started from darkness. `pair_sum` is the light `S`
    /// of a pattern and its complement together, in the units of `d`: the reading of the all-ones
    /// pattern less the dark level.
    pub fn correct_differential_from_dark(&self, d: &mut [f64], pair_sum: f64) {
        for (d, odd) in d.iter_mut().zip(self.taps.iter().skip(1).step_by(2)) {
            *d += pair_sum * odd / 2.0;
        }
        undo(&self.pair_taps(), d, Sweep::FromDark);
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
    let leaked = y.to_vec();
    let from_earlier = |x: &[f64], i: usize| -> f64 {
        let history = taps[1..].iter().enumerate();
        match sweep {
            Sweep::FromDark => history.take(i).map(|(j, tap)| tap * x[i - 1 - j]).sum(),
            Sweep::Repeating => {
                history.map(|(j, tap)| tap * x[(i + count * (1 + j / count) - 1 - j) % count]).sum()
            }
        }
    };
    // From darkness one pass is exact. In a cycle the first slots depend on the last, so
    // Gauss-Seidel passes follow, each of which shrinks the error at least by the leaked share.
    let share = taps[1..].iter().map(|tap| tap.abs()).sum::<f64>() / taps[0];
    let passes = match sweep {
        Sweep::FromDark => 1,
        Sweep::Repeating => (f64::EPSILON.ln() / share.ln()).ceil().max(1.0) as usize + 1,
    };
    for _ in 0..passes {
        let mut settled = true;
        for i in 0..count {
            let x = (leaked[i] - from_earlier(y, i)) / taps[0];
            settled &= x == y[i];
            y[i] = x;
        }
        if settled {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn leaked(taps: &[f64], x: &[f64], sweep: Sweep) -> Vec<f64> {
        let count = x.len() as i64;
        (0..count)
            .map(|i| {
                let earlier = taps.iter().enumerate().map(|(j, tap)| (tap, i - j as i64));
                match sweep {
                    Sweep::Repeating => {
                        earlier.map(|(tap, k)| tap * x[k.rem_euclid(count) as usize]).sum::<f64>()
                    }
                    Sweep::FromDark => {
                        earlier.filter(|(_, k)| *k >= 0).map(|(tap, k)| tap * x[k as usize]).sum()
                    }
                }
            })
            .collect()
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
            let leak = Leak::new(taps.clone()).unwrap();
            for sweep in [Sweep::Repeating, Sweep::FromDark] {
                let mut y = leaked(&taps, &x, sweep);
                leak.correct_single(&mut y, sweep);
                prop_assert!(close(&y, &x), "{:?}", sweep);
            }
        }

        #[test]
        fn correcting_differences_undoes_leaking_between_slots(
            taps in leaks(), h in prop::collection::vec(-1.0..1.0, 1..40), sum in 1.0..3.0
        ) {
            let leak = Leak::new(taps.clone()).unwrap();
            let x: Vec<f64> = h.iter().flat_map(|h| [(sum + h) / 2.0, (sum - h) / 2.0]).collect();
            for sweep in [Sweep::Repeating, Sweep::FromDark] {
                let y = leaked(&taps, &x, sweep);
                let mut d: Vec<f64> = y.as_chunks::<2>().0.iter().map(|[p, m]| p - m).collect();
                match sweep {
                    Sweep::Repeating => leak.correct_differential(&mut d),
                    Sweep::FromDark => leak.correct_differential_from_dark(&mut d, sum),
                }
                prop_assert!(close(&d, &h), "{:?}", sweep);
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
            let mut y = leaked(&taps, &x, Sweep::Repeating);
            leak.correct_single(&mut y, Sweep::Repeating);
            assert!(close(&y, &x), "{own}: {y:?}");
        }
    }
}
