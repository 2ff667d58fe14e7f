//! A camera behind a serial port: a UART with an adapter, or the UART of QEMU.

use super::{Link, Received, is_hangup};
use serial2::{CharSize, FlowControl, Parity, SerialPort, Settings, StopBits};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Default speed of a serial link. USB serial ports ignore the speed.
pub const DEFAULT_BAUD: u32 = 115_200;
/// The longest time for sending a command.
const SEND_TIMEOUT: Duration = Duration::from_secs(5);

/// A serial port: 8 data bits, no parity, one stop bit, no flow control.
#[derive(Debug)]
pub struct SerialLink {
    port: SerialPort,
    timeout: Duration,
}

impl SerialLink {
    /// Opens the port and discards the bytes that it received before.
    ///
    /// # Errors
    /// If the port does not exist, may not be used, or cannot run at `baud` bits a second.
    pub fn open(path: &Path, baud: u32) -> io::Result<Self> {
        let mut port = SerialPort::open(path, |mut settings: Settings| {
            settings.set_raw();
            settings.set_char_size(CharSize::Bits8);
            settings.set_parity(Parity::None);
            settings.set_stop_bits(StopBits::One);
            settings.set_flow_control(FlowControl::None);
            settings.set_baud_rate(baud)?;
            Ok(settings)
        })?;
        port.set_write_timeout(SEND_TIMEOUT)?;
        port.discard_buffers()?;
        Ok(Self { port, timeout: Duration::ZERO })
    }
}

/// Whether the adapter was unplugged, or the other end of a pseudo-terminal closed.
fn has_gone(error: &io::Error) -> bool {
    // EIO, ENXIO and ENODEV have these numbers on Linux, macOS and the BSDs.
    is_hangup(error) || (cfg!(unix) && matches!(error.raw_os_error(), Some(5 | 6 | 19)))
}

impl Link for SerialLink {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.port.write_all(bytes).map_err(|error| {
            if has_gone(&error) { io::Error::new(io::ErrorKind::BrokenPipe, error) } else { error }
        })
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<Received> {
        if timeout != self.timeout {
            self.port.set_read_timeout(timeout)?;
            self.timeout = timeout;
        }
        match self.port.read(buffer) {
            // The port was readable, so no more bytes will arrive.
            Ok(0) => Ok(Received::Closed),
            Ok(bytes) => Ok(Received::Bytes(bytes)),
            Err(error) if has_gone(&error) => Ok(Received::Closed),
            Err(error) => match error.kind() {
                io::ErrorKind::WouldBlock
                | io::ErrorKind::TimedOut
                | io::ErrorKind::Interrupted => Ok(Received::Nothing),
                _ => Err(error),
            },
        }
    }
}

/// Serial ports that may lead to a camera, by name. No port is opened, because the device behind a
/// port is unknown.
///
/// # Errors
/// If the system does not list its ports.
pub fn serial_ports() -> io::Result<Vec<PathBuf>> {
    let mut ports = SerialPort::available_ports()?;
    ports.retain(|port| could_be_a_camera(port));
    ports.sort();
    Ok(ports)
}

/// Excludes UARTs of the mainboard (`ttyS0` to `ttyS31` are always listed), modems and Bluetooth.
/// macOS has two names for each port; the name that waits for a carrier is excluded.
fn could_be_a_camera(port: &Path) -> bool {
    let name = port.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let kinds = ["ttyUSB", "ttyACM", "ttyAMA", "cu.usb", "cuaU", "COM"];
    kinds.iter().any(|kind| name.starts_with(kind))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mainboard_ports_and_bluetooth_are_no_cameras() {
        let camera = |name: &str| could_be_a_camera(Path::new(name));
        for name in ["/dev/ttyUSB0", "/dev/ttyACM3", "/dev/cu.usbmodem14201", "COM7"] {
            assert!(camera(name), "{name}");
        }
        for name in ["/dev/ttyS0", "/dev/rfcomm0", "/dev/cu.Bluetooth-Incoming-Port", "/dev/tty"] {
            assert!(!camera(name), "{name}");
        }
    }

    #[test]
    fn a_port_that_is_not_there_is_not_found() {
        let error = SerialLink::open(Path::new("/dev/no-such-port"), DEFAULT_BAUD).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::NotFound);
    }
}
