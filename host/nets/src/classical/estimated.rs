//! Classical deblurring of images whose blur and noise are estimated, as the networks' are.

use super::{ClassicalError, Method, deblur};
use crate::consistency::Consistency;
use crate::{BlurEstimator, Enhanced, Images, KnownEstimate};

/// The side of the images.
const SIDE: usize = crate::grid::FINE;

/// Deblurs each image with its own blur and noise: the known ones, or else the estimated ones.
/// Calls `done` after each image.
///
/// # Errors
/// [`ClassicalError`] if a known blur or noise is out of range.
pub fn deblur_all(
    method: Method,
    images: Images<'_, SIDE>,
    estimator: &BlurEstimator,
    known: KnownEstimate,
    done: &mut dyn FnMut(),
) -> Result<Enhanced, ClassicalError> {
    let mut result = Enhanced::default();
    for (image, estimate) in images.iter().zip(estimator.estimate(images)) {
        let estimate = known.over(estimate);
        let (sigma_px, noise) = (estimate.sigma_px, estimate.noise.min(1.0));
        let sharp = deblur(method, image, (SIDE, SIDE), sigma_px, noise)?;
        let model = Consistency::new(SIDE, sigma_px, noise);
        result.inconsistency.push(model.residual_ratio(image, &sharp));
        result.images.extend(sharp);
        result.estimates.push(estimate);
        done();
    }
    Ok(result)
}
