//! The FPGA's host port over a serial line: firmware on an emulated board accesses a simulated
//! FPGA.
//!
//! Each request is one access and has one reply. Requests and replies alternate. Numbers are
//! little-endian.
//!
//! | request | bytes | reply | bytes |
//! |---|---|---|---|
//! | opcode of [`host_port`](crate::host_port), or [`LOOK`] | 1 | [`Request::number`] again | 1 |
//! | [`Request::number`] | 1 | bits of [`Lines`] | 1 |
//! | address | 2 | temperature, hundredths of a degree Celsius | 2 |
//! | argument: value to write, or bytes to read | 4 | value or bytes that were read | [`Request::reply_data`] |
//! | level of the board's LED enable, 0 or 1 | 1 | | |
//! | CRC-32 of all before | 4 | CRC-32 of all before | 4 |
//!
//! # Invariant
//! An access takes effect once, if its request is whole. A request that is not whole gets no answer
//! (`tests::a_request_comes_back_and_no_damaged_one_does`).

use crate::crc32;
use crate::fpga::MAX_FRAME_BYTES;
use crate::host_port::{READ_FRAME, READ_PACKET, READ_RAW, READ_REGISTER, WRITE_REGISTER};

/// Opcode without an access: time passes, and the reply has the state of the lines.
pub const LOOK: u8 = 0x00;
/// Number of bytes of a request.
pub const REQUEST_BYTES: usize = 13;
/// Number of bytes of a reply before its data.
pub const REPLY_HEAD_BYTES: usize = 4;
/// Number of bytes of the checksum.
pub const CRC_BYTES: usize = 4;

/// One access.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Request {
    /// The opcode.
    pub opcode: u8,
    /// Number chosen by the firmware. The reply repeats the number, so that a late reply is
    /// recognised.
    pub number: u8,
    /// Address of the register; 0 for frames and bursts.
    pub address: u16,
    /// Value to write, or bytes of a frame or burst to read.
    pub argument: u32,
    /// Level of the board's own LED enable.
    pub board_enable: bool,
}

impl Request {
    /// The request's bytes on the line.
    #[must_use]
    pub fn to_bytes(self) -> [u8; REQUEST_BYTES] {
        let [a0, a1] = self.address.to_le_bytes();
        let [v0, v1, v2, v3] = self.argument.to_le_bytes();
        let pin = u8::from(self.board_enable);
        let head = [self.opcode, self.number, a0, a1, v0, v1, v2, v3, pin];
        let [c0, c1, c2, c3] = crc32(&head).to_le_bytes();
        [self.opcode, self.number, a0, a1, v0, v1, v2, v3, pin, c0, c1, c2, c3]
    }

    /// The request; `None` if the bytes are not a request, or ask for more than the longest frame.
    #[must_use]
    pub fn from_bytes(bytes: &[u8; REQUEST_BYTES]) -> Option<Self> {
        let (head, crc) = bytes.split_last_chunk::<CRC_BYTES>()?;
        let known = matches!(
            head.first()?,
            &LOOK | &WRITE_REGISTER | &READ_REGISTER | &READ_FRAME | &READ_PACKET | &READ_RAW
        );
        if !known || crc32(head) != u32::from_le_bytes(*crc) {
            return None;
        }
        let &[opcode, number, a0, a1, v0, v1, v2, v3, pin, ..] = bytes;
        let (address, argument) =
            (u16::from_le_bytes([a0, a1]), u32::from_le_bytes([v0, v1, v2, v3]));
        // No frame or burst is longer, and the reply has as many bytes as were asked for.
        let request = Self { opcode, number, address, argument, board_enable: pin == 1 };
        (pin <= 1 && request.reply_data() <= MAX_FRAME_BYTES).then_some(request)
    }

    /// Number of data bytes in the reply.
    #[must_use]
    pub const fn reply_data(self) -> usize {
        match self.opcode {
            READ_REGISTER => 4,
            READ_FRAME | READ_PACKET | READ_RAW => self.argument as usize,
            _ => 0,
        }
    }
}

/// The state of the microcontroller's other pins: lines of the FPGA, and the simulated sensors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Lines {
    /// The FPGA's line of the same name.
    pub frame_ready: bool,
    /// The FPGA's line of the same name.
    pub raw_ready: bool,
    /// The enclosure's interlock.
    pub interlock_closed: bool,
    /// LED array, hundredths of a degree Celsius; `None` if the sensor does not answer.
    pub temperature_centi_celsius: Option<i16>,
}

const FRAME_READY: u8 = 1 << 0;
const RAW_READY: u8 = 1 << 1;
const INTERLOCK_CLOSED: u8 = 1 << 2;
const TEMPERATURE: u8 = 1 << 3;

impl Lines {
    /// The beginning of the reply to request `number`.
    #[must_use]
    pub fn to_reply_head(self, number: u8) -> [u8; REPLY_HEAD_BYTES] {
        let bit = |is_set: bool, bit: u8| if is_set { bit } else { 0 };
        let bits = bit(self.frame_ready, FRAME_READY)
            | bit(self.raw_ready, RAW_READY)
            | bit(self.interlock_closed, INTERLOCK_CLOSED)
            | bit(self.temperature_centi_celsius.is_some(), TEMPERATURE);
        let [t0, t1] = self.temperature_centi_celsius.unwrap_or(0).to_le_bytes();
        [number, bits, t0, t1]
    }

    /// Number of the request, and the lines.
    #[must_use]
    pub fn from_reply_head(head: [u8; REPLY_HEAD_BYTES]) -> (u8, Self) {
        let [number, bits, t0, t1] = head;
        let temperature = i16::from_le_bytes([t0, t1]);
        let lines = Self {
            frame_ready: bits & FRAME_READY != 0,
            raw_ready: bits & RAW_READY != 0,
            interlock_closed: bits & INTERLOCK_CLOSED != 0,
            temperature_centi_celsius: (bits & TEMPERATURE != 0).then_some(temperature),
        };
        (number, lines)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_request_comes_back_and_no_damaged_one_does(
            number: u8, address: u16, argument: u32, board_enable: bool,
            opcode in prop::sample::select(&[LOOK, WRITE_REGISTER, READ_REGISTER, READ_FRAME, READ_PACKET, READ_RAW][..]),
            at in 0..REQUEST_BYTES, flip in 1u8..,
        ) {
            let request = Request { opcode, number, address, argument, board_enable };
            let mut bytes = request.to_bytes();
            let fits = request.reply_data() <= MAX_FRAME_BYTES;
            prop_assert_eq!(Request::from_bytes(&bytes), fits.then_some(request));
            bytes[at] ^= flip;
            prop_assert_eq!(Request::from_bytes(&bytes), None);
        }

        #[test]
        fn lines_come_back(
            number: u8,
            (frame_ready, raw_ready, interlock_closed) in any::<(bool, bool, bool)>(),
            temperature_centi_celsius: Option<i16>,
        ) {
            let lines = Lines { frame_ready, raw_ready, interlock_closed, temperature_centi_celsius };
            prop_assert_eq!(Lines::from_reply_head(lines.to_reply_head(number)), (number, lines));
        }
    }

    #[test]
    fn a_request_for_more_than_a_frame_is_refused() {
        let ask = |argument| {
            let request = Request {
                opcode: READ_FRAME,
                number: 1,
                address: 0,
                argument,
                board_enable: false,
            };
            Request::from_bytes(&request.to_bytes())
        };
        assert!(ask(MAX_FRAME_BYTES as u32).is_some());
        assert_eq!(ask(MAX_FRAME_BYTES as u32 + 1), None);
        assert_eq!(ask(u32::MAX), None);
    }

    #[test]
    fn a_reply_has_a_registers_bytes_or_as_many_as_were_asked_for() {
        let reply = |opcode| {
            let (number, address, argument) = (1, 2, 30);
            Request { opcode, number, address, argument, board_enable: true }.reply_data()
        };
        let opcodes = [LOOK, WRITE_REGISTER, READ_REGISTER, READ_FRAME, READ_PACKET, READ_RAW];
        assert_eq!(opcodes.map(reply), [0, 0, 4, 30, 30, 30]);
    }

    #[test]
    fn a_zeroed_line_is_no_request() {
        assert_eq!(Request::from_bytes(&[0; REQUEST_BYTES]), None);
    }
}
