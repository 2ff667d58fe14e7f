//! Fuzzes both packet decoders. They must not panic, and a decoded message must encode to the same
//! bytes.
#![no_main]

use libfuzzer_sys::fuzz_target;
use nirspi_wire::packet::MAX_DEVICE_PACKET;
use nirspi_wire::{Deframed, Deframer, DeviceMessage, Request, encode, open};

fuzz_target!(|bytes: &[u8]| {
    let mut deframer = Deframer::<MAX_DEVICE_PACKET>::new();
    let mut rest = bytes;
    while let Some(found) = deframer.next(&mut rest) {
        let Deframed::Packet(packet) = found else { continue };
        let (mut first, mut second) = (packet.to_vec(), packet.to_vec());
        let mut buffer = vec![0; MAX_DEVICE_PACKET + 1];
        if let Ok(message) = open::<DeviceMessage<'_>>(&mut first) {
            let mut again = encode(&message, &mut buffer).expect("it fitted").to_vec();
            again.pop();
            assert_eq!(open::<DeviceMessage<'_>>(&mut again), Ok(message));
        }
        if let Ok(request) = open::<Request<'_>>(&mut second) {
            let mut again = encode(&request, &mut buffer).expect("it fitted").to_vec();
            again.pop();
            assert_eq!(open::<Request<'_>>(&mut again), Ok(request));
        }
    }
});
