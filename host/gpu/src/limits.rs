//! Limits of a device: shared memory, buffers, and the length of its loops.
//!
//! A problem that exceeds a limit is refused before the launch, with the amount needed and the
//! limit. Software Vulkan ends an invocation's loops after some 65 535 rounds without an error, so
//! the rounds of all loops are counted before a launch.

use crate::error::GpuError;

/// Largest number of rounds of all loops of one invocation, below the limit of software Vulkan.
pub const ROUNDS: usize = 60_000;

/// Largest number of workgroups that every device takes in one direction.
pub(crate) const GROUPS: usize = 65_535;

/// Largest buffer in bytes that is made, where a device allows more.
pub(crate) const BUFFER_BYTES: usize = 1 << 30;

/// Limits that a device reports.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DeviceLimits {
    /// Largest shared memory of a workgroup, in bytes.
    pub shared_bytes: usize,
    /// Largest buffer, in bytes.
    pub buffer_bytes: usize,
    /// Largest number of units in a workgroup.
    pub units: usize,
    /// Largest number of buffers of a kernel.
    pub buffers: usize,
}

impl DeviceLimits {
    /// Checks that a buffer of `count` four-byte numbers fits.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] if it does not.
    pub fn fits(&self, what: &'static str, count: usize) -> Result<(), GpuError> {
        check(what, count.saturating_mul(4), self.buffer_bytes)
    }
}

/// Checks that a problem needs no more than a device has.
///
/// # Errors
/// [`GpuError::TooLarge`] if `needed` is more than `limit`.
pub fn check(what: &'static str, needed: usize, limit: usize) -> Result<(), GpuError> {
    if needed > limit {
        return Err(GpuError::TooLarge { what, needed, limit });
    }
    Ok(())
}
