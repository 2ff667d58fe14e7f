//! What would explain readings that do not belong to the patterns they are said to be of: a trigger
//! that came some readings early or late, or another order of the patterns.

use super::{HeldBack, Method, MethodSettings};
use crate::{Measurements, Order, Rows};
use std::fmt;

/// The most readings by which a recording may have begun early or late.
const MOST_READINGS: usize = 3;

/// What would explain readings.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Explanation {
    /// Each reading is that of the pattern this many places later in the order (earlier, if
    /// negative).
    Shift(i32),
    /// The patterns were shown in this order.
    Order(Order),
}

impl fmt::Display for Explanation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Shift(patterns) => {
                let (count, place) =
                    (patterns.unsigned_abs(), if *patterns > 0 { "later" } else { "earlier" });
                let s = if count == 1 { "" } else { "s" };
                write!(f, "readings of the pattern {count} place{s} {place} in the order")
            }
            Self::Order(order) => write!(f, "the order {order}"),
        }
    }
}

/// The shift or the named order under which the readings predict each other best, if one does far
/// better than chance; for readings that are [predicted by chance](HeldBack::is_by_chance) alone as
/// they are.
#[must_use]
pub fn explanation(measurements: &Measurements) -> Option<Explanation> {
    let side = measurements.side();
    let rows = measurements.rows();
    let most = MOST_READINGS.min(rows.len() / 2);
    let late = (1..=most).map(|by| {
        let shifted = rows.iter().skip(by).copied().collect();
        (Explanation::Shift(by as i32), shifted, 0)
    });
    let early = (1..=most).map(|by| {
        let shifted = rows.iter().take(rows.len() - by).copied().collect();
        (Explanation::Shift(-(by as i32)), shifted, by)
    });
    let orders = Order::NAMED.iter().filter_map(|named| {
        let order: Order = named.name.parse().ok()?;
        let first = order.rows(side).ok()?.first(rows.len()).to_vec();
        Some((Explanation::Order(order), first, 0))
    });
    let tried = late.chain(early).chain(orders).filter_map(|(explanation, patterns, skipped)| {
        let values = measurements.values()[skipped..][..patterns.len()].to_vec();
        let patterns = Rows::new(side, patterns).ok()?;
        let found = Measurements::from_differential(&patterns, &values).ok()?;
        Some((explanation, held_back(&found)?.score))
    });
    let tried: Vec<(Explanation, f64)> = tried.collect();
    let best = tried.iter().map(|(_, score)| *score).fold(f64::NEG_INFINITY, f64::max);
    // An order and its transpose explain a symmetrical scene equally well.
    let named = tried.into_iter().find(|(_, score)| *score >= 0.9 * best);
    named.filter(|_| best >= HeldBack::AMONG_MANY).map(|(explanation, _)| explanation)
}

/// What Tikhonov's method says of held-back readings.
fn held_back(measurements: &Measurements) -> Option<HeldBack> {
    let method = Method::TIKHONOV.prepare(&MethodSettings::default()).ok()?;
    method.reconstruct(measurements).ok()?.report.held_back
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{noisy, scene, side};

    /// Measurements of a figure whose readings are said to be of other patterns.
    fn said_to_be(of: impl Fn(usize) -> usize) -> Measurements {
        let rows = Order::ZigZag.rows(side(32)).unwrap();
        let shown = noisy(&rows, &scene(side(32), 1), 0.1, 1);
        let values: Vec<f64> = (0..800).map(|k| shown.values()[of(k)]).collect();
        Measurements::from_differential(&rows.first(800), &values).unwrap()
    }

    #[test]
    fn a_shift_and_another_order_are_named_and_right_readings_are_not_by_chance() {
        let right = said_to_be(|k| k);
        assert!(!held_back(&right).unwrap().is_by_chance());
        for (by, late) in [(1, true), (3, true), (2, false)] {
            let shifted = said_to_be(|k| if late { k + by } else { k.saturating_sub(by) });
            let by = if late { by as i32 } else { -(by as i32) };
            assert_eq!(
                explanation(&shifted),
                Some(Explanation::Shift(by)),
                "{:?}",
                held_back(&right)
            );
        }
        let cake = Order::CakeCutting.rows(side(32)).unwrap().first(800);
        let other = Measurements::from_differential(&cake, right.values()).unwrap();
        assert!(held_back(&other).unwrap().is_by_chance());
        assert_eq!(explanation(&other), Some(Explanation::Order(Order::ZigZag)));
        let noise = noisy(&cake, &[0.0; 1024], 1.0, 5);
        assert_eq!(explanation(&noise), None);
    }
}
