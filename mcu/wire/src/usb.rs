//! USB identity. Vendor class (0xFF) with Microsoft OS 2.0 descriptors, so that no system needs a
//! driver.

use crate::version;

/// Vendor id of pid.codes, which lends product ids to open hardware.
pub const VENDOR_ID: u16 = 0x1209;
/// pid.codes' id for private testing. The id must be replaced by nirspi's own before hardware is
/// distributed.
pub const PRODUCT_ID: u16 = 0x0001;
/// Product name. Hosts also match the name, because other devices use the same testing id.
pub const PRODUCT: &str = "nirspi";
/// `iManufacturer`.
pub const MANUFACTURER: &str = "nirspi project";
/// Vendor-specific interface class.
pub const INTERFACE_CLASS: u8 = 0xFF;
/// `bInterfaceSubClass` of the camera interface.
pub const INTERFACE_SUBCLASS: u8 = 0x53;
/// `bInterfaceProtocol`: the oldest protocol version that the camera speaks. A host that speaks
/// this version or a newer one can greet the camera; the greeting settles the version of the
/// session.
pub const INTERFACE_PROTOCOL: u8 = version::MIN as u8;
/// Bulk OUT, host to device.
pub const ENDPOINT_OUT: u8 = 0x01;
/// Bulk IN, device to host.
pub const ENDPOINT_IN: u8 = 0x81;
/// `bMS_VendorCode` of the Microsoft OS 2.0 descriptor set.
pub const MS_OS_VENDOR_CODE: u8 = 0x20;
/// `bVendorCode` of WebUSB's platform capability.
pub const WEB_USB_VENDOR_CODE: u8 = 0x21;
/// `DeviceInterfaceGUIDs` under which Windows lists the camera.
pub const DEVICE_INTERFACE_GUID: &str = "{6E697273-7069-4E49-8001-00001550A032}";
