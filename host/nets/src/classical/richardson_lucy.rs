//! Richardson-Lucy deconvolution (Richardson, J. Opt. Soc. Am. 62, 1972; Lucy, Astron. J. 79,
//! 1974).
//!
//! x <- x * B(y / B x): the estimate stays positive and keeps the light. Without a stop the
//! iteration would reproduce the noise. It stops by the discrepancy principle (Morozov, 1966): when
//! noise alone explains the residual.

use super::{Blur, noise_budget};

/// Largest number of rounds. With hardly any noise the iteration would otherwise go on refining
/// rounding errors.
const MOST_ROUNDS: usize = 300;

/// Light added to every pixel, so that no quotient has a zero denominator.
const GROUND: f32 = 1e-3;

/// The sharpened image: positive, not clamped to 1.
#[must_use]
pub fn deblur(image: &[f32], blur: &Blur, noise: f32) -> Vec<f32> {
    let budget = noise_budget(image, noise);
    let mut quotient: Vec<f32> = vec![0.0; image.len()];
    let mut estimate: Vec<f32> = image.iter().map(|pixel| pixel + GROUND).collect();
    for _ in 0..MOST_ROUNDS {
        let blurred = blur.apply(&estimate);
        let mut residual = 0.0;
        for ((quotient, pixel), model) in quotient.iter_mut().zip(image).zip(&blurred) {
            let seen = pixel + GROUND;
            residual += (seen - model).powi(2);
            *quotient = seen / model;
        }
        if residual <= budget {
            break;
        }
        // The blur is its own adjoint and keeps the sum of light, so no further factor is
        // necessary.
        let correction = blur.apply(&quotient);
        estimate.iter_mut().zip(&correction).for_each(|(value, by)| *value *= by);
    }
    estimate.into_iter().map(|value| (value - GROUND).max(0.0)).collect()
}
