//! The two functions that the telemetry needs beyond the four basic operations, on processors with
//! a unit for single precision.
//!
//! `micromath` is small and rough: its square root is right to 5 %, its logarithm to 1e-4 above 1
//! only. So its root is a first guess here, and its logarithm is never asked below 1.

use micromath::F32Ext;

/// Square root, right to 1e-6 of itself; 0 for 0 and below.
pub(crate) fn root(value: f32) -> f32 {
    if value <= 0.0 {
        return 0.0;
    }
    // Named in full: where the standard library is linked, `value.sqrt()` would be the library's.
    let guess = F32Ext::sqrt(value);
    // A step of Newton's turns a relative error e into e^2 / 2: from 5e-2 to 1e-3, to 1e-6, and then
    // below what an `f32` resolves.
    let better = 0.5 * (guess + value / guess);
    let better = 0.5 * (better + value / better);
    0.5 * (better + value / better)
}

/// Natural logarithm of a positive number, right to 1e-4.
pub(crate) fn ln(value: f32) -> f32 {
    if value < 1.0 { -F32Ext::ln(1.0 / value) } else { F32Ext::ln(value) }
}

/// The nearest `f32`, by way of the 32 most significant bits: the processor has no instruction for
/// 64.
pub(crate) fn from_u64(value: u64) -> f32 {
    let dropped = 32_u32.saturating_sub(value.leading_zeros());
    let kept = u32::try_from(value >> dropped).unwrap_or(u32::MAX);
    kept as f32 * power_of_two(dropped)
}

/// 2 to this power, at most 127.
pub(crate) fn power_of_two(exponent: u32) -> f32 {
    f32::from_bits(exponent.min(127).saturating_add(127) << 23)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_root_is_right_to_a_millionth(exponent in -60.0_f64..60.0) {
            let value = exponent.exp2() as f32;
            let exact = f64::from(value).sqrt();
            prop_assert!((f64::from(root(value)) / exact - 1.0).abs() < 1e-6, "{value}");
        }

        #[test]
        fn a_logarithm_is_right_to_a_ten_thousandth(exponent in -60.0_f64..60.0) {
            let value = exponent.exp2() as f32;
            let exact = f64::from(value).ln();
            prop_assert!((f64::from(ln(value)) - exact).abs() < 1e-4, "{value}");
        }

        #[test]
        fn a_large_integer_keeps_its_leading_bits(value: u64, shift in 0_u32..64) {
            let value = value >> shift;
            let error = (f64::from(from_u64(value)) - value as f64).abs();
            prop_assert!(error <= value as f64 * 1.2e-7, "{value}");
        }
    }

    #[test]
    fn nothing_and_less_have_no_root() {
        assert_eq!((root(0.0), root(-1.0)), (0.0, 0.0));
    }

    #[test]
    fn powers_of_two_are_exact() {
        assert_eq!(
            (power_of_two(0), power_of_two(10), power_of_two(96)),
            (1.0, 1024.0, 96_f32.exp2())
        );
    }
}
