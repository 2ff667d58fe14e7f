//! Where a feed comes from.

use std::fmt;
use std::fs::{self, File};
use std::io::{self, Read};
use std::net::{TcpListener, TcpStream, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use thiserror::Error;

/// How long a connection may take.
const CONNECT: Duration = Duration::from_secs(5);
/// The longest wait before a reader looks whether it is still wanted.
const TICK: Duration = Duration::from_millis(50);
/// Time between two looks at a file that grows.
const GROWS: Duration = Duration::from_millis(20);

/// Where a feed comes from: `HOST:PORT`, `listen:HOST:PORT`, a path, or `-`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Address {
    /// A TCP server that sends the feed.
    Tcp(String),
    /// This program is the TCP server: the first program that connects sends the feed.
    Listen(String),
    /// A Unix socket, a pipe, a device, or a file that grows.
    Path(PathBuf),
    /// The standard input.
    Stdin,
}

impl FromStr for Address {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let is_host = |text: &str| {
            text.rsplit_once(':').is_some_and(|(host, port)| {
                !host.is_empty() && !host.contains(['/', '\\']) && port.parse::<u16>().is_ok()
            })
        };
        match text.strip_prefix("listen:") {
            _ if text == "-" => Ok(Self::Stdin),
            Some(host) if is_host(host) => Ok(Self::Listen(host.to_owned())),
            None if is_host(text) => Ok(Self::Tcp(text.to_owned())),
            None if !text.is_empty() => Ok(Self::Path(PathBuf::from(text))),
            _ => {
                Err("expected feed:HOST:PORT, feed:listen:HOST:PORT, feed:PATH or feed:-"
                    .to_owned())
            }
        }
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tcp(host) => write!(f, "feed:{host}"),
            Self::Listen(host) => write!(f, "feed:listen:{host}"),
            Self::Path(path) => write!(f, "feed:{}", path.display()),
            Self::Stdin => f.write_str("feed:-"),
        }
    }
}

/// Why nothing can be read at an address. `Display` is one line.
#[derive(Debug, Error)]
#[error("{address}: {}", reason(.address, .system))]
pub struct AddressError {
    /// The address.
    pub address: Address,
    /// The system's error.
    pub system: io::Error,
}

fn reason(address: &Address, system: &io::Error) -> String {
    match (address, system.kind()) {
        (Address::Path(_), io::ErrorKind::NotFound) => {
            "no such file, pipe or socket; a feed over TCP is feed:HOST:PORT".to_owned()
        }
        (Address::Tcp(_), io::ErrorKind::ConnectionRefused) => {
            "no program listens there; with feed:listen:HOST:PORT this program listens".to_owned()
        }
        _ => system.to_string(),
    }
}

/// Something that gives bytes, or nothing for a while.
pub(super) trait Source: Send {
    /// Reads bytes. `Ok(None)`: none came for a while.
    ///
    /// # Errors
    /// The system's error; `Ok(Some(0))` is the end.
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<Option<usize>>;
}

/// Bytes of a reader whose end is the end of the feed.
pub(super) struct Plain<R>(pub(super) R);

impl<R: Read + Send> Source for Plain<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<Option<usize>> {
        match self.0.read(bytes) {
            Ok(count) => Ok(Some(count)),
            Err(error) => match error.kind() {
                io::ErrorKind::WouldBlock
                | io::ErrorKind::TimedOut
                | io::ErrorKind::Interrupted => Ok(None),
                _ => Err(error),
            },
        }
    }
}

/// A file that grows.
struct Growing {
    file: File,
    at: u64,
}

impl Source for Growing {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<Option<usize>> {
        let count = self.file.read(bytes)?;
        self.at += count as u64;
        if count > 0 {
            return Ok(Some(count));
        }
        if self.file.metadata()?.len() < self.at {
            return Err(io::Error::other("the file became shorter"));
        }
        std::thread::sleep(GROWS);
        Ok(None)
    }
}

/// A pipe or device, whose opening may wait for its other end.
struct Waiting(PathBuf, Option<File>);

impl Source for Waiting {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<Option<usize>> {
        match &mut self.1 {
            Some(file) => Ok(Some(file.read(bytes)?)),
            unopened => {
                *unopened = Some(File::open(&self.0)?);
                Ok(None)
            }
        }
    }
}

/// A server before and after the sender has connected.
struct Listening(TcpListener, Option<TcpStream>);

impl Source for Listening {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<Option<usize>> {
        if let Some(stream) = &mut self.1 {
            return Plain(stream).read(bytes);
        }
        match self.0.accept() {
            Ok((stream, _)) => {
                stream.set_nonblocking(false)?;
                stream.set_read_timeout(Some(TICK))?;
                self.1 = Some(stream);
            }
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => std::thread::sleep(TICK),
            Err(error) => return Err(error),
        }
        Ok(None)
    }
}

impl Address {
    /// Opens the address without waiting for a program at its other end.
    pub(super) fn open(&self) -> Result<Box<dyn Source>, AddressError> {
        let open = || -> io::Result<Box<dyn Source>> {
            match self {
                Self::Tcp(host) => {
                    let stream = connect(host)?;
                    stream.set_read_timeout(Some(TICK))?;
                    Ok(Box::new(Plain(stream)))
                }
                Self::Listen(host) => {
                    let listener = TcpListener::bind(host)?;
                    listener.set_nonblocking(true)?;
                    Ok(Box::new(Listening(listener, None)))
                }
                Self::Path(path) => at_path(path),
                Self::Stdin => Ok(Box::new(Plain(io::stdin()))),
            }
        };
        open().map_err(|system| AddressError { address: self.clone(), system })
    }
}

fn connect(host: &str) -> io::Result<TcpStream> {
    let mut last = io::Error::new(io::ErrorKind::NotFound, "the host has no address");
    for address in host.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, CONNECT) {
            Ok(stream) => return Ok(stream),
            Err(error) => last = error,
        }
    }
    Err(last)
}

fn at_path(path: &Path) -> io::Result<Box<dyn Source>> {
    let kind = fs::metadata(path)?;
    if kind.is_dir() {
        return Err(io::Error::other("a folder, expected a file, pipe or socket"));
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        if kind.file_type().is_socket() {
            let stream = std::os::unix::net::UnixStream::connect(path)?;
            stream.set_read_timeout(Some(TICK))?;
            return Ok(Box::new(Plain(stream)));
        }
    }
    if kind.is_file() {
        return Ok(Box::new(Growing { file: File::open(path)?, at: 0 }));
    }
    Ok(Box::new(Waiting(path.to_owned(), None)))
}

/// Reads until the end, an error, or until `give` returns false, because the receiver wants no more.
pub(super) fn pump(
    mut source: Box<dyn Source>,
    closed: &AtomicBool,
    block: usize,
    mut give: impl FnMut(io::Result<Vec<u8>>) -> bool,
) {
    while !closed.load(Ordering::Relaxed) {
        let mut bytes = vec![0; block];
        match source.read(&mut bytes) {
            Ok(None) => {}
            Ok(Some(count)) => {
                bytes.truncate(count);
                if !give(Ok(bytes)) || count == 0 {
                    return;
                }
            }
            Err(error) => {
                give(Err(error));
                return;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_form_of_an_address_is_understood_and_said_again() {
        let path = |path: &str| Address::Path(path.into());
        for (text, expected) in [
            ("-", Address::Stdin),
            ("localhost:5025", Address::Tcp("localhost:5025".to_owned())),
            ("[::1]:5025", Address::Tcp("[::1]:5025".to_owned())),
            ("listen:0.0.0.0:5025", Address::Listen("0.0.0.0:5025".to_owned())),
            ("/tmp/feed.sock", path("/tmp/feed.sock")),
            ("readings.txt", path("readings.txt")),
            ("./a:1", path("./a:1")),
            ("C:\\data\\feed.txt", path("C:\\data\\feed.txt")),
            ("a:b", path("a:b")),
        ] {
            assert_eq!(text.parse(), Ok(expected.clone()), "{text}");
            assert_eq!(expected.to_string(), format!("feed:{text}"));
        }
        for text in ["", "listen:", "listen:here"] {
            assert!(text.parse::<Address>().is_err(), "{text}");
        }
    }
}
