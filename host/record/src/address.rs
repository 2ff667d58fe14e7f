//! The addresses of cameras: `virtual`, `usb`, `usb:SERIAL`, `tcp:HOST:PORT`, `serial:PATH[:BAUD]` and
//! `replay:REC[,SPEED]`; and of [feeds](nirspi_feed), `feed:ADDR`, which are benches of any other kind.

use crate::recording::RecordingError;
use crate::replay::{ReplayAddress, ReplayLink};
use nirspi_camera::link::usb::UsbError;
use nirspi_camera::link::{DEFAULT_BAUD, Link, SerialLink, TcpLink, UsbLink};
use nirspi_camera::session::{Session, SessionError};
use nirspi_feed::Address as FeedAddress;
use std::fmt;
use std::io;
use std::path::PathBuf;
use std::str::FromStr;
use thiserror::Error;

/// The address of a camera.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum CameraAddress {
    /// The virtual camera in this process.
    Virtual,
    /// A camera behind a TCP address.
    Tcp(String),
    /// A camera behind a serial port.
    Serial {
        /// The port's device, such as `/dev/ttyACM0` or `COM7`.
        path: PathBuf,
        /// Bits a second.
        baud: u32,
    },
    /// A camera on USB: the camera with this serial number, or the only camera.
    Usb(Option<String>),
    /// A recording that is played back as a camera.
    Replay(ReplayAddress),
    /// Live readings of a bench that is no camera of nirspi.
    Feed(FeedAddress),
}

impl FromStr for CameraAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            None if text == "virtual" => Ok(Self::Virtual),
            None if text == "usb" => Ok(Self::Usb(None)),
            Some(("usb", serial)) if !serial.is_empty() => Ok(Self::Usb(Some(serial.to_owned()))),
            Some(("feed", address)) => address.parse().map(Self::Feed),
            Some(("replay", recording)) => recording.parse().map(Self::Replay),
            Some(("tcp", address)) if address.contains(':') => Ok(Self::Tcp(address.to_owned())),
            Some(("serial", port)) if !port.is_empty() => {
                let speed = port.rsplit_once(':').and_then(|(path, baud)| {
                    let baud = baud.parse().ok().filter(|&baud: &u32| baud > 0)?;
                    Some((path, baud)).filter(|(path, _)| !path.is_empty())
                });
                let (path, baud) = speed.unwrap_or((port, DEFAULT_BAUD));
                Ok(Self::Serial { path: PathBuf::from(path), baud })
            }
            _ => {
                Err("expected virtual, usb, usb:SERIAL, tcp:HOST:PORT, serial:PATH[:BAUD], replay:REC[,SPEED] or \
                      feed:ADDR"
                    .to_owned())
            }
        }
    }
}

impl fmt::Display for CameraAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Virtual => f.write_str("virtual"),
            Self::Tcp(address) => write!(f, "tcp:{address}"),
            Self::Serial { path, .. } => write!(f, "serial:{}", path.display()),
            Self::Usb(None) => f.write_str("usb"),
            Self::Usb(Some(serial)) => write!(f, "usb:{serial}"),
            Self::Replay(recording) => recording.fmt(f),
            Self::Feed(address) => address.fmt(f),
        }
    }
}

/// Why a camera could not be opened.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum OpenError {
    /// The TCP address does not answer.
    #[error("no camera at tcp:{address}")]
    Tcp {
        /// The address.
        address: String,
        /// The network's error.
        #[source]
        problem: io::Error,
    },
    /// The serial port cannot be used.
    #[error("serial:{}: {}", .path.display(), serial_problem(.problem))]
    Serial {
        /// The port.
        path: PathBuf,
        /// The system's error.
        problem: io::Error,
    },
    /// The recording cannot be played back.
    #[error(transparent)]
    Replay(#[from] RecordingError),
    /// There is no such camera on USB, or the camera cannot be used.
    #[error(transparent)]
    Usb(#[from] UsbError),
    /// A feed is no camera.
    #[error(
        "{0}: a feed sends readings and takes no commands: nirspi capture and nirspi serve read it"
    )]
    Feed(FeedAddress),
    /// The device at the address does not answer as a camera.
    #[error("{camera}")]
    Session {
        /// The camera's address.
        camera: String,
        /// The session's error.
        #[source]
        problem: SessionError,
    },
    /// The virtual camera cannot be built.
    #[error("the virtual camera cannot be built")]
    Virtual(#[source] Box<dyn std::error::Error + Send + Sync>),
}

impl CameraAddress {
    /// Opens a session with the camera. `virtual_link` makes the link to the virtual camera in this
    /// process, if the address is `virtual`.
    ///
    /// # Errors
    /// [`OpenError`], which says what to do.
    pub fn open<E: Into<Box<dyn std::error::Error + Send + Sync>>>(
        &self,
        virtual_link: impl FnOnce() -> Result<Box<dyn Link>, E>,
    ) -> Result<Session, OpenError> {
        let session_error = |problem| OpenError::Session { camera: self.to_string(), problem };
        let link: Box<dyn Link> = match self {
            Self::Replay(recording) => {
                let link = ReplayLink::open(recording)?;
                let recorded = link.recorded().clone();
                let session = Session::open(Box::new(link)).map_err(session_error)?;
                return Ok(session.with_recorded(recorded));
            }
            Self::Virtual => {
                virtual_link().map_err(|problem| OpenError::Virtual(problem.into()))?
            }
            Self::Tcp(address) => Box::new(
                TcpLink::connect(address)
                    .map_err(|problem| OpenError::Tcp { address: address.clone(), problem })?,
            ),
            Self::Serial { path, baud } => Box::new(
                SerialLink::open(path, *baud)
                    .map_err(|problem| OpenError::Serial { path: path.clone(), problem })?,
            ),
            Self::Feed(address) => return Err(OpenError::Feed(address.clone())),
            // The link's errors name the camera and say what to do.
            Self::Usb(serial) => Box::new(UsbLink::open(serial.as_deref())?),
        };
        Session::open(link).map_err(session_error)
    }

    /// Frames of 1024 patterns a second that the link must carry; 0 if any speed is enough.
    #[must_use]
    pub fn min_frames_per_s(&self) -> f64 {
        match self {
            // Three quarters of the rate that the boards' link to the FPGA allows, by the estimate
            // in docs/log/firmware.md.
            Self::Usb(_) => 300.0,
            _ => 0.0,
        }
    }
}

fn serial_problem(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::NotFound => {
            "there is no such port: nirspi camera devices lists them".to_owned()
        }
        io::ErrorKind::PermissionDenied if cfg!(target_os = "linux") => {
            "no permission: sudo usermod -aG dialout $USER, then log in again".to_owned()
        }
        _ => error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::replay::Speed;

    #[test]
    fn every_form_is_understood_and_said_again() {
        let serial = |path: &str, baud| CameraAddress::Serial { path: path.into(), baud };
        let replay =
            |path: &str, speed| CameraAddress::Replay(ReplayAddress { path: path.into(), speed });
        for (text, expected) in [
            ("virtual", CameraAddress::Virtual),
            ("usb", CameraAddress::Usb(None)),
            ("replay:a.mcap", replay("a.mcap", Speed::Times(1.0))),
            ("replay:a,b.mcap,2.5", replay("a,b.mcap", Speed::Times(2.5))),
            ("replay:a,b.mcap,max", replay("a,b.mcap", Speed::Max)),
            ("replay:a,b.mcap", replay("a,b.mcap", Speed::Times(1.0))),
            ("usb:0042:A", CameraAddress::Usb(Some("0042:A".to_owned()))),
            ("tcp:[::1]:1550", CameraAddress::Tcp("[::1]:1550".to_owned())),
            ("feed:host:5025", CameraAddress::Feed("host:5025".parse().unwrap())),
            ("feed:-", CameraAddress::Feed(FeedAddress::Stdin)),
            ("serial:/dev/ttyACM0", serial("/dev/ttyACM0", DEFAULT_BAUD)),
            ("serial:COM7:3000000", serial("COM7", 3_000_000)),
            ("serial:/dev/by-path/pci:0", serial("/dev/by-path/pci:0", DEFAULT_BAUD)),
        ] {
            let plain = !matches!(expected, CameraAddress::Serial { .. });
            assert_eq!(text.parse(), Ok(expected.clone()), "{text}");
            assert!(!plain || expected.to_string() == text, "{expected}");
        }
        for text in
            ["", "replay:", "replay:,max", "usb:", "tcp:nowhere", "serial:", "feed:", "fax:1"]
        {
            assert!(text.parse::<CameraAddress>().is_err(), "{text}");
        }
    }
}
