//! Notes for the user: what networks did in another way than asked.

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

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
