//! Lanczos interpolation to twice the side, without learning: the baseline that every learned stage
//! has to beat.
//!
//! Separable Lanczos-3 interpolation (Duchon, J. Appl. Meteorol. 18, 1979). Pixel *centres* are
//! aligned: output pixel i lies at input coordinate (i + 1/2) / 2 - 1/2, so the picture does not
//! shift. Beyond the edge the edge pixel is repeated; weights are normalised.
//!
//! # Invariant
//! Before the clamp to [0, 1] the map is linear (`tests::interpolation_is_linear`), keeps a
//! constant image constant (`tests::a_constant_image_stays_constant`) and commutes with mirroring
//! (`tests::a_mirrored_image_gives_the_mirrored_result`).

use std::f64::consts::PI;

use thiserror::Error;

/// Number of lobes of the kernel on either side.
const LOBES: usize = 3;

/// Number of input pixels under the kernel for any output pixel.
const TAPS: usize = 2 * LOBES;

/// Why a stack of images cannot be upscaled.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum UpscaleError {
    /// The stack has no pixel, or its size does not fit the number of values.
    #[error(
        "upscale: {found} values given for {images} images of {height} x {width}; \
         expected their product, and at least one pixel"
    )]
    Shape {
        /// Number of images according to the caller.
        images: usize,
        /// Rows of an image.
        height: usize,
        /// Columns of an image.
        width: usize,
        /// Number of values given.
        found: usize,
    },
    /// A pixel is not in [0, 1].
    #[error("upscale: image {image}, row {row}, column {column} is {value}, expected 0 to 1")]
    Pixel {
        /// Index of the image.
        image: usize,
        /// Row from the top.
        row: usize,
        /// Column from the left.
        column: usize,
        /// The value found.
        value: f32,
    },
}

/// Enlarges a stack of `images` images of `height` x `width` pixels in [0, 1] (row-major, N, H, W)
/// to `2 height` x `2 width`, values in [0, 1], in the same layout.
///
/// # Errors
/// [`UpscaleError`] if the shape does not fit the values, or a pixel is NaN or outside [0, 1].
pub fn upscale_2x(
    stack: &[f32],
    images: usize,
    height: usize,
    width: usize,
) -> Result<Vec<f32>, UpscaleError> {
    let expected = images.checked_mul(height).and_then(|rows| rows.checked_mul(width));
    if expected != Some(stack.len()) || stack.is_empty() {
        return Err(UpscaleError::Shape { images, height, width, found: stack.len() });
    }
    if let Some(at) = stack.iter().position(|v| !(0.0..=1.0).contains(v)) {
        let (image, pixel) = (at / (height * width), at % (height * width));
        let (row, column) = (pixel / width, pixel % width);
        return Err(UpscaleError::Pixel { image, row, column, value: stack[at] });
    }
    let mut enlarged = interpolate(stack, height, width);
    for value in &mut enlarged {
        *value = value.clamp(0.0, 1.0);
    }
    Ok(enlarged)
}

/// The linear part: both axes, not clamped.
fn interpolate(stack: &[f32], height: usize, width: usize) -> Vec<f32> {
    let taps = half_pixel_taps();
    let mut enlarged = Vec::with_capacity(4 * stack.len());
    let mut wide = vec![0.0; 2 * width * height];
    for image in stack.chunks_exact(height * width) {
        for (row, out) in image.chunks_exact(width).zip(wide.chunks_exact_mut(2 * width)) {
            for (x, value) in out.iter_mut().enumerate() {
                *value = weighted(&taps, x, width, |column| row[column]);
            }
        }
        for y in 0..2 * height {
            for x in 0..2 * width {
                enlarged.push(weighted(&taps, y, height, |row| wide[row * 2 * width + x]));
            }
        }
    }
    enlarged
}

/// Weights of the input pixels for an output coordinate a quarter of a pixel to the right of an
/// input pixel, at offsets -2 to 3 from it. The weights for a quarter to the left are the mirror
/// image.
fn half_pixel_taps() -> [f32; TAPS] {
    let weights: [f64; TAPS] =
        std::array::from_fn(|tap| lanczos(tap as f64 + 1.0 - LOBES as f64 - 0.25));
    let sum: f64 = weights.iter().sum();
    weights.map(|weight| (weight / sum) as f32)
}

fn lanczos(x: f64) -> f64 {
    let lobes = LOBES as f64;
    if x == 0.0 {
        1.0
    } else if x.abs() >= lobes {
        0.0
    } else {
        lobes * (PI * x).sin() * (PI * x / lobes).sin() / (PI * x).powi(2)
    }
}

/// Output pixel `out` of a line of `length` input pixels.
fn weighted(taps: &[f32; TAPS], out: usize, length: usize, pixel: impl Fn(usize) -> f32) -> f32 {
    let nearest = (out / 2) as isize;
    let toward = if out % 2 == 1 { 1 } else { -1 };
    let mut sum = 0.0;
    for (tap, weight) in taps.iter().enumerate() {
        let offset = tap as isize + 1 - LOBES as isize;
        let at = (nearest + toward * offset).clamp(0, length as isize - 1);
        sum += weight * pixel(at as usize);
    }
    sum
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const H: usize = 12;
    const W: usize = 9;

    fn image() -> impl Strategy<Value = Vec<f32>> {
        prop::collection::vec(0.0_f32..=1.0, H * W)
    }

    fn mirrored(image: &[f32], width: usize) -> Vec<f32> {
        image.chunks_exact(width).flat_map(|row| row.iter().rev().copied()).collect()
    }

    fn mean(values: &[f32]) -> f64 {
        values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64
    }

    fn close(a: &[f32], b: &[f32]) -> bool {
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5)
    }

    proptest! {
        #[test]
        fn a_constant_image_stays_constant(value in 0.0_f32..=1.0, h in 1_usize..8, w in 1_usize..8) {
            let enlarged = upscale_2x(&vec![value; h * w], 1, h, w).unwrap();
            prop_assert!(close(&enlarged, &vec![value; 4 * h * w]));
        }

        #[test]
        fn interpolation_is_linear(a in image(), b in image(), p in -2.0_f32..2.0) {
            let mixed: Vec<f32> = a.iter().zip(&b).map(|(a, b)| a + p * b).collect();
            let expected: Vec<f32> = interpolate(&a, H, W)
                .iter()
                .zip(&interpolate(&b, H, W))
                .map(|(a, b)| a + p * b)
                .collect();
            prop_assert!(close(&interpolate(&mixed, H, W), &expected));
        }

        #[test]
        fn a_mirrored_image_gives_the_mirrored_result(image in image()) {
            let of_mirrored = upscale_2x(&mirrored(&image, W), 1, H, W).unwrap();
            let upright = upscale_2x(&image, 1, H, W).unwrap();
            prop_assert!(close(&of_mirrored, &mirrored(&upright, 2 * W)));

            let turned: Vec<f32> = image.iter().rev().copied().collect();
            let turned_back: Vec<f32> = upright.iter().rev().copied().collect();
            prop_assert!(close(&upscale_2x(&turned, 1, H, W).unwrap(), &turned_back));
        }

        #[test]
        fn the_mean_is_kept_where_the_edge_is_dark(mut image in image()) {
            // Repeating an edge pixel counts it more than once, so the edges are dark here.
            for (i, v) in image.iter_mut().enumerate() {
                let (row, column) = (i / W, i % W);
                if !((3..H - 3).contains(&row) && (3..W - 3).contains(&column)) {
                    *v = 0.0;
                }
            }
            let enlarged = interpolate(&image, H, W);
            prop_assert!((mean(&enlarged) - mean(&image)).abs() < 1e-6);
        }

        #[test]
        fn the_mean_nearly_stays_with_light_at_the_edge(image in image()) {
            let enlarged = interpolate(&image, H, W);
            prop_assert!((mean(&enlarged) - mean(&image)).abs() < 0.02);
        }

        #[test]
        fn the_result_is_in_range_and_each_image_on_its_own(a in image(), b in image()) {
            let stack: Vec<f32> = a.iter().chain(&b).copied().collect();
            let enlarged = upscale_2x(&stack, 2, H, W).unwrap();
            prop_assert!(enlarged.iter().all(|v| (0.0..=1.0).contains(v)));
            prop_assert_eq!(&enlarged[..4 * H * W], &upscale_2x(&a, 1, H, W).unwrap()[..]);
            prop_assert_eq!(&enlarged[4 * H * W..], &upscale_2x(&b, 1, H, W).unwrap()[..]);
        }
    }

    #[test]
    fn a_fine_wave_is_resampled_where_it_lies() {
        // A cosine of 8 pixels per period, away from the edges: output i has its value at i / 2 -
        // 1/4.
        let wave = |x: f64| (0.5 + 0.4 * (PI * x / 4.0).cos()) as f32;
        let row: Vec<f32> = (0..32).map(|x| wave(f64::from(x))).collect();
        let enlarged = upscale_2x(&row, 1, 1, 32).unwrap();
        assert_eq!(enlarged.len(), 128);
        for (i, value) in enlarged[..64].iter().enumerate().skip(6).take(52) {
            let expected = wave(i as f64 / 2.0 - 0.25);
            assert!((value - expected).abs() < 0.01, "{i}: {value} against {expected}");
        }
    }

    #[test]
    fn shapes_that_do_not_fit_are_refused() {
        for (images, height, width) in
            [(1, 3, 3), (2, 2, 3), (0, 3, 4), (usize::MAX, 2, 2), (1, 2, usize::MAX)]
        {
            let error = upscale_2x(&[0.5; 11], images, height, width).unwrap_err();
            assert_eq!(error, UpscaleError::Shape { images, height, width, found: 11 });
        }
        assert!(matches!(upscale_2x(&[], 0, 32, 32), Err(UpscaleError::Shape { .. })));
        assert!(matches!(upscale_2x(&[], 1, 0, 0), Err(UpscaleError::Shape { .. })));
    }

    #[test]
    fn a_pixel_that_is_no_brightness_is_named() {
        for bad in [f32::NAN, f32::INFINITY, -0.01, 1.01] {
            let mut stack = [0.5; 2 * 3 * 4];
            stack[12 + 4 + 2] = bad;
            let error = upscale_2x(&stack, 2, 3, 4).unwrap_err();
            assert!(
                matches!(error, UpscaleError::Pixel { image: 1, row: 1, column: 2, .. }),
                "{error}"
            );
        }
    }
}
