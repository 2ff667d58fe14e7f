//! The bytes that protocol version 4 has added, frozen.
//!
//! If a test in this file fails, do not change the test: the change would lock out every camera and every recording of
//! version 4.

use super::bytes::{hex, holds, packet, unhex};
use nirspi_wire::samples::{MAX_SHIFT, NARROW, Width};
use nirspi_wire::{
    Answer, Capabilities, Command, Configuration, DeviceMessage, Frame, FrameFlags, Identity,
    PatternOrder, Reply, Request, RunLength, SampleSource, Samples, Tail, Version, encode, open,
};

/// The configuration with its tail.
pub fn requests() -> Vec<(Request<'static>, &'static str)> {
    vec![
        (configure(Tail(Some(true))), "02 01 00 80 08 01 05 02 07 01 00 80 20 01"),
        (configure(Tail(Some(false))), "02 01 00 80 08 01 05 02 07 01 00 80 20 00"),
    ]
}

/// The greeting with the new capability, and frames with samples of 24 bits.
pub fn device_messages() -> Vec<(DeviceMessage<'static>, &'static str)> {
    let frame = Frame {
        run: 1,
        sequence: 300,
        device_time_us: 40,
        sweeps: 1,
        flags: FrameFlags::DIFFERENTIAL,
        samples: narrow(&[1, -1, 0x7F_FFFF, -0x80_0000, 0x01_0203]),
    };
    vec![
        (greeting(), "00 01 00 00 04 01 02 03 00 01 02 01 62 01 73 20 c0 b2 cd 3b 0e 8e 0c 10"),
        (
            DeviceMessage::Frame(frame),
            "01 01 ac 02 28 01 10 80 0f 01 00 00 ff ff ff ff ff 7f 00 00 80 03 02 01",
        ),
    ]
}

fn configure(narrow: Tail<bool>) -> Request<'static> {
    let configuration = Configuration {
        order: PatternOrder::Natural,
        patterns: 1024,
        differential: true,
        clocks_per_pattern: 5,
        blanked: 2,
        adc_latency: 7,
        sweeps: 1,
        source: SampleSource::Detector,
        over_range_trip: 4096,
        narrow,
    };
    Request { id: 2, command: Command::Configure(configuration) }
}

fn narrow(values: &[i64]) -> Samples<'static> {
    Samples::pack_narrow(values.iter().copied(), vec![0; 3 * values.len()].leak()).unwrap()
}

fn greeting() -> DeviceMessage<'static> {
    let identity = Identity {
        protocol: 4,
        firmware: Version(1, 2, 3),
        gateware: Version(0, 1, 2),
        board: "b",
        serial: "s",
        side: 32,
        adc_hz: 125_000_000,
        adc_bits: 14,
        wavelength_nm: 1550,
        capabilities: Tail(Some(Capabilities::NARROW_SAMPLES)),
    };
    DeviceMessage::Reply(Reply { id: 1, outcome: Ok(Answer::Hello(identity)) })
}

#[test]
fn requests_have_these_bytes() {
    for (request, payload) in requests() {
        holds(&request, &mut packet(&unhex(payload)));
    }
}

#[test]
fn device_messages_have_these_bytes() {
    for (message, payload) in device_messages() {
        holds(&message, &mut packet(&unhex(payload)));
    }
}

#[test]
fn a_configuration_of_an_earlier_version_asks_for_nothing() {
    let longer = unhex(requests()[0].1);
    let shorter = &longer[..longer.len() - 1];
    holds(&configure(Tail(None)), &mut packet(shorter));
    // A camera of an earlier version reads the fields that it knows, and the tail as bytes of a later version.
    let older: (u16, u8, u8, u16, bool, u16, u16, u8, u32, u8, u32) =
        postcard::take_from_bytes(&longer).unwrap().0;
    assert_eq!(older, (2, 1, 0, 1024, true, 5, 2, 7, 1, 0, 4096));
    let start = Request { id: 9, command: Command::Start(RunLength::Continuous) };
    assert_eq!(hex(encode(&start, &mut [0; 16]).unwrap()), hex(&packet(&unhex("09 02 00"))));
}

/// Earlier versions refuse a shift above [`MAX_SHIFT`], so an older program that plays back a recording counts such a
/// frame as a message that it does not know, and shows no wrong samples.
#[test]
fn only_a_byte_that_earlier_versions_refuse_stands_before_words_of_24_bits() {
    assert_eq!((NARROW, Width::Bits24.form(), Width::Bits32.form()), (0x80, 0x80, 0));
    assert_eq!(MAX_SHIFT, 18);
    let (_, frame) = device_messages()[1];
    let at = "01 01 ac 02 28 01 10 ".len();
    for form in 0..=u8::MAX {
        let payload = format!("{}{form:02x}{}", &frame[..at], &frame[at + 2..]);
        let mut bytes = packet(&unhex(&payload));
        let encoded = bytes.split_last_mut().unwrap().1;
        // Fifteen bytes are no whole words of 32 bits, with any shift.
        assert_eq!(open::<DeviceMessage<'_>>(encoded).is_ok(), form == NARROW, "{form:#x}");
    }
}
