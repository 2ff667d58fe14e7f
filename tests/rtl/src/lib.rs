//! The simulated RTL of the gateware as a part of the camera, in the place where other tests have its golden model.

mod board;
mod fpga;

pub use fpga::RtlFpga;
