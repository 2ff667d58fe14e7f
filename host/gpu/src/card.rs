//! Kinds of NVIDIA GPUs, by what they can do.

use std::fmt;

/// A kind of NVIDIA GPU, by its compute capability. `Display` is NVRTC's name, `sm_90`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Card {
    /// Ten times the major version plus the minor version: 90 for 9.0.
    pub capability: u16,
}

impl Card {
    /// H100 and H200.
    pub const HOPPER: Self = Self { capability: 90 };

    /// Largest shared memory of a workgroup, in bytes: the table of compute capabilities in NVIDIA's
    /// programming guide.
    pub(crate) fn shared_bytes(self) -> usize {
        let kib = match self.capability {
            80 | 87 => 163,
            90 | 100..=110 => 227,
            86 | 89 | 120.. => 99,
            72..80 => 64,
            _ => 48,
        };
        kib << 10
    }
}

impl Default for Card {
    fn default() -> Self {
        Self::HOPPER
    }
}

impl fmt::Display for Card {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "sm_{}", self.capability)
    }
}
