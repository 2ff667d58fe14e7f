//! The backend of the command line.
//!
//! # Invariant
//! A GPU requested by name computes, or one line says why not. If `auto` finds no GPU, one line
//! says so, and the CPU computes (`without_a_gpu_auto_says_so_once_and_goes_on` in
//! `host/cli/tests/cli/sparse_problems.rs`).

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

/// The device for a batch of `frames`; `None` means the processor.
#[cfg(feature = "gpu")]
pub fn choose(backend: Backend, frames: usize) -> Result<Option<Device>> {
    match gpu::choose(backend, frames)? {
        Choice::Gpu(device) => {
            say_slow_start();
            Ok(Some(device))
        }
        Choice::Cpu(None) => Ok(None),
        Choice::Cpu(Some(absent)) => {
            print::complain(format_args!("{absent}; using the CPU"));
            Ok(None)
        }
    }
}

/// Says once on stderr why each run compiles the GPU's kernels, if it does.
pub fn say_slow_start() {
    #[cfg(feature = "gpu")]
    if let Some(why) = nirspi_recon::backend::probe::kernel_cache_trouble() {
        print::remark(why);
    }
}

/// `None`: this build has only the processor.
#[cfg(not(feature = "gpu"))]
pub fn choose(backend: Backend, _frames: usize) -> Result<Option<Device>> {
    match backend {
        Backend::Auto | Backend::Cpu => Ok(None),
        Backend::Wgpu | Backend::Cuda => Err(BackendError::not_built().into()),
    }
}
