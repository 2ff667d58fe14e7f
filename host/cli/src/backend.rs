//! What computes, as the command line says it.
//!
//! The one law: who asked for a GPU gets it or one line that says why not; who did not is told once, and goes on.

#[cfg(feature = "gpu")]
use super::print;
use anyhow::Result;
use nirspi_recon::omp::Backend;
#[cfg(not(feature = "gpu"))]
use nirspi_recon::omp::BackendError;
#[cfg(feature = "gpu")]
use nirspi_recon::omp::gpu::{self, Choice};

/// A device to compute on.
#[cfg(feature = "gpu")]
pub use nirspi_recon::omp::gpu::Device;

/// No device: this build has no kernels.
#[cfg(not(feature = "gpu"))]
pub enum Device {}

/// The device for a batch of `frames`, or none: the processor.
#[cfg(feature = "gpu")]
pub fn choose(backend: Backend, frames: usize) -> Result<Option<Device>> {
    match gpu::choose(backend, frames)? {
        Choice::Gpu(device) => Ok(Some(device)),
        Choice::Cpu(None) => Ok(None),
        Choice::Cpu(Some(absent)) => {
            print::complain(format_args!("{absent}; using the CPU"));
            Ok(None)
        }
    }
}

/// None: the processor is all that this build has.
#[cfg(not(feature = "gpu"))]
pub fn choose(backend: Backend, _frames: usize) -> Result<Option<Device>> {
    match backend {
        Backend::Auto | Backend::Cpu => Ok(None),
        Backend::Wgpu | Backend::Cuda => Err(BackendError::not_built().into()),
    }
}
