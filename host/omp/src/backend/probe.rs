//! Finds the GPU of a backend.
//!
//! # Invariant
//! [`find`] is the only function that turns a [`Backend`] into a device. A backend requested by
//! name is found, or the error says what is missing
//! (`tests::a_backend_by_name_is_that_one_or_missing`). [`Backend::Auto`] never gives a software
//! device (`tests::auto_gives_a_real_gpu_or_says_what_is_missing`).

use super::Backend;
use nirspi_gpu::Gpu;
pub use nirspi_gpu::cache::trouble as kernel_cache_trouble;
use nirspi_gpu::probe::{Absent, Adapters, adapter, cuda};
use thiserror::Error;

/// The device of a backend was not found. `Display` gives one line with everything that was looked
/// for.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{}", .looked_for.iter().map(|(kind, absent)| format!("{kind}: {absent}")).collect::<Vec<_>>().join("; "))]
pub struct Missing {
    /// The backends that were tried (CUDA, wgpu or both), each with what is missing.
    pub looked_for: Vec<(&'static str, Absent)>,
}

/// The device of a backend; `None` for the processor. [`Backend::Auto`] means a GPU through CUDA,
/// else a discrete or integrated GPU through wgpu. Only [`Backend::Wgpu`] gives a software device.
///
/// # Errors
/// [`Missing`] names the backends that were tried, and why each is not usable.
pub fn find(backend: Backend) -> Result<Option<Gpu>, Missing> {
    let through_cuda = || cuda().map(Gpu::Cuda).map_err(|absent| ("CUDA", absent));
    let through_wgpu = |kinds| adapter(kinds).map_err(|absent| ("wgpu", absent));
    let found = match backend {
        Backend::Cpu => return Ok(None),
        Backend::Cuda => through_cuda().map_err(|absent| vec![absent]),
        Backend::Wgpu => through_wgpu(Adapters::All).map_err(|absent| vec![absent]),
        Backend::Auto => through_cuda().or_else(|no_cuda| {
            through_wgpu(Adapters::Gpus).map_err(|no_wgpu| vec![no_wgpu, no_cuda])
        }),
    };
    found.map(Some).map_err(|looked_for| Missing { looked_for })
}

/// The backend that computes on this device.
#[must_use]
pub fn backend(gpu: &Gpu) -> Backend {
    if gpu.is_cuda() { Backend::Cuda } else { Backend::Wgpu }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn auto_gives_a_real_gpu_or_says_what_is_missing() {
        match find(Backend::Auto) {
            Ok(None) => panic!("the processor is no answer to a search for a GPU"),
            Ok(Some(gpu)) => assert!(!gpu.is_software(), "{gpu:?}"),
            Err(missing) => {
                let line = missing.to_string();
                assert!(line.contains("wgpu: ") && line.contains("; CUDA: "), "{line}");
                assert!(!line.contains('\n'), "{line}");
            }
        }
        assert_eq!(find(Backend::Cpu), Ok(None));
    }

    #[test]
    fn a_backend_by_name_is_that_one_or_missing() {
        for (asked, name) in [(Backend::Cuda, "CUDA: "), (Backend::Wgpu, "wgpu: ")] {
            match find(asked) {
                Ok(found) => assert_eq!(found.as_ref().map(backend), Some(asked), "{found:?}"),
                Err(missing) => assert!(missing.to_string().starts_with(name), "{missing}"),
            }
        }
    }
}
