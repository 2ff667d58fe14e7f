//! The format of accesses on the FPGA's host port: an SPI slave, mode 0, most significant bit
//! first.
//!
//! | phase | clocks of `sck`, one line | four lines |
//! |---|---|---|
//! | opcode, always by `io0` alone | 8 | 8 |
//! | address, 16 bits; 0 for frames and bursts | 16 | 4 |
//! | write: value of 32 bits and its check ([`seal`]) | 48 | 12 |
//! | read: [`DUMMY_CYCLES`], lines not driven | 8 | 8 |
//! | register read: value of 32 bits and its check | 48 | 12 |
//! | frame or burst: its bytes | 8 a byte | 2 a byte |
//!
//! On a single line, the host drives `io0` and the FPGA answers on `io1`. With [`QUAD`] in the
//! opcode, everything after the opcode uses `io0` to `io3`, with `io3` the most significant. The
//! FPGA changes its lines after the rising edge of `sck` on which the host samples them. One access
//! lasts while `cs_n` is low, for any time. A write takes effect with its last bit. A write that ends
//! earlier, or whose check is wrong, has no effect. Bytes beyond the end of a frame or burst, or
//! without a frame or burst, are 0; no frame begins with 0.
//!
//! # Packets at a faster clock
//! [`READ_PACKET`] is a [`READ_FRAME`] by four lines whose bits are clocked by `sck` itself, from
//! [`PACKET_SCK_MIN_HZ`] to [`PACKET_SCK_MAX_HZ`]. The phases and their clocks are the same. Only packets
//! ([`mode::PACKETS`](crate::register::mode::PACKETS)) come without a gap at that speed. Without the
//! ADC's clock, the FPGA does not drive the lines.
//!
//! # Check
//! The check is a CRC-16 of address and value ([`check`]): 64 bits with itself. Up to three wrong bits,
//! and wrong bits within four clocks of four lines, never pass; anything else passes once in 65 536
//! times. The answer to a read has the check of the address that the FPGA has seen, so an address
//! that came damaged shows too.
//!
//! # Invariant
//! A register access with up to three wrong bits is never taken
//! (`tests::an_access_with_up_to_three_wrong_bits_is_not_taken`), and lines that stand still are no
//! answer of any register or entry of the order table (`tests::lines_that_stand_still_are_no_answer`).

/// Writes a register.
pub const WRITE_REGISTER: u8 = 0x54;
/// Reads a register; 0 at an address without a register.
pub const READ_REGISTER: u8 = 0x55;
/// Reads the delivered frame from its first byte.
pub const READ_FRAME: u8 = 0x56;
/// Reads the raw burst from its first byte.
pub const READ_RAW: u8 = 0x57;
/// Reads the delivered frame from its first byte, clocked by `sck`. The opcode must have [`QUAD`].
///
/// The port looks at this opcode without a filter. With [`QUAD`] it differs in four bits or more from
/// every other opcode, so that one wrong edge of `sck` does not turn another opcode into this one.
pub const READ_PACKET: u8 = 0x0B;
/// Bit of an opcode: address, value and bytes use four lines.
pub const QUAD: u8 = 0x80;
/// Clocks of `sck` between the address of a read and its first bit.
pub const DUMMY_CYCLES: u8 = 8;
/// The host port samples its pins. The clock of `sck` must be at most the port's clock divided by
/// this number.
pub const SCK_DIVIDER: u8 = 6;
/// Slowest `sck` of a [`READ_PACKET`], in Hz. Its opcode must be over 227 ns after `cs_n` fell, because no
/// other opcode can be, whatever glitches do to it. Nine periods of this `sck` are 225 ns.
pub const PACKET_SCK_MIN_HZ: u32 = 40_000_000;
/// Fastest `sck` of a [`READ_PACKET`], in Hz. The FPGA makes the bytes of a packet faster than that.
pub const PACKET_SCK_MAX_HZ: u32 = 60_000_000;
/// Bytes of a value and its check.
pub const SEALED_BYTES: usize = 6;
/// Polynomial of the check: `x^16 + x^12 + x^5 + 1`, most significant bit first.
pub const CHECK_POLYNOMIAL: u16 = 0x1021;
/// State of the check before the address.
pub const CHECK_SEED: u16 = 0xFFFF;

/// The check of an access: CRC-16 (IBM-3740) of the 16 bits of the address and the 32 bits of the
/// value.
#[must_use]
pub const fn check(address: u16, value: u32) -> u16 {
    let [a0, a1] = address.to_be_bytes();
    let [v0, v1, v2, v3] = value.to_be_bytes();
    let state = extend(extend(CHECK_SEED, a0), a1);
    extend(extend(extend(extend(state, v0), v1), v2), v3)
}

/// The check after one more byte: eight steps of
/// [`CHECK_POLYNOMIAL`] at once, without a table.
const fn extend(state: u16, byte: u8) -> u16 {
    let mut x = (state >> 8) ^ byte as u16;
    x ^= x >> 4;
    (state << 8) ^ (x << 12) ^ (x << 5) ^ x
}

/// A value and its check, in the order on the lines.
#[must_use]
pub const fn seal(address: u16, value: u32) -> [u8; SEALED_BYTES] {
    let [v0, v1, v2, v3] = value.to_be_bytes();
    let [c0, c1] = check(address, value).to_be_bytes();
    [v0, v1, v2, v3, c0, c1]
}

/// The value, if its check is that of this address and value.
#[must_use]
pub const fn unseal(address: u16, sealed: [u8; SEALED_BYTES]) -> Option<u32> {
    let [v0, v1, v2, v3, c0, c1] = sealed;
    let value = u32::from_be_bytes([v0, v1, v2, v3]);
    if check(address, value) == u16::from_be_bytes([c0, c1]) { Some(value) } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PATTERNS;
    use crate::register::{ORDER_TABLE, Register};
    use proptest::prelude::*;

    /// The catalogue of parametrised CRCs states the CRC-16/IBM-3740 of the nine digits from 1 to 9. The first six digits
    /// have the length of an access, so [`check`] must agree on them.
    #[test]
    fn the_check_is_that_of_the_catalogue() {
        let crc = |bytes: &[u8]| {
            bytes.iter().fold(CHECK_SEED, |state, &byte| {
                (0..8).fold(state ^ u16::from(byte) << 8, |state, _| {
                    state << 1 ^ if state >> 15 == 1 { CHECK_POLYNOMIAL } else { 0 }
                })
            })
        };
        assert_eq!(crc(b"123456789"), 0x29B1);
        assert_eq!(check(0x3132, 0x3334_3536), crc(b"123456"));
    }

    #[test]
    fn an_access_with_up_to_three_wrong_bits_is_not_taken() {
        // The check is linear: whether wrong bits pass depends on their places alone.
        let word = |bits: &[usize]| bits.iter().fold(0u64, |word, bit| word ^ 1 << bit);
        let passes = |wrong: u64| {
            let [a0, a1, sealed @ ..] = wrong.to_be_bytes();
            let address = u16::from_be_bytes([a0, a1]);
            let zeros = check(0, 0).to_be_bytes();
            let [v0, v1, v2, v3, c0, c1] = sealed;
            unseal(address, [v0, v1, v2, v3, c0 ^ zeros[0], c1 ^ zeros[1]]).is_some()
        };
        assert!(passes(0));
        for a in 0..64 {
            assert!(!passes(word(&[a])));
            for b in 0..a {
                assert!(!passes(word(&[a, b])));
                for c in 0..b {
                    assert!(!passes(word(&[a, b, c])));
                }
            }
        }
        // Four clocks of four lines.
        for shift in 0..=48 {
            for burst in 1u64..1 << 16 {
                assert!(!passes(burst << shift));
            }
        }
    }

    #[test]
    fn lines_that_stand_still_are_no_answer() {
        let table = ORDER_TABLE..ORDER_TABLE + PATTERNS;
        for address in Register::ALL.iter().map(|r| r.address()).chain(table) {
            for level in [0x00, 0xFF] {
                assert_eq!(unseal(address, [level; SEALED_BYTES]), None, "{address:#x} {level:#x}");
            }
        }
    }

    /// One edge of `sck` too many repeats a bit, and one too few leaves a bit out.
    #[test]
    fn one_wrong_edge_or_three_wrong_bits_turn_no_opcode_into_a_read_of_a_packet() {
        let wanted = READ_PACKET | QUAD;
        for opcode in [WRITE_REGISTER, READ_REGISTER, READ_FRAME, READ_RAW] {
            for opcode in [opcode, opcode | QUAD] {
                assert!((opcode ^ wanted).count_ones() > 3, "{opcode:#x}");
                for at in 0..8 {
                    let (before, after) = (0xFF00 >> at & 0xFF, 0xFF >> at);
                    let kept = u16::from(opcode) & before;
                    let repeated = kept | (u16::from(opcode) >> 1) & after;
                    // The first bit of the address follows.
                    let left_out = kept | (u16::from(opcode) << 1) & after;
                    for found in [repeated, left_out, left_out | 1] {
                        assert_ne!(found & 0xFF, u16::from(wanted), "{opcode:#x}, bit {at}");
                    }
                }
            }
        }
    }

    proptest! {
        #[test]
        fn a_value_comes_back(address: u16, value: u32) {
            prop_assert_eq!(unseal(address, seal(address, value)), Some(value));
        }
    }
}
