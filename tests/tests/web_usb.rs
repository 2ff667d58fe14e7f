//! The identity by which a page in a browser finds the camera on USB is the one that the camera has.

use nirspi_wire::usb;

#[test]
fn the_page_asks_for_the_camera_that_the_firmware_is() {
    let page = include_str!("../../host/web/page/usb.js");
    let camera = format!(
        "const CAMERA = {{ vendorId: {:#06x}, productId: {:#06x}, classCode: {:#04x}, subclassCode: {:#04x} }};",
        usb::VENDOR_ID,
        usb::PRODUCT_ID,
        usb::INTERFACE_CLASS,
        usb::INTERFACE_SUBCLASS,
    );
    assert!(page.contains(&camera), "expected {camera}");
    // WebUSB numbers endpoints without their direction.
    assert_eq!(usb::ENDPOINT_IN & 0x7F, usb::ENDPOINT_OUT);
    let endpoint = format!("const ENDPOINT = {};", usb::ENDPOINT_OUT);
    assert!(page.contains(&endpoint), "expected {endpoint}");
}
