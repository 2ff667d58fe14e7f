//! Why patterns of one's own give no image.

use nirspi_recon::Size;
use nirspi_recon::basis::Basis;
use nirspi_recon::omp::OmpError;
use thiserror::Error;

/// Why a matrix, its measurements or a setting is refused.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum MatrixError {
    /// The weights are not a whole number of patterns.
    #[error("{found} numbers, expected a multiple of the {} pixels of a {size} image", size.area())]
    Shape {
        /// Number of weights.
        found: usize,
        /// The size of an image.
        size: Size,
    },
    /// Images of this size have no such basis.
    #[error(
        "the {basis} basis of {size} images, expected dct or pixel: wavelets need squares of 2, 4, 8, ... pixels a side"
    )]
    Basis {
        /// The basis.
        basis: Basis,
        /// The size of the images.
        size: Size,
    },
    /// A weight or measurement is NaN or infinite.
    #[error("{field} is {found} at [{row}, {column}], expected finite numbers")]
    NotFinite {
        /// `matrix` or `y`.
        field: &'static str,
        /// Index of the pattern.
        row: usize,
        /// Index of the pixel.
        column: usize,
        /// The value found.
        found: f64,
    },
    /// All weights of all patterns are 0.
    #[error("a matrix of rank 0: every weight is 0, expected patterns that see something")]
    Dark,
    /// The number of measurements is not the number of patterns.
    #[error("{found} measurements by {expected} patterns, expected one a pattern")]
    Length {
        /// Number of measurements.
        found: usize,
        /// Number of patterns.
        expected: usize,
    },
    /// A setting out of range.
    #[error("{setting} is {found}, expected {expected}")]
    Setting {
        /// The name of the setting.
        setting: &'static str,
        /// The value that was given.
        found: f64,
        /// The allowed values.
        expected: &'static str,
    },
    /// Non-negative coefficients were requested for a basis whose atoms have negative pixels.
    #[error(
        "coefficients of 0 or more in the {basis} basis, expected the pixel basis or atoms of one's own"
    )]
    Signed {
        /// The basis.
        basis: Basis,
    },
    /// The pursuit refused the problem.
    #[error(transparent)]
    Pursuit(#[from] OmpError),
}
