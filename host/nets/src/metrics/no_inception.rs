//! Inception in a build without the feature `train`: it cannot be made, and says which build has it.

use crate::weights::Weights;
use std::convert::Infallible;
use thiserror::Error;

/// Features of an image.
pub const FEATURES: usize = 2048;

/// Classes of the published weights that FID is defined with.
pub const FID_CLASSES: usize = 1008;

/// This build cannot compute FID.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("this build has no FID; build it with: cargo build --release --features train")]
pub struct NotBuilt;

/// Never there.
#[derive(Debug, Clone)]
pub struct Inception {
    never: Infallible,
}

impl Inception {
    /// Fails always.
    ///
    /// # Errors
    /// [`NotBuilt`].
    pub fn new(_weights: &Weights) -> Result<Self, NotBuilt> {
        Err(NotBuilt)
    }

    /// Are the weights, by the number of their classes, of the kind that FID is defined with?
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
