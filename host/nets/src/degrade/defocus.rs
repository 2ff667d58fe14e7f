//! Blur of a 64 x 64 scene by a lens out of focus, with a reflecting edge.
//!
//! # Invariant
//! The blur keeps the light and the range of values
//! (`tests::a_blur_keeps_the_light_and_the_range`).

use crate::blur::{along_rows, reflected};
use crate::data::{AREA_PX, SIDE_PX};

/// Smallest radius of a disc that is applied, in pixels. A smaller disc may lie between the points
/// at which discs are sampled, the nearest of which is 0.09 pixels from the middle.
const LEAST_PX: f32 = 0.1;

/// Blurs by a disc of `diameter_px`, as a lens out of focus does. The blur's standard deviation
/// along an axis is a quarter of the diameter.
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
    // The share of each pixel that the disc covers, counted at 8 x 8 points, because small discs
    // have no other exact shape.
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
        let across = along_rows(scene, SIDE_PX, &weights);
        for (row, line) in sum.chunks_exact_mut(SIDE_PX).enumerate() {
            let from = reflected(row as isize + dy as isize, SIDE_PX) * SIDE_PX;
            for (sum, value) in line.iter_mut().zip(&across[from..from + SIDE_PX]) {
                *sum += value;
            }
        }
    }
    sum.iter().map(|v| v / total).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Standard deviation along the rows of the blurred image of one point in the middle.
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
            // The expected width includes the sampling at points of 1/8 pixel, and a pixel's own
            // width of 1/sqrt(12).
            let wide = spread(&disc(&point(), 4.0 * sigma));
            let expected = (sigma * sigma + 1.0 / 12.0).sqrt();
            assert!((wide - expected).abs() < 0.04 * expected, "{wide} against {expected}");
        }
    }

    #[test]
    fn a_disc_within_a_pixel_changes_nothing() {
        for hundredths in 0..=80_u8 {
            assert_eq!(disc(&point(), f32::from(hundredths) / 100.0), point(), "{hundredths}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]
        #[test]
        fn a_blur_keeps_the_light_and_the_range(
            scene in prop::collection::vec(0f32..=1.0, AREA_PX), width in 0f32..12.0
        ) {
            let blurred = disc(&scene, width);
            let sum = |image: &[f32]| image.iter().map(|v| f64::from(*v)).sum::<f64>();
            // A reflecting edge keeps the light.
            prop_assert!((sum(&blurred) / sum(&scene) - 1.0).abs() < 1e-4);
            prop_assert!(blurred.iter().all(|v| (-1e-5..=1.0 + 1e-5).contains(v)));
        }
    }
}
