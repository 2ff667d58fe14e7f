//! The order in which Hadamard patterns are shown.
//!
//! The one law: [`Order::rows`] is a permutation of `0..n^2`, whose k-th entry is the row of the
//! natural-order Hadamard matrix shown k-th.
//!
//! Row `r = n * r_hi + r_lo` is the pattern `w(r_hi) (x) w(r_lo)`: the 1-D Walsh function `w(r_hi)` down
//! the image times `w(r_lo)` across it. `s(r)` below is the *sequency* of a 1-D function, its number of sign
//! changes; `i = s(r_hi)`, `j = s(r_lo)`. A 1-D function has `s + 1` runs of equal sign. Every tie is
//! broken by the smaller natural row.
//!
//! | order | definition followed | source |
//! |---|---|---|
//! | `natural` | row k | J. J. Sylvester, *Thoughts on inverse orthogonal matrices*, 1867 |
//! | `sequency` | `bitrev(gray(k))` over all `log2(n^2)` bits: sign changes of the row as one long 1-D function; the gateware computes it without a table | J. L. Walsh, *A closed set of normal orthogonal functions*, 1923 |
//! | `zig-zag` | the `(i, j)` grid along anti-diagonals `i + j`, with `i` growing along the odd ones and falling along the even ones, as JPEG scans a block; this is the order of the public log `opar_ala1` | L. Lopez-Garcia et al., *Efficient ordering of the Hadamard basis for single pixel imaging*, 2022 (the idea; ours is fixed by that log) |
//! | `cake-cutting` | ascending number of connected blocks of the pattern, `(i + 1)(j + 1)` | W.-K. Yu, *Super sub-Nyquist single-pixel imaging by means of cake-cutting Hadamard basis sort*, 2019 |
//! | `russian-dolls` | complete `2 x 2`, then `4 x 4`, ... bases, one inside the other; what each adds comes as the quarter finer across (`j` new), the quarter finer down (its transposes, in the same order), the quarter finer both ways; within a quarter ascending number of blocks (which of the two half-finer quarters comes first is our choice) | M.-J. Sun et al., *A Russian Dolls ordering of the Hadamard basis for compressive single-pixel imaging*, 2017 |
//! | `total-variation` | ascending total variation of the pattern: the sum of the lengths of its forward-difference gradients (isotropic, which the paper's text was not at hand to confirm), `2 n (i + j) - (4 - 2 sqrt 2) i j` | X. Yu et al., *Super sub-Nyquist single-pixel imaging by total variation ascending ordering of the Hadamard basis*, 2020 |
//! | `random:SEED` | Fisher-Yates from the last entry down, driven by `rand_pcg::Pcg64` | R. Durstenfeld, *Algorithm 235: random permutation*, 1964; M. E. O'Neill, *PCG*, 2014 |
//!
//! Other programs use some of these names for other orders; compare tables, not names.

use crate::Side;
use rand::Rng;
use rand_pcg::Pcg64;
use std::cmp::Ordering;
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// An order of the `n^2` patterns of a sweep. The module's table says which definition each one follows.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
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
    /// A shuffle that its seed determines, today and in every later version.
    Random(u64),
    /// The user's own: entry k is the natural row shown k-th.
    Table(Vec<u32>),
}

/// A table that is no permutation of the rows.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum OrderError {
    /// The table does not have one entry a pattern.
    #[error("an order table of {found} entries, expected {expected}")]
    Length {
        /// Entries of the table.
        found: usize,
        /// Patterns of a sweep, `n^2`.
        expected: usize,
    },
    /// An entry is no row.
    #[error("order table entry {index} is {found}, expected 0 to {last}")]
    OutOfRange {
        /// Position in the table.
        index: usize,
        /// The entry.
        found: u32,
        /// Last row there is.
        last: u32,
    },
    /// An entry is there twice.
    #[error("order table entry {index} repeats row {row}, first at entry {first}")]
    Repeated {
        /// Position of the second.
        index: usize,
        /// Position of the first.
        first: usize,
        /// The row.
        row: u32,
    },
}

/// The name of no order.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error(
    "unknown order {found:?}, expected natural, sequency, zig-zag, cake-cutting, russian-dolls, \
     total-variation or random:SEED"
)]
pub struct ParseOrderError {
    /// What was given.
    pub found: String,
}

const NAMED: [(&str, Order); 6] = [
    ("natural", Order::Natural),
    ("sequency", Order::Sequency),
    ("zig-zag", Order::ZigZag),
    ("cake-cutting", Order::CakeCutting),
    ("russian-dolls", Order::RussianDolls),
    ("total-variation", Order::TotalVariation),
];

impl FromStr for Order {
    type Err = ParseOrderError;

    fn from_str(name: &str) -> Result<Self, ParseOrderError> {
        if let Some((_, order)) = NAMED.iter().find(|(known, _)| *known == name) {
            return Ok(order.clone());
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
            Self::Table(_) => f.write_str("table"),
            named => {
                let name =
                    NAMED.iter().find(|(_, order)| order == named).map_or("", |(name, _)| name);
                f.write_str(name)
            }
        }
    }
}

impl Order {
    /// Natural row shown k-th, for all `side^2` patterns.
    ///
    /// # Errors
    /// [`OrderError`] if this is a [`Table`](Self::Table) that is no permutation of `0..side^2`.
    pub fn rows(&self, side: Side) -> Result<Vec<u32>, OrderError> {
        let area = side.area() as u32;
        Ok(match self {
            Self::Natural => (0..area).collect(),
            Self::Sequency => (0..area).map(|k| walsh_row(k, area)).collect(),
            Self::ZigZag => zig_zag(side),
            Self::CakeCutting => sorted(side, Pattern::blocks),
            Self::RussianDolls => russian_dolls(side),
            Self::TotalVariation => {
                let n = side.pixels() as f64;
                let variation = |p: &Pattern| {
                    let (i, j) = (f64::from(p.down), f64::from(p.across));
                    2.0 * n * (i + j) - (4.0 - 2.0 * std::f64::consts::SQRT_2) * i * j
                };
                sorted(side, |p| Ascending(variation(p)))
            }
            Self::Random(seed) => shuffled(area, *seed),
            Self::Table(table) => {
                check_permutation(table, side.area())?;
                table.clone()
            }
        })
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
pub(crate) fn positions_by_sequency(side: Side, rows: &[u32]) -> Vec<usize> {
    let mut rank = vec![0; side.area()];
    // A named order always exists.
    for (k, row) in Order::ZigZag.rows(side).unwrap_or_default().into_iter().enumerate() {
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

fn patterns(side: Side) -> Vec<Pattern> {
    let n = side.pixels() as u32;
    let mut sequency = vec![0; side.pixels()];
    for s in 0..n {
        sequency[walsh_row(s, n) as usize] = s;
    }
    let at = |row: u32| sequency[row as usize];
    (0..n * n).map(|row| Pattern { row, down: at(row / n), across: at(row % n) }).collect()
}

fn sorted<K: Ord>(side: Side, key: impl Fn(&Pattern) -> K) -> Vec<u32> {
    let mut patterns = patterns(side);
    patterns.sort_by_key(key); // stable: ties stay in natural order
    patterns.iter().map(|p| p.row).collect()
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

/// Stream of the generator behind [`Order::Random`]: any constant would do, but never another one.
const RANDOM_STREAM: u128 = 0x6e69_7273_7069;

fn shuffled(count: u32, seed: u64) -> Vec<u32> {
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

fn check_permutation(table: &[u32], area: usize) -> Result<(), OrderError> {
    if table.len() != area {
        return Err(OrderError::Length { found: table.len(), expected: area });
    }
    let mut first = vec![None; area];
    for (index, &row) in table.iter().enumerate() {
        let Some(seen) = first.get_mut(row as usize) else {
            return Err(OrderError::OutOfRange { index, found: row, last: area as u32 - 1 });
        };
        match *seen {
            Some(first) => return Err(OrderError::Repeated { index, first, row }),
            None => *seen = Some(index),
        }
    }
    Ok(())
}

/// A finite number as a sort key.
struct Ascending(f64);
impl PartialEq for Ascending {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Ascending {}
impl PartialOrd for Ascending {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Ascending {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0)
    }
}

#[cfg(test)]
mod tests;
