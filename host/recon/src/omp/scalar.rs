//! The two number types that every path but the reference is written for.
//!
//! The one law: an algorithm says nothing about the type but its rounding, so `f32` and `f64` choose alike
//! wherever rounding does not decide.

use std::ops::{AddAssign, Mul, SubAssign};

/// `f32` or `f64`.
pub trait Scalar:
    crate::fwht::Real
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
    /// Distance from 1 to the next number.
    const EPSILON: f64;

    /// The nearest number of this type.
    fn from_f64(value: f64) -> Self;
    /// Magnitude.
    fn magnitude(self) -> Self;
    /// Square root.
    fn root(self) -> Self;
}

macro_rules! scalar {
    ($type:ident) => {
        impl Scalar for $type {
            const EPSILON: f64 = $type::EPSILON as f64;

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
        }
    };
}

scalar!(f32);
scalar!(f64);
