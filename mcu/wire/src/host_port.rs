//! The format of accesses on the FPGA's host port: an SPI slave, mode 0, most significant bit
//! first.
//!
//! | phase | clocks of `sck`, one line | four lines |
//! |---|---|---|
//! | opcode, always by `io0` alone | 8 | 8 |
//! | address, 16 bits; 0 for frames and bursts | 16 | 4 |
//! | write: value, 32 bits | 32 | 8 |
//! | read: [`DUMMY_CYCLES`], lines not driven | 8 | 8 |
//! | read: value of 32 bits, or bytes of the frame or burst | 8 a byte | 2 a byte |
//!
//! On a single line, the host drives `io0` and the FPGA answers on `io1`. With [`QUAD`] in the
//! opcode, everything after the opcode uses `io0` to `io3`, with `io3` the most significant. The
//! FPGA changes its lines after the rising edge of `sck` on which the host samples them. One access
//! lasts while `cs_n` is low, for any time. A write takes effect with its last bit, and a write
//! that ends earlier has no effect. Bytes beyond the end of a frame or burst, or without a frame or
//! burst, are 0; no frame begins with 0.

/// Writes a register.
pub const WRITE_REGISTER: u8 = 0x54;
/// Reads a register; 0 at an address without a register.
pub const READ_REGISTER: u8 = 0x55;
/// Reads the delivered frame from its first byte.
pub const READ_FRAME: u8 = 0x56;
/// Reads the raw burst from its first byte.
pub const READ_RAW: u8 = 0x57;
/// Bit of an opcode: address, value and bytes use four lines.
pub const QUAD: u8 = 0x80;
/// Clocks of `sck` between the address of a read and its first bit.
pub const DUMMY_CYCLES: u8 = 8;
/// The host port samples its pins. The clock of `sck` must be at most the port's clock divided by
/// this number.
pub const SCK_DIVIDER: u8 = 6;
