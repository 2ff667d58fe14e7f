//! Blur of a 64 x 64 scene by a Gaussian or by a disc, with an edge that reflects.
//!
//! The one law: a blur is a mean, so a scene of one brightness stays as it is.

use crate::data::{AREA_PX, SIDE_PX};

/// Standard deviations from the middle of a Gaussian to where it is cut.
const REACH_SIGMAS: f32 = 3.5;
/// Narrower than this, in pixels, a blur leaves a pixel what it was.
const LEAST_PX: f32 = 0.05;

/// Blur by a Gaussian of `sigma_px` (Eq. 5 to 7 of the paper have no other).
///
/// # Panics
/// If the scene is not 64 x 64.
#[must_use]
pub fn gaussian(scene: &[f32], sigma_px: f32) -> Vec<f32> {
    assert_eq!(scene.len(), AREA_PX, "pixels of a 64 x 64 scene");
    if sigma_px < LEAST_PX {
        return scene.to_vec();
    }
    let reach = (REACH_SIGMAS * sigma_px).ceil() as i32;
    let weights: Vec<f32> =
        (-reach..=reach).map(|d| (-0.5 * (d as f32 / sigma_px).powi(2)).exp()).collect();
    let total: f32 = weights.iter().sum();
    let weights: Vec<f32> = weights.iter().map(|w| w / total).collect();
    let across = along_rows(scene, &weights);
    transposed(&along_rows(&transposed(&across), &weights))
}

/// Blur by a disc of `diameter_px`: what a lens out of focus does. Its standard deviation along an axis is a quarter
/// of the diameter.
///
/// # Panics
/// If the scene is not 64 x 64.
#[must_use]
pub fn disc(scene: &[f32], diameter_px: f32) -> Vec<f32> {
    assert_eq!(scene.len(), AREA_PX, "pixels of a 64 x 64 scene");
    let radius = diameter_px / 2.0;
    if radius < LEAST_PX {
        return scene.to_vec();
    }
    // How much of each pixel the disc covers, counted at 8 x 8 points: small discs have no other shape.
    const FINE: i32 = 8;
    let reach = radius.ceil() as i32;
    let covered = |dx: i32, dy: i32| {
        let at = |d: i32, fine: i32| d as f32 + (fine as f32 + 0.5) / FINE as f32 - 0.5;
        let points = (0..FINE * FINE).filter(|i| at(dx, i % FINE).hypot(at(dy, i / FINE)) < radius);
        points.count() as f32
    };
    let mut sum = vec![0.0; AREA_PX];
    let mut total = 0.0;
    for dy in -reach..=reach {
        let weights: Vec<f32> = (-reach..=reach).map(|dx| covered(dx, dy)).collect();
        let weight: f32 = weights.iter().sum();
        if weight == 0.0 {
            continue;
        }
        total += weight;
        let across = along_rows(scene, &weights);
        for (row, line) in sum.chunks_exact_mut(SIDE_PX).enumerate() {
            let from = reflected(row as i32 + dy) * SIDE_PX;
            for (sum, value) in line.iter_mut().zip(&across[from..from + SIDE_PX]) {
                *sum += value;
            }
        }
    }
    sum.iter().map(|v| v / total).collect()
}

/// Each row correlated with `weights`, whose middle is at the pixel.
fn along_rows(scene: &[f32], weights: &[f32]) -> Vec<f32> {
    let reach = weights.len() / 2;
    let mut padded = vec![0.0; SIDE_PX + 2 * reach];
    let mut out = vec![0.0; AREA_PX];
    for (line, result) in scene.chunks_exact(SIDE_PX).zip(out.chunks_exact_mut(SIDE_PX)) {
        for (at, value) in padded.iter_mut().enumerate() {
            *value = line[reflected(at as i32 - reach as i32)];
        }
        // Weight by weight: long vectors instead of short sums.
        for (weight, shifted) in weights.iter().zip(padded.windows(SIDE_PX)) {
            for (sum, value) in result.iter_mut().zip(shifted) {
                *sum += weight * value;
            }
        }
    }
    out
}

fn transposed(scene: &[f32]) -> Vec<f32> {
    (0..AREA_PX).map(|at| scene[at % SIDE_PX * SIDE_PX + at / SIDE_PX]).collect()
}

/// Mirrored at the edges, the edge pixel twice: ... 1 0 | 0 1 2 ...
fn reflected(at: i32) -> usize {
    let period = 2 * SIDE_PX as i32;
    let at = at.rem_euclid(period) as usize;
    if at < SIDE_PX { at } else { 2 * SIDE_PX - 1 - at }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Standard deviation along rows of what a blur makes of one point in the middle.
    fn spread(blurred: &[f32]) -> f32 {
        let of = |f: &dyn Fn(f32) -> f32| -> f32 {
            blurred.iter().enumerate().map(|(at, v)| v * f((at % SIDE_PX) as f32 - 32.0)).sum()
        };
        (of(&|x| x * x) / of(&|_| 1.0)).sqrt()
    }

    fn point() -> Vec<f32> {
        let mut scene = vec![0.0; AREA_PX];
        scene[32 * SIDE_PX + 32] = 1.0;
        scene
    }

    #[test]
    fn a_blur_is_as_wide_as_asked() {
        for sigma in [0.8, 2.0, 4.0] {
            assert!((spread(&gaussian(&point(), sigma)) - sigma).abs() < 0.02 * sigma);
            // Counted at points of 1/8 pixel, and a pixel's own width of 1/sqrt(12) beside.
            let wide = spread(&disc(&point(), 4.0 * sigma));
            let expected = (sigma * sigma + 1.0 / 12.0).sqrt();
            assert!((wide - expected).abs() < 0.04 * expected, "{wide} against {expected}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]
        #[test]
        fn a_blur_keeps_the_light_and_the_range(
            scene in prop::collection::vec(0f32..=1.0, AREA_PX), width in 0f32..12.0
        ) {
            for blurred in [gaussian(&scene, width / 2.0), disc(&scene, width)] {
                let sum = |image: &[f32]| image.iter().map(|v| f64::from(*v)).sum::<f64>();
                // A reflecting edge gives back what it takes.
                prop_assert!((sum(&blurred) / sum(&scene) - 1.0).abs() < 1e-4);
                prop_assert!(blurred.iter().all(|v| (-1e-5..=1.0 + 1e-5).contains(v)));
            }
        }
    }
}
