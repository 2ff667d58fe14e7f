//! The Fréchet Inception distance, with the user's weights of Inception-v3.

use crate::error::{On, Result};
use nirspi_nets::Weights;
use nirspi_nets::metrics::{Inception, frechet_distance, inception};
use std::path::{Path, PathBuf};

/// Inception-v3 with the weights of a file.
pub struct Fid {
    network: Inception,
    path: PathBuf,
}

impl Fid {
    /// Reads the weights: safetensors with torchvision's names.
    ///
    /// # Errors
    /// `EvalError` for a file that cannot be read, weights of another network, or a build without
    /// the feature `train`.
    pub fn read(path: &Path) -> Result<Self> {
        Ok(Self { network: Inception::new(&Weights::read(path)?)?, path: path.to_owned() })
    }

    /// Why the distance with these weights is not FID; `None` if it is FID.
    pub(crate) fn note(&self) -> Option<String> {
        (!self.network.is_of_fid()).then(|| {
            format!(
                "these weights tell other than {} classes: FID is defined with those that do; compare this one only \
                 with itself",
                inception::FID_CLASSES
            )
        })
    }

    /// The distance of two sets of grey images of `height` x `width`; `done` is called after each
    /// image.
    pub(crate) fn distance<'a>(
        &self,
        reference: impl Iterator<Item = &'a [f32]>,
        test: impl Iterator<Item = &'a [f32]>,
        size: (usize, usize),
        done: &dyn Fn(),
    ) -> Result<f64> {
        let a = self.features(reference, size, done)?;
        let b = self.features(test, size, done)?;
        let named = || format!("FID with {}", self.path.display());
        frechet_distance(&a, &b, inception::FEATURES).on(named)
    }

    fn features<'a>(
        &self,
        images: impl Iterator<Item = &'a [f32]>,
        size: (usize, usize),
        done: &dyn Fn(),
    ) -> Result<Vec<f32>> {
        let mut all = Vec::new();
        for image in images {
            all.extend(self.network.features(image, size)?);
            done();
        }
        Ok(all)
    }
}
