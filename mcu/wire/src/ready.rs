//! A frame that the FPGA has made into a packet, which the firmware forwards as it is.
//!
//! The packet is the one that [`encode`](crate::encode) makes of the same
//! [`Frame`](crate::Frame), but for the length of its numbers: postcard's variable-length integers
//! are padded with `0x80` to the longest form of their type, so every field has a fixed place.
//! Postcard takes the padded form like the short one
//! (`a_packet_with_padded_numbers_is_the_same_message` in `tests/packets.rs`).
//!
//! | bytes | field | form |
//! |---|---|---|
//! | 1 | 1: [`DeviceMessage::Frame`](crate::DeviceMessage::Frame) | byte |
//! | 3 | run | padded |
//! | 5 | sequence | padded |
//! | 10 | device time in us | padded |
//! | 5 | sweeps | padded |
//! | 3 | [`FrameFlags`] | padded |
//! | 1 | 0: 32 bits; [`NARROW`]: 24 bits | byte |
//! | 2 | 4 M or 3 M, for M patterns | padded |
//! | 4 M or 3 M | positive less negative sum of each pattern in the order shown | little-endian, signed |
//! | 4 | CRC-32 of all before | little-endian |
//!
//! The samples have 24 bits in a run with [`mode::NARROW`](crate::register::mode::NARROW).
//!
//! Then COBS and the delimiter, as in every packet.
//!
//! A read of the frame ([`READ_FRAME`](crate::host_port::READ_FRAME)) gives zeros until the packet begins, at most
//! [`LEAD_BYTES`] of them, then the packet without a gap, then zeros. A read that is clocked by `sck`
//! ([`READ_PACKET`](crate::host_port::READ_PACKET)) gives at most [`FAST_LEAD_BYTES`] zeros before the packet. On the
//! host's link zeros are empty packets, which every receiver skips.

use crate::packet::overhead;
use crate::samples::{NARROW, Width};
use crate::{CLOCKS_PER_PATTERN, Crc32, FrameFlags, PATTERNS};
use core::ops::{Range, RangeInclusive};

/// Bytes before the samples.
pub const HEADER_BYTES: usize = 30;

/// Most ADC samples in a sum with which no difference of two sums can leave 32 bits. A camera refuses a configuration
/// with more.
pub const MAX_SUMMED_SAMPLES: u32 = 1 << 17;

// One sweep at the fastest rate is far from it, and the largest sum is in range.
const _: () = assert!(MAX_SUMMED_SAMPLES > CLOCKS_PER_PATTERN as u32);
const _: () = assert!(MAX_SUMMED_SAMPLES as u64 * crate::ADC_MAX as u64 <= i32::MAX as u64);

/// Most ADC samples in a sum with which no difference of two sums can leave 24 bits.
pub const MAX_NARROW_SAMPLES: u32 = 512;

// The bound is exact: one sample more could leave 24 bits.
const _: () = assert!(MAX_NARROW_SAMPLES * (crate::ADC_MAX as u32) < 1 << 23);
const _: () = assert!((MAX_NARROW_SAMPLES + 1) * (crate::ADC_MAX as u32) >= 1 << 23);

/// Most zeros before a packet, at the fastest `sck` that the host port allows: the FPGA begins when it has so many bytes
/// of the packet that it never has to wait.
pub const LEAD_BYTES: usize = 64;

/// Most zeros before a packet that is read at [`PACKET_SCK_MAX_HZ`](crate::host_port::PACKET_SCK_MAX_HZ).
pub const FAST_LEAD_BYTES: usize = 160;

/// Bytes of the message of so many patterns.
const fn payload_bytes(patterns: u16, width: Width) -> usize {
    HEADER_BYTES + width.bytes() * patterns as usize
}

/// Most bytes of the packet of a frame of so many patterns.
#[must_use]
pub const fn packet_bytes(patterns: u16, width: Width) -> usize {
    let payload = payload_bytes(patterns, width);
    payload + overhead(payload)
}

/// The lengths that the packet of a frame of so many patterns can have, delimiter included.
#[must_use]
pub const fn packet_lengths(patterns: u16, width: Width) -> RangeInclusive<usize> {
    // COBS adds a byte at least, and one for each 254 at most; the CRC has four, the delimiter one.
    payload_bytes(patterns, width) + 6..=packet_bytes(patterns, width)
}

/// Bytes to read of a frame of so many patterns, with which the whole packet has come.
#[must_use]
pub const fn read_bytes(patterns: u16, width: Width) -> usize {
    LEAD_BYTES + packet_bytes(patterns, width)
}

/// The same for a read that is clocked by `sck`.
#[must_use]
pub const fn fast_read_bytes(patterns: u16, width: Width) -> usize {
    FAST_LEAD_BYTES + packet_bytes(patterns, width)
}

/// Bytes to read of the longest frame.
pub const MAX_READ_BYTES: usize = fast_read_bytes(PATTERNS, Width::Bits32);

/// Where the packet lies in the bytes of a read, delimiter included: without the zeros before and after. `None` if
/// the bytes hold no packet, or a packet that is longer or shorter than a frame of so many patterns.
///
/// Bytes inside the packet are not looked at. The receiver's CRC-32 finds damage there.
#[must_use]
pub fn packet_in(read: &[u8], patterns: u16, width: Width) -> Option<Range<usize>> {
    let is_byte = |byte: &u8| *byte != 0;
    let start = read.iter().position(is_byte)?;
    let end = read.iter().rposition(is_byte)? + 2;
    let fits = packet_lengths(patterns, width).contains(&(end - start));
    (fits && end <= read.len()).then_some(start..end)
}

/// Encoded bytes at the beginning of a packet that tell frames apart: run, sequence and device time.
pub const BEGINNING_BYTES: usize = 20;

/// Encoded bytes at the beginning of a packet that hold run and sequence.
pub const NUMBER_BYTES: usize = 10;

/// Number of the run, and number of the frame in the run, of a packet that begins with these bytes.
#[must_use]
pub fn numbers(beginning: &[u8; NUMBER_BYTES]) -> (u16, u32) {
    // Each code of COBS says where the next one is, and stands in the place of a zero.
    let mut bytes = *beginning;
    let mut code = usize::from(bytes[0]);
    while let Some(zero) = bytes.get_mut(code) {
        code += usize::from(core::mem::take(zero)).max(1);
    }
    let [_, _, r0, r1, r2, s0, s1, s2, s3, s4] = bytes.map(|byte| u32::from(byte & 0x7F));
    ((r2 << 14 | r1 << 7 | r0) as u16, s4 << 28 | s3 << 21 | s2 << 14 | s1 << 7 | s0)
}

/// Bytes of samples that [`Reader`] decodes at once: whole samples of either width.
const CHUNK_BYTES: usize = 192;

const _: () = assert!(CHUNK_BYTES.is_multiple_of(12));

/// The samples of a packet, one after the other, straight from its encoded bytes. They count only if the packet
/// [is intact](Self::is_intact), which shows after the last.
#[derive(Debug, Clone)]
pub struct Reader<'p> {
    bytes: Unstuffed<'p>,
    crc: Crc32,
    /// Samples that have not been read.
    left: u16,
    is_narrow: bool,
    /// Decoded bytes, and where the next sample begins in them.
    chunk: [u8; CHUNK_BYTES],
    at: usize,
    /// Number of the frame in its run.
    pub sequence: u32,
    /// What happened to the frame.
    pub flags: FrameFlags,
}

impl<'p> Reader<'p> {
    /// The reader of a packet of so many patterns.
    #[must_use]
    pub fn new(packet: &'p [u8], patterns: u16) -> Self {
        let mut bytes = Unstuffed { bytes: packet, left: 0, owes_zero: false };
        let head: [u8; HEADER_BYTES] = bytes.array();
        let mut crc = Crc32::new();
        crc.update(&head);
        let number = |bytes: &[u8]| {
            bytes.iter().rev().fold(0u32, |number, byte| number << 7 | u32::from(byte & 0x7F))
        };
        let flags = FrameFlags(number(&head[24..27]) as u16);
        Self {
            bytes,
            crc,
            left: patterns,
            is_narrow: head[27] == NARROW,
            chunk: [0; CHUNK_BYTES],
            at: CHUNK_BYTES,
            sequence: number(&head[4..9]),
            flags,
        }
    }

    /// The next sample; 0 after the last.
    pub fn sample(&mut self) -> i32 {
        if self.left == 0 {
            return 0;
        }
        if self.at >= CHUNK_BYTES {
            self.decode();
        }
        self.left -= 1;
        let bytes = self.chunk.get(self.at..).unwrap_or_default();
        if self.is_narrow {
            self.at += 3;
            // The upper bytes of a word, so that the shift brings the sign down.
            bytes
                .first_chunk()
                .map_or(0, |&[low, middle, high]| i32::from_le_bytes([0, low, middle, high]) >> 8)
        } else {
            self.at += 4;
            bytes.first_chunk().map_or(0, |word| i32::from_le_bytes(*word))
        }
    }

    /// Decodes the next bytes of samples.
    #[inline(never)]
    fn decode(&mut self) {
        let width = if self.is_narrow { 3 } else { 4 };
        let length = CHUNK_BYTES.min(width * usize::from(self.left));
        let bytes = self.chunk.get_mut(..length).unwrap_or_default();
        self.bytes.fill(bytes);
        self.crc.update(bytes);
        self.at = 0;
    }

    /// Whether all samples have been read and the packet ends with the CRC-32 of its bytes.
    #[must_use]
    pub fn is_intact(&mut self) -> bool {
        self.left == 0 && self.bytes.array() == self.crc.value().to_le_bytes()
    }
}

/// The bytes behind COBS. Beyond the end there are zeros.
#[derive(Debug, Clone)]
struct Unstuffed<'p> {
    bytes: &'p [u8],
    /// Bytes left of the open block.
    left: u8,
    /// The open block stands for a zero after it, if another block follows.
    owes_zero: bool,
}

impl Unstuffed<'_> {
    fn array<const N: usize>(&mut self) -> [u8; N] {
        let mut array = [0; N];
        self.fill(&mut array);
        array
    }

    /// Byte after byte, since dim light has many zeros and so blocks of few bytes. What changes with each byte is in
    /// registers.
    #[inline(never)]
    fn fill(&mut self, to: &mut [u8]) {
        let Self { mut bytes, mut left, mut owes_zero } = *self;
        for to in to {
            *to = loop {
                let Some((&byte, rest)) = bytes.split_first() else { break 0 };
                bytes = rest;
                if left > 0 {
                    left -= 1;
                    break byte;
                }
                left = byte.saturating_sub(1);
                if core::mem::replace(&mut owes_zero, byte < 0xFF) {
                    break 0;
                }
            };
        }
        *self = Self { bytes, left, owes_zero };
    }
}

/// The fields before the samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Head {
    /// Number of the run since power-up.
    pub run: u16,
    /// Number of the frame in its run.
    pub sequence: u32,
    /// Device time of the frame's first pattern.
    pub device_time_us: u64,
    /// Sweeps summed.
    pub sweeps: u32,
    /// What happened to the frame.
    pub flags: FrameFlags,
    /// Patterns of the sweep.
    pub patterns: u16,
    /// Bits of a sample.
    pub width: Width,
}

impl Head {
    /// The bytes before the samples.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; HEADER_BYTES] {
        let mut bytes = [0; HEADER_BYTES];
        bytes[0] = 1;
        pad(self.run.into(), &mut bytes[1..4]);
        pad(self.sequence.into(), &mut bytes[4..9]);
        pad(self.device_time_us, &mut bytes[9..19]);
        pad(self.sweeps.into(), &mut bytes[19..24]);
        pad(self.flags.0.into(), &mut bytes[24..27]);
        bytes[27] = self.width.form();
        pad(self.width.bytes() as u64 * u64::from(self.patterns), &mut bytes[28..30]);
        bytes
    }
}

/// Writes a number as a variable-length integer of exactly this length.
fn pad(value: u64, into: &mut [u8]) {
    let mut rest = value;
    for byte in into.iter_mut() {
        *byte = rest as u8 | 0x80;
        rest >>= 7;
    }
    if let Some(last) = into.last_mut() {
        *last &= 0x7F;
    }
}
