//! Stacks of images as the networks expect them: square, of a known size, in [0, 1].
//!
//! # Invariant
//! An [`Images`] holds only such images (`tests::only_whole_images_in_range_are_let_in`).

use thiserror::Error;

/// Why a stack of images is refused.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ImagesError {
    /// There is no image, or the values are not whole images.
    #[error("{found} values, expected whole images of {side} x {side}, at least one")]
    Shape {
        /// Expected side of the images.
        side: usize,
        /// Number of values.
        found: usize,
    },
    /// A pixel is not in [0, 1].
    #[error("image {image}, row {row}, column {column} is {value}, expected 0 to 1")]
    Pixel {
        /// Index of the image.
        image: usize,
        /// Row from the top.
        row: usize,
        /// Column from the left.
        column: usize,
        /// The value found.
        value: f32,
    },
}

/// Images of `SIDE` x `SIDE` pixels in [0, 1], row-major, one after another.
#[derive(Debug, Clone, Copy)]
pub struct Images<'a, const SIDE: usize>(&'a [f32]);

impl<'a, const SIDE: usize> Images<'a, SIDE> {
    /// Checks a stack.
    ///
    /// # Errors
    /// [`ImagesError`] if it holds no whole image, or a pixel is NaN or outside [0, 1].
    pub fn new(values: &'a [f32]) -> Result<Self, ImagesError> {
        let area = SIDE * SIDE;
        if values.is_empty() || !values.len().is_multiple_of(area) {
            return Err(ImagesError::Shape { side: SIDE, found: values.len() });
        }
        if let Some(at) = values.iter().position(|value| !(0.0..=1.0).contains(value)) {
            return Err(ImagesError::Pixel {
                image: at / area,
                row: at % area / SIDE,
                column: at % SIDE,
                value: values[at],
            });
        }
        Ok(Self(values))
    }

    /// A stack that is known to be valid: a part of a valid stack, or the output of a network.
    pub(crate) fn known(values: &'a [f32]) -> Self {
        debug_assert!(Self::new(values).is_ok());
        Self(values)
    }

    /// Number of images.
    pub fn count(&self) -> usize {
        self.0.len() / (SIDE * SIDE)
    }

    /// All pixels.
    pub fn values(&self) -> &'a [f32] {
        self.0
    }

    /// Iterates over the images.
    pub fn iter(&self) -> std::slice::ChunksExact<'a, f32> {
        self.0.chunks_exact(SIDE * SIDE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_whole_images_in_range_are_let_in() {
        assert_eq!(Images::<4>::new(&[0.5; 32]).unwrap().count(), 2);
        for found in [0, 15, 17] {
            let error = Images::<4>::new(&vec![0.5; found]).unwrap_err();
            assert_eq!(error, ImagesError::Shape { side: 4, found });
        }
        for bad in [f32::NAN, -0.01, 1.01, f32::INFINITY] {
            let mut values = [1.0; 32];
            values[16 + 4 + 3] = bad;
            let error = Images::<4>::new(&values).unwrap_err();
            assert!(
                matches!(error, ImagesError::Pixel { image: 1, row: 1, column: 3, .. }),
                "{error}"
            );
        }
    }
}
