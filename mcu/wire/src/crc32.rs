//! CRC-32 as in zlib, Ethernet and the STM32's CRC unit (ISO-HDLC): polynomial 0x04C1_1DB7
//! reflected, initial value and final XOR all ones. Packets and FPGA frames use the same CRC.
//!
//! The CRC processes several bytes in one step with as many tables ("slicing", Kounavis and Berry
//! 2005): table `k` holds the effect of a byte `k` bytes later. With one table, CRC took two thirds
//! of a frame's instructions.

/// The polynomial; bit 0 is its highest power.
const POLYNOMIAL: u32 = 0xEDB8_8320;

/// 16 KB of tables let the host process 24 414 frames a second.
#[cfg(not(target_os = "none"))]
static TABLES: Tables<16> = Tables::new();

/// A microcontroller can spare 4 KB.
#[cfg(target_os = "none")]
static TABLES: Tables<4> = Tables::new();

/// Register after `bits` zero bits, from `crc`.
const fn shifted(mut crc: u32, bits: u32) -> u32 {
    let mut bit = 0;
    while bit < bits {
        crc = (crc >> 1) ^ ((crc & 1) * POLYNOMIAL);
        bit += 1;
    }
    crc
}

/// Processes `N` bytes in one step, with a table of 1 KB for each.
struct Tables<const N: usize>([[u32; 256]; N]);

impl<const N: usize> Tables<N> {
    const fn new() -> Self {
        let mut tables = [[0; 256]; N];
        let mut byte = 0;
        while byte < 256 {
            let mut crc = byte as u32;
            let mut k = 0;
            while k < N {
                crc = shifted(crc, 8);
                tables[k][byte] = crc;
                k += 1;
            }
            byte += 1;
        }
        Self(tables)
    }

    /// The register after `bytes`.
    fn update(&self, mut crc: u32, bytes: &[u8]) -> u32 {
        // A step is of whole words.
        const { assert!(N.is_multiple_of(4)) }
        let (steps, rest) = bytes.as_chunks::<N>();
        for step in steps {
            let (words, _) = step.as_chunks::<4>();
            let mut next = 0;
            for (i, &word) in words.iter().enumerate() {
                let word = u32::from_le_bytes(word) ^ if i == 0 { crc } else { 0 };
                for (j, byte) in word.to_le_bytes().into_iter().enumerate() {
                    next ^= self.0[N - 1 - 4 * i - j][usize::from(byte)];
                }
            }
            crc = next;
        }
        for &byte in rest {
            let [low, ..] = crc.to_le_bytes();
            crc = (crc >> 8) ^ self.0[0][usize::from(low ^ byte)];
        }
        crc
    }
}

/// CRC-32 (ISO-HDLC) of `bytes`; 0xCBF4_3926 for `b"123456789"`.
#[must_use]
pub fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = Crc32::new();
    crc.update(bytes);
    crc.value()
}

/// [`crc32`] of bytes in pieces.
#[derive(Debug, Clone)]
pub struct Crc32(u32);

impl Crc32 {
    /// The CRC of no bytes.
    #[must_use]
    pub const fn new() -> Self {
        Self(u32::MAX)
    }

    /// Adds the next piece.
    pub fn update(&mut self, bytes: &[u8]) {
        self.0 = TABLES.update(self.0, bytes);
    }

    /// CRC-32 of all pieces so far.
    #[must_use]
    pub const fn value(&self) -> u32 {
        !self.0
    }
}

impl Default for Crc32 {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    /// The CRC by definition, bit by bit.
    fn by_definition(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(u32::MAX, |crc, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ ((crc & 1) * POLYNOMIAL))
        })
    }

    proptest! {
        #[test]
        fn every_step_length_gives_what_the_definition_gives_in_any_pieces(
            bytes in prop::collection::vec(any::<u8>(), 0..200), at: prop::sample::Index,
        ) {
            let expected = by_definition(&bytes);
            prop_assert_eq!(crc32(&bytes), expected);
            prop_assert_eq!(!Tables::<4>::new().update(u32::MAX, &bytes), expected);
            let (first, rest): (Vec<u8>, Vec<u8>) = {
                let (a, b) = bytes.split_at(at.index(bytes.len() + 1));
                (a.to_vec(), b.to_vec())
            };
            let mut crc = Crc32::new();
            crc.update(&first);
            crc.update(&rest);
            prop_assert_eq!(crc.value(), expected);
        }
    }

    #[test]
    fn the_published_check_value_comes_out() {
        assert_eq!(crc32(b"123456789"), 0xCBF4_3926);
    }
}
