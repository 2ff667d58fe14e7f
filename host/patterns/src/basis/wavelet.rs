//! Orthonormal wavelets of images: S. Mallat's square pyramid, periodic at the borders.
//!
//! A step splits the top-left corner of an image into sums and differences along both axes. Every
//! step is orthonormal, so the whole transform is (`basis::tests::atoms_are_orthonormal`).

use std::f32::consts::FRAC_1_SQRT_2;

/// Low-pass taps of the Haar wavelet.
pub(super) const HAAR: &[f32] = &[FRAC_1_SQRT_2, FRAC_1_SQRT_2];

/// Low-pass taps of the Daubechies wavelet of four taps, `(1 + s, 3 + s, 3 - s, 1 - s) / (4 sqrt
/// 2)` with `s = sqrt 3`.
pub(super) const DAUBECHIES_4: &[f32] = &[0.482_962_9, 0.836_516_3, 0.224_143_87, -0.129_409_52];

/// High-pass tap `i`: the low-pass taps backwards with alternating signs.
fn high(taps: &[f32], i: usize) -> f32 {
    let tap = taps[taps.len() - 1 - i];
    if i.is_multiple_of(2) { tap } else { -tap }
}

/// One step along a line: smooth half, then detail half.
pub(crate) fn split(taps: &[f32], line: &[f32], out: &mut [f32]) {
    let size = line.len();
    let (smooth, detail) = out.split_at_mut(size / 2);
    for (k, (smooth, detail)) in smooth.iter_mut().zip(detail).enumerate() {
        (*smooth, *detail) = (0.0, 0.0);
        for (i, tap) in taps.iter().enumerate() {
            let value = line[(2 * k + i) % size];
            *smooth += tap * value;
            *detail += high(taps, i) * value;
        }
    }
}

/// A step back along a line: the inverse, and transpose, of the step that gives its smooth half, then its detail half.
pub fn merge(taps: &[f32], line: &[f32], out: &mut [f32]) {
    let size = line.len();
    let (smooth, detail) = line.split_at(size / 2);
    out.fill(0.0);
    for (k, (smooth, detail)) in smooth.iter().zip(detail).enumerate() {
        for (i, tap) in taps.iter().enumerate() {
            out[(2 * k + i) % size] += tap * smooth + high(taps, i) * detail;
        }
    }
}

/// Replaces a row-major `n x n` image by its coefficients.
pub(super) fn analyse(taps: &[f32], n: usize, image: &mut [f32]) {
    let mut size = n;
    while size > 1 {
        along_both_axes(n, size, image, |line, out| split(taps, line, out));
        size /= 2;
    }
}

/// Replaces coefficients by their row-major `n x n` image.
pub(super) fn synthesise(taps: &[f32], n: usize, coefficients: &mut [f32]) {
    let mut size = 2;
    while size <= n {
        along_both_axes(n, size, coefficients, |line, out| merge(taps, line, out));
        size *= 2;
    }
}

/// Applies `step` to the rows, then the columns, of the top-left `size x size` corner of an `n x n`
/// image.
fn along_both_axes(n: usize, size: usize, image: &mut [f32], step: impl Fn(&[f32], &mut [f32])) {
    let (mut line, mut out) = (vec![0.0; size], vec![0.0; size]);
    let rows = (0..size).map(|r| (r * n, 1));
    for (start, stride) in rows.chain((0..size).map(|c| (c, n))) {
        for (k, value) in line.iter_mut().enumerate() {
            *value = image[start + k * stride];
        }
        step(&line, &mut out);
        for (k, value) in out.iter().enumerate() {
            image[start + k * stride] = *value;
        }
    }
}
