//! The cameras that can be used from this machine.

use crate::address::CameraAddress;
use nirspi_camera::link::usb::{self, UsbCamera, identify::check_version};
use nirspi_camera::link::{TcpLink, serial_ports};
use nirspi_camera::session::{Session, SessionError};
use nirspi_files::causes::in_one_line;
use nirspi_files::identity::CameraIdentity;
use serde::Serialize;
use std::path::PathBuf;
use std::{fmt, io};
use thiserror::Error;

/// Default address of `nirspi dev virtual`.
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

/// The camera of a user who names no camera.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DefaultCamera {
    /// Its address.
    pub address: CameraAddress,
    /// Which camera it is, in one line for the user.
    pub note: String,
}

/// The user names no camera, and several cameras are on USB.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{} cameras are on USB ({}), expected the address of one of them", .0.len(), .0.join(", "))]
pub struct SeveralCameras(Vec<String>);

/// The camera of a user who names no camera: the camera on USB, or the virtual camera if USB has no camera.
///
/// # Errors
/// [`SeveralCameras`] if USB has several.
pub fn default_camera() -> Result<DefaultCamera, SeveralCameras> {
    choose(usb::usb_cameras())
}

fn choose(found: io::Result<Vec<UsbCamera>>) -> Result<DefaultCamera, SeveralCameras> {
    let (address, note) = match found.as_deref() {
        Ok([]) => {
            (CameraAddress::Virtual, "no camera found on USB: using the virtual camera".to_owned())
        }
        Ok([camera]) => (
            CameraAddress::Usb(camera.serial.clone()),
            format!("using {camera}, the only camera on USB"),
        ),
        Ok(several) => {
            return Err(SeveralCameras(several.iter().map(UsbCamera::to_string).collect()));
        }
        Err(error) => {
            let why = in_one_line(error);
            (CameraAddress::Virtual, format!("cannot list USB ({why}): using the virtual camera"))
        }
    };
    Ok(DefaultCamera { address, note })
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
        let note = format!("a serial port, not opened: nirspi camera info --camera {camera}");
        Device::new(camera).noting(&note)
    };
    ports.into_iter().map(device).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_only_camera_on_usb_is_the_default_and_several_are_listed() {
        let camera =
            |serial: &str| UsbCamera { serial: Some(serial.to_owned()), protocol: Some(4) };
        let chosen = choose(Ok(vec![camera("77")])).unwrap();
        assert_eq!(chosen.address, CameraAddress::Usb(Some("77".to_owned())));
        assert_eq!(chosen.note, "using usb:77, the only camera on USB");
        let several = choose(Ok(vec![camera("77"), camera("78")])).unwrap_err();
        let words = "2 cameras are on USB (usb:77, usb:78), expected the address of one of them";
        assert_eq!(several.to_string(), words);
        for (found, words) in [
            (Ok(Vec::new()), "no camera found on USB: using the virtual camera"),
            (Err(io::Error::other("no rights")), "cannot list USB (no rights): using the virtual"),
        ] {
            let chosen = choose(found).unwrap();
            assert_eq!(chosen.address, CameraAddress::Virtual);
            assert!(chosen.note.starts_with(words), "{}", chosen.note);
        }
    }
}
