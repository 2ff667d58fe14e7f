//! Decides from descriptors alone which devices on the bus are cameras, and which camera to use.
//!
//! This module never accesses the bus, so tests need no bus.

use nirspi_wire::usb::{INTERFACE_CLASS, INTERFACE_SUBCLASS, PRODUCT, PRODUCT_ID, VENDOR_ID};
use nirspi_wire::version;
use std::fmt;
use std::io;
use thiserror::Error;

/// The descriptor of an interface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct InterfaceId {
    /// `bInterfaceNumber`.
    pub number: u8,
    /// `bInterfaceClass`.
    pub class: u8,
    /// `bInterfaceSubClass`.
    pub subclass: u8,
    /// `bInterfaceProtocol`.
    pub protocol: u8,
}

impl InterfaceId {
    /// Whether this is the interface of a camera, of any protocol version.
    #[must_use]
    pub fn is_camera(&self) -> bool {
        (self.class, self.subclass) == (INTERFACE_CLASS, INTERFACE_SUBCLASS)
    }
}

/// The properties of a device that the system knows without opening it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DeviceId {
    /// `idVendor`.
    pub vendor: u16,
    /// `idProduct`.
    pub product: u16,
    /// `iProduct`.
    pub name: Option<String>,
    /// `iSerialNumber`.
    pub serial: Option<String>,
    /// Interfaces of the active configuration. Windows lists no interfaces before the device is
    /// open.
    pub interfaces: Vec<InterfaceId>,
}

/// A camera on the bus, not opened.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UsbCamera {
    /// Serial number.
    pub serial: Option<String>,
    /// Oldest protocol version that the camera speaks, if the system shows the interface before the
    /// device is open.
    pub protocol: Option<u16>,
}

impl fmt::Display for UsbCamera {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.serial {
            Some(serial) => write!(f, "usb:{serial}"),
            None => f.write_str("usb (without a serial number)"),
        }
    }
}

/// The camera, if this device is a camera. Vendor and product id are test ids shared with other
/// devices, so the name must match too, and the interface if the system shows it.
#[must_use]
pub fn recognise(device: &DeviceId) -> Option<UsbCamera> {
    let ours = (device.vendor, device.product) == (VENDOR_ID, PRODUCT_ID)
        && device.name.as_deref() == Some(PRODUCT);
    let interface = device.interfaces.iter().find(|interface| interface.is_camera());
    if !ours || (interface.is_none() && !device.interfaces.is_empty()) {
        return None;
    }
    let protocol = interface.map(|interface| u16::from(interface.protocol));
    Some(UsbCamera { serial: device.serial.clone(), protocol })
}

/// Chooses one of the listed cameras: the camera with `serial`, or the only camera.
///
/// # Errors
/// [`UsbError::None`] or [`UsbError::Several`], which name the connected cameras.
pub fn choose<'c, T>(
    cameras: &'c [(UsbCamera, T)],
    serial: Option<&str>,
) -> Result<&'c (UsbCamera, T), UsbError> {
    let there = || cameras.iter().map(|(camera, _)| camera.to_string()).collect();
    let none = || UsbError::None { wanted: serial.map(str::to_owned), there: there() };
    match (serial, cameras) {
        (None, [] | [_]) => cameras.first().ok_or_else(none),
        (None, _) => Err(UsbError::Several { there: there() }),
        (Some(wanted), _) => cameras
            .iter()
            .find(|(camera, _)| camera.serial.as_deref() == Some(wanted))
            .ok_or_else(none),
    }
}

/// Checks the oldest version that the camera speaks, which its interface's descriptor names.
///
/// # Errors
/// [`UsbError::Version`] if this program does not speak that version.
pub fn check_version(oldest: u16) -> Result<(), UsbError> {
    if oldest <= version::CURRENT { Ok(()) } else { Err(UsbError::Version { oldest }) }
}

/// Why a USB camera cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum UsbError {
    /// The camera is not connected.
    #[error("{}", none(.wanted.as_deref(), .there))]
    None {
        /// The requested serial number.
        wanted: Option<String>,
        /// The connected cameras.
        there: Vec<String>,
    },
    /// Several cameras are connected and the user did not choose one.
    #[error("{} cameras on USB: name one of {}", .there.len(), .there.join(", "))]
    Several {
        /// The connected cameras.
        there: Vec<String>,
    },
    /// The camera needs a newer protocol version than this program has.
    #[error(
        "the camera's USB descriptor asks for protocol version {oldest} or newer, this program speaks up to {}: update this program",
        version::CURRENT
    )]
    Version {
        /// The oldest version that the camera speaks.
        oldest: u16,
    },
    /// The system denies the user access.
    #[error("no permission to open {camera}{}", permission_hint(cfg!(target_os = "linux")))]
    Permission {
        /// The camera.
        camera: String,
    },
    /// Another program uses the camera.
    #[error("{camera} is in use by another program")]
    Busy {
        /// The camera.
        camera: String,
    },
    /// The device has the name of a camera but not the endpoints of a camera.
    #[error("{camera} has no camera interface: is its firmware ours?")]
    NoInterface {
        /// The camera.
        camera: String,
    },
    /// The system's USB failed.
    #[error("the system's USB failed")]
    Io(#[from] io::Error),
}

fn none(wanted: Option<&str>, there: &[String]) -> String {
    match (wanted, there) {
        (Some(serial), []) => format!("no camera on USB, so none with serial number {serial}"),
        (Some(serial), there) => {
            format!("no camera on USB with serial number {serial}; there is {}", there.join(", "))
        }
        (None, _) => "no camera on USB: is it plugged in, powered and flashed?".to_owned(),
    }
}

/// What to do about a missing permission.
fn permission_hint(linux: bool) -> &'static str {
    if linux {
        ": sudo nirspi camera setup; over SSH and in a service sudo nirspi camera setup --group GROUP, with a group of yours"
    } else {
        ""
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(serial: &str) -> DeviceId {
        DeviceId {
            vendor: VENDOR_ID,
            product: PRODUCT_ID,
            name: Some(PRODUCT.to_owned()),
            serial: Some(serial.to_owned()),
            interfaces: vec![InterfaceId {
                number: 0,
                class: INTERFACE_CLASS,
                subclass: INTERFACE_SUBCLASS,
                protocol: nirspi_wire::usb::INTERFACE_PROTOCOL,
            }],
        }
    }

    #[test]
    fn a_camera_is_known_by_ids_name_and_interface_together() {
        let found = recognise(&camera("A1")).unwrap();
        assert_eq!(found.serial.as_deref(), Some("A1"));
        assert_eq!(found.protocol, Some(version::MIN));
        let changes: [&dyn Fn(&mut DeviceId); 6] = [
            &|device| device.vendor ^= 1,
            &|device| device.product ^= 1,
            &|device| device.name = Some("someone's test device".to_owned()),
            &|device| device.name = None,
            &|device| device.interfaces[0].class = 3,
            &|device| device.interfaces[0].subclass ^= 1,
        ];
        for (number, change) in changes.iter().enumerate() {
            let mut device = camera("A1");
            change(&mut device);
            assert_eq!(recognise(&device), None, "change {number}");
        }
    }

    #[test]
    fn where_the_system_shows_no_interface_the_names_are_enough_and_the_version_is_open() {
        let device = DeviceId { interfaces: Vec::new(), ..camera("A1") };
        assert_eq!(recognise(&device).unwrap().protocol, None);
    }

    #[test]
    fn of_several_cameras_one_must_be_named() {
        let cameras = ["A1", "B2"].map(|serial| (recognise(&camera(serial)).unwrap(), serial));
        assert_eq!(choose(&cameras, Some("B2")).unwrap().1, "B2");
        assert_eq!(choose(&cameras[..1], None).unwrap().1, "A1");
        let message = choose(&cameras, None).unwrap_err().to_string();
        assert!(message.contains("usb:A1, usb:B2"), "{message}");
        let message = choose(&cameras, Some("C3")).unwrap_err().to_string();
        assert!(message.contains("C3") && message.contains("usb:B2"), "{message}");
        let message = choose::<()>(&[], None).unwrap_err().to_string();
        assert!(message.contains("plugged in"), "{message}");
    }

    #[test]
    fn a_camera_that_no_longer_speaks_our_version_says_to_update_the_program() {
        check_version(version::MIN).unwrap();
        check_version(version::CURRENT).unwrap();
        let newer = check_version(version::CURRENT + 1).unwrap_err().to_string();
        assert!(newer.contains("update this program"), "{newer}");
    }

    #[test]
    fn a_missing_permission_names_the_command_for_people_and_for_services() {
        assert!(permission_hint(true).contains("sudo nirspi camera setup; "));
        assert!(permission_hint(true).contains("nirspi camera setup --group"));
        let error = UsbError::Permission { camera: "usb:A1".to_owned() }.to_string();
        assert!(error.starts_with("no permission to open usb:A1"), "{error}");
    }
}
