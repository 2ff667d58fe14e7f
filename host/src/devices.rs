//! The cameras that can be used from this machine.

use crate::causes::in_one_line;
use crate::link::usb::{self, UsbCamera, identify::check_version};
use crate::link::{CameraAddress, TcpLink, serial_ports};
use crate::session::{CameraIdentity, Session, SessionError};
use serde::Serialize;
use std::fmt;
use std::io;
use std::path::PathBuf;
use thiserror::Error;

/// Default address of `nirspi virtual`.
pub const DEFAULT_TCP: &str = "127.0.0.1:1550";

/// One camera, with its address for `--camera`.
#[derive(Debug, Serialize)]
pub struct Device {
    /// The camera's address.
    pub camera: String,
    /// The camera's answer; `null` if the camera was not opened, or did not answer.
    pub identity: Option<CameraIdentity>,
    /// The protocol version of a USB camera that was not opened.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub protocol: Option<u16>,
    /// What is known of a camera that was not opened.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
    /// Why the camera cannot be used.
    pub problem: Option<String>,
}

impl Device {
    fn new(camera: String) -> Self {
        Self { camera, identity: None, protocol: None, note: None, problem: None }
    }

    fn noting(self, note: &str) -> Self {
        Self { note: Some(note.to_owned()), ..self }
    }
}

impl fmt::Display for Device {
    /// The camera in one line, without its address.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.identity, &self.problem, &self.note) {
            (Some(id), _, _) => write!(
                f,
                "{} {}, firmware {}, gateware {}, protocol {}",
                id.board, id.serial, id.firmware, id.gateware, id.protocol
            ),
            (None, Some(text), _) | (None, None, Some(text)) => f.write_str(text),
            (None, None, None) => Ok(()),
        }
    }
}

/// The camera that is meant where none is named, and what a user should know of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Meant {
    /// Its address.
    pub address: CameraAddress,
    /// Why it is the one, in one line.
    pub because: String,
}

/// Several cameras are there, and none was named.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{} cameras on USB ({}), expected one, or an address", .0.len(), .0.join(", "))]
pub struct SeveralCameras(Vec<String>);

/// The camera that is meant where none is named: the one on USB, or the virtual one if there is none.
///
/// # Errors
/// [`SeveralCameras`] if there are several on USB.
pub fn meant() -> Result<Meant, SeveralCameras> {
    of_those_on_usb(usb::usb_cameras())
}

fn of_those_on_usb(found: io::Result<Vec<UsbCamera>>) -> Result<Meant, SeveralCameras> {
    let (address, because) = match found.as_deref() {
        Ok([]) => (CameraAddress::Virtual, "no camera on USB: this is the virtual one".to_owned()),
        Ok([camera]) => {
            (CameraAddress::Usb(camera.serial.clone()), format!("{camera}: the one camera on USB"))
        }
        Ok(several) => {
            return Err(SeveralCameras(several.iter().map(UsbCamera::to_string).collect()));
        }
        Err(error) => {
            let why = in_one_line(error);
            (CameraAddress::Virtual, format!("USB not listed ({why}): this is the virtual camera"))
        }
    };
    Ok(Meant { address, because })
}

/// The virtual camera of this program, the cameras at these TCP addresses and at the default one,
/// cameras on USB, and serial ports, which are not opened.
#[must_use]
pub fn list(tcp: &[String]) -> Vec<Device> {
    let default = (!tcp.iter().any(|a| a == DEFAULT_TCP)).then_some(DEFAULT_TCP);
    let asked = tcp.iter().map(|address| (address.as_str(), true));
    let addresses: Vec<(&str, bool)> =
        asked.chain(default.map(|address| (address, false))).collect();
    // The addresses are tried in parallel, because an address without an answer takes time.
    let answers: Vec<_> = std::thread::scope(|scope| {
        let asking: Vec<_> =
            addresses.iter().map(|(address, _)| scope.spawn(|| identify(address))).collect();
        asking.into_iter().map(std::thread::ScopedJoinHandle::join).collect()
    });
    let mut devices = vec![
        Device::new("virtual".to_owned())
            .noting("built in: optics simulator, gateware model, real firmware logic"),
    ];
    for ((address, named), answer) in addresses.into_iter().zip(answers) {
        let device = Device::new(format!("tcp:{address}"));
        devices.push(match answer {
            Ok(Ok(identity)) => Device { identity: Some(identity), ..device },
            // A missing camera at the default address is not reported.
            Ok(Err(SessionError::Link(error)))
                if !named && error.kind() == io::ErrorKind::ConnectionRefused =>
            {
                continue;
            }
            Ok(Err(error)) => Device { problem: Some(in_one_line(&error)), ..device },
            Err(_) => Device { problem: Some("the request failed".to_owned()), ..device },
        });
    }
    devices.extend(on_usb());
    devices.extend(on_serial_ports());
    devices
}

fn identify(address: &str) -> Result<CameraIdentity, SessionError> {
    let link = TcpLink::connect(address)?;
    Ok(Session::open(Box::new(link))?.identity().clone())
}

/// Cameras on USB, by their descriptors; empty on a system without USB.
fn on_usb() -> Vec<Device> {
    let cameras = match usb::usb_cameras() {
        Ok(cameras) => cameras,
        Err(error) => {
            return vec![
                Device::new("usb".to_owned())
                    .noting(&format!("not listed: {}", in_one_line(&error))),
            ];
        }
    };
    let device = |camera: UsbCamera| {
        let said = match camera.protocol.map(|protocol| (protocol, check_version(protocol))) {
            None => "the protocol version is known only after the camera is opened".to_owned(),
            Some((oldest, Ok(()))) => format!("protocol {oldest} or newer"),
            Some((_, Err(problem))) => problem.to_string(),
        };
        let protocol = camera.protocol;
        Device { protocol, ..Device::new(camera.to_string()).noting(&said) }
    };
    cameras.into_iter().map(device).collect()
}

/// Serial ports; empty on a system that does not list its ports.
fn on_serial_ports() -> Vec<Device> {
    let ports = serial_ports().unwrap_or_default();
    let device = |port: PathBuf| {
        let camera = format!("serial:{}", port.display());
        let note = format!("a serial port, not opened: nirspi info --camera {camera}");
        Device::new(camera).noting(&note)
    };
    ports.into_iter().map(device).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_one_camera_is_meant_and_several_are_named() {
        let camera =
            |serial: &str| UsbCamera { serial: Some(serial.to_owned()), protocol: Some(4) };
        let meant = of_those_on_usb(Ok(vec![camera("77")])).unwrap();
        assert_eq!(meant.address, CameraAddress::Usb(Some("77".to_owned())));
        assert_eq!(meant.because, "usb:77: the one camera on USB");
        let several = of_those_on_usb(Ok(vec![camera("77"), camera("78")])).unwrap_err();
        let words = "2 cameras on USB (usb:77, usb:78), expected one, or an address";
        assert_eq!(several.to_string(), words);
        for (found, words) in [
            (Ok(Vec::new()), "no camera on USB: this is the virtual one"),
            (Err(io::Error::other("no rights")), "USB not listed (no rights): this is the virtual"),
        ] {
            let meant = of_those_on_usb(found).unwrap();
            assert_eq!(meant.address, CameraAddress::Virtual);
            assert!(meant.because.starts_with(words), "{}", meant.because);
        }
    }
}
