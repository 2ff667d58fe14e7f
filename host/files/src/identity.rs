//! The identity of a camera: who it is, and what it can do.

use crate::causes::printable;
use nirspi_wire::register::Register;
use nirspi_wire::{ADC_BITS, ADC_HZ, Capabilities, Identity, Version, WAVELENGTH_NM, version};
use serde::{Deserialize, Serialize};

/// The identity of a camera: the wire's [`Identity`], owned.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct CameraIdentity {
    /// The camera's protocol version.
    pub protocol: u16,
    /// Firmware version.
    pub firmware: String,
    /// Gateware version.
    pub gateware: String,
    /// Board name.
    pub board: String,
    /// Serial number.
    pub serial: String,
    /// Rate of the ADC.
    pub adc_hz: u32,
    /// Resolution of the ADC.
    pub adc_bits: u8,
    /// Wavelength of the LEDs.
    pub wavelength_nm: u16,
    /// The capabilities of the camera in words; empty for a camera of protocol version 1, which
    /// does not report capabilities.
    #[serde(default)]
    pub capabilities: Vec<String>,
}

impl CameraIdentity {
    /// What a board of this name says of itself with firmware and gateware of this program's version.
    #[must_use]
    pub fn current(board: &str, serial: &str) -> Self {
        Self {
            protocol: version::CURRENT,
            firmware: env!("CARGO_PKG_VERSION").to_owned(),
            gateware: Version::of_register(Register::Version.reset()).to_string(),
            board: board.to_owned(),
            serial: serial.to_owned(),
            adc_hz: ADC_HZ,
            adc_bits: ADC_BITS,
            wavelength_nm: WAVELENGTH_NM,
            capabilities: Vec::new(),
        }
    }
}

impl From<&Identity<'_>> for CameraIdentity {
    fn from(identity: &Identity<'_>) -> Self {
        Self {
            protocol: identity.protocol,
            firmware: identity.firmware.to_string(),
            gateware: identity.gateware.to_string(),
            board: printable(identity.board),
            serial: printable(identity.serial),
            adc_hz: identity.adc_hz,
            adc_bits: identity.adc_bits,
            wavelength_nm: identity.wavelength_nm,
            capabilities: in_words(identity.capabilities),
        }
    }
}

/// The name of each capability; the number of the bit for a capability that this program does not
/// know.
pub fn in_words(capabilities: Capabilities) -> Vec<String> {
    let bits = (0..u32::BITS).filter(|bit| capabilities.contains(Capabilities(1 << bit)));
    bits.map(|bit| {
        let known = Capabilities::NAMES.iter().find(|(known, _)| known.0 == 1 << bit);
        known.map_or_else(|| format!("capability {bit}"), |(_, name)| (*name).to_owned())
    })
    .collect()
}
