//! Images of 64 x 64, each with a label and a group.

use super::{AREA_PX, CLASSES};
use thiserror::Error;

/// The content of a stack, which decides the allowed augmentations.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// One bright character on black, typed or handwritten.
    Drawn,
    /// A cut from a photograph, of any contrast.
    Photograph,
}

/// A set of images. Levels are 8 bit; a scene is `level / 255`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Stack {
    name: String,
    kind: Kind,
    levels: Vec<u8>,
    labels: Option<Vec<u8>>,
    groups: Vec<u32>,
}

/// Why data cannot be used for training. The caller adds the name of the file.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum DataError {
    /// There is no image.
    #[error("no image, expected at least one of 64 x 64")]
    Empty,
    /// Two lists that belong together differ in length.
    #[error("{field} holds {found} values, expected {expected}: one an image")]
    Length {
        /// Name of the list.
        field: &'static str,
        /// Its length.
        found: usize,
        /// The length that fits the images.
        expected: usize,
    },
    /// The number of pixels is not a whole number of images.
    #[error("{found} pixels, expected a multiple of 4096: images of 64 x 64")]
    Pixels {
        /// Number of pixels.
        found: usize,
    },
    /// A label beyond the classes.
    #[error("label {found} of image {image}, expected 0 to 61 (0-9, A-Z, a-z)")]
    Label {
        /// Number of the image.
        image: usize,
        /// The label.
        found: u8,
    },
    /// One family of groups cannot be split.
    #[error(
        "{name}: all images are of one group, or of groups that share images; expected two or more, \
         so that one can be held out"
    )]
    OneGroup {
        /// The stack.
        name: String,
    },
    /// A share is out of its range.
    #[error("{name} is {found}, expected {expected}")]
    Share {
        /// Name of the share.
        name: &'static str,
        /// The value, as text.
        found: String,
        /// The accepted range.
        expected: &'static str,
    },
}

impl Stack {
    /// A stack of row-major images of 64 x 64: `levels.len() / 4096` images, each with one group
    /// and, if there are labels, one class (0 to 61).
    ///
    /// # Errors
    /// [`DataError`] if lengths do not fit, a label is not a class, or there is no image.
    pub fn new(
        name: impl Into<String>,
        kind: Kind,
        levels: Vec<u8>,
        labels: Option<Vec<u8>>,
        groups: Vec<u32>,
    ) -> Result<Self, DataError> {
        if levels.is_empty() {
            return Err(DataError::Empty);
        }
        if !levels.len().is_multiple_of(AREA_PX) {
            return Err(DataError::Pixels { found: levels.len() });
        }
        let expected = levels.len() / AREA_PX;
        let fits = |field, found| match found == expected {
            true => Ok(()),
            false => Err(DataError::Length { field, found, expected }),
        };
        fits("groups", groups.len())?;
        if let Some(labels) = &labels {
            fits("labels", labels.len())?;
            if let Some(image) = labels.iter().position(|&label| usize::from(label) >= CLASSES) {
                return Err(DataError::Label { image, found: labels[image] });
            }
        }
        Ok(Self { name: name.into(), kind, levels, labels, groups })
    }

    /// The stack's name in reports.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The content of the stack.
    #[must_use]
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// Number of images, at least 1.
    #[must_use]
    pub fn len(&self) -> usize {
        self.groups.len()
    }

    /// Always false: a stack has at least one image.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.groups.is_empty()
    }

    /// Image `at`, 64 x 64, row-major.
    ///
    /// # Panics
    /// If there are fewer images.
    #[must_use]
    pub fn image(&self, at: usize) -> &[u8] {
        &self.levels[at * AREA_PX..(at + 1) * AREA_PX]
    }

    /// Class of image `at`, if the stack has labels.
    #[must_use]
    pub fn label(&self, at: usize) -> Option<u8> {
        self.labels.as_ref().and_then(|labels| labels.get(at).copied())
    }

    /// Group of each image: font family, writer, photograph.
    #[must_use]
    pub fn groups(&self) -> &[u32] {
        &self.groups
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_named() {
        let stack = |pixels: usize, labels: Option<Vec<u8>>, groups: usize| {
            Stack::new("s", Kind::Drawn, vec![0; pixels], labels, vec![0; groups])
        };
        assert_eq!(stack(0, None, 0), Err(DataError::Empty));
        assert_eq!(stack(100, None, 1), Err(DataError::Pixels { found: 100 }));
        let length = DataError::Length { field: "groups", found: 1, expected: 2 };
        assert_eq!(stack(2 * AREA_PX, None, 1), Err(length));
        assert_eq!(
            stack(AREA_PX, Some(vec![62]), 1),
            Err(DataError::Label { image: 0, found: 62 })
        );
        assert_eq!(stack(AREA_PX, Some(vec![61]), 1).unwrap().label(0), Some(61));
    }
}
