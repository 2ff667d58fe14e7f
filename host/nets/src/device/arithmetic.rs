//! The arithmetic of networks on a GPU, and notes for the user about it.

use std::fmt;
use std::str::FromStr;
use std::sync::{Arc, Mutex, PoisonError};

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

/// Something that networks did in another way than asked or expected. The results are right all the
/// same. `Display` is one line.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Note {
    /// Half precision was asked of a device without tensor cores.
    NoTensorCores {
        /// Name of the device.
        device: String,
    },
    /// Some weights are not exact in half precision, so their layers do without the tensor cores.
    WeightsNotF16,
    /// Some weights are too large for half precision.
    WeightsBeyondF16,
    /// An activation was too large for half precision.
    BeyondF16,
    /// The kernel of the agreement with the readings needs more than the device has.
    AgreementOnCpu {
        /// What it needs, and what the device has.
        why: String,
    },
    /// Images come to the host between the networks of a GPU, which takes longer.
    ThroughHost {
        /// Why.
        why: String,
    },
    /// The tensor cores did not give what the plain kernels give, or could not be used.
    TensorCoresDiffer,
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoTensorCores { device } => {
                write!(f, "precision f16 needs a GPU with tensor cores, through CUDA; {device} computes in f32")
            }
            Self::WeightsNotF16 => f.write_str(
                "some weights are not exact in f16; their layers run without tensor cores, in f32",
            ),
            Self::WeightsBeyondF16 => f.write_str(
                "some weights are too large for f16; their layers run without tensor cores, in f32",
            ),
            Self::BeyondF16 => f.write_str(
                "a number in the network was too large for f16; the images were made again without tensor cores",
            ),
            Self::AgreementOnCpu { why } => {
                write!(f, "{why}; the CPU computes the agreement with the readings")
            }
            Self::ThroughHost { why } => {
                write!(f, "{why}; images come to the CPU between the networks, which takes longer")
            }
            Self::TensorCoresDiffer => f.write_str(
                "the tensor cores failed a comparison with the plain kernels; networks run without them",
            ),
        }
    }
}

/// Notes that every clone of a device, and every network on it, can add to.
#[derive(Debug, Clone, Default)]
pub(crate) struct Notes(Arc<Mutex<Vec<Note>>>);

impl Notes {
    pub(crate) fn add(&self, note: Note) {
        let mut notes = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if !notes.contains(&note) {
            notes.push(note);
        }
    }

    pub(crate) fn take(&self) -> Vec<Note> {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
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

    #[test]
    fn a_note_is_told_once() {
        let notes = Notes::default();
        let clone = notes.clone();
        for note in [Note::BeyondF16, Note::WeightsNotF16, Note::BeyondF16] {
            clone.add(note);
        }
        assert_eq!(notes.take(), [Note::BeyondF16, Note::WeightsNotF16]);
        assert_eq!(clone.take(), []);
    }
}
