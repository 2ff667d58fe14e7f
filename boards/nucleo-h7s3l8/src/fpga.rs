//! The FPGA's host port on XSPI1, and its two ready lines.
//!
//! One line carries the opcode and four lines the rest, with eight dummy cycles before data that is
//! read: `nirspi_wire::host_port`. The peripheral makes its own clock and waits for no signal, so
//! an access always ends, whatever the FPGA does.

use crate::clocks::BUS_HZ;
use embassy_futures::select::select;
use embassy_stm32::exti::ExtiInput;
use embassy_stm32::mode::Async;
use embassy_stm32::pac::XSPI1 as XSPI;
use embassy_stm32::peripherals::XSPI1;
use embassy_stm32::xspi::{
    AddressSize, Config, DummyCycles, MemorySize, MemoryType, TransferConfig, Xspi, XspiError,
    XspiWidth,
};
use nirspi_app::FpgaPort;
use nirspi_mcu::{BusError, HostPort};
use nirspi_nucleo::port::prescaler;
use nirspi_wire::host_port::{QUAD, READ_PACKET, READ_REGISTER, SEALED_BYTES, WRITE_REGISTER};

/// Prescaler of everything but packets.
const SLOW: u8 = prescaler(BUS_HZ, READ_REGISTER);
/// Prescaler of packets, which `sck` clocks through the FPGA.
const FAST: u8 = prescaler(BUS_HZ, READ_PACKET);

/// Settings of the peripheral. Addresses and lengths must lie within the memory size given here.
pub fn config() -> Config {
    Config {
        memory_type: MemoryType::Standard,
        device_size: MemorySize::_1MiB,
        clock_prescaler: SLOW,
        ..Config::default()
    }
}

fn access(opcode: u8, address: u16, dummy: DummyCycles) -> TransferConfig {
    TransferConfig {
        iwidth: XspiWidth::SING,
        instruction: Some((opcode | QUAD).into()),
        adwidth: XspiWidth::QUAD,
        address: Some(address.into()),
        adsize: AddressSize::_16bit,
        dwidth: XspiWidth::QUAD,
        dummy,
        ..TransferConfig::default()
    }
}

/// Changes `sck` between two accesses. Lines that the FPGA changes with an edge of the faster clock are
/// sampled one and a half periods after that edge (docs/gateware.md, Packets clocked by sck). The
/// peripheral takes a new prescaler only when it is not busy, and is busy for a moment afterwards, for
/// which the next access waits.
fn set_prescaler(prescaler: u8) {
    while XSPI.sr().read().busy() {}
    XSPI.tcr().modify(|timing| timing.set_sshift(prescaler == FAST));
    XSPI.dcr2().modify(|clock| clock.set_prescaler(prescaler));
}

fn failed(error: XspiError) -> BusError {
    defmt::warn!("fpga port: {}", error);
    BusError::Transfer
}

/// The port.
pub struct Fpga {
    pub xspi: Xspi<'static, XSPI1, Async>,
    pub frame_ready: ExtiInput<'static, Async>,
    pub raw_ready: ExtiInput<'static, Async>,
}

impl HostPort for Fpga {
    fn write(&mut self, address: u16, sealed: [u8; SEALED_BYTES]) -> Result<(), BusError> {
        let access = access(WRITE_REGISTER, address, DummyCycles::_0);
        self.xspi.blocking_write(&sealed, access).map_err(failed)
    }

    fn read(&mut self, address: u16) -> Result<[u8; SEALED_BYTES], BusError> {
        let mut sealed = [0; SEALED_BYTES];
        let access = access(READ_REGISTER, address, DummyCycles::_8);
        self.xspi.blocking_read(&mut sealed, access).map_err(failed)?;
        Ok(sealed)
    }

    fn frame_ready(&mut self) -> bool {
        self.frame_ready.is_high()
    }

    fn raw_ready(&mut self) -> bool {
        self.raw_ready.is_high()
    }
}

impl FpgaPort for Fpga {
    async fn read_bytes(&mut self, opcode: u8, into: &mut [u8]) -> Result<(), BusError> {
        set_prescaler(if opcode == READ_PACKET { FAST } else { SLOW });
        let read = self.xspi.read(into, access(opcode, 0, DummyCycles::_8)).await;
        set_prescaler(SLOW);
        read.map_err(failed)
    }

    async fn ready(&mut self) {
        select(self.frame_ready.wait_for_high(), self.raw_ready.wait_for_high()).await;
    }
}
