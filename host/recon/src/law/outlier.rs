//! Single readings that light cannot have given.

use super::doubt::Short;
use std::fmt;

/// A reading that light cannot have given. The measurements leave its pattern out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outlier {
    /// The reading, an index into the readings. Of a pair with too much light, the larger reading.
    pub reading: usize,
    /// The value of the reading.
    pub value: f64,
    /// The natural row of the pattern.
    pub row: u32,
    /// What is impossible.
    pub why: Impossible,
}

/// What light cannot do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Impossible {
    /// More light than the all-on pattern collects.
    AboveAllOn {
        /// The reading of the all-on pattern.
        all_on: f64,
    },
    /// Less light than the all-off pattern collects.
    BelowAllOff {
        /// The reading of the all-off pattern.
        all_off: f64,
    },
    /// More light in a pair than in the pairs beside it.
    PairTooBright {
        /// The sum of the pair.
        sum: f64,
        /// The sum of the pairs beside it.
        expected: f64,
    },
}

impl fmt::Display for Outlier {
    /// What is wrong with the reading, without its place.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = Short(self.value);
        match self.why {
            Impossible::AboveAllOn { all_on } => {
                write!(f, "{value} is above the all-on reading {}", Short(all_on))
            }
            Impossible::BelowAllOff { all_off } => {
                write!(f, "{value} is below the all-off reading {}", Short(all_off))
            }
            Impossible::PairTooBright { sum, expected } => write!(
                f,
                "{value} is in a pair with the sum {}, the pairs beside it have {}",
                Short(sum),
                Short(expected)
            ),
        }
    }
}
