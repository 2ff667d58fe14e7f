//! The number types `f32` and `f64`, for which every implementation except the reference is
//! written.
//!
//! An algorithm depends on the type only through its rounding, so `f32` and `f64` choose the same
//! atoms unless rounding decides (`tests::both_number_types_find_what_the_reference_finds`).

use pulp::Simd;
use std::ops::{AddAssign, Mul, SubAssign};

/// `f32` or `f64`.
pub trait Scalar:
    nirspi_patterns::fwht::Real
    + nalgebra::Scalar
    + Default
    + PartialOrd
    + Send
    + Sync
    + Into<f64>
    + Mul<Output = Self>
    + AddAssign
    + SubAssign
{
    /// A vector of the machine, filled with numbers of this type.
    #[doc(hidden)]
    type Vector<S: Simd>: Copy;

    /// Distance from 1 to the next number.
    const EPSILON: f64;

    /// A pivot below this share of its atom's squared norm is rounding.
    #[doc(hidden)]
    const DEPENDENT: f64;
    /// A correlation below this share of the first one is rounding.
    #[doc(hidden)]
    const ROUNDING: f64;

    /// The nearest number of this type.
    fn from_f64(value: f64) -> Self;
    /// Magnitude.
    fn magnitude(self) -> Self;
    /// Square root.
    fn root(self) -> Self;

    #[doc(hidden)]
    fn splat<S: Simd>(simd: S, value: Self) -> Self::Vector<S>;
    /// `sum + a * b`, rounded twice.
    #[doc(hidden)]
    fn accumulate<S: Simd>(
        simd: S,
        sum: Self::Vector<S>,
        a: Self::Vector<S>,
        b: Self::Vector<S>,
    ) -> Self::Vector<S>;
    #[doc(hidden)]
    fn vectors<S: Simd>(values: &[Self]) -> &[Self::Vector<S>];
    #[doc(hidden)]
    fn vectors_mut<S: Simd>(values: &mut [Self]) -> &mut [Self::Vector<S>];
}

macro_rules! scalar {
    ($type:ident, $rounding:literal, $vector:ident, $splat:ident, $add:ident, $mul:ident, $view:ident, $view_mut:ident) => {
        impl Scalar for $type {
            type Vector<S: Simd> = S::$vector;

            const EPSILON: f64 = $type::EPSILON as f64;
            const DEPENDENT: f64 = $rounding;
            const ROUNDING: f64 = $rounding;

            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                value as Self
            }

            #[inline(always)]
            fn magnitude(self) -> Self {
                self.abs()
            }

            #[inline(always)]
            fn root(self) -> Self {
                self.sqrt()
            }

            #[inline(always)]
            fn splat<S: Simd>(simd: S, value: Self) -> S::$vector {
                simd.$splat(value)
            }

            #[inline(always)]
            fn accumulate<S: Simd>(
                simd: S,
                sum: S::$vector,
                a: S::$vector,
                b: S::$vector,
            ) -> S::$vector {
                simd.$add(sum, simd.$mul(a, b))
            }

            #[inline(always)]
            fn vectors<S: Simd>(values: &[Self]) -> &[S::$vector] {
                S::$view(values).0
            }

            #[inline(always)]
            fn vectors_mut<S: Simd>(values: &mut [Self]) -> &mut [S::$vector] {
                S::$view_mut(values).0
            }
        }
    };
}

scalar!(f32, 1e-5, f32s, splat_f32s, add_f32s, mul_f32s, as_simd_f32s, as_mut_simd_f32s);
scalar!(f64, 1e-10, f64s, splat_f64s, add_f64s, mul_f64s, as_simd_f64s, as_mut_simd_f64s);
