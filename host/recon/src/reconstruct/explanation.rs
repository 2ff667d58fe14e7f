//! What would explain readings that do not belong to the patterns they are said to be of: a trigger
//! that came some readings early or late, or another order of the patterns.

use crate::Order;
use std::fmt;

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

impl Explanation {
    /// The most readings by which a recording may have begun early or late.
    pub const MOST_READINGS: usize = 3;
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
