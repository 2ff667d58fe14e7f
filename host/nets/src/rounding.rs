//! Rounds numbers for the file of the calibration.

/// A number rounded to five digits.
pub(crate) fn rounded(value: f32) -> f32 {
    format!("{value:.4e}").parse().unwrap_or(value)
}
