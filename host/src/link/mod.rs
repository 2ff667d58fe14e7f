//! A byte link to a camera: TCP, a serial port, USB; an in-memory one is in [`virtual_camera`](crate::virtual_camera).
//!
//! The one law: a link moves bytes and knows nothing of packets.

mod address;
mod serial;
mod tcp;
pub mod usb;

pub use address::{CameraAddress, OpenError};
pub use serial::{DEFAULT_BAUD, SerialLink, serial_ports};
pub use tcp::TcpLink;
pub use usb::UsbLink;

use std::io;
use std::time::Duration;

/// What came of waiting for bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Received {
    /// This many bytes, at least one.
    Bytes(usize),
    /// None in the time given.
    Nothing,
    /// The other side has gone.
    Closed,
}

/// A two-way byte stream to a camera.
pub trait Link: Send {
    /// Sends all of `bytes`.
    ///
    /// # Errors
    /// When the link is down.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Waits up to `timeout` for bytes.
    ///
    /// # Errors
    /// When the link fails other than by an orderly end or a reset by the other side.
    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<Received>;
}

/// Whether this error means that the other side went away, rather than that something is wrong here.
pub(crate) fn is_hangup(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::ConnectionReset
            | io::ErrorKind::ConnectionAborted
            | io::ErrorKind::BrokenPipe
            | io::ErrorKind::UnexpectedEof
    )
}
