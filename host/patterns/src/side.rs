//! The side of a square image, in pixels.

use thiserror::Error;

/// Side `n` of an `n x n` image and of its `n^2 x n^2` Hadamard matrix: a power of two, 2 to 256.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Side(u16);

/// The side asked for has no Hadamard basis here.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("an image side of {found} pixels: expected a power of two from 2 to 256")]
pub struct SideError {
    /// The side that was asked for.
    pub found: u64,
}

impl Side {
    /// The instrument's own 32 x 32 array.
    pub const INSTRUMENT: Self = Self(32);

    /// Checks that `side` is a power of two from 2 to 256.
    ///
    /// # Errors
    /// [`SideError`] names the side found.
    pub fn new(side: u64) -> Result<Self, SideError> {
        match u16::try_from(side) {
            Ok(n) if n.is_power_of_two() && (2..=256).contains(&n) => Ok(Self(n)),
            _ => Err(SideError { found: side }),
        }
    }

    /// Pixels along one edge, `n`.
    #[must_use]
    pub const fn pixels(self) -> usize {
        self.0 as usize
    }

    /// Pixels of the image and patterns of a full sweep, `n^2`.
    #[must_use]
    pub const fn area(self) -> usize {
        self.pixels() * self.pixels()
    }
}
