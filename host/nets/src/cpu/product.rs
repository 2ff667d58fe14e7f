//! The product of two matrices, the innermost loop of a UNet.
//!
//! Eight rows by three vectors of columns stay in registers (four by three where a machine has 16
//! registers), so each weight that is loaded serves eight sums, and the multipliers limit the
//! speed.
//!
//! # Invariant
//! A sum begins with its start and adds its products in the order of the inner index, fused. It
//! does not depend on the other rows, so a row gives the same bits in every batch.

use pulp::{Arch, Simd, WithSimd};

/// Number of vectors of columns computed together.
const VECTORS: usize = 3;

/// `out` = `start` + `left` `right`, where `start` is added to each row.
pub(super) struct Product<'a> {
    /// Rows of `left_pitch` floats, of which the first `inner` count.
    pub left: &'a [f32],
    pub left_pitch: usize,
    pub inner: usize,
    /// `inner` rows of `columns` floats.
    pub right: &'a [f32],
    /// A multiple of every vector's length ([`padded`](super::pixels::padded)).
    pub columns: usize,
    /// One float for each column.
    pub start: &'a [f32],
    /// Rows of `columns` floats.
    pub out: &'a mut [f32],
}

impl WithSimd for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let whole = VECTORS * S::F32_LANES;
        let mut from = 0;
        while self.columns - from >= whole {
            self.panel::<S, VECTORS>(simd, from);
            from += whole;
        }
        if self.columns - from == 2 * S::F32_LANES {
            self.panel::<S, 2>(simd, from);
        } else if self.columns - from == S::F32_LANES {
            self.panel::<S, 1>(simd, from);
        }
    }
}

impl Product<'_> {
    /// Computes the product. Never inlined, so that the loops are compiled once for each length of
    /// vectors, and not once more for each caller.
    #[inline(never)]
    pub fn compute(self, arch: Arch) {
        arch.dispatch(self);
    }

    /// All rows of `V` vectors of columns, beginning with column `from`.
    #[inline(always)]
    fn panel<S: Simd, const V: usize>(&mut self, simd: S, from: usize) {
        if S::REGISTER_COUNT < 32 {
            self.rows::<S, 4, V>(simd, from);
        } else {
            self.rows::<S, 8, V>(simd, from);
        }
    }

    /// The same, `R` rows at a time.
    #[inline(always)]
    fn rows<S: Simd, const R: usize, const V: usize>(&mut self, simd: S, from: usize) {
        let (inner, columns, width) = (self.inner, self.columns, V * S::F32_LANES);
        let (start, _) = S::as_simd_f32s(&self.start[from..][..width]);
        let right = &self.right[..inner * columns];
        let count = self.out.len() / columns;
        for (block, out) in self.out.chunks_mut(R * columns).enumerate() {
            // Missing rows of the last block repeat the last row, and are not stored.
            let row = |r: usize| (block * R + r).min(count - 1) * self.left_pitch;
            let left: [&[f32]; R] = std::array::from_fn(|r| &self.left[row(r)..][..inner]);
            let mut sums = [[simd.splat_f32s(0.0); V]; R];
            sums.iter_mut().for_each(|sums| sums.copy_from_slice(start));
            for i in 0..inner {
                let (line, _) = S::as_simd_f32s(&right[i * columns + from..][..width]);
                let line: [S::f32s; V] = std::array::from_fn(|v| line[v]);
                for (left, sums) in left.iter().zip(&mut sums) {
                    let factor = simd.splat_f32s(left[i]);
                    for (sum, &value) in sums.iter_mut().zip(&line) {
                        *sum = simd.mul_add_e_f32s(factor, value, *sum);
                    }
                }
            }
            for (out, sums) in out.chunks_exact_mut(columns).zip(&sums) {
                let (to, _) = S::as_mut_simd_f32s(&mut out[from..][..width]);
                to.copy_from_slice(sums);
            }
        }
    }
}
