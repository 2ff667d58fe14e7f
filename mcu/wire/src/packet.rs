//! Encodes messages as bytes on a link, in the same way on USB bulk, UART and TCP.
//!
//! `packet = COBS( postcard(message) ++ CRC-32 little-endian ) ++ 0x00`
//!
//! Empty packets are allowed and have no meaning. A sender may start with a zero, which ends what
//! an earlier session left half sent.
//!
//! # Invariant
//! A receiver that joins anywhere, or receives damaged bytes, is in step again after the next zero
//! byte (`a_stream_with_a_gap_is_in_step_after_the_next_delimiter` in `tests/packets.rs`). Damaged
//! bytes never become a message (`a_damaged_byte_never_becomes_another_message`).

use crate::stuffing::{Stuffer, unstuff};
use crate::{Crc32, crc32};
use postcard::ser_flavors::Flavor;
use serde::{Deserialize, Serialize};

/// The most bytes that CRC, COBS and the delimiter add to `payload` bytes of postcard.
#[must_use]
pub const fn overhead(payload: usize) -> usize {
    let framed = payload + 4;
    4 + framed / 254 + 1 + 1
}

/// Largest packet that a device sends: a frame of all patterns, with room for its header.
pub const MAX_DEVICE_PACKET: usize = {
    let payload = 4 * crate::PATTERNS as usize + 64;
    payload + overhead(payload)
};

/// Largest packet that a host sends: a configuration with its own order table.
pub const MAX_HOST_PACKET: usize = {
    let payload = 2 * crate::PATTERNS as usize + 64;
    payload + overhead(payload)
};

/// Why bytes are not a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PacketError {
    /// The caller's buffer is too small for the message.
    BufferTooSmall,
    /// No delimiter arrived within the length of the longest packet.
    TooLong,
    /// The COBS code points outside the packet.
    Cobs,
    /// The checksum does not match: bytes were damaged.
    Crc,
    /// The checksum is right, but the message is unknown: the sender speaks a newer version.
    Message,
}

impl core::fmt::Display for PacketError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::BufferTooSmall => "the buffer is too small for the message",
            Self::TooLong => "no delimiter within the longest packet",
            Self::Cobs => "broken COBS code",
            Self::Crc => "wrong CRC-32",
            Self::Message => "an intact message that this protocol version does not know",
        })
    }
}

impl core::error::Error for PacketError {}

/// Computes the checksum of postcard's output, and writes the output COBS-encoded into the caller's
/// buffer.
struct PacketWriter<'b> {
    cobs: Stuffer<'b>,
    crc: Crc32,
}

impl Flavor for PacketWriter<'_> {
    type Output = usize;

    fn try_extend(&mut self, data: &[u8]) -> postcard::Result<()> {
        self.crc.update(data);
        self.cobs.push(data).map_err(|_| postcard::Error::SerializeBufferFull)
    }

    fn try_push(&mut self, data: u8) -> postcard::Result<()> {
        self.try_extend(&[data])
    }

    fn finalize(mut self) -> postcard::Result<usize> {
        let crc = self.crc.value().to_le_bytes();
        self.cobs.push(&crc).map_err(|_| postcard::Error::SerializeBufferFull)?;
        self.cobs.finish().map_err(|_| postcard::Error::SerializeBufferFull)
    }
}

/// Encodes `message` into `out`; returns the packet, delimiter included.
///
/// # Errors
/// [`PacketError::BufferTooSmall`].
pub fn encode<'b, T: Serialize>(message: &T, out: &'b mut [u8]) -> Result<&'b [u8], PacketError> {
    write(out, |writer| postcard::serialize_with_flavor(message, writer))
}

/// Makes a packet of the bytes of a message; returns the packet, delimiter included.
///
/// # Errors
/// [`PacketError::BufferTooSmall`].
pub fn seal<'b>(payload: &[u8], out: &'b mut [u8]) -> Result<&'b [u8], PacketError> {
    write(out, |mut writer| {
        writer.try_extend(payload)?;
        writer.finalize()
    })
}

/// `fill` gives the length of the packet without its delimiter.
fn write(
    out: &mut [u8],
    fill: impl FnOnce(PacketWriter<'_>) -> postcard::Result<usize>,
) -> Result<&[u8], PacketError> {
    if out.is_empty() {
        return Err(PacketError::BufferTooSmall);
    }
    let writer = PacketWriter { cobs: Stuffer::new(out), crc: Crc32::new() };
    let length = fill(writer).map_err(|_| PacketError::BufferTooSmall)?;
    *out.get_mut(length).ok_or(PacketError::BufferTooSmall)? = 0;
    Ok(&out[..=length])
}

/// Opens one packet, without its delimiter, in place; the message borrows from it.
///
/// # Errors
/// [`PacketError::Cobs`], [`Crc`](PacketError::Crc), [`Message`](PacketError::Message).
pub fn open<'p, T: Deserialize<'p>>(packet: &'p mut [u8]) -> Result<T, PacketError> {
    parse(unseal(packet)?)
}

/// Removes COBS and CRC from one packet, in place. Returns the bytes of its message.
///
/// # Errors
/// [`PacketError::Cobs`], [`Crc`](PacketError::Crc).
pub fn unseal(packet: &mut [u8]) -> Result<&[u8], PacketError> {
    let length = unstuff(packet).ok_or(PacketError::Cobs)?;
    let framed = packet.get(..length).ok_or(PacketError::Cobs)?;
    let (payload, crc) = framed.split_last_chunk::<4>().ok_or(PacketError::Crc)?;
    if crc32(payload) == u32::from_le_bytes(*crc) { Ok(payload) } else { Err(PacketError::Crc) }
}

/// Reads the bytes of a message. Bytes after the message are the tail of a newer version, and are
/// ignored.
///
/// # Errors
/// [`PacketError::Message`].
pub fn parse<'p, T: Deserialize<'p>>(payload: &'p [u8]) -> Result<T, PacketError> {
    match postcard::take_from_bytes(payload) {
        Ok((message, _tail)) => Ok(message),
        Err(_) => Err(PacketError::Message),
    }
}

/// The number of a request whose command is unknown, from the bytes of the message.
#[must_use]
pub fn request_id(payload: &[u8]) -> Option<u16> {
    postcard::take_from_bytes(payload).ok().map(|(id, _)| id)
}

/// The parts of an answer to `Hello` that are the same in every version: the request's number and
/// the device's protocol version. For a message that [`parse`] does not know.
#[must_use]
pub fn hello_of_any_version(payload: &[u8]) -> Option<(u16, u16)> {
    // DeviceMessage::Reply, its id, Ok, Answer::Hello, and the first field of Identity.
    match postcard::take_from_bytes::<(u8, u16, u8, u8, u16)>(payload) {
        Ok(((0, id, 0, 0, protocol), _)) => Some((id, protocol)),
        _ => None,
    }
}

/// Splits a byte stream into packets. `N` is the length of the longest packet without its
/// delimiter.
#[derive(Debug, Clone)]
pub struct Deframer<const N: usize> {
    bytes: [u8; N],
    length: usize,
    /// Whether the packet is longer than the buffer, so that its bytes are skipped up to the
    /// delimiter.
    skipping: bool,
}

/// What a [`Deframer`] found.
#[derive(Debug, PartialEq, Eq)]
pub enum Deframed<'d> {
    /// The bytes between two delimiters, still encoded.
    Packet(&'d mut [u8]),
    /// More bytes without a delimiter than any packet has. The bytes are lost.
    TooLong,
}

impl<const N: usize> Default for Deframer<N> {
    fn default() -> Self {
        Self { bytes: [0; N], length: 0, skipping: false }
    }
}

impl<const N: usize> Deframer<N> {
    /// A deframer without any bytes.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes bytes from the front of `input` up to and including the next delimiter. `None` means
    /// that all bytes were taken and no packet is complete.
    pub fn next<'d>(&'d mut self, input: &mut &[u8]) -> Option<Deframed<'d>> {
        while !input.is_empty() {
            let end = input.iter().position(|&byte| byte == 0);
            let taken = end.unwrap_or(input.len());
            let (part, rest) = input.split_at(taken);
            *input = rest.get(usize::from(end.is_some())..).unwrap_or(&[]);
            match self.bytes.get_mut(self.length..self.length + part.len()) {
                Some(room) if !self.skipping => {
                    room.copy_from_slice(part);
                    self.length += part.len();
                }
                _ => self.skipping = true,
            }
            if end.is_some() {
                let length = core::mem::take(&mut self.length);
                if core::mem::take(&mut self.skipping) {
                    return Some(Deframed::TooLong);
                }
                if length > 0 {
                    return self.bytes.get_mut(..length).map(Deframed::Packet);
                }
            }
        }
        None
    }

    /// Number of bytes of a packet without its delimiter so far. If the link ends now, it ends in
    /// mid-packet.
    #[must_use]
    pub fn pending(&self) -> usize {
        if self.skipping { N } else { self.length }
    }
}
