//! Sets of patterns that have a name: Fourier's of three or four steps, and cyclic S-matrices.
//!
//! # Invariant
//! A scene seen through a set gives its image by the set's name (`tests::a_scene_behind_a_set_gives_its_image`).

mod fourier;
#[cfg(test)]
mod tests;

pub(super) use fourier::read_fourier;

use super::patterns::Patterns;
use nirspi_recon::{Size, s_matrix};
use std::fmt;
use std::path::Path;
use std::str::FromStr;

/// A set of patterns by its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NamedPatterns {
    /// `fourier:3` or `fourier:4`: cosines of each frequency, shifted in 3 or 4 equal steps.
    Fourier {
        /// Steps of a full turn: 3 or 4.
        steps: usize,
    },
    /// `s-matrix:N`: the cyclic S-matrix of order N, whose row k is the first row moved k pixels to the left.
    SMatrix {
        /// Number of patterns, and of pixels.
        order: usize,
    },
}

impl NamedPatterns {
    /// The names, for help and error messages.
    pub const EXPECTED: &'static str =
        "fourier:3, fourier:4, or s-matrix:N with N such as 15, 63, 255 or 1023";

    /// The set of the name that stands in the place of a file, if no such file exists.
    pub(super) fn instead_of(path: &Path) -> Option<Result<Self, String>> {
        let name = path.to_str()?;
        let is_name = name.starts_with("fourier:") || name.starts_with("s-matrix:");
        (is_name && !path.exists()).then(|| name.parse())
    }

    /// The patterns of the set for images of this size, in the order in which they are shown.
    ///
    /// # Errors
    /// What was found, and what was expected.
    pub fn patterns(self, size: Option<Size>) -> Result<Patterns, (String, String)> {
        match self {
            Self::SMatrix { order } => of_s_matrix(order, size),
            Self::Fourier { steps } => {
                let no_size =
                    || ("no size".to_owned(), "the height and width of the image".to_owned());
                fourier::shown(size.ok_or_else(no_size)?, steps)
            }
        }
    }
}

impl FromStr for NamedPatterns {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let expected = || format!("expected {}", Self::EXPECTED);
        let (set, number) = name.split_once(':').ok_or_else(expected)?;
        let number: usize = number.parse().map_err(|_| expected())?;
        match (set, number) {
            ("fourier", 3 | 4) => Ok(Self::Fourier { steps: number }),
            ("s-matrix", order) if s_matrix::first_row(order).is_some() => {
                Ok(Self::SMatrix { order })
            }
            ("s-matrix", _) => Err(format!(
                "expected an order up to {} that is a prime of the form 4 k - 1, 2^k - 1, or a product of twin primes: \
                 7, 15, 31, 35, 63, 127, 143, 255, 1023, 4095, ...",
                s_matrix::MOST
            )),
            _ => Err(expected()),
        }
    }
}

impl fmt::Display for NamedPatterns {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fourier { steps } => write!(f, "fourier:{steps}"),
            Self::SMatrix { order } => write!(f, "s-matrix:{order}"),
        }
    }
}

/// The patterns of an S-matrix for images of this size; by default the size of this many pixels that is nearest to a square.
fn of_s_matrix(order: usize, size: Option<Size>) -> Result<Patterns, (String, String)> {
    let side = (1..=order.isqrt()).rev().find(|&side| order.is_multiple_of(side)).unwrap_or(1);
    let size = match size {
        Some(size) if size.area() == order => size,
        Some(size) => {
            let expected =
                format!("{order} pixels for s-matrix:{order}, such as {side}x{}", order / side);
            return Err((format!("has {} pixels for {size}", size.area()), expected));
        }
        None => Size::new(side, order / side).map_err(|error| {
            (format!("an image of {side} x {}", order / side), error.to_string())
        })?,
    };
    let row = s_matrix::first_row(order).unwrap_or_default();
    let moved = |by: usize| (0..order).map(move |at| (at + by) % order);
    let weights = (0..order).flat_map(moved).map(|at| f64::from(u8::from(row[at]))).collect();
    Ok(Patterns { size, count: order, weights })
}
