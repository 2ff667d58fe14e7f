//! CRC-32 as in zlib, Ethernet and the STM32's CRC unit (ISO-HDLC): polynomial 0x04C1_1DB7 reflected,
//! initial value and final XOR all ones. The same one guards packets and FPGA frames.

use crc::{CRC_32_ISO_HDLC, Crc};

// 16 KB of tables buy the host 24 414 frames a second; a microcontroller keeps its flash.
#[cfg(target_os = "none")]
type Tables = crc::Table<1>;
#[cfg(not(target_os = "none"))]
type Tables = crc::Table<16>;

static CRC: Crc<u32, Tables> = Crc::<u32, Tables>::new(&CRC_32_ISO_HDLC);

pub(crate) type Digest = crc::Digest<'static, u32, Tables>;

pub(crate) fn digest() -> Digest {
    CRC.digest()
}

/// CRC-32 (ISO-HDLC) of `bytes`; 0xCBF4_3926 for `b"123456789"`.
#[must_use]
pub fn crc32(bytes: &[u8]) -> u32 {
    CRC.checksum(bytes)
}

/// [`crc32`] of bytes that come in pieces.
#[derive(Clone)]
pub struct Crc32(Digest);

impl Crc32 {
    /// Of no bytes yet.
    #[must_use]
    pub fn new() -> Self {
        Self(digest())
    }

    /// Takes the next piece.
    pub fn update(&mut self, bytes: &[u8]) {
        self.0.update(bytes);
    }

    /// CRC-32 of all pieces so far.
    #[must_use]
    pub fn value(&self) -> u32 {
        self.0.clone().finalize()
    }
}

impl Default for Crc32 {
    fn default() -> Self {
        Self::new()
    }
}

impl core::fmt::Debug for Crc32 {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Crc32({:#010x})", self.value())
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn pieces_give_the_same_as_the_whole() {
        let mut crc = super::Crc32::new();
        crc.update(b"1234");
        crc.update(b"");
        crc.update(b"56789");
        assert_eq!(crc.value(), super::crc32(b"123456789"));
    }

    #[test]
    fn the_published_check_value_comes_out() {
        assert_eq!(super::crc32(b"123456789"), 0xCBF4_3926);
    }
}
