//! Orders as other packages define them, so that their files open here.
//!
//! # Invariant
//! Each order is that of the package named, down to the transposition of the image, at sides 8, 16
//! and 32; where the package leaves ties to an unstable sort, up to these ties. Held against tables
//! that the packages themselves have made (`others.txt`, by `scripts/orders_of_others.py`) by
//! `order::tests::orders_of_other_packages_are_theirs`.

use super::{Pattern, sorted, walsh_row};
use crate::Side;

/// SPyRiT's `HadamSplit2d(n)` and `walsh_matrix_2d`: the grid of two sequencies, row by row.
pub(super) fn walsh_2d(side: Side) -> Vec<u32> {
    sorted(side, |p| (p.down, p.across))
}

/// deepinv's `sequency`: sign changes of the column-major image as one long function.
pub(super) fn deepinv_sequency(side: Side) -> Vec<u32> {
    let area = side.area() as u32;
    (0..area).map(|k| transposed(side, walsh_row(k, area))).collect()
}

/// deepinv's `cake_cutting`: ascending number of blocks. Ties, which deepinv leaves to NumPy's
/// unstable sort, stand as in its list before that sort: sequency by sequency down the image, the
/// across one growing or falling in turn.
pub(super) fn deepinv_cake_cutting(side: Side) -> Vec<u32> {
    sorted(side, |p| {
        let turn = if p.across.is_multiple_of(2) { p.down } else { u32::MAX - p.down };
        (p.blocks(), p.across, turn)
    })
}

/// deepinv's `zig_zag`: anti-diagonals of the grid of two sequencies, each from its end with the
/// highest one down the image.
pub(super) fn deepinv_zig_zag(side: Side) -> Vec<u32> {
    sorted(side, |p| (p.down + p.across, u32::MAX - p.down))
}

/// deepinv's `xy`: ascending `x y + (x^2 + y^2) / 4` of the two sequencies. Ties, which deepinv
/// leaves to PyTorch's unstable sort, stand in the order of the grid's rows.
pub(super) fn deepinv_xy(side: Side) -> Vec<u32> {
    sorted(side, |p| (xy(p), p.down, p.across))
}

/// Four times what deepinv's `xy` sorts by.
fn xy(p: &Pattern) -> u64 {
    let (x, y) = (u64::from(p.down), u64::from(p.across));
    4 * x * y + x * x + y * y
}

/// What an order sorts by, where it leaves ties to an unstable sort. The formulas are not those of
/// the orders, which they check.
#[cfg(test)]
pub(super) fn ties(name: &str) -> Option<fn(&Pattern) -> u64> {
    match name {
        "deepinv:cake_cutting" => Some(|p| ((p.down + 1) * (p.across + 1)).into()),
        "deepinv:xy" => Some(|p| ((p.down + p.across).pow(2) + 2 * p.down * p.across).into()),
        _ => None,
    }
}

/// The row whose pattern is the transpose.
fn transposed(side: Side, row: u32) -> u32 {
    let n = side.pixels() as u32;
    (row % n) * n + row / n
}

/// The patterns of a side by their row.
#[cfg(test)]
pub(super) fn by_row(side: Side) -> Vec<Pattern> {
    super::patterns(side)
}
