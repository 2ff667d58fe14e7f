//! Tests of what a host sees of the device, with requests as hosts make them, over a simulated bus.

mod dma;
mod fake;
mod faults;
mod otg_core;
mod ring;
mod speeds;
mod stuck;
mod unplug;
mod world;

use super::*;
use embassy_usb::driver::Event;
use fake::{FakeDriver, Wire};
use std::boxed::Box;
use std::string::String;
use std::vec::Vec;

const SERIAL: &str = "0123456789ABCDEF01234567";

/// A device after its first reset.
struct Bench {
    wire: Wire,
    presence: &'static Presence,
    device: Device<FakeDriver>,
}

impl Bench {
    fn new() -> Self {
        let wire = Wire::default();
        let presence: &'static Presence = Box::leak(Box::new(Presence::new()));
        let memory = Box::leak(Box::new(Memory::new(presence)));
        let driver = FakeDriver(wire.clone());
        let (device, _endpoints) = device(driver, SERIAL, Version(1, 2, 3), memory);
        let mut bench = Self { wire, presence, device };
        bench.after(Event::PowerDetected);
        bench.after(Event::Reset);
        bench
    }

    fn after(&mut self, event: Event) -> Option<Option<u32>> {
        self.wire.happen(event);
        self.run();
        self.presence.session.try_take()
    }

    fn run(&mut self) {
        let running = core::pin::pin!(self.device.run());
        assert!(embassy_futures::poll_once(running).is_pending());
    }

    /// Data of a control transfer to the host; `None` if it is refused.
    fn ask(&mut self, request_type: u8, request: u8, value: u16, index: u16) -> Option<Vec<u8>> {
        self.wire.ask(request_type, request, value, index, 0xFFFF);
        self.run();
        self.wire.answer()
    }

    fn descriptor(&mut self, kind: u8, index: u8) -> Vec<u8> {
        self.ask(0x80, 6, u16::from(kind) << 8 | u16::from(index), 0).expect("a descriptor")
    }

    fn string(&mut self, index: u8) -> String {
        let descriptor = self.ask(0x80, 6, 0x300 | u16::from(index), 0x409).expect("a string");
        utf16(&descriptor[2..])
    }

    fn configure(&mut self, configuration: u16) -> Option<Option<u32>> {
        self.wire.ask(0x00, 9, configuration, 0, 0);
        self.run();
        self.presence.session.try_take()
    }
}

fn utf16(bytes: &[u8]) -> String {
    let units: Vec<u16> =
        bytes.chunks(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect();
    String::from_utf16(&units).unwrap()
}

#[test]
fn the_device_names_itself_with_the_contracts_ids() {
    let mut bench = Bench::new();
    let device = bench.descriptor(1, 0);
    assert_eq!(device.len(), 18);
    assert!(u16::from_le_bytes([device[2], device[3]]) >= 0x0201, "hosts ask for BOS from 2.01 on");
    assert_eq!(&device[4..8], &[0, 0, 0, 64], "the interface says its class");
    assert_eq!(u16::from_le_bytes([device[8], device[9]]), usb::VENDOR_ID);
    assert_eq!(u16::from_le_bytes([device[10], device[11]]), usb::PRODUCT_ID);
    assert_eq!(u16::from_le_bytes([device[12], device[13]]), 0x0123, "firmware 1.2.3");
    let [manufacturer, product, serial] = [14, 15, 16].map(|field| bench.string(device[field]));
    assert_eq!((&*manufacturer, &*product, &*serial), (usb::MANUFACTURER, usb::PRODUCT, SERIAL));
}

#[test]
fn the_interface_carries_the_protocol_version_and_two_bulk_endpoints() {
    let configuration = Bench::new().descriptor(2, 0);
    assert_eq!(usize::from(configuration[2]), configuration.len());
    let expected = [
        [9, 4, 0, 0, 2, 0xFF, usb::INTERFACE_SUBCLASS, usb::INTERFACE_PROTOCOL, 0].as_slice(),
        &[7, 5, usb::ENDPOINT_OUT, 2, 0x00, 0x02, 0],
        &[7, 5, usb::ENDPOINT_IN, 2, 0x00, 0x02, 0],
    ];
    assert_eq!(&configuration[9..], expected.concat());
}

#[test]
fn windows_is_told_to_bind_winusb_and_under_which_name() {
    let mut bench = Bench::new();
    let capabilities = bench.descriptor(15, 0);
    // {D8DD60DF-4589-4CC7-9CD2-659D9E648A9F}, from Microsoft's OS 2.0 descriptors specification.
    let uuid = [
        0xDF, 0x60, 0xDD, 0xD8, 0x89, 0x45, 0xC7, 0x4C, 0x9C, 0xD2, 0x65, 0x9D, 0x9E, 0x64, 0x8A,
        0x9F,
    ];
    let at = capabilities.windows(16).position(|window| window == uuid).expect("the capability");
    let rest = &capabilities[at + 16..];
    assert_eq!(rest[6], usb::MS_OS_VENDOR_CODE);
    let length = u16::from_le_bytes([rest[4], rest[5]]);

    let set = bench.ask(0xC0, usb::MS_OS_VENDOR_CODE, 0, 7).expect("the descriptor set");
    assert_eq!(set.len(), usize::from(length));
    assert!(set.windows(8).any(|window| window == b"WINUSB\0\0"));
    let guid: Vec<u8> =
        usb::DEVICE_INTERFACE_GUID.encode_utf16().flat_map(u16::to_le_bytes).collect();
    assert!(set.windows(guid.len()).any(|window| window == guid));
    // Features of the whole device only; features of a function are for composite devices.
    let kinds: Vec<u16> = descriptors(&set).map(|d| u16::from_le_bytes([d[2], d[3]])).collect();
    assert_eq!(kinds, [0, 3, 4]);
}

/// Each begins with its length.
fn descriptors(mut set: &[u8]) -> impl Iterator<Item = &[u8]> {
    core::iter::from_fn(move || {
        let length = u16::from_le_bytes([*set.first()?, *set.get(1)?]);
        let (found, rest) = set.split_at(length.into());
        set = rest;
        Some(found)
    })
}

#[test]
fn browsers_are_told_that_they_may_ask_for_it() {
    let capabilities = Bench::new().descriptor(15, 0);
    assert_eq!(usize::from(capabilities[2]), capabilities.len());
    let expected = [&[24, 16, 5], WEB_USB.as_slice()].concat();
    assert!(capabilities.windows(24).any(|window| window == expected));
    let [.., version_low, version_high, vendor_code, page] = WEB_USB;
    assert_eq!((version_low, version_high, page), (0x00, 0x01, 0), "1.0, no landing page");
    assert_eq!(vendor_code, usb::WEB_USB_VENDOR_CODE);
    assert_ne!(vendor_code, usb::MS_OS_VENDOR_CODE);
}

#[test]
fn all_descriptors_fit_their_memory() {
    let report = Bench::new().device.usb.buffer_usage();
    let memory: [usize; 3] = [64, 96, 192];
    let used =
        [report.config_descriptor_used, report.bos_descriptor_used, report.msos_descriptor_used];
    assert!(used.iter().zip(memory).all(|(used, memory)| *used <= memory), "{used:?}");
    assert!(report.config_descriptor_used <= CONTROL_BYTES, "one packet: {used:?}");
}

#[test]
fn a_session_lasts_from_configuration_to_suspend_reset_or_another_configuration() {
    let mut bench = Bench::new();
    let first = bench.configure(1).expect("news").expect("a session");
    assert_eq!(bench.after(Event::Suspend), Some(None), "the cable, or a host asleep");
    let second = bench.after(Event::Resume).expect("news").expect("a session");
    assert_eq!(bench.after(Event::Reset), Some(None));
    assert_eq!(bench.after(Event::Resume), Some(None), "not configured");
    let third = bench.configure(1).expect("news").expect("a session");
    assert_eq!(bench.configure(0), Some(None));
    let fourth = bench.configure(1).expect("news").expect("a session");
    assert_eq!(bench.after(Event::PowerRemoved), Some(None));
    assert!([first, second, third, fourth].is_sorted_by(|a, b| a < b), "none is taken for another");
}

#[test]
fn device_releases_are_binary_coded_decimals() {
    for (version, release) in
        [(Version(0, 1, 0), 0x0010), (Version(12, 3, 4), 0x1234), (Version(99, 12, 250), 0x9999)]
    {
        assert_eq!(bcd(version), release);
    }
}
