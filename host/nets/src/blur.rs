//! Blur with a reflecting edge: by a Gaussian, or row by row with any weights.
//!
//! Beyond the edge the image continues mirrored (d c b a | a b c d | d c b a).
//!
//! # Invariant
//! With a symmetric kernel the blur is its own adjoint (`tests::the_blur_is_its_own_adjoint`),
//! keeps the mean (`tests::the_blur_keeps_the_mean_and_the_range`), and is diagonal in the DCT-II
//! (Strang, SIAM Review 41, 1999; `tests::the_transfer_is_what_happens_to_a_wave`).

use std::f64::consts::PI;

/// Reach of the kernel, in standard deviations from its middle to its end. Less than 1e-4 of the
/// light lies beyond.
const REACH_SIGMAS: f32 = 4.0;

/// A Gaussian blur of images of one size, sampled and normalised.
#[derive(Debug, Clone, PartialEq)]
pub struct Blur {
    height: usize,
    width: usize,
    /// Symmetric about its middle, of sum 1.
    kernel: Vec<f32>,
}

impl Blur {
    /// A blur of standard deviation `sigma_px` >= 0 pixels, for images of `height` x `width`.
    #[must_use]
    pub fn new(height: usize, width: usize, sigma_px: f32) -> Self {
        let reach = (REACH_SIGMAS * sigma_px).ceil() as i32;
        let weight = |at: i32| {
            let z = f64::from(at) / f64::from(sigma_px.max(f32::MIN_POSITIVE));
            (-0.5 * z * z).exp()
        };
        let sum: f64 = (-reach..=reach).map(weight).sum();
        let kernel = (-reach..=reach).map(|at| (weight(at) / sum) as f32).collect();
        Self { height, width, kernel }
    }

    /// Rows and columns of the images.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        (self.height, self.width)
    }

    /// The blurred image, row-major. The adjoint is the same function.
    ///
    /// # Panics
    /// If the image has another size.
    #[must_use]
    pub fn apply(&self, image: &[f32]) -> Vec<f32> {
        let (height, width) = self.size();
        assert_eq!(image.len(), height * width, "pixels");
        let across = along_rows(image, width, &self.kernel);
        let down = along_rows(&transposed(&across, width), height, &self.kernel);
        transposed(&down, height)
    }

    /// Factors of the blur for the waves of a DCT-II along the rows and along the columns: wave (k,
    /// l) of an image is multiplied by `down[k] * across[l]`.
    #[must_use]
    pub fn transfer(&self) -> (Vec<f64>, Vec<f64>) {
        let half = &self.kernel[self.kernel.len() / 2..];
        let along = |length: usize| {
            let of = |wave: usize| {
                let angle = PI * wave as f64 / length as f64;
                let side = |(k, w): (usize, &f32)| 2.0 * f64::from(*w) * (angle * k as f64).cos();
                let sides: f64 = half.iter().enumerate().skip(1).map(side).sum();
                f64::from(half[0]) + sides
            };
            (0..length).map(of).collect()
        };
        (along(self.height), along(self.width))
    }
}

/// Correlates each row of an image of `width` columns with `weights`, whose middle is at the pixel.
pub(crate) fn along_rows(image: &[f32], width: usize, weights: &[f32]) -> Vec<f32> {
    let reach = weights.len() / 2;
    let mut padded = vec![0.0; width + 2 * reach];
    let mut out = vec![0.0; image.len()];
    for (line, result) in image.chunks_exact(width).zip(out.chunks_exact_mut(width)) {
        for (at, value) in padded.iter_mut().enumerate() {
            *value = line[reflected(at as isize - reach as isize, width)];
        }
        // The loop goes weight by weight, which gives long vectors instead of short sums.
        for (weight, shifted) in weights.iter().zip(padded.windows(width)) {
            for (sum, value) in result.iter_mut().zip(shifted) {
                *sum += weight * value;
            }
        }
    }
    out
}

/// Index in a line of `length` pixels that corresponds to index `at` of the mirrored line.
pub(crate) fn reflected(at: isize, length: usize) -> usize {
    let period = 2 * length as isize;
    let at = at.rem_euclid(period);
    if at < length as isize { at as usize } else { (period - 1 - at) as usize }
}

/// The transposed image.
fn transposed(image: &[f32], width: usize) -> Vec<f32> {
    let height = image.len() / width;
    (0..image.len()).map(|at| image[at % height * width + at / height]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn dot(a: &[f32], b: &[f32]) -> f64 {
        a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
    }

    fn mean(values: &[f32]) -> f64 {
        values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64
    }

    /// Images of 7 x 5, smaller than most kernels.
    fn small() -> impl Strategy<Value = Vec<f32>> {
        prop::collection::vec(0.0_f32..=1.0, 35)
    }

    proptest! {
        #[test]
        fn the_blur_is_its_own_adjoint(a in small(), b in small(), sigma in 0.0_f32..4.0) {
            let blur = Blur::new(7, 5, sigma);
            prop_assert!((dot(&blur.apply(&a), &b) - dot(&a, &blur.apply(&b))).abs() < 1e-4);
        }

        #[test]
        fn the_blur_keeps_the_mean_and_the_range(image in small(), sigma in 0.0_f32..16.0) {
            let blurred = Blur::new(7, 5, sigma).apply(&image);
            prop_assert!((mean(&blurred) - mean(&image)).abs() < 1e-5);
            prop_assert!(blurred.iter().all(|v| (-1e-5..=1.0 + 1e-5).contains(v)));
        }

        #[test]
        fn too_narrow_a_blur_to_reach_the_next_pixel_changes_nothing(
            image in small(), sigma in 0.0_f32..0.05
        ) {
            prop_assert_eq!(Blur::new(7, 5, sigma).apply(&image), image);
        }
    }

    /// Result of SciPy 1.17.1's `gaussian_filter` (sigma 1.5) of a 1 in the middle of 33 x 33
    /// zeros: its row from the middle.
    const SCIPY_ROW: [f32; 4] = [0.070_737, 0.056_641_75, 0.029_080_844, 0.009_573_21];

    #[test]
    fn the_kernel_is_the_gaussian_of_scipy() {
        let mut point = vec![0.0; 33 * 33];
        point[16 * 33 + 16] = 1.0;
        let blurred = Blur::new(33, 33, 1.5).apply(&point);
        for (found, expected) in blurred[16 * 33 + 16..].iter().zip(SCIPY_ROW) {
            assert!((found - expected).abs() < 1e-7, "{found} against {expected}");
        }
    }

    #[test]
    fn the_transfer_is_what_happens_to_a_wave() {
        let blur = Blur::new(8, 12, 1.3);
        let (down, across) = blur.transfer();
        let wave = |k: usize, l: usize| -> Vec<f32> {
            let cosine = |i: usize, wave: usize, n: usize| {
                (PI * (i as f64 + 0.5) * wave as f64 / n as f64).cos()
            };
            (0..96).map(|at| (cosine(at / 12, k, 8) * cosine(at % 12, l, 12)) as f32).collect()
        };
        for (k, l) in [(0, 0), (1, 0), (3, 5), (7, 11)] {
            let expected = (down[k] * across[l]) as f32;
            for (out, wave) in blur.apply(&wave(k, l)).iter().zip(wave(k, l)) {
                assert!((out - expected * wave).abs() < 1e-6, "{k}, {l}");
            }
        }
    }
}
