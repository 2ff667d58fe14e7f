//! The orthonormal cosine transform (DCT-II) of a square image, by its matrix: at 64 pixels a side
//! that is half a million multiplications.

use std::f64::consts::PI;
use std::sync::LazyLock;

use super::SIDE;

/// The transform of one size.
#[derive(Debug)]
pub(super) struct Cosine {
    side: usize,
    /// Row k: cosine k.
    matrix: Vec<f32>,
    transposed: Vec<f32>,
}

impl Cosine {
    /// That of the sharp image.
    pub(super) fn of_image() -> &'static Self {
        static OF_IMAGE: LazyLock<Cosine> = LazyLock::new(|| Cosine::new(SIDE));
        &OF_IMAGE
    }

    /// That of readings of half its side.
    pub(super) fn of_readings() -> &'static Self {
        static OF_READINGS: LazyLock<Cosine> = LazyLock::new(|| Cosine::new(SIDE / 2));
        &OF_READINGS
    }

    fn new(side: usize) -> Self {
        let n = side as f64;
        let element = |k: usize, x: usize| {
            let norm = if k == 0 { 1.0 / n } else { 2.0 / n };
            (norm.sqrt() * (PI * (x as f64 + 0.5) * k as f64 / n).cos()) as f32
        };
        let indices = || (0..side * side).map(|i| (i / side, i % side));
        Self {
            side,
            matrix: indices().map(|(k, x)| element(k, x)).collect(),
            transposed: indices().map(|(x, k)| element(k, x)).collect(),
        }
    }

    /// C X C^T.
    pub(super) fn forward(&self, image: &[f32]) -> Vec<f32> {
        self.product(&self.product(&self.matrix, image), &self.transposed)
    }

    /// C^T X C.
    pub(super) fn inverse(&self, spectrum: &[f32]) -> Vec<f32> {
        self.product(&self.product(&self.transposed, spectrum), &self.matrix)
    }

    fn product(&self, a: &[f32], b: &[f32]) -> Vec<f32> {
        let side = self.side;
        let mut product = vec![0.0; side * side];
        for (out, row) in product.chunks_exact_mut(side).zip(a.chunks_exact(side)) {
            for (&factor, line) in row.iter().zip(b.chunks_exact(side)) {
                for (out, value) in out.iter_mut().zip(line) {
                    *out += factor * value;
                }
            }
        }
        product
    }
}
