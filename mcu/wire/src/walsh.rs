//! The LEDs of a pattern: the natural-order (Sylvester) Hadamard matrix by rows and columns.
//!
//! Pattern `k = 32 k_hi + k_lo` at LED `(r, c)` has the sign `(-1)^(popcount(k_hi & r) +
//! popcount(k_lo & c))`, so 32 row lines and 32 column lines with an XOR at each LED show any
//! pattern. A line is 0 for `+` and 1 for `-`. An LED is lit if the XOR of its two lines is 0. The
//! complement of a pattern inverts the row lines.

use crate::{PATTERNS, SIDE};

/// Bit `i` is the sign line of index `i` for the Walsh function `k`: `popcount(k & i) mod 2`.
#[must_use]
pub const fn lines(k: u8) -> u32 {
    let mut word = 0;
    let mut i = 0;
    while i < SIDE {
        word |= ((k & i).count_ones() & 1) << i;
        i += 1;
    }
    word
}

/// Row and column lines of pattern `k` of the 1024, or of its complement.
#[must_use]
pub const fn pattern(k: u16, complement: bool) -> (u32, u32) {
    let rows = lines((k / SIDE as u16) as u8 % SIDE);
    let columns = lines((k % SIDE as u16) as u8);
    (if complement { !rows } else { rows }, columns)
}

/// Whether the LED `(row, column)` is lit by these lines.
#[must_use]
pub const fn lit(rows: u32, columns: u32, row: u8, column: u8) -> bool {
    ((rows >> row) ^ (columns >> column)) & 1 == 0
}

/// Pattern shown `i`-th in sequency order: `bitrev(gray(i))` over the bits of a row (1-D Walsh order).
#[must_use]
pub const fn sequency(i: u16) -> u16 {
    let gray = i ^ (i >> 1);
    gray.reverse_bits() >> (16 - PATTERNS.trailing_zeros())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lit_leds_are_the_positive_entries_of_the_hadamard_row() {
        for k in 0..PATTERNS {
            let (rows, columns) = pattern(k, false);
            let (inverted, same) = pattern(k, true);
            for r in 0..SIDE {
                for c in 0..SIDE {
                    let pixel = u16::from(r) * u16::from(SIDE) + u16::from(c);
                    let positive = (k & pixel).count_ones().is_multiple_of(2);
                    assert_eq!(lit(rows, columns, r, c), positive, "k {k} ({r}, {c})");
                    assert_eq!(lit(inverted, same, r, c), !positive, "complement of {k}");
                }
            }
        }
    }

    #[test]
    fn sequency_counts_the_sign_changes_of_the_row() {
        for i in 0..PATTERNS {
            let k = sequency(i);
            let sign = |p: u16| (k & p).count_ones() & 1;
            let changes = (1..PATTERNS).filter(|&p| sign(p) != sign(p - 1)).count();
            assert_eq!(changes, usize::from(i));
        }
    }
}
