//! What this version makes of bytes that a later version adds.

use super::bytes::{packet, unhex};
use super::v1;
use nirspi_wire::packet::{parse, request_id, unseal};
use nirspi_wire::{DeviceMessage, Request, open};

#[test]
fn fields_of_a_later_version_are_passed_over() {
    for (message, payload) in v1::device_messages() {
        let mut longer = packet(&unhex(&format!("{payload} 2a 07 ff")));
        let encoded = longer.split_last_mut().unwrap().1;
        assert_eq!(open::<DeviceMessage<'_>>(encoded), Ok(message));
    }
}

#[test]
fn a_request_of_a_later_version_still_shows_its_number() {
    // Id 300, a command number that no version has yet, and what may follow.
    let mut unknown = packet(&unhex("ac 02 7f 01 02 03"));
    let encoded = unknown.split_last_mut().unwrap().1;
    let payload = unseal(encoded).unwrap();
    assert!(parse::<Request<'_>>(payload).is_err());
    assert_eq!(request_id(payload), Some(300));
}
