//! The bytes that protocol version 3 has added, frozen.
//!
//! If a test in this file fails, do not change the test: the change would lock out every camera and every recording of
//! version 3.

use super::bytes::{holds, packet, samples, unhex};
use nirspi_wire::{
    Answer, Capabilities, Channel, DeviceMessage, Frame, FrameFlags, Identity, Reply, Tail,
    Version, open,
};

/// Every message that is new, and the greeting with its tails.
pub fn device_messages() -> Vec<(DeviceMessage<'static>, &'static str)> {
    vec![
        (
            greeting(Tail(Some(Capabilities::DEPTH)), Tail(Some(3))),
            "00 01 00 00 03 01 02 03 00 01 02 01 62 01 73 20 c0 b2 cd 3b 0e 8e 0c 01 03",
        ),
        (
            DeviceMessage::Channel(Channel {
                detector: 2,
                frame: Frame {
                    run: 1,
                    sequence: 300,
                    device_time_us: 40,
                    sweeps: 1,
                    flags: FrameFlags::DIFFERENTIAL,
                    samples: samples(&[1, -1]),
                },
            }),
            "06 02 01 ac 02 28 01 10 00 08 01 00 00 00 ff ff ff ff",
        ),
    ]
}

fn greeting(capabilities: Tail<Capabilities>, detectors: Tail<u8>) -> DeviceMessage<'static> {
    let identity = Identity {
        protocol: 3,
        firmware: Version(1, 2, 3),
        gateware: Version(0, 1, 2),
        board: "b",
        serial: "s",
        side: 32,
        adc_hz: 125_000_000,
        adc_bits: 14,
        wavelength_nm: 1550,
        capabilities,
        detectors,
    };
    DeviceMessage::Reply(Reply { id: 1, outcome: Ok(Answer::Hello(identity)) })
}

#[test]
fn device_messages_have_these_bytes() {
    for (message, payload) in device_messages() {
        holds(&message, &mut packet(&unhex(payload)));
    }
}

#[test]
fn each_tail_may_be_the_last_one() {
    let whole = device_messages()[0].1;
    let without_detectors = &whole[..whole.len() - " 03".len()];
    let capabilities = Tail(Some(Capabilities::DEPTH));
    holds(&greeting(capabilities, Tail(None)), &mut packet(&unhex(without_detectors)));
    let without_both = &without_detectors[..without_detectors.len() - " 01".len()];
    holds(&greeting(Tail(None), Tail(None)), &mut packet(&unhex(without_both)));
}

#[test]
fn a_tail_of_a_later_version_is_passed_over() {
    let (message, payload) = device_messages()[0];
    let mut longer = packet(&unhex(&format!("{payload} 2a 07 ff")));
    let encoded = longer.split_last_mut().unwrap().1;
    assert_eq!(open::<DeviceMessage<'_>>(encoded), Ok(message));
}

#[test]
fn the_frame_of_a_message_comes_with_its_detector() {
    let [(greeting, _), (channel, _)] = device_messages()[..] else { panic!("two messages") };
    assert_eq!(greeting.frame(), None);
    let (detector, frame) = channel.frame().unwrap();
    assert_eq!((detector, frame.sequence), (2, 300));
    assert_eq!(DeviceMessage::Frame(*frame).frame(), Some((0, frame)));
}
