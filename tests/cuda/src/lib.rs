//! A CUDA driver for machines without a GPU.
//!
//! Built as `libcuda.so`, it stands where NVIDIA's driver would be. A program then goes its whole
//! way through CUDA: CubeCL makes the source of a kernel, NVRTC compiles it to PTX, and this library
//! runs the PTX on the processor, instruction by instruction. So tests see what the tensor cores'
//! instructions do to a matrix. They do not see how long anything takes.
//!
//! The "device" claims to be an H100 (compute capability 9.0). Device memory is the host's memory,
//! and every call has finished when it returns.
//!
//! `NIRSPI_CUDA_DUMP=FOLDER` writes the PTX of each kernel there.
//!
//! # Modules
//!
//! | module | contents |
//! |---|---|
//! | `driver` | the functions of the driver that CubeCL calls |
//! | [`ptx`] | reads PTX |
//! | [`run`] | runs it |

mod driver;
pub mod ptx;
pub mod run;
