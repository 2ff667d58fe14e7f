//! The arithmetic of networks on a GPU.

use std::fmt;
use std::str::FromStr;

use thiserror::Error;

/// The arithmetic of the UNet's convolutions. Everything else is in `f32` always.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum Arithmetic {
    /// Single precision: a GPU gives the processor's results to within 1e-4 of full scale.
    #[default]
    F32,
    /// Operands in half precision and sums in single precision, by the tensor cores of a GPU: within
    /// 5e-3 of full scale, 2e-4 root mean square, with half of the products of
    /// [`F32`](Self::F32) there.
    F16,
}

impl fmt::Display for Arithmetic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::F32 => "f32",
            Self::F16 => "f16",
        })
    }
}

/// A precision that does not exist.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("precision {0:?}, expected f32 or f16")]
pub struct ParseArithmeticError(String);

impl FromStr for Arithmetic {
    type Err = ParseArithmeticError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text {
            "f32" => Ok(Self::F32),
            "f16" => Ok(Self::F16),
            other => Err(ParseArithmeticError(other.to_owned())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_precision_is_read_as_it_is_written_and_others_are_refused_by_name() {
        for arithmetic in [Arithmetic::F32, Arithmetic::F16] {
            assert_eq!(arithmetic.to_string().parse(), Ok(arithmetic));
        }
        let refused = "bf16".parse::<Arithmetic>().unwrap_err().to_string();
        assert_eq!(refused, "precision \"bf16\", expected f32 or f16");
    }
}
