//! Activations between convolutions, over whole channels, written so that the compiler vectorises
//! them.
//!
//! Every activation maps zero to zero, which keeps margins zero, except [`FilmSilu`], whose caller
//! leaves the margins out.

use pulp::{Arch, Simd, WithSimd};

use super::aligned::LINE_FLOATS;

/// e^x for |x| <= 87, with a relative error below 2e-7: 2^n from the exponent's bits, the rest from
/// the Taylor polynomial.
#[inline(always)]
fn exp(x: f32) -> f32 {
    /// 1.5 * 2^23: adding it leaves the nearest integer in the low bits of the sum.
    const ROUND: f32 = 12_582_912.0;
    /// ln 2 in two parts. The first part has few bits, so that its product with n is exact (Cody
    /// and Waite).
    const LN_2: (f32, f32) = (0.693_359_4, -2.121_944_4e-4);
    let x = x.clamp(-87.0, 87.0);
    let shifted = x * std::f32::consts::LOG2_E + ROUND;
    let n = shifted - ROUND;
    let r = (x - n * LN_2.0) - n * LN_2.1;
    let mut p = 1.0 / 5040.0;
    for c in [1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0] {
        p = p * r + c;
    }
    p * f32::from_bits((shifted.to_bits() << 23).wrapping_add(0x3F80_0000))
}

/// x / (1 + e^-x).
#[inline(always)]
fn silu_of(x: f32) -> f32 {
    x / (1.0 + exp(-x))
}

/// SiLU of every value.
pub(super) fn silu(arch: Arch, values: &mut [f32]) {
    arch.dispatch(|| values.iter_mut().for_each(|x| *x = silu_of(*x)));
}

/// Writes SiLU of `values` into `out`.
pub(super) fn silu_into(arch: Arch, values: &[f32], out: &mut [f32]) {
    arch.dispatch(|| values.iter().zip(out).for_each(|(x, out)| *out = silu_of(*x)));
}

/// SiLU of `gain * value + offset` of each pixel, with one gain and one offset for each of a pixel's
/// floats: feature-wise modulation (Perez et al., FiLM, AAAI 2018).
pub(super) struct FilmSilu<'a> {
    /// Pixels of as many floats as there are gains, a multiple of [`LINE_FLOATS`].
    pub pixels: &'a mut [f32],
    pub gains: &'a [f32],
    pub offsets: &'a [f32],
}

impl WithSimd for FilmSilu<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { pixels, gains, offsets } = self;
        for pixel in pixels.chunks_exact_mut(gains.len()) {
            let lines = gains.as_chunks::<LINE_FLOATS>().0.iter().zip(offsets.as_chunks().0);
            for (x, (gain, offset)) in pixel.as_chunks_mut().0.iter_mut().zip(lines) {
                let (x, offset): (&mut [f32; LINE_FLOATS], &[f32; LINE_FLOATS]) = (x, offset);
                for ((x, gain), offset) in x.iter_mut().zip(gain).zip(offset) {
                    *x = silu_of(*x * gain + offset);
                }
            }
        }
    }
}

/// Multiplies negative values by `slope`: PReLU; with slope 0, ReLU.
pub(super) fn prelu(arch: Arch, values: &mut [f32], slope: f32) {
    arch.dispatch(|| values.iter_mut().for_each(|x| *x = x.max(0.0) + slope * x.min(0.0)));
}

/// ln(1 + e^x), without overflow.
pub(super) fn softplus(x: f32) -> f32 {
    x.max(0.0) + (-x.abs()).exp().ln_1p()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponential_is_right_to_the_last_digits() {
        for i in -8600..8600 {
            let x = i as f32 / 100.0;
            let expected = f64::from(x).exp();
            assert!((f64::from(exp(x)) / expected - 1.0).abs() < 4e-7, "{x}: {}", exp(x));
        }
        assert!(exp(-1e9) < 1e-37 && exp(1e9).is_finite());
    }

    #[test]
    fn activations_are_what_they_are_called() {
        let arch = Arch::new();
        let x = [-3.0_f32, -0.5, 0.0, 0.7, 40.0];
        let mut y = x;
        silu(arch, &mut y);
        for (x, y) in x.iter().zip(y) {
            assert!((y - x / (1.0 + (-x).exp())).abs() < 1e-6, "{x}: {y}");
        }
        let mut y = x;
        prelu(arch, &mut y, 0.25);
        assert_eq!(y, [-0.75, -0.125, 0.0, 0.7, 40.0]);
        let mut pixels = [0.7; 2 * LINE_FLOATS];
        let (mut gains, mut offsets) = ([2.0; LINE_FLOATS], [-1.0; LINE_FLOATS]);
        (gains[9], offsets[9]) = (0.0, 0.0);
        arch.dispatch(FilmSilu { pixels: &mut pixels, gains: &gains, offsets: &offsets });
        for (at, y) in pixels.iter().enumerate() {
            let x: f32 = if at % LINE_FLOATS == 9 { 0.0 } else { 0.4 };
            assert!((y - x / (1.0 + (-x).exp())).abs() < 1e-6, "{at}: {y}");
        }
        assert!((softplus(0.0) - 2.0_f32.ln()).abs() < 1e-6);
        assert_eq!(softplus(100.0), 100.0);
    }
}
