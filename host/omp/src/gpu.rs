//! OMP on a GPU: one kernel source for CUDA, Vulkan, Metal and DirectX, through CubeCL.
//!
//! # Invariant
//! A GPU finds the support that the CPU finds
//! (`tests::gpu::every_kind_of_problem_has_the_references_solution`). The kernel flags a frame
//! whose choices are within the rounding of single precision, and the CPU solves such a frame again
//! in `f64` (`tests::gpu::few_of_many_frames_need_double_precision_and_all_have_its_support`),
//! as [`MixedDictionary`](super::MixedDictionary) does.
//!
//! | type | what it is |
//! |---|---|
//! | [`Device`] | a GPU, or software Vulkan if requested by name |
//! | [`choose`] | whether a batch goes to a GPU or stays on the processor |
//! | [`DeviceDictionary`] | a matrix, its Gram matrix and norms on a device; solves batches |
//! | [`DeviceFrames`], [`DeviceSolutions`], [`DeviceImages`] | measurements, sparse representations and images that stay on the device |
//! | [`OverDevice`], [`path_over`] | any other [`Dictionary`](super::Dictionary), its Gram matrix uploaded once, or for one call |
//!
//! The kernels, and how they pursue a frame, are in [`nirspi_gpu::pursuit`].
//!
//! Not on the GPU: non-negative coefficients, warm starts, and `f64`.

mod choice;
mod device;
mod dictionary;
mod gram;
mod images;

pub use choice::{Choice, FRAMES_WORTH_A_GPU, choose};
pub use device::Device;
pub use dictionary::{DeviceDictionary, DeviceFrames, DevicePictures, OverDevice, path_over};
pub use gram::DeviceSolutions;
pub use images::{DeviceImages, HostImages};
