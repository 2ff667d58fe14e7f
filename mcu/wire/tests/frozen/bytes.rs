//! Messages, payloads and packets as hexadecimal text; what makes a payload a packet is written out here again.

use nirspi_wire::samples::{Width, Words};
use nirspi_wire::{Samples, encode, open};
use serde::{Deserialize, Serialize};

pub fn words(bytes: &'static [u8]) -> Words<'static> {
    Words::from_le_bytes(bytes).unwrap()
}

pub fn samples(width: Width, values: &[i64]) -> Samples<'static> {
    Samples::pack(values.iter().copied(), width, vec![0; 4 * values.len()].leak()).unwrap()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().join(" ")
}

pub fn unhex(text: &str) -> Vec<u8> {
    text.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

/// CRC-32 (ISO-HDLC), bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ ((crc & 1) * 0xEDB8_8320))
    })
}

/// The packet of a payload of less than 250 bytes: there COBS has one code a zero, the distance to the next.
pub fn packet(payload: &[u8]) -> Vec<u8> {
    let framed = [payload, &crc32(payload).to_le_bytes()].concat();
    let mut packet = Vec::new();
    for block in framed.split(|&byte| byte == 0) {
        packet.push(block.len() as u8 + 1);
        packet.extend(block);
    }
    packet.push(0);
    packet
}

/// Both directions: the message gives the packet, the packet gives the message.
pub fn holds<'p, T>(message: &T, packet: &'p mut [u8])
where
    T: Serialize + Deserialize<'p> + PartialEq + std::fmt::Debug,
{
    assert_eq!(hex(encode(message, &mut [0; 512]).unwrap()), hex(packet), "{message:?}");
    let (delimiter, encoded) = packet.split_last_mut().unwrap();
    assert_eq!(*delimiter, 0);
    assert_eq!(open::<T>(encoded).as_ref(), Ok(message));
}
