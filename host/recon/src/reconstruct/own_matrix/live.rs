//! The images of one measurement after another by the same patterns, as a live view makes them.

use super::many::{Kept, Many};
use super::{MatrixError, MatrixReconstruction, MatrixSettings, OwnMatrix};

/// Patterns with what depends on them alone, which is found out once. What a method chooses for the first measurement serves
/// those after it, because judging a choice takes longer than making an image; it is chosen again after a number of images.
///
/// # Invariant
/// The first image, and each one after a number of images, is that of [`OwnMatrix::reconstruct`]; the others are those of the
/// method, the strength and the number of atoms that it chose (`tests::many::a_live_view_chooses_once_for_many_images`).
pub struct LiveMatrix {
    own: OwnMatrix,
    settings: MatrixSettings,
    kept: Kept,
    every: u32,
    /// The settings that were chosen, and how many images they still serve.
    chosen: Option<(MatrixSettings, u32)>,
}

impl LiveMatrix {
    /// A view by these patterns, whose settings are chosen every `every` images.
    #[must_use]
    pub fn new(own: OwnMatrix, settings: MatrixSettings, every: u32) -> Self {
        Self { own, settings, kept: Kept::default(), every, chosen: None }
    }

    /// The patterns.
    #[must_use]
    pub fn own(&self) -> &OwnMatrix {
        &self.own
    }

    /// The image of the next measurement.
    ///
    /// # Errors
    /// As [`OwnMatrix::reconstruct`]. The next image is then chosen for anew.
    pub fn image(&mut self, y: &[f64]) -> Result<MatrixReconstruction, MatrixError> {
        let chosen = self.chosen.take().filter(|(_, left)| *left > 0);
        let settings = chosen.as_ref().map_or(&self.settings, |(settings, _)| settings);
        self.own.check(&[y], settings)?;
        let made = Many::new(&self.own, settings, &[y], &self.kept).images()?.remove(0);
        self.chosen = chosen.map(|(settings, left)| (settings, left - 1)).or_else(|| {
            let (strength, sparsity) = (made.strength, made.atoms.map(|(size, _)| size));
            let own = self.settings.clone();
            let settings = MatrixSettings { method: made.method, strength, sparsity, ..own };
            Some((settings, self.every.saturating_sub(1)))
        });
        Ok(made)
    }
}
