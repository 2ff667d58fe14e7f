//! The camera as a USB device: one vendor interface with a bulk endpoint each way, no driver on any system.
//!
//! ```text
//! device ── Microsoft OS 2.0: WINUSB, interface GUID; BOS: WebUSB
//!  └ interface 0: class 0xFF, protocol = version of the wire protocol
//!     ├ bulk OUT 0x01, 512 bytes: commands
//!     └ bulk IN  0x81, 512 bytes: replies, events, frames
//! ```
//!
//! Replies, events and frames are merged into full packets where the processor copies them for the chip's
//! driver. Where the driver reads memory by DMA, each of them is one transfer, which the core cuts into
//! packets.
//!
//! On a full-speed bus the packets have 64 bytes ([`Speeds`]).
//!
//! # Invariant
//! A session lasts as long as the USB configuration. A reset, another configuration or a suspend
//! ends the session, and with it the light
//! (`tests::a_session_lasts_from_configuration_to_suspend_reset_or_another_configuration`). So does
//! a host that fetches nothing for five seconds
//! (`tests::stuck::a_host_that_stops_reading_ends_its_session_and_the_light`). A pulled cable looks
//! like a suspend to a board with its own supply.
#![no_std]

#[cfg(test)]
extern crate std;

mod serve;
mod speeds;

#[cfg(test)]
mod tests;

use embassy_futures::select::{Either, select};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Timer};
use embassy_usb::descriptor::capability_type;
use embassy_usb::driver::{Driver, EndpointAddress};
use embassy_usb::msos::{self, PropertyData};
use embassy_usb::{Builder, Config, Handler, UsbDevice};
use nirspi_wire::{Version, usb};

pub use serve::{ToHost, serve};
pub use speeds::{BusSpeed, Speeds};

/// Size of a high-speed bulk packet in bytes (USB 2.0, 5.8.3).
pub const PACKET_BYTES: usize = 512;

/// The driver's memory for packets from the host: one bulk packet and one control packet, where the DMA
/// of a USB core can write them.
#[repr(C, align(4))]
pub struct OutBuffer(pub [u8; PACKET_BYTES + CONTROL_BYTES]);

impl OutBuffer {
    /// Memory without packets.
    #[must_use]
    pub const fn new() -> Self {
        Self([0; _])
    }
}

impl Default for OutBuffer {
    fn default() -> Self {
        Self::new()
    }
}

const CONTROL_BYTES: usize = 64;

/// How long the device stays off the bus when the link is stuck. A host sees a device that is gone
/// for 100 ms, however slow its hub is.
const AWAY: Duration = Duration::from_millis(100);

/// Fields of the device descriptor.
fn identity(serial: &'static str, firmware: Version) -> Config<'static> {
    let mut config = Config::new(usb::VENDOR_ID, usb::PRODUCT_ID);
    config.manufacturer = Some(usb::MANUFACTURER);
    config.product = Some(usb::PRODUCT);
    config.serial_number = Some(serial);
    config.device_release = bcd(firmware);
    // The device has one interface, and the interface states its own class.
    config.device_class = 0;
    config.device_sub_class = 0;
    config.device_protocol = 0;
    config.composite_with_iads = false;
    config.max_packet_size_0 = CONTROL_BYTES as u8;
    config.self_powered = true;
    config
}

/// `bcdDevice`: two digits of the major version, one digit each of minor and patch.
fn bcd(Version(major, minor, patch): Version) -> u16 {
    let major = u16::from(major / 10 % 10) << 4 | u16::from(major % 10);
    major << 8 | u16::from(minor.min(9)) << 4 | u16::from(patch.min(9))
}

/// Platform capability of WebUSB 1.0 (WebUSB, 5.1), without a landing page.
const WEB_USB: [u8; 21] = {
    // {3408b638-09a9-47a0-8bfd-a0768815b665}, after a reserved byte.
    let uuid = [
        0x00, 0x38, 0xB6, 0x08, 0x34, 0xA9, 0x09, 0xA0, 0x47, 0x8B, 0xFD, 0xA0, 0x76, 0x88, 0x15,
        0xB6, 0x65,
    ];
    let mut capability = [0; 21];
    let (head, tail) = capability.split_at_mut(uuid.len());
    head.copy_from_slice(&uuid);
    tail.copy_from_slice(&[0x00, 0x01, usb::WEB_USB_VENDOR_CODE, 0]);
    capability
};

/// The device's memory, which must live as long as the device.
pub struct Memory {
    configuration: [u8; 64],
    bos: [u8; 96],
    msos: [u8; 192],
    control: [u8; CONTROL_BYTES],
    watch: Watch,
}

impl Memory {
    /// Unused memory.
    #[must_use]
    pub const fn new(presence: &'static Presence) -> Self {
        Self {
            configuration: [0; 64],
            bos: [0; 96],
            msos: [0; 192],
            control: [0; CONTROL_BYTES],
            watch: Watch { presence, session: 0, configured: false, suspended: false },
        }
    }
}

/// What the device and [`serve`] tell each other.
pub struct Presence {
    /// Number of the session that the host may have now, if any. Each configuration and each resume
    /// begins another session.
    session: Signal<NoopRawMutex, Option<u32>>,
    /// The link is stuck: leave the bus and come back.
    leave: Signal<NoopRawMutex, ()>,
}

impl Presence {
    /// No host, and nothing to say.
    #[must_use]
    pub const fn new() -> Self {
        Self { session: Signal::new(), leave: Signal::new() }
    }
}

impl Default for Presence {
    fn default() -> Self {
        Self::new()
    }
}

struct Watch {
    presence: &'static Presence,
    session: u32,
    configured: bool,
    suspended: bool,
}

impl Watch {
    fn tell(&mut self) {
        let there = self.configured && !self.suspended;
        self.session = self.session.wrapping_add(1);
        self.presence.session.signal(there.then_some(self.session));
    }
}

impl Handler for Watch {
    fn enabled(&mut self, _enabled: bool) {
        self.configured = false;
        self.suspended = false;
        self.tell();
    }

    fn reset(&mut self) {
        self.configured = false;
        self.suspended = false;
        self.tell();
    }

    fn configured(&mut self, configured: bool) {
        self.configured = configured;
        self.tell();
    }

    fn suspended(&mut self, suspended: bool) {
        self.suspended = suspended;
        self.tell();
    }
}

/// The endpoints, for [`serve`].
pub struct Endpoints<D: Driver<'static>> {
    from_host: D::EndpointOut,
    to_host: D::EndpointIn,
    presence: &'static Presence,
}

/// The device on the bus.
pub struct Device<D>
where
    D: Driver<'static>,
    D::ControlPipe: BusSpeed,
{
    usb: UsbDevice<'static, Speeds<D>>,
    presence: &'static Presence,
}

impl<D> Device<D>
where
    D: Driver<'static>,
    D::ControlPipe: BusSpeed,
{
    /// Answers the host's control requests for ever, and leaves the bus for a moment when [`serve`]
    /// finds the link stuck.
    pub async fn run(&mut self) -> ! {
        loop {
            match select(self.usb.run(), self.presence.leave.wait()).await {
                Either::First(never) => never,
                Either::Second(()) => {
                    self.usb.disable().await;
                    Timer::after(AWAY).await;
                }
            }
        }
    }
}

/// Builds the device. A board awaits the first's [`run`](Device::run), and [`serve`] of the second.
pub fn device<D>(
    driver: D,
    serial: &'static str,
    firmware: Version,
    memory: &'static mut Memory,
) -> (Device<D>, Endpoints<D>)
where
    D: Driver<'static>,
    D::ControlPipe: BusSpeed,
{
    let Memory { configuration, bos, msos, control, watch } = memory;
    let presence = watch.presence;
    let config = identity(serial, firmware);
    let driver = Speeds(driver);
    let mut builder = Builder::new(driver, config, configuration, bos, msos, control);
    builder.msos_descriptor(msos::windows_version::WIN8_1, usb::MS_OS_VENDOR_CODE);
    builder.msos_feature(msos::CompatibleIdFeatureDescriptor::new("WINUSB", ""));
    builder.msos_feature(msos::RegistryPropertyFeatureDescriptor::new(
        "DeviceInterfaceGUIDs",
        PropertyData::RegMultiSz(&[usb::DEVICE_INTERFACE_GUID]),
    ));
    builder.handler(watch);

    let [class, subclass, protocol] =
        [usb::INTERFACE_CLASS, usb::INTERFACE_SUBCLASS, usb::INTERFACE_PROTOCOL];
    let mut function = builder.function(class, subclass, protocol);
    let mut interface = function.interface();
    let mut setting = interface.alt_setting(class, subclass, protocol, None);
    setting.bos_capability(capability_type::PLATFORM, &WEB_USB);
    let address = |address: u8| Some(EndpointAddress::from(address));
    let packet_bytes = PACKET_BYTES as u16;
    let from_host = setting.endpoint_bulk_out(address(usb::ENDPOINT_OUT), packet_bytes);
    let to_host = setting.endpoint_bulk_in(address(usb::ENDPOINT_IN), packet_bytes);
    drop(function);
    (Device { usb: builder.build(), presence }, Endpoints { from_host, to_host, presence })
}
