//! The FPGA's host port on OCTOSPI1, and its two ready lines.
//!
//! One line carries the opcode and four lines the rest, with eight dummy cycles before data that is
//! read: `nirspi_wire::host_port`. The peripheral makes its own clock and waits for no signal, so
//! an access always ends, whatever the FPGA does.

use crate::clocks::SYSTEM_HZ;
use crate::port::prescaler;
use embassy_futures::select::select;
use embassy_stm32::exti::ExtiInput;
use embassy_stm32::mode::Async;
use embassy_stm32::ospi::{
    AddressSize, Config, DummyCycles, FIFOThresholdLevel, MemorySize, MemoryType, Ospi, OspiError,
    OspiWidth, TransferConfig,
};
use embassy_stm32::pac::OCTOSPI1 as OSPI;
use embassy_stm32::pac::octospi::vals::SampleShift;
use embassy_stm32::peripherals::OCTOSPI1;
use nirspi_app::FpgaPort;
use nirspi_mcu::{BusError, HostPort};
use nirspi_wire::host_port::{QUAD, READ_PACKET, READ_REGISTER, SEALED_BYTES, WRITE_REGISTER};

/// Prescaler of everything but packets.
const SLOW: u8 = prescaler(SYSTEM_HZ, READ_REGISTER);
/// Prescaler of packets, which `sck` clocks through the FPGA.
const FAST: u8 = prescaler(SYSTEM_HZ, READ_PACKET);

/// Settings of the peripheral. Addresses and lengths must lie within the memory size given here.
pub fn config() -> Config {
    Config {
        memory_type: MemoryType::Standard,
        device_size: MemorySize::_1MiB,
        clock_prescaler: SLOW,
        // The DMA is asked when a word is there.
        fifo_threshold: FIFOThresholdLevel::_4Bytes,
        ..Config::default()
    }
}

fn access(opcode: u8, address: u16, dummy: DummyCycles) -> TransferConfig {
    TransferConfig {
        iwidth: OspiWidth::SING,
        instruction: Some((opcode | QUAD).into()),
        adwidth: OspiWidth::QUAD,
        address: Some(address.into()),
        adsize: AddressSize::_16Bit,
        dwidth: OspiWidth::QUAD,
        dummy,
        // The peripheral sends the opcode with every access.
        sioo: false,
        ..TransferConfig::default()
    }
}

/// Changes `sck` between two accesses. Lines that the FPGA changes with an edge of the faster clock are
/// sampled one and a half periods after that edge (docs/log/gateware.md, Packets clocked by sck). The
/// peripheral takes a new prescaler only when it is not busy, and is busy for a moment afterwards, for
/// which the next access waits.
fn set_prescaler(prescaler: u8) {
    while OSPI.sr().read().busy() {}
    let shift = if prescaler == FAST { SampleShift::HALF_CYCLE } else { SampleShift::NONE };
    OSPI.tcr().modify(|timing| timing.set_sshift(shift));
    OSPI.dcr2().modify(|clock| clock.set_prescaler(prescaler));
}

/// These bytes as words, if they are whole words at a multiple of four, as packets are.
fn words(bytes: &mut [u8]) -> Option<&mut [u32]> {
    #[expect(unsafe_code, reason = "bytes as words")]
    // SAFETY: every four bytes are a word.
    let ([], words, []) = (unsafe { bytes.align_to_mut() }) else { return None };
    Some(words)
}

fn failed(error: OspiError) -> BusError {
    defmt::warn!("fpga port: {}", error);
    BusError::Transfer
}

/// The port.
pub struct Fpga {
    pub ospi: Ospi<'static, OCTOSPI1, Async>,
    pub frame_ready: ExtiInput<'static, Async>,
    pub raw_ready: ExtiInput<'static, Async>,
    #[cfg(feature = "parallel")]
    pub parallel: crate::parallel::Parallel,
}

impl HostPort for Fpga {
    fn write(&mut self, address: u16, sealed: [u8; SEALED_BYTES]) -> Result<(), BusError> {
        let access = access(WRITE_REGISTER, address, DummyCycles::_0);
        self.ospi.blocking_write(&sealed, access).map_err(failed)
    }

    fn read(&mut self, address: u16) -> Result<[u8; SEALED_BYTES], BusError> {
        let mut sealed = [0; SEALED_BYTES];
        let access = access(READ_REGISTER, address, DummyCycles::_8);
        self.ospi.blocking_read(&mut sealed, access).map_err(failed)?;
        Ok(sealed)
    }

    fn frame_ready(&mut self) -> bool {
        self.frame_ready.is_high()
    }

    fn raw_ready(&mut self) -> bool {
        self.raw_ready.is_high()
    }

    #[cfg(feature = "parallel")]
    fn ring(&mut self) -> Option<&mut nirspi_mcu::Ring> {
        Some(self.parallel.ring())
    }

    #[cfg(feature = "parallel")]
    fn look(&mut self) {
        self.parallel.look();
    }
}

impl FpgaPort for Fpga {
    async fn read_bytes(&mut self, opcode: u8, into: &mut [u8]) -> Result<(), BusError> {
        set_prescaler(if opcode == READ_PACKET { FAST } else { SLOW });
        let access = access(opcode, 0, DummyCycles::_8);
        // A word a beat: at 53.3 MHz by four lines a byte comes every 6 clocks of the bus, and a beat takes 7 to 10 (an
        // estimate). Packets of 1024 patterns are whole words.
        let read = match words(into) {
            Some(words) => self.ospi.read(words, access).await,
            None => self.ospi.read(into, access).await,
        };
        set_prescaler(SLOW);
        read.map_err(failed)
    }

    async fn ready(&mut self) {
        select(self.frame_ready.wait_for_high(), self.raw_ready.wait_for_high()).await;
    }
}
