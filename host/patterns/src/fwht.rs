//! Fast Walsh-Hadamard transform, in place, natural (Sylvester) order, unnormalised.
//!
//! # Invariant
//! The result is `H x` with `H[i][j] = (-1)^popcount(i & j)` (`tests::equals_the_matrix_of_signs`),
//! so `fwht(fwht(x)) = N x` (`tests::twice_is_a_multiplication_by_the_length`).
//!
//! Because `H_{n*n} = H_n (x) H_n`, the one-dimensional transform of a row-major `n x n` image *is*
//! its two-dimensional transform.
//!
//! The radix-8 first pass keeps the three smallest strides in registers. The later passes are radix
//! 4 over contiguous runs of at least eight values. A compiler turns such runs into vector code on
//! any target with vectors (baseline x86-64 included, wider vectors where the machine has them),
//! and radix 4 halves the memory traffic of radix 2. The vector width never changes a result,
//! because each value is one chain of sums.

use pulp::{Arch, Simd, WithSimd};
use std::ops::{Add, Sub};
use thiserror::Error;

/// Error: a slice of this length has no Walsh-Hadamard transform.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("{found} values to transform, expected a power of two")]
pub struct FwhtLengthError {
    /// Length of the slice.
    pub found: usize,
}

/// Real numbers that [`fwht`] transforms: `f32` and `f64`.
pub trait Real: Copy + Add<Output = Self> + Sub<Output = Self> + private::Sealed {}
impl Real for f32 {}
impl Real for f64 {}

mod private {
    pub trait Sealed {}
    impl Sealed for f32 {}
    impl Sealed for f64 {}
}

/// Replaces `data` by its Walsh-Hadamard transform `H data`.
///
/// # Errors
/// [`FwhtLengthError`] if the length is not a power of two; `data` then stays unchanged.
///
/// ```
/// let mut x = [1.0_f32, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0];
/// nirspi_patterns::fwht(&mut x)?;
/// assert_eq!(x, [2.0, 0.0, 2.0, 0.0, 0.0, 2.0, 0.0, 2.0]);
/// # Ok::<(), nirspi_patterns::FwhtLengthError>(())
/// ```
pub fn fwht<T: Real>(data: &mut [T]) -> Result<(), FwhtLengthError> {
    if !data.len().is_power_of_two() {
        return Err(FwhtLengthError { found: data.len() });
    }
    transform(data);
    Ok(())
}

/// [`fwht`] for lengths that are a power of two by construction (images of a [`crate::Side`]).
pub fn transform<T: Real>(data: &mut [T]) {
    debug_assert!(data.len().is_power_of_two());
    if data.len() < DISPATCHED {
        return passes(data);
    }
    Arch::new().dispatch(Passes(data));
}

/// Lengths from which a vector width is chosen. A shorter transform takes no longer than the
/// choice.
const DISPATCHED: usize = 256;

/// [`passes`] as a type, because `pulp` compiles a type's method for each vector width.
struct Passes<'a, T>(&'a mut [T]);

impl<T: Real> WithSimd for Passes<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        passes(self.0);
    }
}

#[inline(always)]
fn passes<T: Real>(data: &mut [T]) {
    let mut stride = 1;
    if data.len() >= 8 {
        for block in data.as_chunks_mut().0 {
            radix8(block);
        }
        stride = 8;
    }
    while stride * 4 <= data.len() {
        for block in data.chunks_exact_mut(4 * stride) {
            let (low, high) = block.split_at_mut(2 * stride);
            let (a, b) = low.split_at_mut(stride);
            let (c, d) = high.split_at_mut(stride);
            radix4(a, b, c, d);
        }
        stride *= 4;
    }
    if stride < data.len() {
        for block in data.chunks_exact_mut(2 * stride) {
            let (a, b) = block.split_at_mut(stride);
            for (a, b) in a.iter_mut().zip(b) {
                (*a, *b) = (*a + *b, *a - *b);
            }
        }
    }
}

#[inline(always)]
fn radix8<T: Real>(x: &mut [T; 8]) {
    let [a, b, c, d, e, f, g, h] = *x;
    // The widest stride comes first: four independent sums and differences of neighbours fill a
    // vector.
    let (s, t) = ([a + e, b + f, c + g, d + h], [a - e, b - f, c - g, d - h]);
    let [s, t] = [s, t].map(|[a, b, c, d]| {
        let [p, q, r, s] = [a + c, b + d, a - c, b - d];
        [p + q, p - q, r + s, r - s]
    });
    *x = [s[0], s[1], s[2], s[3], t[0], t[1], t[2], t[3]];
}

// Four separate arguments instead of one slice: the compiler knows that they do not overlap, and
// vectorises the loop.
#[inline(always)]
fn radix4<T: Real>(a: &mut [T], b: &mut [T], c: &mut [T], d: &mut [T]) {
    for (((a, b), c), d) in a.iter_mut().zip(b).zip(c).zip(d) {
        let (ab, ba) = (*a + *b, *a - *b);
        let (cd, dc) = (*c + *d, *c - *d);
        (*a, *b, *c, *d) = (ab + cd, ba + dc, ab - cd, ba - dc);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn naive(x: &[f64]) -> Vec<f64> {
        let sign =
            |i: usize, j: usize| if (i & j).count_ones().is_multiple_of(2) { 1.0 } else { -1.0 };
        (0..x.len()).map(|i| x.iter().enumerate().map(|(j, x)| sign(i, j) * x).sum()).collect()
    }

    fn signal() -> impl Strategy<Value = Vec<f64>> {
        (0_u32..=10).prop_flat_map(|log| prop::collection::vec(-1e3..1e3, 1 << log))
    }

    fn largest_gap(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    proptest! {
        #[test]
        fn equals_the_matrix_of_signs(x in signal()) {
            let mut fast = x.clone();
            fwht(&mut fast).unwrap();
            prop_assert!(largest_gap(&fast, &naive(&x)) < 1e-8);
            let mut single: Vec<f32> = x.iter().map(|&x| x as f32).collect();
            fwht(&mut single).unwrap();
            let single: Vec<f64> = single.into_iter().map(f64::from).collect();
            prop_assert!(largest_gap(&single, &fast) <= 1e-6 * 1e3 * x.len() as f64);
        }

        #[test]
        fn twice_is_a_multiplication_by_the_length(x in signal()) {
            let mut twice = x.clone();
            fwht(&mut twice).unwrap();
            fwht(&mut twice).unwrap();
            let scaled: Vec<f64> = x.iter().map(|v| v * x.len() as f64).collect();
            prop_assert!(largest_gap(&twice, &scaled) <= 1e-9 * 1e3 * x.len() as f64);
        }

        #[test]
        fn energy_grows_by_the_length(x in signal()) {
            let energy = |x: &[f64]| x.iter().map(|v| v * v).sum::<f64>();
            let mut y = x.clone();
            fwht(&mut y).unwrap();
            let expected = energy(&x) * x.len() as f64;
            prop_assert!((energy(&y) - expected).abs() <= 1e-9 * expected);
        }

        #[test]
        fn a_row_major_image_is_transformed_in_two_dimensions(
            image in prop::collection::vec(-1.0..1.0, 64)
        ) {
            let mut once = image.clone();
            fwht(&mut once).unwrap();
            let mut rows = image;
            for row in rows.chunks_exact_mut(8) {
                fwht(row).unwrap();
            }
            for c in 0..8 {
                let mut column: Vec<f64> = (0..8).map(|r| rows[8 * r + c]).collect();
                fwht(&mut column).unwrap();
                for r in 0..8 {
                    prop_assert!((once[8 * r + c] - column[r]).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn the_largest_image_transforms_a_point_into_its_pattern() {
        let mut x = vec![0.0_f32; 65_536];
        x[43_981] = 1.0;
        fwht(&mut x).unwrap();
        for (i, value) in x.iter().enumerate() {
            assert_eq!(
                *value,
                if (i & 43_981).count_ones().is_multiple_of(2) { 1.0 } else { -1.0 }
            );
        }
    }

    #[test]
    fn other_lengths_are_refused_and_left_alone() {
        for length in [0, 3, 6, 1000] {
            let mut x: Vec<f32> = (0..length).map(|v| v as f32).collect();
            let before = x.clone();
            assert_eq!(fwht(&mut x), Err(FwhtLengthError { found: length as usize }));
            assert_eq!(x, before);
        }
    }
}
