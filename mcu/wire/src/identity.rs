//! Reads an identity by the rules of its own version.

use crate::{Capabilities, Channel, Identity, Tail, Version};
use serde::Deserialize;

/// The bytes of an [`Identity`]. A tail that is newer than the version which the identity names is passed over: behind
/// the tails of version 2 stand bytes that version 2 does not know (`tests/frozen/v2.rs`:
/// `a_tail_of_a_later_version_is_passed_over`).
#[derive(Deserialize)]
pub(crate) struct Received<'a> {
    protocol: u16,
    firmware: Version,
    gateware: Version,
    board: &'a str,
    serial: &'a str,
    side: u8,
    adc_hz: u32,
    adc_bits: u8,
    wavelength_nm: u16,
    capabilities: Tail<Capabilities>,
    detectors: Tail<u8>,
}

impl<'a> From<Received<'a>> for Identity<'a> {
    fn from(received: Received<'a>) -> Self {
        let Received { protocol, firmware, gateware, board, serial, side, .. } = received;
        let Received { adc_hz, adc_bits, wavelength_nm, capabilities, detectors, .. } = received;
        Self {
            protocol,
            firmware,
            gateware,
            board,
            serial,
            side,
            adc_hz,
            adc_bits,
            wavelength_nm,
            capabilities,
            detectors: Tail(detectors.0.filter(|_| protocol >= Channel::SINCE)),
        }
    }
}
