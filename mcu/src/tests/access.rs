//! Which fault the host is told when an access to the FPGA fails.

use super::fake_fpga::FakeFpga;
use crate::{BusError, fpga};
use nirspi_wire::Fault;
use nirspi_wire::register::{DAMAGED, IDENTITY, Register};

/// The identity tells a builder what to look for: crossed wires, old gateware, noise, or nothing there.
#[test]
fn the_fault_of_a_failed_access_says_what_the_identity_shows() {
    let told = |error, fpga: FakeFpga| match fpga::failed(error, &mut { fpga }) {
        Fault::FpgaAbsent { identity } => identity,
        fault => panic!("{fault:?}"),
    };
    let well = FakeFpga::default;
    assert_eq!(told(BusError::Damaged, well()), DAMAGED);
    let mut crossed = well();
    crossed.identity = IDENTITY.rotate_left(1);
    assert_eq!(told(BusError::Damaged, crossed), IDENTITY.rotate_left(1));
    let mut old = well();
    old.registers.insert(Register::Version.address(), 0x0000_0100);
    assert_eq!(told(BusError::Damaged, old), IDENTITY);
    assert_eq!(told(BusError::Transfer, well()), 0);
}
