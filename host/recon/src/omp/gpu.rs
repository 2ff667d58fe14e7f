//! OMP on a GPU: one kernel source for CUDA, Vulkan, Metal and DirectX, through CubeCL.
//!
//! # Invariant
//! A GPU finds the support that the CPU finds
//! (`omp::tests::gpu::every_kind_of_problem_has_the_references_solution`). The kernel flags a frame
//! whose choices are within the rounding of single precision, and the CPU solves such a frame again
//! in `f64` (`omp::tests::gpu::few_of_many_frames_need_double_precision_and_all_have_its_support`),
//! as [`MixedDictionary`](super::MixedDictionary) does.
//!
//! | type | what it is |
//! |---|---|
//! | [`Device`] | a GPU, or software Vulkan if requested by name |
//! | [`choose`] | whether a batch goes to a GPU or stays on the processor |
//! | [`DeviceDictionary`] | a matrix, its Gram matrix and norms on a device; solves batches |
//! | [`DeviceFrames`], [`DeviceSolutions`], [`DeviceImages`] | measurements, sparse representations and images that stay on the device |
//! | [`solve_batch_over`], [`path_over`] | any other [`Dictionary`](super::Dictionary), its Gram matrix uploaded for one call |
//!
//! # How
//! One workgroup pursues one frame, with its projections in registers: four atoms a unit for 1024
//! atoms. As on the CPU, the columns of the chosen atoms in the Gram matrix are orthogonalised one
//! by one (a pivoted partial Cholesky factorisation), so a step solves no triangular system. A step
//! reads the earlier rows once, 4 bytes per atom and row, and writes one row. The rows are in the
//! device's memory. Shared memory holds three numbers for each unit and one weight for each chosen
//! atom: 16 KB are enough for 2048 atoms, 32 KB for 4096, so one variant of the kernel serves all
//! sizes. The number of loop rounds grows with the atoms, and `budget` splits a pursuit into as
//! many launches as necessary.
//!
//! Not on the GPU: non-negative coefficients, warm starts, and `f64`.

mod budget;
mod choice;
mod device;
mod dictionary;
mod engine;
mod gram;
mod images;
mod kernels;
mod layout;

pub use choice::{Choice, FRAMES_WORTH_A_GPU, choose};
pub use device::Device;
pub use dictionary::{DeviceDictionary, DeviceFrames, DevicePictures, path_over, solve_batch_over};
pub use gram::DeviceSolutions;
pub use images::{DeviceImages, HostImages};
