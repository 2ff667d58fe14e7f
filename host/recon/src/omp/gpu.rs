//! OMP on a GPU: one kernel source for CUDA, Vulkan, Metal and DirectX, through CubeCL.
//!
//! The one law: a GPU finds what the CPU finds. Single precision decides only what it can; frames whose choices are within
//! its rounding are flagged by the kernel and solved again in `f64` on the CPU, as [`MixedDictionary`](super::MixedDictionary)
//! does.
//!
//! | type | is |
//! |---|---|
//! | [`Device`] | a GPU that was found, or the software Vulkan that was asked for by name |
//! | [`choose`] | whether a batch goes to a GPU or stays on the processor |
//! | [`DeviceDictionary`] | a matrix, its Gram matrix and lengths on a device; solves batches |
//! | [`DeviceFrames`], [`DeviceSolutions`], [`DeviceImages`] | measurements, sparse representations and images that stay there |
//! | [`solve_batch_over`], [`path_over`] | any other [`Dictionary`](super::Dictionary), its Gram matrix uploaded for one call |
//!
//! # How
//! One workgroup pursues one frame, with its projections in registers: four atoms a unit for 1024 atoms. As on the CPU the chosen
//! columns of the Gram matrix are orthogonalised as they come (a pivoted partial Cholesky factorisation), so a step solves
//! no triangular system: it reads the rows so far once, 4 bytes an atom each, and writes one. The rows are in the device's memory, shared
//! memory holds three numbers a unit and one weight an atom chosen: 16 KB are enough for 2048 atoms, 32 KB for 4096, so there is
//! no second variant for many atoms. What does grow is the number of loop rounds, and `budget` splits a pursuit into as many
//! launches as it takes.
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
