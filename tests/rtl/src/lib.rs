//! The simulated RTL of the gateware as a part of the camera, in the place where other tests have its golden model.
#![expect(clippy::unwrap_used, reason = "a failed unwrap here fails the test that uses it")]

mod board;
mod fpga;

pub use fpga::RtlFpga;
