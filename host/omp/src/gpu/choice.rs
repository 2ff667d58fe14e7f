//! Chooses between a GPU and the processor for a batch.
//!
//! # Invariant
//! `auto` never fails because a GPU is missing, and never takes a software device
//! (`tests::gpu::auto_takes_no_software_device_and_a_name_is_kept_to`).

use super::device::Device;
use crate::{Backend, BackendError};

/// Number of frames from which `auto` looks for a GPU. A GPU needs about as long for one frame as
/// for 64 (a frame is one workgroup, whose steps follow each other); the processor needs tens of
/// microseconds. At 64 frames an H200 was as fast as 16 cores.
pub const FRAMES_WORTH_A_GPU: usize = 64;

/// The choice between processor and GPU.
#[derive(Debug, Clone)]
pub enum Choice {
    /// The processor: it was requested, or the batch is small, or no GPU was found (then with the
    /// reason).
    Cpu(Option<BackendError>),
    /// A device.
    Gpu(Device),
}

/// Chooses a device for `frames` measurements of one dictionary.
///
/// # Errors
/// [`BackendError::Absent`] if the requested device is missing.
pub fn choose(backend: Backend, frames: usize) -> Result<Choice, BackendError> {
    if backend == Backend::Auto && frames < FRAMES_WORTH_A_GPU {
        return Ok(Choice::Cpu(None));
    }
    match Device::open(backend) {
        Ok(None) => Ok(Choice::Cpu(None)),
        Ok(Some(device)) => Ok(Choice::Gpu(device)),
        Err(absent) if backend == Backend::Auto => Ok(Choice::Cpu(Some(absent))),
        Err(absent) => Err(absent),
    }
}
