//! The simulated core of `nirspi-otg-core`, in front of the driver and of the memory that the driver lends.

pub use nirspi_otg_core::{Answer, ENDPOINTS, Speed};

use embassy_usb_synopsys_otg::simulated::{self, Core};
use nirspi_otg_core::Memory;
use std::ops::{Deref, DerefMut};
use std::vec::Vec;

/// Memory that the driver has lent to the core.
struct Lent;

impl Memory for Lent {
    fn fetch(&mut self, address: u32, bytes: usize) -> Option<Vec<u8>> {
        simulated::fetch(address, bytes)
    }

    fn store(&mut self, address: u32, bytes: &[u8]) -> bool {
        simulated::store(address, bytes)
    }
}

/// The core, as the driver's tests know it.
pub struct OtgCore(nirspi_otg_core::OtgCore);

impl Default for OtgCore {
    fn default() -> Self {
        Self(nirspi_otg_core::OtgCore::new(Lent))
    }
}

impl Deref for OtgCore {
    type Target = nirspi_otg_core::OtgCore;

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl DerefMut for OtgCore {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.0
    }
}

impl Core for OtgCore {
    fn read(&mut self, offset: usize) -> u32 {
        self.0.read(offset)
    }

    fn write(&mut self, offset: usize, value: u32) {
        self.0.write(offset, value);
    }
}
