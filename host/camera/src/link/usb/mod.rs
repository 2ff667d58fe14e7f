//! A camera on USB, through `nusb`, which needs no driver and no system library.
//!
//! [`identify`] decides which device to use, and [`transfers`] makes a byte stream of bulk
//! transfers. Both are tested without a bus. The rest of this module connects them to `nusb` and
//! **has not been tested with hardware yet**.

pub mod identify;
pub mod transfers;

pub use identify::{UsbCamera, UsbError};

use super::{Link, Received};
use identify::{DeviceId, InterfaceId, check_version, choose, recognise};
use nirspi_wire::usb::{ENDPOINT_IN, ENDPOINT_OUT};
use nusb::transfer::{Buffer, Bulk, BulkOrInterrupt, EndpointDirection, In, Out, TransferError};
use nusb::{DeviceInfo, ErrorKind, MaybeFuture};
use std::io;
use std::time::{Duration, Instant};
use transfers::{Endpoint, InStream, TRANSFER_BYTES, TRANSFERS, TransferProblem};

/// How long to wait for a permission: udev grants access some moments after a device was connected.
const PERMISSION_PATIENCE: Duration = Duration::from_secs(2);
/// The first pause between two attempts. Each later pause is twice as long.
const FIRST_PAUSE: Duration = Duration::from_millis(50);

/// The connected cameras on USB, with their devices.
fn listed() -> io::Result<Vec<(UsbCamera, DeviceInfo)>> {
    /// "No such file or folder": the kernel, or the container, has no USB.
    const ENOENT: u32 = 2;
    let devices = match nusb::list_devices().wait() {
        Ok(devices) => devices,
        Err(error) if cfg!(target_os = "linux") && error.os_error() == Some(ENOENT) => {
            return Ok(Vec::new());
        }
        Err(error) => return Err(error.into()),
    };
    Ok(devices.filter_map(|device| Some((recognise(&device_id(&device))?, device))).collect())
}

/// The connected cameras on USB. No camera is opened.
///
/// # Errors
/// If the system does not list its devices.
pub fn usb_cameras() -> io::Result<Vec<UsbCamera>> {
    Ok(listed()?.into_iter().map(|(camera, _)| camera).collect())
}

fn device_id(device: &DeviceInfo) -> DeviceId {
    DeviceId {
        vendor: device.vendor_id(),
        product: device.product_id(),
        name: device.product_string().map(str::to_owned),
        serial: device.serial_number().map(str::to_owned),
        interfaces: device
            .interfaces()
            .map(|interface| InterfaceId {
                number: interface.interface_number(),
                class: interface.class(),
                subclass: interface.subclass(),
                protocol: interface.protocol(),
            })
            .collect(),
    }
}

/// A camera on USB. The link holds the camera's interface for as long as the link lives.
pub struct UsbLink {
    incoming: InStream<nusb::Endpoint<Bulk, In>>,
    outgoing: nusb::Endpoint<Bulk, Out>,
}

impl UsbLink {
    /// Opens the camera with this serial number, or the only camera.
    ///
    /// # Errors
    /// [`UsbError`], which says what to do.
    pub fn open(serial: Option<&str>) -> Result<Self, UsbError> {
        let cameras = listed()?;
        let (camera, info) = choose(&cameras, serial)?;
        if let Some(protocol) = camera.protocol {
            check_version(protocol)?;
        }
        let name = camera.to_string();
        let problem = |error: nusb::Error| match error.kind() {
            ErrorKind::PermissionDenied => UsbError::Permission { camera: name.clone() },
            ErrorKind::Busy => UsbError::Busy { camera: name.clone() },
            _ => UsbError::Io(error.into()),
        };
        let device = patiently(|| info.open().wait()).map_err(&problem)?;
        let configuration = device.active_configuration().map_err(|e| problem(e.into()))?;
        let interface = configuration
            .interface_alt_settings()
            .map(|interface| InterfaceId {
                number: interface.interface_number(),
                class: interface.class(),
                subclass: interface.subclass(),
                protocol: interface.protocol(),
            })
            .find(InterfaceId::is_camera)
            .ok_or_else(|| UsbError::NoInterface { camera: name.clone() })?;
        check_version(interface.protocol.into())?;
        let claimed = device.claim_interface(interface.number).wait().map_err(&problem)?;
        let incoming = claimed.endpoint::<Bulk, In>(ENDPOINT_IN).map_err(&problem)?;
        let outgoing = claimed.endpoint::<Bulk, Out>(ENDPOINT_OUT).map_err(&problem)?;
        let buffers: Vec<Buffer> =
            (0..TRANSFERS).map(|_| incoming.allocate(TRANSFER_BYTES)).collect();
        Ok(Self { incoming: InStream::new(incoming, buffers), outgoing })
    }
}

/// Tries again with growing pauses until the system grants access to the device.
fn patiently<T>(mut open: impl FnMut() -> Result<T, nusb::Error>) -> Result<T, nusb::Error> {
    let deadline = Instant::now() + PERMISSION_PATIENCE;
    let mut pause = FIRST_PAUSE;
    loop {
        match open() {
            Err(error)
                if error.kind() == ErrorKind::PermissionDenied
                    && Instant::now() + pause < deadline =>
            {
                std::thread::sleep(pause);
                pause *= 2;
            }
            other => return other,
        }
    }
}

impl Link for UsbLink {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        transfers::send(&mut self.outgoing, bytes.to_vec().into())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<Received> {
        self.incoming.receive(buffer, timeout)
    }
}

impl<Dir: EndpointDirection> Endpoint for nusb::Endpoint<Bulk, Dir>
where
    Bulk: BulkOrInterrupt,
{
    type Buffer = Buffer;

    fn submit(&mut self, buffer: Buffer) {
        Self::submit(self, buffer);
    }

    fn pending(&self) -> usize {
        Self::pending(self)
    }

    fn complete(&mut self, timeout: Duration) -> Option<(Buffer, Result<(), TransferProblem>)> {
        let completion = self.wait_next_complete(timeout)?;
        let outcome = completion.status.map_err(|error| match error {
            TransferError::Cancelled => TransferProblem::Cancelled,
            TransferError::Stall => TransferProblem::Stalled,
            TransferError::Disconnected => TransferProblem::Gone,
            error => TransferProblem::Other(error.to_string()),
        });
        Some((completion.buffer, outcome))
    }

    fn cancel_all(&mut self) {
        Self::cancel_all(self);
    }

    fn clear_halt(&mut self) -> io::Result<()> {
        Ok(Self::clear_halt(self).wait()?)
    }
}
