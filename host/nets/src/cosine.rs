//! The orthonormal cosine transform (DCT-II) of images, by its matrix: at 64 pixels a side that is half a million
//! multiplications, and no faster transform is worth its code.
//!
//! The law: it is orthogonal, so its inverse is its adjoint and norms stay what they are.

use nalgebra::RealField;
use std::f64::consts::PI;

/// The transform of images of one size, in single or double precision.
#[derive(Debug)]
pub(crate) struct Cosine<T> {
    down: Waves<T>,
    across: Waves<T>,
}

impl<T: RealField + Copy> Cosine<T> {
    /// That of images of `height` x `width`.
    pub(crate) fn new(height: usize, width: usize) -> Self {
        Self { down: Waves::new(height), across: Waves::new(width) }
    }

    /// C X C^T: the coefficient in row k and column l is that of wave k down the image times wave l across it.
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

/// The waves along one axis.
#[derive(Debug)]
struct Waves<T> {
    length: usize,
    /// Row k is wave k.
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

/// A matrix of `inner` columns by one of `inner` rows.
fn product<T: RealField + Copy>(a: &[T], b: &[T], inner: usize) -> Vec<T> {
    let columns = b.len() / inner;
    let mut product = vec![T::zero(); a.len() / inner * columns];
    for (out, row) in product.chunks_exact_mut(columns).zip(a.chunks_exact(inner)) {
        for (&factor, line) in row.iter().zip(b.chunks_exact(columns)) {
            for (out, &value) in out.iter_mut().zip(line) {
                *out += factor * value;
            }
        }
    }
    product
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
