//! The bytes that protocol version 2 has added, frozen.
//!
//! If a test in this file fails, do not change the test: the change would lock out every camera and every recording of
//! version 2.

use super::bytes::{holds, packet, unhex};
use nirspi_wire::packet::{request_id, unseal};
use nirspi_wire::{
    Answer, Capabilities, DeviceMessage, Event, EventKind, Identity, Refusal, Reply, Request,
    Signal, State, Status, Tail, Version, open,
};

/// Every message that is new, and the greeting with its tail.
pub fn device_messages() -> Vec<(DeviceMessage<'static>, &'static str)> {
    let capabilities = Capabilities::DEPTH.with(Capabilities::BOOTLOADER);
    vec![
        (
            greeting(Tail(Some(capabilities))),
            "00 01 00 00 02 01 02 03 00 01 02 01 62 01 73 20 c0 b2 cd 3b 0e 8e 0c 05",
        ),
        (DeviceMessage::Reply(Reply { id: 300, outcome: Err(Refusal::Unknown) }), "00 ac 02 01 0a"),
        (
            DeviceMessage::Event(Event {
                device_time_us: 4_000,
                kind: EventKind::FpgaAccessesDamaged { total: 300 },
            }),
            "04 a0 1f 04 ac 02",
        ),
        (status(Some(None)), "00 07 00 02 01 00 00 00 00 00 00 00 00 00 c4 13 f4 03 00 01 00"),
        (
            status(Some(Some(Signal {
                mean_milli_counts: 8_192_000,
                signal_milli_counts: 1_000,
                noise_milli_counts: 10,
                snr_centi_db: -150,
                over_range_ppm: 3,
            }))),
            "00 07 00 02 01 00 00 00 00 00 00 00 00 00 c4 13 f4 03 00 01 01 80 80 f4 03 e8 07 0a ab 02 03",
        ),
    ]
}

fn greeting(capabilities: Tail<Capabilities>) -> DeviceMessage<'static> {
    let identity = Identity {
        protocol: 2,
        firmware: Version(1, 2, 3),
        gateware: Version(0, 1, 2),
        board: "b",
        serial: "s",
        side: 32,
        adc_hz: 125_000_000,
        adc_bits: 14,
        wavelength_nm: 1550,
        capabilities,
    };
    DeviceMessage::Reply(Reply { id: 1, outcome: Ok(Answer::Hello(identity)) })
}

fn status(signal: Option<Option<Signal>>) -> DeviceMessage<'static> {
    let status = Status {
        state: State::Configured,
        fault: None,
        uptime_us: 0,
        run: 0,
        frames_made: 0,
        frames_sent: 0,
        frames_dropped: 0,
        fpga_frames_lost: 0,
        fpga_frames_corrupt: 0,
        commands_damaged: 0,
        temperature_centi_celsius: 1_250,
        duty_permille: 500,
        leds_on: false,
        interlock_closed: true,
        signal: Tail(signal),
    };
    DeviceMessage::Reply(Reply { id: 7, outcome: Ok(Answer::Status(status)) })
}

#[test]
fn device_messages_have_these_bytes() {
    for (message, payload) in device_messages() {
        holds(&message, &mut packet(&unhex(payload)));
    }
}

#[test]
fn an_absent_tail_has_no_bytes() {
    let whole = device_messages()[0].1;
    let without = &whole[..whole.len() - " 05".len()];
    holds(&greeting(Tail(None)), &mut packet(&unhex(without)));
}

#[test]
fn a_tail_of_a_later_version_is_passed_over() {
    let (message, payload) = device_messages()[0];
    let mut longer = packet(&unhex(&format!("{payload} 2a 07 ff")));
    let encoded = longer.split_last_mut().unwrap().1;
    assert_eq!(open::<DeviceMessage<'_>>(encoded), Ok(message));
}

#[test]
fn a_request_of_a_later_version_still_shows_its_number() {
    // Id 300, a command number that no version has yet, and what may follow.
    let mut unknown = packet(&unhex("ac 02 7f 01 02 03"));
    let encoded = unknown.split_last_mut().unwrap().1;
    let payload = unseal(encoded).unwrap();
    assert!(nirspi_wire::packet::parse::<Request<'_>>(payload).is_err());
    assert_eq!(request_id(payload), Some(300));
}
