//! A camera behind a TCP address.

use super::{Link, Received, is_hangup};
use std::io::{self, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

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
    /// If the address does not resolve, or no program listens at the address within five seconds.
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

impl Link for TcpLink {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.stream.write_all(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<Received> {
        // A socket interprets a timeout of zero as "for ever".
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
