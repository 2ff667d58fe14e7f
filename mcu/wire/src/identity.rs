//! Reads an identity by the rules of its own version.

use crate::{Capabilities, Channel, Identity, Tail, Version};
use serde::Deserialize;

/// The bytes of an [`Identity`]. A tail that is newer than the version which the identity names is passed over: behind
/// the tails of version 2 stand bytes that version 2 does not know (`tests/frozen/v2.rs`:
/// `a_tail_of_a_later_version_is_passed_over`). A tail behind one that does not read is passed over too
/// (`tests::nothing_is_read_behind_a_tail_that_does_not_read`).
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
            detectors: Tail(
                detectors.0.filter(|_| protocol >= Channel::SINCE && capabilities.0.is_some()),
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Found by `tests/fuzz`: the number of detectors came from the middle of another number.
    #[test]
    fn nothing_is_read_behind_a_tail_that_does_not_read() {
        let fields = [3, 0, 0, 0, 0, 0, 0, 0, 0, 32, 0, 14, 0];
        let read = |tails: &[u8]| {
            let bytes: std::vec::Vec<u8> = fields.iter().chain(tails).copied().collect();
            let identity: Identity<'_> = crate::packet::parse(&bytes).unwrap();
            (identity.capabilities.0, identity.detectors.0)
        };
        assert_eq!(read(&[0x0C, 3]), (Some(Capabilities(12)), Some(3)));
        // A number of more than 32 bits.
        assert_eq!(read(&[0x83; 6]), (None, None));
    }
}
