//! The order in which Hadamard patterns are shown.
//!
//! A new order is a variant of [`Order`], an entry of [`Order::NAMED`] with the function that makes
//! its rows, and a line of the table below. Parsers, help texts and comparisons follow from the
//! entry.
//!
//! # Invariant
//! [`Order::rows`] is a permutation of `0..n^2`, whose k-th entry is the row of the natural-order
//! Hadamard matrix shown k-th. Held by `order::tests::every_order_is_a_permutation_at_every_side`.
//!
//! Row `r = n * r_hi + r_lo` is the pattern `w(r_hi) (x) w(r_lo)`: the 1-D Walsh function `w(r_hi)`
//! down the image times `w(r_lo)` across it. `s(r)` below is the *sequency* of a 1-D function, its
//! number of sign changes; `i = s(r_hi)`, `j = s(r_lo)`. A 1-D function has `s + 1` runs of equal
//! sign. Every tie is broken by the smaller natural row.
//!
//! | order | definition followed | source |
//! |---|---|---|
//! | `natural` | row k | J. J. Sylvester, *Thoughts on inverse orthogonal matrices*, 1867 |
//! | `sequency` | `bitrev(gray(k))` over all `log2(n^2)` bits: sign changes of the row as one long 1-D function; the gateware computes it without a table | J. L. Walsh, *A closed set of normal orthogonal functions*, 1923 |
//! | `zig-zag` | the `(i, j)` grid along anti-diagonals `i + j`, with `i` growing along the odd ones and falling along the even ones, as JPEG scans a block; this is the order of the public log `opar_ala1` | L. Lopez-Garcia et al., *Efficient ordering of the Hadamard basis for single pixel imaging*, 2022 (the idea; ours is fixed by that log) |
//! | `cake-cutting` | ascending number of connected blocks of the pattern, `(i + 1)(j + 1)` | W.-K. Yu, *Super sub-Nyquist single-pixel imaging by means of cake-cutting Hadamard basis sort*, 2019 |
//! | `russian-dolls` | complete `2 x 2`, then `4 x 4`, ... bases, one inside the other; what each adds comes as the quarter finer across (`j` new), the quarter finer down (its transposes, in the same order), the quarter finer both ways; within a quarter ascending number of blocks (which of the two half-finer quarters comes first is our choice) | M.-J. Sun et al., *A Russian Dolls ordering of the Hadamard basis for compressive single-pixel imaging*, 2017 |
//! | `total-variation` | ascending total variation of the pattern: the sum of the lengths of its forward-difference gradients (isotropic, which the paper's text was not at hand to confirm), `2 n (i + j) - (4 - 2 sqrt 2) i j` | X. Yu et al., *Super sub-Nyquist single-pixel imaging by total variation ascending ordering of the Hadamard basis*, 2020 |
//! | `random:SEED` | Fisher-Yates from the last entry down, driven by `rand_pcg::Pcg64`; then the all-ones pattern moves to the front, so that every part of a sweep holds it | R. Durstenfeld, *Algorithm 235: random permutation*, 1964; M. E. O'Neill, *PCG*, 2014 |
//! | `walsh-2d` | the `(i, j)` grid row by row: `p(i) n + p(j)`, `p(s)` being the row of 1-D sequency `s` | SPyRiT 3.1.1, `HadamSplit2d(n)` without an order |
//! | `deepinv:sequency` | ours, transposed | deepinv 0.5.0, `SinglePixelCamera(ordering="sequency")` |
//! | `deepinv:cake_cutting` | ascending `(i + 1)(j + 1)`; its ties are not defined | the same, `"cake_cutting"` |
//! | `deepinv:zig_zag` | anti-diagonals, `i` falling along each | the same, `"zig_zag"` |
//! | `deepinv:xy` | ascending `i j + (i^2 + j^2) / 4`; its ties are not defined | the same, `"xy"` |
//!
//! Other programs use some of these names for other orders; compare tables, not names. SPyRiT's
//! `define_order` (TV, CC, Sequency, Variance) is no order that can be named: it leaves ties, the
//! all-ones pattern's among them, to PyTorch's unstable sort, and `Variance` comes from measured
//! images. Such an order is given as a table.

use crate::{Rows, RowsError, Side};
use rand::Rng;
use rand_pcg::Pcg64;
use std::cmp::Ordering;
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// An order of the `n^2` patterns of a sweep. The module's table says which definition each one
/// follows.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Order {
    /// Row k of the Sylvester matrix.
    Natural,
    /// Ascending sign changes of the row seen as one 1-D function.
    Sequency,
    /// Anti-diagonals of the grid of two 1-D sequencies.
    ZigZag,
    /// Ascending number of connected blocks.
    CakeCutting,
    /// Complete coarse bases first, each inside the next.
    RussianDolls,
    /// Ascending isotropic total variation.
    TotalVariation,
    /// The grid of two sequencies row by row: SPyRiT's.
    Walsh2d,
    /// deepinv's `sequency`.
    DeepinvSequency,
    /// deepinv's `cake_cutting`.
    DeepinvCakeCutting,
    /// deepinv's `zig_zag`.
    DeepinvZigZag,
    /// deepinv's `xy`.
    DeepinvXy,
    /// The all-ones pattern, then all others in a shuffle that the seed determines.
    Random(u64),
    /// The user's own: entry k is the natural row shown k-th.
    Table(Vec<u32>),
}

/// An order that has a name, with what belongs to it: one entry here is all that an order needs.
#[derive(Debug, Clone)]
pub struct NamedOrder {
    /// The name that [`Order::from_str`] reads.
    pub name: &'static str,
    /// In one line, for a list of orders.
    pub about: &'static str,
    /// The order.
    pub order: Order,
    /// The package whose definition it is, if it is another one's.
    pub package: Option<&'static str>,
    /// Whether that package leaves the order of equal patterns to an unstable sort: its files may
    /// have equal ones exchanged.
    pub has_undefined_ties: bool,
    rows: fn(Side) -> Vec<u32>,
}

impl Order {
    /// Every order that has a name. Argument parsers, error texts and comparisons take their lists
    /// from here.
    pub const NAMED: &'static [NamedOrder] = &[
        NamedOrder {
            name: "natural",
            about: "rows of the Sylvester matrix as they come",
            order: Self::Natural,
            package: None,
            has_undefined_ties: false,
            rows: |side| (0..side.area() as u32).collect(),
        },
        NamedOrder {
            name: "sequency",
            about: "ascending sign changes of the row as one long function",
            order: Self::Sequency,
            package: None,
            has_undefined_ties: false,
            rows: sequency,
        },
        NamedOrder {
            name: "zig-zag",
            about: "anti-diagonals of the grid of two sequencies, as JPEG scans a block",
            order: Self::ZigZag,
            package: None,
            has_undefined_ties: false,
            rows: zig_zag,
        },
        NamedOrder {
            name: "cake-cutting",
            about: "ascending number of connected blocks",
            order: Self::CakeCutting,
            package: None,
            has_undefined_ties: false,
            rows: |side| sorted(side, Pattern::blocks),
        },
        NamedOrder {
            name: "russian-dolls",
            about: "complete coarse bases first, each inside the next",
            order: Self::RussianDolls,
            package: None,
            has_undefined_ties: false,
            rows: russian_dolls,
        },
        NamedOrder {
            name: "total-variation",
            about: "ascending total variation of the pattern",
            order: Self::TotalVariation,
            package: None,
            has_undefined_ties: false,
            rows: total_variation,
        },
        NamedOrder {
            name: "walsh-2d",
            about: "the grid of two sequencies row by row: SPyRiT's HadamSplit2d",
            order: Self::Walsh2d,
            package: Some("SPyRiT"),
            has_undefined_ties: false,
            rows: others::walsh_2d,
        },
        NamedOrder {
            name: "deepinv:sequency",
            about: "deepinv's: as `sequency`, down the columns",
            order: Self::DeepinvSequency,
            package: Some("deepinv"),
            has_undefined_ties: false,
            rows: others::deepinv_sequency,
        },
        NamedOrder {
            name: "deepinv:cake_cutting",
            about: "deepinv's: ascending number of connected blocks",
            order: Self::DeepinvCakeCutting,
            package: Some("deepinv"),
            has_undefined_ties: true,
            rows: others::deepinv_cake_cutting,
        },
        NamedOrder {
            name: "deepinv:zig_zag",
            about: "deepinv's: anti-diagonals of the grid of two sequencies, all in one direction",
            order: Self::DeepinvZigZag,
            package: Some("deepinv"),
            has_undefined_ties: false,
            rows: others::deepinv_zig_zag,
        },
        NamedOrder {
            name: "deepinv:xy",
            about: "deepinv's: ascending x y + (x^2 + y^2) / 4 of the two sequencies",
            order: Self::DeepinvXy,
            package: Some("deepinv"),
            has_undefined_ties: true,
            rows: others::deepinv_xy,
        },
    ];

    /// What [`Order::from_str`] reads, as a list for messages: `natural, sequency, ... or
    /// random:SEED`.
    #[must_use]
    pub fn expected() -> String {
        let names: Vec<&str> = Self::NAMED.iter().map(|named| named.name).collect();
        format!("{} or random:SEED", names.join(", "))
    }

    /// The row shown k-th, for all `side^2` patterns.
    ///
    /// # Errors
    /// [`RowsError`] if this is a [`Table`](Self::Table) that is no permutation of `0..side^2`.
    pub fn rows(&self, side: Side) -> Result<Rows, RowsError> {
        let rows = match self {
            Self::Random(seed) => all_ones_first(shuffled(side.area() as u32, *seed)),
            Self::Table(table) => {
                return Rows::new(side, table.iter().copied()).and_then(Rows::whole);
            }
            named => (named.entry().ok_or(RowsError::Empty)?.rows)(side),
        };
        Ok(Rows::trusted(side, rows))
    }

    /// The first named order that shows these rows in this sequence; `None` if none does. One row
    /// alone is no order.
    #[must_use]
    pub fn of(rows: &[u32], side: Side) -> Option<Self> {
        let mut named = Self::NAMED.iter().filter(|_| rows.len() > 1);
        named.find(|named| (named.rows)(side).starts_with(rows)).map(|named| named.order.clone())
    }

    /// The order's entry in the list, if it has a name.
    #[must_use]
    pub fn entry(&self) -> Option<&'static NamedOrder> {
        Self::NAMED.iter().find(|named| named.order == *self)
    }
}

/// The name of no order.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("unknown order {found:?}, expected {}", Order::expected())]
pub struct ParseOrderError {
    /// What was given.
    pub found: String,
}

impl FromStr for Order {
    type Err = ParseOrderError;

    fn from_str(name: &str) -> Result<Self, ParseOrderError> {
        if let Some(named) = Self::NAMED.iter().find(|named| named.name == name) {
            return Ok(named.order.clone());
        }
        name.strip_prefix("random:")
            .and_then(|seed| seed.parse().ok())
            .map(Self::Random)
            .ok_or_else(|| ParseOrderError { found: name.to_owned() })
    }
}

impl fmt::Display for Order {
    /// The name that [`FromStr`] reads; a table, which has none, is `table`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Random(seed) => write!(f, "random:{seed}"),
            named => f.write_str(named.entry().map_or("table", |entry| entry.name)),
        }
    }
}

/// A pattern by the sequencies of its two factors.
#[derive(Clone, Copy)]
struct Pattern {
    row: u32,
    down: u32,
    across: u32,
}

impl Pattern {
    fn blocks(&self) -> u32 {
        (self.down + 1) * (self.across + 1)
    }
}

/// Positions of the rows but the all-ones one, in ascending sequency (along the zig-zag).
pub fn positions_by_sequency(rows: &Rows) -> Vec<usize> {
    let mut rank = vec![0; rows.side().area()];
    for (k, row) in zig_zag(rows.side()).into_iter().enumerate() {
        rank[row as usize] = k;
    }
    let mut positions: Vec<usize> = (0..rows.len()).filter(|&k| rows[k] != 0).collect();
    positions.sort_by_key(|&k| rank[rows[k] as usize]);
    positions
}

/// Natural row of the Walsh function of that sequency, among `count` (a power of two).
fn walsh_row(sequency: u32, count: u32) -> u32 {
    let gray = sequency ^ (sequency >> 1);
    gray.reverse_bits() >> (u32::BITS - count.trailing_zeros())
}

/// Sequency of each natural row of the 1-D Walsh functions, `count` of them (a power of two).
pub fn sequencies(count: u32) -> Vec<u32> {
    let mut sequency = vec![0; count as usize];
    for s in 0..count {
        sequency[walsh_row(s, count) as usize] = s;
    }
    sequency
}

fn patterns(side: Side) -> Vec<Pattern> {
    let n = side.pixels() as u32;
    let sequency = sequencies(n);
    let at = |row: u32| sequency[row as usize];
    (0..n * n).map(|row| Pattern { row, down: at(row / n), across: at(row % n) }).collect()
}

fn sorted<K: Ord>(side: Side, key: impl Fn(&Pattern) -> K) -> Vec<u32> {
    let mut patterns = patterns(side);
    patterns.sort_by_key(key); // stable: ties stay in natural order
    patterns.iter().map(|p| p.row).collect()
}

fn sequency(side: Side) -> Vec<u32> {
    let area = side.area() as u32;
    (0..area).map(|k| walsh_row(k, area)).collect()
}

fn zig_zag(side: Side) -> Vec<u32> {
    sorted(side, |p| {
        let diagonal = p.down + p.across;
        (diagonal, if diagonal % 2 == 1 { p.down } else { p.across })
    })
}

fn russian_dolls(side: Side) -> Vec<u32> {
    let doll = |sequency: u32| u32::BITS - sequency.leading_zeros();
    sorted(side, |p| {
        let (down, across) = (doll(p.down), doll(p.across));
        let (quarter, row_of_transpose) = match down.cmp(&across) {
            Ordering::Less => (0, p.row),
            // Transposed, so that the third quarter repeats the second one's order.
            Ordering::Greater => {
                let n = side.pixels() as u32;
                (1, (p.row % n) * n + p.row / n)
            }
            Ordering::Equal => (2, p.row),
        };
        (down.max(across), quarter, p.blocks(), row_of_transpose)
    })
}

fn total_variation(side: Side) -> Vec<u32> {
    let n = side.pixels() as f64;
    sorted(side, |p| {
        let (i, j) = (f64::from(p.down), f64::from(p.across));
        let variation = 2.0 * n * (i + j) - (4.0 - 2.0 * std::f64::consts::SQRT_2) * i * j;
        // The bits of numbers that are not negative ascend as the numbers do.
        variation.to_bits()
    })
}

/// Stream of the generator behind [`Order::Random`]: any constant would do, but never another one.
const RANDOM_STREAM: u128 = 0x6e69_7273_7069;

/// Numbers in an order that the seed determines.
pub fn shuffled(count: u32, seed: u64) -> Vec<u32> {
    let mut generator = Pcg64::new(u128::from(seed), RANDOM_STREAM);
    // Written out, not taken from a library: a library may change how it draws, recordings may not.
    let mut below = |bound: u64| {
        let unbiased = u64::MAX - u64::MAX % bound;
        loop {
            let draw = generator.next_u64();
            if draw < unbiased {
                return (draw % bound) as usize;
            }
        }
    };
    let mut rows: Vec<u32> = (0..count).collect();
    for last in (1..rows.len()).rev() {
        rows.swap(last, below(last as u64 + 1));
    }
    rows
}

/// The rows with the all-ones pattern in front. The mean of an image is in this pattern alone: a part of
/// a sweep without it has none.
fn all_ones_first(mut rows: Vec<u32>) -> Vec<u32> {
    let all_ones = rows.iter().position(|&row| row == 0).unwrap_or(0);
    rows[..=all_ones].rotate_right(1);
    rows
}

mod others;
#[cfg(test)]
mod tests;
