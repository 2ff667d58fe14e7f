//! Two speeds: a host's port may run at full speed only, as behind an old hub.
//!
//! embassy-usb has one set of descriptors. So this driver stands between embassy-usb and the chip's
//! driver: it changes the packet sizes in the configuration descriptor to those of the bus, and
//! answers the request for the configuration at the other speed (USB 2.0, 9.6.4), which embassy-usb
//! refuses. The chip's driver sends packets of the size that the speed allows.

use crate::PACKET_BYTES;
use embassy_usb::driver::{
    ControlPipe, Driver, EndpointAddress, EndpointAllocError, EndpointError, EndpointType,
};

/// Size of a full-speed bulk packet in bytes (USB 2.0, 5.8.3).
const FULL_SPEED_PACKET_BYTES: usize = 64;

/// `GET_DESCRIPTOR` of the device (USB 2.0, table 9-4).
const GET_DESCRIPTOR: [u8; 2] = [0x80, 6];
/// Types of descriptors (USB 2.0, table 9-5).
const CONFIGURATION: u8 = 2;
const ENDPOINT: u8 = 5;
const OTHER_SPEED_CONFIGURATION: u8 = 7;

/// Longest answer in one packet of a control transfer.
const CONTROL_BYTES: usize = crate::CONTROL_BYTES;

/// A control pipe that knows the speed of its bus.
pub trait BusSpeed {
    /// Whether the host and the device have agreed on full speed.
    fn is_full_speed(&self) -> bool;
}

impl BusSpeed for embassy_usb_synopsys_otg::ControlPipe<'_> {
    fn is_full_speed(&self) -> bool {
        Self::is_full_speed(self)
    }
}

/// A driver whose configuration descriptors are those of the bus's speed.
pub struct Speeds<D>(pub(crate) D);

impl<D> Driver<'static> for Speeds<D>
where
    D: Driver<'static>,
    D::ControlPipe: BusSpeed,
{
    type EndpointOut = D::EndpointOut;
    type EndpointIn = D::EndpointIn;
    type ControlPipe = Pipe<D::ControlPipe>;
    type Bus = D::Bus;

    fn alloc_endpoint_out(
        &mut self,
        ep_type: EndpointType,
        ep_addr: Option<EndpointAddress>,
        max_packet_size: u16,
        interval_ms: u8,
    ) -> Result<Self::EndpointOut, EndpointAllocError> {
        self.0.alloc_endpoint_out(ep_type, ep_addr, max_packet_size, interval_ms)
    }

    fn alloc_endpoint_in(
        &mut self,
        ep_type: EndpointType,
        ep_addr: Option<EndpointAddress>,
        max_packet_size: u16,
        interval_ms: u8,
    ) -> Result<Self::EndpointIn, EndpointAllocError> {
        self.0.alloc_endpoint_in(ep_type, ep_addr, max_packet_size, interval_ms)
    }

    fn start(self, control_max_packet_size: u16) -> (Self::Bus, Self::ControlPipe) {
        let (bus, inner) = self.0.start(control_max_packet_size);
        (bus, Pipe { inner, asked: None })
    }
}

/// The control pipe of [`Speeds`].
pub struct Pipe<P> {
    inner: P,
    /// Type of the configuration descriptor that the host has asked for.
    asked: Option<u8>,
}

impl<P: ControlPipe + BusSpeed> ControlPipe for Pipe<P> {
    fn max_packet_size(&self) -> usize {
        self.inner.max_packet_size()
    }

    async fn setup(&mut self) -> [u8; 8] {
        let mut request = self.inner.setup().await;
        let [kind, code, _, descriptor, ..] = &mut request;
        self.asked = None;
        if [*kind, *code] == GET_DESCRIPTOR
            && matches!(*descriptor, CONFIGURATION | OTHER_SPEED_CONFIGURATION)
        {
            self.asked = Some(*descriptor);
            // Both are one descriptor to embassy-usb.
            *descriptor = CONFIGURATION;
        }
        request
    }

    async fn data_out(
        &mut self,
        buf: &mut [u8],
        first: bool,
        last: bool,
    ) -> Result<usize, EndpointError> {
        self.inner.data_out(buf, first, last).await
    }

    async fn data_in(&mut self, data: &[u8], first: bool, last: bool) -> Result<(), EndpointError> {
        let mut bytes = [0; CONTROL_BYTES];
        match (self.asked, bytes.get_mut(..data.len())) {
            // The whole descriptor is in the first packet (`tests::all_descriptors_fit_their_memory`).
            (Some(asked), Some(bytes)) if first => {
                bytes.copy_from_slice(data);
                let is_other = asked == OTHER_SPEED_CONFIGURATION;
                fit(bytes, asked, self.inner.is_full_speed() != is_other);
                self.inner.data_in(bytes, first, last).await
            }
            _ => self.inner.data_in(data, first, last).await,
        }
    }

    async fn accept(&mut self) {
        self.inner.accept().await;
    }

    async fn reject(&mut self) {
        self.inner.reject().await;
    }

    async fn accept_set_address(&mut self, addr: u8) {
        self.inner.accept_set_address(addr).await;
    }
}

/// Sets the type of a configuration descriptor and the packet sizes of its endpoints. The
/// descriptor may be cut anywhere.
fn fit(bytes: &mut [u8], kind: u8, full_speed: bool) {
    let packet_bytes = if full_speed { FULL_SPEED_PACKET_BYTES } else { PACKET_BYTES } as u16;
    if let Some(place) = bytes.get_mut(1) {
        *place = kind;
    }
    let mut rest = bytes;
    while let Some(length) = rest.first().map(|&length| usize::from(length)).filter(|&n| n > 0) {
        let (descriptor, next) = rest.split_at_mut(length.min(rest.len()));
        if descriptor.get(1) == Some(&ENDPOINT)
            && let Some(size) = descriptor.get_mut(4..)
        {
            size.iter_mut().zip(packet_bytes.to_le_bytes()).for_each(|(to, byte)| *to = byte);
        }
        rest = next;
    }
}
