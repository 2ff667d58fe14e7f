//! The backend of the command line.
//!
//! # Invariant
//! A GPU requested by name computes, or one line says why not. If `auto` finds no GPU, one line
//! says so, and the CPU computes (`without_a_gpu_auto_says_so_once_and_goes_on` in
//! `host/cli/tests/cli/sparse_problems.rs`).

use super::print;
use anyhow::Result;
use nirspi_recon::omp::Backend;
use nirspi_recon::omp::gpu::{self, Choice, Device};

/// The device for a batch of `frames`; `None` means the processor.
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
    if let Some(why) = nirspi_recon::backend::probe::kernel_cache_trouble() {
        print::remark(why);
    }
}
