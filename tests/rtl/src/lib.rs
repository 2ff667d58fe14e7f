//! The simulated RTL of the gateware as a part of the camera. Other tests use the golden model in
//! its place.
#![expect(clippy::unwrap_used, reason = "a failed unwrap here fails the test that uses it")]

mod board;
mod fpga;
mod port;
mod receiver;

pub use fpga::RtlFpga;
pub use port::RtlPort;
