//! The images of one measurement after another by the same patterns, as a live view makes them.

use super::many::{Kept, Many};
use super::outliers::Expected;
use super::{KnownNoise, MatrixError, MatrixReconstruction, MatrixSettings, OwnMatrix};
use std::collections::VecDeque;

/// Patterns with what depends on them alone, which is found out once. What a method chooses for the first measurement serves
/// those after it, because judging a choice takes longer than making an image; it is chosen again after a number of images.
///
/// # Invariant
/// The first image, and each one after a number of images, is that of [`OwnMatrix::reconstruct`] with the noise that the
/// measurements so far [tell](OwnMatrix::known_noise); the others are those of the
/// method, the strength and the number of atoms that it chose (`tests::many::a_live_view_chooses_once_for_many_images`).
pub struct LiveMatrix {
    own: OwnMatrix,
    settings: MatrixSettings,
    kept: Kept,
    expected: Expected,
    every: u32,
    /// The settings that were chosen, and how many images they still serve.
    chosen: Option<(MatrixSettings, u32)>,
    /// The newest measurements, for their noise.
    newest: VecDeque<Vec<f64>>,
    noise: Option<KnownNoise>,
}

/// Measurements that tell the noise.
const TELLING: usize = 8;

impl LiveMatrix {
    /// A view by these patterns, whose settings are chosen every `every` images.
    #[must_use]
    pub fn new(own: OwnMatrix, settings: MatrixSettings, every: u32) -> Self {
        let (kept, newest) = (Kept::default(), VecDeque::new());
        let expected = Expected::new(&own);
        Self { own, settings, kept, expected, every, chosen: None, newest, noise: None }
    }

    /// The patterns.
    #[must_use]
    pub fn own(&self) -> &OwnMatrix {
        &self.own
    }

    /// The noise of a measurement, if it is known.
    #[must_use]
    pub fn noise(&self) -> Option<KnownNoise> {
        self.noise
    }

    /// The image of the next measurement.
    ///
    /// # Errors
    /// As [`OwnMatrix::reconstruct`]. The next image is then chosen for anew.
    pub fn image(&mut self, y: &[f64]) -> Result<MatrixReconstruction, MatrixError> {
        let chosen = self.chosen.take().filter(|(_, left)| *left > 0);
        self.own.check(&[y], &self.settings)?;
        if self.newest.len() == TELLING {
            self.newest.pop_front();
        }
        self.newest.push_back(y.to_vec());
        if chosen.is_none() && self.settings.noise.is_none() {
            let newest: Vec<&[f64]> = self.newest.iter().map(Vec::as_slice).collect();
            self.noise = self.own.known_noise(&newest);
        }
        let noise = self.settings.noise.or(self.noise.map(|known| known.sigma));
        let anew = MatrixSettings { noise, ..self.settings.clone() };
        let settings = chosen.as_ref().map_or(&anew, |(settings, _)| settings);
        let outliers = self.expected.outliers(&self.own, y, settings.dark);
        let made = match outliers.is_empty() {
            true => Many::new(&self.own, settings, &[y], &self.kept).images()?.remove(0),
            false => self.own.without(outliers, y, settings)?,
        };
        self.chosen = chosen.map(|(settings, left)| (settings, left - 1)).or_else(|| {
            let (strength, sparsity) = (made.strength, made.atoms.map(|(size, _)| size));
            let method = made.method;
            let settings = MatrixSettings { method, strength, sparsity, judge: false, ..anew };
            Some((settings, self.every.saturating_sub(1)))
        });
        Ok(made)
    }
}
