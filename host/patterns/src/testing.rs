//! Shared test support.

use crate::Side;

pub(crate) fn side(n: u64) -> Side {
    Side::new(n).unwrap()
}
