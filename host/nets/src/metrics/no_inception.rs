//! Inception in a build without the feature `train`: it cannot be created, and the error says which
//! build has it.

use crate::weights::Weights;
use std::convert::Infallible;
use thiserror::Error;

/// Number of features of an image.
pub const FEATURES: usize = 2048;

/// Number of classes of the published weights that define FID.
pub const FID_CLASSES: usize = 1008;

/// Error: this build cannot compute FID.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("this build has no FID; build it with: cargo build --release --features train")]
pub struct NotBuilt;

/// A type without values.
#[derive(Debug, Clone)]
pub struct Inception {
    never: Infallible,
}

impl Inception {
    /// Always fails.
    ///
    /// # Errors
    /// [`NotBuilt`].
    pub fn new(_weights: &Weights) -> Result<Self, NotBuilt> {
        Err(NotBuilt)
    }

    /// Whether the weights have as many classes as those that define FID.
    #[must_use]
    pub fn is_of_fid(&self) -> bool {
        match self.never {}
    }

    /// The [`FEATURES`] features of an image.
    ///
    /// # Errors
    /// [`NotBuilt`].
    pub fn features(&self, _image: &[f32], _size: (usize, usize)) -> Result<Vec<f32>, NotBuilt> {
        match self.never {}
    }
}
