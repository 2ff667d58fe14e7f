//! Why a device cannot compute.

use thiserror::Error;

/// Why a device cannot compute. `Display` is one line.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum GpuError {
    /// The problem exceeds a limit of the device.
    #[error("the GPU has {limit} {what}, this problem needs {needed}")]
    TooLarge {
        /// What the device has too little of, with its unit.
        what: &'static str,
        /// How much the problem needs.
        needed: usize,
        /// How much the device has.
        limit: usize,
    },
    /// The device or its driver failed.
    #[error("the GPU failed: {0}")]
    Failed(String),
}
