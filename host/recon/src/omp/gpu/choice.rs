//! Whether a batch goes to a GPU.
//!
//! The one law: `auto` never fails for want of a GPU, and never looks for one that would not pay.

use super::device::Device;
use crate::omp::{Backend, BackendError};

/// Frames from which `auto` looks for a GPU. One frame takes a GPU about as long as 64 do (each is one of its workgroups, a step waits
/// for the step before), and the processor tens of microseconds: an H200 beside 16 cores was as fast as they at 64.
pub const FRAMES_WORTH_A_GPU: usize = 64;

/// What computes.
#[derive(Debug, Clone)]
pub enum Choice {
    /// The processor, since it was asked for or the batch is small; or since there is no GPU, which is said why.
    Cpu(Option<BackendError>),
    /// A device.
    Gpu(Device),
}

/// Chooses for `frames` of one dictionary.
///
/// # Errors
/// [`BackendError::Absent`] if a device was asked for by name and is not there.
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
