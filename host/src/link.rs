//! A byte link to a camera: TCP here, an in-memory one in [`virtual_camera`](crate::virtual_camera).
//!
//! The one law: a link moves bytes and knows nothing of packets.

use std::io::{self, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
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

/// A camera behind a TCP address.
#[derive(Debug)]
pub struct TcpLink {
    stream: TcpStream,
    timeout: Duration,
}

impl TcpLink {
    /// Connects to `address`, `host:port`.
    ///
    /// # Errors
    /// When the address does not resolve, or nothing listens there within five seconds.
    pub fn connect(address: &str) -> io::Result<Self> {
        let mut last = io::Error::new(io::ErrorKind::NotFound, "the address names no host");
        for candidate in address.to_socket_addrs()? {
            match TcpStream::connect_timeout(&candidate, Duration::from_secs(5)) {
                Ok(stream) => {
                    stream.set_nodelay(true)?;
                    return Ok(Self { stream, timeout: Duration::ZERO });
                }
                Err(error) => last = error,
            }
        }
        Err(last)
    }
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

impl Link for TcpLink {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.stream.write_all(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<Received> {
        // A timeout of zero would mean "for ever" to the socket.
        let timeout = timeout.max(Duration::from_millis(1));
        if timeout != self.timeout {
            self.stream.set_read_timeout(Some(timeout))?;
            self.timeout = timeout;
        }
        match self.stream.read(buffer) {
            Ok(0) => Ok(Received::Closed),
            Ok(bytes) => Ok(Received::Bytes(bytes)),
            Err(error) if is_hangup(&error) => Ok(Received::Closed),
            Err(error) => match error.kind() {
                io::ErrorKind::WouldBlock
                | io::ErrorKind::TimedOut
                | io::ErrorKind::Interrupted => Ok(Received::Nothing),
                _ => Err(error),
            },
        }
    }
}
