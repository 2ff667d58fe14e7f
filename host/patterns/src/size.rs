//! Height and width of an image that may have any shape.

use crate::Side;
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// Height and width of an image in pixels, 2 to 65 536 pixels together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Size {
    height: usize,
    width: usize,
}

/// No image has this size, or the text is no size.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("an image of {found} pixels, expected height x width such as 12x15, of 2 to 65536 pixels")]
pub struct SizeError {
    /// What was asked for.
    pub found: String,
}

/// What says how high and wide an image is: a [`Side`], or a [`Size`].
pub trait Shape: Copy + Into<Size> {}

impl<S: Copy + Into<Size>> Shape for S {}

impl Size {
    /// The most pixels of an image, those of the largest [`Side`].
    const MOST: usize = 256 * 256;

    /// Checks that an image can have this size.
    ///
    /// # Errors
    /// [`SizeError`] names the size.
    pub fn new(height: usize, width: usize) -> Result<Self, SizeError> {
        match height.checked_mul(width) {
            Some(2..=Self::MOST) => Ok(Self { height, width }),
            _ => Err(SizeError { found: format!("{height} x {width}") }),
        }
    }

    /// The square of this many pixels, if there is one.
    #[must_use]
    pub fn square(area: usize) -> Option<Self> {
        let side = area.isqrt();
        Self::new(side, side).ok().filter(|size| size.area() == area)
    }

    /// Number of rows of pixels.
    #[must_use]
    pub const fn height(self) -> usize {
        self.height
    }

    /// Number of columns of pixels.
    #[must_use]
    pub const fn width(self) -> usize {
        self.width
    }

    /// Number of pixels.
    #[must_use]
    pub const fn area(self) -> usize {
        self.height * self.width
    }

    /// The side, if the image is a square with a Hadamard basis.
    #[must_use]
    pub fn side(self) -> Option<Side> {
        let square = (self.height == self.width).then_some(self.height as u64)?;
        Side::new(square).ok()
    }
}

impl From<Side> for Size {
    fn from(side: Side) -> Self {
        Self { height: side.pixels(), width: side.pixels() }
    }
}

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} x {}", self.height, self.width)
    }
}

impl FromStr for Size {
    type Err = SizeError;

    fn from_str(text: &str) -> Result<Self, SizeError> {
        let wrong = || SizeError { found: text.to_owned() };
        let (height, width) = text.split_once('x').ok_or_else(wrong)?;
        let number = |part: &str| part.trim().parse().map_err(|_| wrong());
        Self::new(number(height)?, number(width)?).map_err(|_| wrong())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_size_is_height_and_width_in_words_too() {
        let size: Size = "12x15".parse().unwrap();
        assert_eq!((size.height(), size.width(), size.area()), (12, 15, 180));
        assert_eq!((size.to_string().parse(), size.side()), (Ok(size), None));
        assert_eq!(Size::from(Side::INSTRUMENT).side(), Some(Side::INSTRUMENT));
        assert_eq!(Size::square(144), Size::new(12, 12).ok());
        assert_eq!((Size::square(180), Size::square(1), Size::square(0)), (None, None, None));
        for wrong in ["", "12", "12x", "x15", "12x15x2", "0x4", "-1x4", "1x1", "257x256", "a x b"] {
            let error = wrong.parse::<Size>().unwrap_err();
            assert_eq!(error, SizeError { found: wrong.to_owned() });
        }
        let most = usize::MAX;
        assert!(Size::new(most, most).unwrap_err().to_string().contains(&most.to_string()));
    }
}
