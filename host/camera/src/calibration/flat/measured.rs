//! What the measurement of a flat field gives.

use super::FlatField;
use serde::{Deserialize, Serialize};

/// Numbers of differential sweeps of all patterns to sum.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sweeps {
    /// Sweeps for the flat field.
    pub map: u32,
    /// Sweeps for each of the two further images of the sheet, which measure how well the flat
    /// field corrects.
    pub check: u32,
}

impl Sweeps {
    /// `map` sweeps for the flat field, and an eighth of `map` for each image that checks the flat
    /// field.
    #[must_use]
    pub fn of_map(map: u32) -> Self {
        Self { map, check: (map / 8).max(1) }
    }
}

/// A flat field, and its effect on two further images of the sheet.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// The flat field.
    pub flat: FlatField,
    /// Fixed pattern of the sheet's images before correction, as a share of white.
    pub pattern_before: f64,
    /// Fixed pattern after correction, as a share of white.
    pub pattern_after: f64,
    /// Noise of a pixel of the flat field, as a share of white.
    pub noise: f64,
}
