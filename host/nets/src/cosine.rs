//! The orthonormal cosine transform (DCT-II) of images as a matrix product. At 64 pixels per side
//! the product takes half a million multiplications, too few to justify the code of a faster
//! transform.
//!
//! # Invariant
//! The transform is orthogonal: the inverse is the adjoint, and norms are kept
//! (`tests::the_inverse_undoes_it`, `tests::a_wave_has_one_coefficient`).

use nalgebra::RealField;
use pulp::{Arch, Simd, WithSimd};
use std::f64::consts::PI;

/// The transform for images of one size, in single or double precision.
#[derive(Debug)]
pub(crate) struct Cosine<T> {
    down: Waves<T>,
    across: Waves<T>,
}

impl<T: RealField + Copy> Cosine<T> {
    /// The transform for images of `height` x `width`.
    pub(crate) fn new(height: usize, width: usize) -> Self {
        Self { down: Waves::new(height), across: Waves::new(width) }
    }

    /// Wave `k` down the image.
    pub(crate) fn wave(&self, k: usize) -> &[T] {
        &self.down.matrix[k * self.down.length..][..self.down.length]
    }

    /// All waves down the image, row after row.
    #[cfg(feature = "gpu")]
    pub(crate) fn waves(&self) -> &[T] {
        &self.down.matrix
    }

    /// C X C^T: the coefficient in row k and column l belongs to wave k down the image times wave l
    /// across it.
    pub(crate) fn forward(&self, image: &[T]) -> Vec<T> {
        let columns = product(&self.down.matrix, image, self.down.length);
        product(&columns, &self.across.transposed, self.across.length)
    }

    /// C^T X C.
    pub(crate) fn inverse(&self, spectrum: &[T]) -> Vec<T> {
        let columns = product(&self.down.transposed, spectrum, self.down.length);
        product(&columns, &self.across.matrix, self.across.length)
    }
}

/// The waves along one axis, as a matrix.
#[derive(Debug)]
struct Waves<T> {
    length: usize,
    /// Row k has wave k.
    matrix: Vec<T>,
    transposed: Vec<T>,
}

impl<T: RealField + Copy> Waves<T> {
    fn new(length: usize) -> Self {
        let n = length as f64;
        let element = |k: usize, x: usize| {
            let norm = if k == 0 { 1.0 / n } else { 2.0 / n };
            nalgebra::convert(norm.sqrt() * (PI * (x as f64 + 0.5) * k as f64 / n).cos())
        };
        let indices = || (0..length * length).map(|i| (i / length, i % length));
        Self {
            length,
            matrix: indices().map(|(k, x)| element(k, x)).collect(),
            transposed: indices().map(|(x, k)| element(k, x)).collect(),
        }
    }
}

/// Number of rows and columns of the product that stay in registers together.
const TILE: (usize, usize) = (4, 16);

/// The product of a matrix with `inner` columns and a matrix with `inner` rows.
///
/// The code is compiled for each vector width. Products are added in the order of the inner index
/// for any width, without fused multiply-add, so every machine gives the same bits
/// (`tests::a_product_has_the_bits_of_the_plain_sums`).
pub(crate) fn product<T: RealField + Copy>(a: &[T], b: &[T], inner: usize) -> Vec<T> {
    let columns = b.len() / inner;
    let mut out = vec![T::zero(); a.len() / inner * columns];
    Arch::new().dispatch(Product { a, b, sizes: (inner, columns), out: &mut out });
    out
}

struct Product<'a, T> {
    a: &'a [T],
    b: &'a [T],
    sizes: (usize, usize),
    out: &'a mut [T],
}

impl<T: RealField + Copy> WithSimd for Product<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { a, b, sizes: (inner, columns), out } = self;
        for (factors, out) in a.chunks(TILE.0 * inner).zip(out.chunks_mut(TILE.0 * columns)) {
            tiles(out, factors, b, (inner, columns));
        }
    }
}

/// Up to four rows of a product, from as many rows of `a`.
#[inline(always)]
fn tiles<T: RealField + Copy>(out: &mut [T], a: &[T], b: &[T], (inner, columns): (usize, usize)) {
    let whole = if a.len() == TILE.0 * inner { columns - columns % TILE.1 } else { 0 };
    for from in (0..whole).step_by(TILE.1) {
        let mut sums = [[T::zero(); TILE.1]; TILE.0];
        for (k, line) in b.chunks_exact(columns).enumerate() {
            let line = &line[from..from + TILE.1];
            for (row, sums) in sums.iter_mut().enumerate() {
                let factor = a[row * inner + k];
                sums.iter_mut().zip(line).for_each(|(sum, &value)| *sum += factor * value);
            }
        }
        for (out, sums) in out.chunks_exact_mut(columns).zip(sums) {
            out[from..from + TILE.1].copy_from_slice(&sums);
        }
    }
    // The columns outside the tiles.
    for (out, factors) in out.chunks_exact_mut(columns).zip(a.chunks_exact(inner)) {
        for (&factor, line) in factors.iter().zip(b.chunks_exact(columns)) {
            for (out, &value) in out[whole..].iter_mut().zip(&line[whole..]) {
                *out += factor * value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_wave_has_one_coefficient() {
        let (height, width) = (6, 10);
        let line = |wave: usize, at: usize, length: usize| {
            (PI * (at as f64 + 0.5) * wave as f64 / length as f64).cos()
        };
        for (k, l) in [(0, 0), (2, 0), (0, 7), (5, 9)] {
            let wave: Vec<f64> =
                (0..60).map(|i| line(k, i / width, height) * line(l, i % width, width)).collect();
            let norm = wave.iter().map(|v| v * v).sum::<f64>().sqrt();
            for (i, found) in Cosine::new(height, width).forward(&wave).into_iter().enumerate() {
                let expected = if i == k * width + l { norm } else { 0.0 };
                assert!((found - expected).abs() < 1e-12, "{k}, {l}: {found} at {i}");
            }
        }
    }

    #[test]
    fn a_product_has_the_bits_of_the_plain_sums() {
        for (rows, inner, columns) in [(32, 32, 32), (8, 64, 64), (7, 5, 35), (6, 3, 16), (1, 1, 1)]
        {
            let numbers = |count: usize| -> Vec<f32> {
                (0..count).map(|i| (i as f32 * 0.37 + count as f32).sin()).collect()
            };
            let (a, b) = (numbers(rows * inner), numbers(inner * columns));
            let found = product(&a, &b, inner);
            for (at, found) in found.iter().enumerate() {
                let (row, column) = (at / columns, at % columns);
                let terms = (0..inner).map(|k| a[row * inner + k] * b[k * columns + column]);
                assert_eq!(*found, terms.fold(0.0, |sum, term| sum + term), "{row}, {column}");
            }
        }
    }

    proptest! {
        #[test]
        fn the_inverse_undoes_it(image in prop::collection::vec(-1.0_f32..1.0, 35)) {
            let cosine = Cosine::new(7, 5);
            for (found, pixel) in cosine.inverse(&cosine.forward(&image)).iter().zip(&image) {
                prop_assert!((found - pixel).abs() < 1e-5);
            }
        }
    }
}
