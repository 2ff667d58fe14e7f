//! A frame from the FPGA's host port: header, two 48-bit sums for each pattern, CRC-32.
//!
//! All little-endian:
//!
//! | offset | bytes | field |
//! |---|---|---|
//! | 0 | 4 | [`MAGIC`] |
//! | 4 | 2 | patterns, M |
//! | 6 | 2 | [`FrameFlags`] |
//! | 8 | 4 | sequence |
//! | 12 | 4 | sweeps |
//! | 16 | 4 | over-range samples |
//! | 20 | 4 | frames lost in this run so far |
//! | 24 | 8 | clock of the first slot, since reset |
//! | 32 | 12 M | for each pattern in the order shown: positive sum, negative sum, 6 bytes each |
//! | 32 + 12 M | 4 | CRC-32 of all before |
//!
//! Sums wrap at 2^48 and set [`FrameFlags::OVERFLOW`]. Without complements the negative sums are 0.

use crate::{FrameFlags, PATTERNS, crc32};

/// `"NSPF"` in ASCII, in the order of memory.
pub const MAGIC: [u8; 4] = *b"NSPF";
/// Bytes before the sums.
pub const HEADER_BYTES: usize = 32;
/// Bytes of the two sums of a pattern.
pub const PATTERN_BYTES: usize = 12;
/// Bytes of the checksum.
pub const CRC_BYTES: usize = 4;
/// The modulus of a sum.
pub const SUM_MODULUS: u64 = 1 << 48;
/// Number of bytes of the longest frame.
pub const MAX_FRAME_BYTES: usize = frame_bytes(PATTERNS);

/// Number of bytes of a frame of this many patterns.
#[must_use]
pub const fn frame_bytes(patterns: u16) -> usize {
    HEADER_BYTES + PATTERN_BYTES * patterns as usize + CRC_BYTES
}

/// The fields before the sums.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// Patterns of the sweep.
    pub patterns: u16,
    /// What happened to the frame.
    pub flags: FrameFlags,
    /// Number of the frame in its run, from 0, lost frames included.
    pub sequence: u32,
    /// Sweeps summed.
    pub sweeps: u32,
    /// Samples outside the ADC's range while the frame was made.
    pub over_range: u32,
    /// Frames lost in this run so far.
    pub lost: u32,
    /// Clock of the first slot, since reset.
    pub clock: u64,
}

impl Header {
    /// The header's bytes in the frame.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; HEADER_BYTES] {
        let mut bytes = [0; HEADER_BYTES];
        bytes[0..4].copy_from_slice(&MAGIC);
        bytes[4..6].copy_from_slice(&self.patterns.to_le_bytes());
        bytes[6..8].copy_from_slice(&self.flags.0.to_le_bytes());
        bytes[8..12].copy_from_slice(&self.sequence.to_le_bytes());
        bytes[12..16].copy_from_slice(&self.sweeps.to_le_bytes());
        bytes[16..20].copy_from_slice(&self.over_range.to_le_bytes());
        bytes[20..24].copy_from_slice(&self.lost.to_le_bytes());
        bytes[24..32].copy_from_slice(&self.clock.to_le_bytes());
        bytes
    }

    fn from_bytes(bytes: &[u8; HEADER_BYTES]) -> Option<Self> {
        let (magic, rest) = bytes.split_first_chunk::<4>()?;
        if *magic != MAGIC {
            return None;
        }
        let (patterns, rest) = rest.split_first_chunk()?;
        let (flags, rest) = rest.split_first_chunk()?;
        let (sequence, rest) = rest.split_first_chunk()?;
        let (sweeps, rest) = rest.split_first_chunk()?;
        let (over_range, rest) = rest.split_first_chunk()?;
        let (lost, rest) = rest.split_first_chunk()?;
        let (clock, _) = rest.split_first_chunk()?;
        Some(Self {
            patterns: u16::from_le_bytes(*patterns),
            flags: FrameFlags(u16::from_le_bytes(*flags)),
            sequence: u32::from_le_bytes(*sequence),
            sweeps: u32::from_le_bytes(*sweeps),
            over_range: u32::from_le_bytes(*over_range),
            lost: u32::from_le_bytes(*lost),
            clock: u64::from_le_bytes(*clock),
        })
    }
}

/// Why bytes are not a frame of the FPGA.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameError {
    /// The length is not that of the header's patterns.
    Length,
    /// The bytes do not begin with [`MAGIC`].
    Magic,
    /// The checksum does not match.
    Crc,
}

/// The two sums of a pattern, in ADC counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Sums {
    /// Samples while the pattern was shown.
    pub positive: u64,
    /// Samples while its complement was shown.
    pub negative: u64,
}

impl Sums {
    /// The sums' bytes in the frame.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; PATTERN_BYTES] {
        let mut bytes = [0; PATTERN_BYTES];
        bytes[..6].copy_from_slice(&self.positive.to_le_bytes()[..6]);
        bytes[6..].copy_from_slice(&self.negative.to_le_bytes()[..6]);
        bytes
    }

    /// The pattern's integrated sample.
    #[must_use]
    pub fn difference(&self) -> i64 {
        self.positive as i64 - self.negative as i64
    }
}

/// Reads a sum with two loads. Reading bytes one at a time took a third of the firmware's work for
/// a frame.
fn sum48(&[b0, b1, b2, b3, b4, b5]: &[u8; 6]) -> u64 {
    let (low, high) = (u32::from_le_bytes([b0, b1, b2, b3]), u16::from_le_bytes([b4, b5]));
    u64::from(high) << 32 | u64::from(low)
}

/// A frame whose length, magic and checksum are right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FpgaFrame<'a> {
    /// The fields before the sums.
    pub header: Header,
    sums: &'a [u8],
}

impl<'a> FpgaFrame<'a> {
    /// Checks a whole frame.
    ///
    /// # Errors
    /// [`FrameError`] says which check failed.
    pub fn parse(bytes: &'a [u8]) -> Result<Self, FrameError> {
        let (head, _) = bytes.split_first_chunk().ok_or(FrameError::Length)?;
        let header = Header::from_bytes(head).ok_or(FrameError::Magic)?;
        if bytes.len() != frame_bytes(header.patterns) {
            return Err(FrameError::Length);
        }
        let (covered, crc) = bytes.split_last_chunk::<CRC_BYTES>().ok_or(FrameError::Length)?;
        if crc32(covered) != u32::from_le_bytes(*crc) {
            return Err(FrameError::Crc);
        }
        Ok(Self { header, sums: covered.get(HEADER_BYTES..).ok_or(FrameError::Length)? })
    }

    /// The header alone, of which only the magic is checked.
    #[must_use]
    pub fn parse_header(bytes: &[u8]) -> Option<Header> {
        bytes.first_chunk().and_then(Header::from_bytes)
    }

    /// The sums of each pattern, in the order shown.
    pub fn sums(&self) -> impl ExactSizeIterator<Item = Sums> + Clone + use<'a> {
        let (patterns, _) = self.sums.as_chunks::<PATTERN_BYTES>();
        patterns.iter().map(|bytes| {
            let (halves, _) = bytes.as_chunks();
            let half = |i: usize| halves.get(i).map_or(0, sum48);
            Sums { positive: half(0), negative: half(1) }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    proptest! {
        #[test]
        fn a_frame_comes_back_and_any_damage_is_seen(
            sums in prop::collection::vec((0..SUM_MODULUS, 0..SUM_MODULUS), 1..20),
            sequence: u32, clock: u64, flags: u16, at: prop::sample::Index, flip in 1u8..,
        ) {
            let header = Header {
                patterns: sums.len() as u16, flags: FrameFlags(flags), sequence,
                sweeps: 3, over_range: 4, lost: 5, clock,
            };
            let mut bytes: Vec<u8> = header.to_bytes().to_vec();
            let sums: Vec<Sums> =
                sums.iter().map(|&(positive, negative)| Sums { positive, negative }).collect();
            for sum in &sums {
                bytes.extend(sum.to_bytes());
            }
            bytes.extend(crc32(&bytes).to_le_bytes());

            let frame = FpgaFrame::parse(&bytes).unwrap();
            prop_assert_eq!(frame.header, header);
            prop_assert_eq!(frame.sums().collect::<Vec<_>>(), sums);

            let at = at.index(bytes.len());
            bytes[at] ^= flip;
            prop_assert!(FpgaFrame::parse(&bytes).is_err());
        }
    }

    #[test]
    fn a_frame_cut_short_is_refused() {
        assert_eq!(FpgaFrame::parse(&[]), Err(FrameError::Length));
        assert_eq!(FpgaFrame::parse(&[0; HEADER_BYTES]), Err(FrameError::Magic));
    }
}
