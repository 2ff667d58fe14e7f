//! Collects a bitstream in memory, and configures the FPGA when the bitstream is complete and
//! right.
//!
//! # Invariant
//! The FPGA keeps its gateware until a whole bitstream is there to replace it
//! (`tests::configuring::a_half_sent_bitstream_does_not_reach_the_chip`). An FPGA that already runs
//! the bitstream is left alone (`tests::configuring::a_staged_bitstream_goes_to_the_chip_once`).

use crate::ecp5::{Configuration, ConfigureError, IDCODE_LFE5UM5G_85F, SlaveSpi, must_load};
use crate::{GatewareLoader, LoadError, Micros};
use nirspi_wire::Crc32;

/// Loads gateware through memory as long as the longest bitstream.
#[derive(Debug)]
pub struct StagingLoader<'m, P> {
    port: P,
    memory: &'m mut [u8],
    filled: usize,
    crc: Crc32,
    /// CRC-32 of the bitstream that the FPGA runs, if this firmware knows.
    running: Option<u32>,
    under_way: Option<Configuration>,
    failure: Option<ConfigureError>,
}

impl<'m, P: SlaveSpi> StagingLoader<'m, P> {
    /// A loader for an FPGA that is known to run the bitstream with this CRC-32.
    #[must_use]
    pub fn new(port: P, memory: &'m mut [u8], running: Option<u32>) -> Self {
        let crc = Crc32::new();
        Self { port, memory, filled: 0, crc, running, under_way: None, failure: None }
    }

    /// CRC-32 of the bitstream that the FPGA runs, if this firmware knows.
    #[must_use]
    pub const fn running(&self) -> Option<u32> {
        self.running
    }

    /// Why the last bitstream was refused. The second call gives `None`.
    pub fn take_failure(&mut self) -> Option<ConfigureError> {
        self.failure.take()
    }
}

impl<P: SlaveSpi> GatewareLoader for StagingLoader<'_, P> {
    fn begin(&mut self, total: u32) -> Result<(), LoadError> {
        self.filled = 0;
        self.crc = Crc32::new();
        let fits = usize::try_from(total).is_ok_and(|total| total <= self.memory.len());
        if fits { Ok(()) } else { Err(LoadError::Unsupported) }
    }

    fn write(&mut self, data: &[u8]) -> Result<(), LoadError> {
        let end = self.filled.saturating_add(data.len());
        let room = self.memory.get_mut(self.filled..end).ok_or(LoadError::Unsupported)?;
        room.copy_from_slice(data);
        self.crc.update(data);
        self.filled = end;
        Ok(())
    }

    fn finish(&mut self) -> Result<(), LoadError> {
        if must_load(self.port.done(), self.running, self.crc.value()) {
            self.running = None;
            self.failure = None;
            self.under_way = Some(Configuration::new(IDCODE_LFE5UM5G_85F));
        }
        Ok(())
    }

    fn forget(&mut self) {
        self.running = None;
    }

    fn step(&mut self, now: Micros) -> bool {
        let Some(configuration) = &mut self.under_way else { return false };
        let bitstream = self.memory.get(..self.filled).unwrap_or(&[]);
        let Some(result) = configuration.poll(now, &mut self.port, bitstream) else { return true };
        match result {
            Ok(()) => self.running = Some(self.crc.value()),
            Err(failure) => self.failure = Some(failure),
        }
        self.under_way = None;
        false
    }
}

/// Bytes of 0xFF kept after the last other byte. A bitstream ends with bytes of 0xFF, whose clocks
/// the FPGA needs to wake up; erased flash memory has the same value.
const TRAILER_BYTES: usize = 32;

/// The bitstream at the beginning of a region of flash memory whose rest is erased; `None` if there
/// is none. A bitstream file begins with a comment (0xFF, 0x00) or with the preamble (0xFF, 0xFF,
/// 0xBD, 0xB3).
#[must_use]
pub fn stored(region: &[u8]) -> Option<&[u8]> {
    let begins = region.starts_with(&[0xFF, 0x00]) || region.starts_with(&[0xFF, 0xFF, 0xBD, 0xB3]);
    let end = region.iter().rposition(|&byte| byte != 0xFF)?.saturating_add(1 + TRAILER_BYTES);
    Some(region.get(..end).unwrap_or(region)).filter(|_| begins)
}
