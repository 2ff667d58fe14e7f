//! Byte links to a camera: TCP, a serial port, USB. The link in memory is in
//! the crate `nirspi-virtual`.
//!
//! A link moves bytes and does not interpret packets. A browser has none of these links.

#[cfg(not(target_family = "wasm"))]
mod serial;
#[cfg(not(target_family = "wasm"))]
mod tcp;
#[cfg(not(target_family = "wasm"))]
pub mod usb;

#[cfg(not(target_family = "wasm"))]
pub use self::{
    serial::{DEFAULT_BAUD, SerialLink, serial_ports},
    tcp::TcpLink,
    usb::UsbLink,
};

use std::io;
use std::time::Duration;

/// The result of waiting for bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Received {
    /// This many bytes, at least one.
    Bytes(usize),
    /// No bytes in the given time.
    Nothing,
    /// The other side has closed the link.
    Closed,
}

/// A two-way byte stream to a camera.
pub trait Link: Send {
    /// Sends all of `bytes`.
    ///
    /// # Errors
    /// If the link is down.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Waits up to `timeout` for bytes.
    ///
    /// # Errors
    /// If the link fails in another way than by an orderly end or a reset by the other side.
    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<Received>;
}

/// Whether the error means that the other side has gone, and not that this side has a problem.
#[must_use]
pub fn is_hangup(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::ConnectionReset
            | io::ErrorKind::ConnectionAborted
            | io::ErrorKind::BrokenPipe
            | io::ErrorKind::UnexpectedEof
    )
}
