//! Packets on a link that cuts, damages and chops: whatever happens, a receiver gets only messages that
//! were sent, and is in step again after the next delimiter.
#![expect(clippy::unwrap_used, reason = "a failed unwrap in a helper fails its test")]

mod strategies;

use nirspi_wire::{
    Command, Configuration, Deframed, Deframer, DeviceMessage, Frame, FrameFlags, GatewareChunk,
    PatternOrder, Request, SampleSource, Samples, encode,
    message::GATEWARE_CHUNK_MAX,
    open,
    packet::{MAX_DEVICE_PACKET, MAX_HOST_PACKET, PacketError, overhead, seal, unseal},
    ready,
    samples::{Width, Words},
};
use proptest::prelude::*;
use serde::{Deserialize, Serialize};
use strategies::{device_message, request};

/// Packets and whole streams of these tests fit.
const ROOM: usize = MAX_DEVICE_PACKET;

fn packet<T: Serialize>(message: &T) -> Vec<u8> {
    encode(message, &mut [0; ROOM]).unwrap().to_vec()
}

/// Everything a receiver makes of this stream.
fn receive(chunks: &[&[u8]]) -> Vec<Result<String, PacketError>> {
    let mut deframer = Deframer::<ROOM>::new();
    let mut received = Vec::new();
    for mut chunk in chunks.iter().copied() {
        while let Some(found) = deframer.next(&mut chunk) {
            received.push(match found {
                Deframed::Packet(packet) => open::<DeviceMessage>(packet).map(|m| format!("{m:?}")),
                Deframed::TooLong => Err(PacketError::TooLong),
            });
        }
    }
    received
}

fn messages_of(received: &[Result<String, PacketError>]) -> Vec<&str> {
    received.iter().filter_map(|r| r.as_deref().ok()).collect()
}

fn is_subsequence<T: PartialEq>(part: &[T], whole: &[T]) -> bool {
    let mut whole = whole.iter();
    part.iter().all(|wanted| whole.any(|found| found == wanted))
}

fn round_trip<'a, T>(message: &T, bytes: &'a mut Vec<u8>) -> Result<(), TestCaseError>
where
    T: Serialize + Deserialize<'a> + PartialEq + std::fmt::Debug,
{
    *bytes = packet(message);
    let (delimiter, encoded) = bytes.split_last_mut().unwrap();
    prop_assert_eq!(*delimiter, 0);
    prop_assert!(!encoded.contains(&0));
    let payload =
        postcard::serialize_with_flavor(message, postcard::ser_flavors::Size::default()).unwrap();
    prop_assert!(encoded.len() < payload + overhead(payload));
    prop_assert_eq!(&open::<T>(encoded).unwrap(), message);
    Ok(())
}

fn width() -> impl Strategy<Value = Width> {
    prop_oneof![Just(Width::Bits32), Just(Width::Bits24)]
}

/// A value that a sample of this width can have.
fn fitting(value: i32, width: Width) -> i32 {
    value >> (32 - 8 * width.bytes())
}

/// The message of a frame as the FPGA makes it.
fn payload_of(head: &ready::Head, values: &[i32]) -> Vec<u8> {
    let mut payload = head.to_bytes().to_vec();
    for value in values {
        payload.extend(&value.to_le_bytes()[..head.width.bytes()]);
    }
    payload
}

proptest! {
    #[test]
    fn a_sealed_payload_is_the_packet_of_its_message(message in request()) {
        let bytes = packet(&message);
        let payload = unseal(&mut bytes[..bytes.len() - 1].to_vec()).unwrap().to_vec();
        let mut room = [0; ROOM];
        prop_assert_eq!(seal(&payload, &mut room).unwrap(), bytes);
    }

    #[test]
    fn a_packet_of_the_fpga_is_found_between_zeros_and_read_sample_by_sample(
        run: u16, sequence: u32, device_time_us: u64, sweeps: u32, flags: u16,
        values in prop::collection::vec(prop_oneof![any::<i32>(), -300..300], 1..=1024),
        width in width(), lead in 0..=ready::LEAD_BYTES, damage: (prop::sample::Index, u8),
    ) {
        let flags = FrameFlags(flags);
        let patterns = values.len() as u16;
        let values: Vec<i32> = values.iter().map(|&value| fitting(value, width)).collect();
        let head = ready::Head { run, sequence, device_time_us, sweeps, flags, patterns, width };
        let payload = payload_of(&head, &values);
        let packet = seal(&payload, &mut [0; ROOM]).unwrap().to_vec();
        let mut read = vec![0; ready::read_bytes(patterns, width)];
        read[lead..lead + packet.len()].copy_from_slice(&packet);
        let place = ready::packet_in(&read, patterns, width);
        prop_assert_eq!(place.clone(), Some(lead..lead + packet.len()));
        // A packet of twice as many patterns has another length.
        prop_assert_eq!(ready::packet_in(&read, 2 * patterns, width), None);

        prop_assert_eq!(ready::numbers(packet.first_chunk().unwrap()), (run, sequence));
        let mut reader = ready::Reader::new(&read[place.clone().unwrap()], patterns);
        prop_assert_eq!((reader.sequence, reader.flags), (sequence, flags));
        prop_assert!(!reader.is_intact(), "nothing has been read");
        let mut reader = ready::Reader::new(&read[place.unwrap()], patterns);
        let found: Vec<i32> = values.iter().map(|_| reader.sample()).collect();
        prop_assert_eq!(&found, &values);
        prop_assert!(reader.is_intact());

        // Whatever byte is damaged, the reader believes no other samples: a wrong length of the last block changes none.
        let (at, flip) = damage;
        let mut damaged = packet;
        let at = at.index(damaged.len() - 1);
        damaged[at] ^= flip.max(1);
        let mut reader = ready::Reader::new(&damaged, patterns);
        let found: Vec<i32> = values.iter().map(|_| reader.sample()).collect();
        prop_assert!(!reader.is_intact() || found == values);
    }

    #[test]
    fn bytes_without_a_packet_have_none(
        patterns in 1..=1024u16, width in width(),
        bytes in prop::collection::vec(any::<u8>(), 0..200),
    ) {
        let shortest = ready::HEADER_BYTES + width.bytes() * usize::from(patterns) + 6;
        prop_assert_eq!(ready::packet_in(&[0; 300], patterns, width), None);
        prop_assert_eq!(ready::packet_in(&[], patterns, width), None);
        if let Some(place) = ready::packet_in(&bytes, patterns, width) {
            prop_assert!(place.len() >= shortest);
            prop_assert_eq!(bytes[place.end - 1], 0);
        }
        // Its delimiter is cut off.
        prop_assert_eq!(ready::packet_in(&vec![1; shortest], patterns, width), None);
        // Any bytes are read to their end.
        let mut reader = ready::Reader::new(&bytes, patterns);
        for _ in 0..=patterns {
            reader.sample();
        }
        prop_assert_eq!(reader.sample(), 0, "beyond the last");
    }

    #[test]
    fn a_packet_with_padded_numbers_is_the_same_message(
        run: u16, sequence: u32, device_time_us: u64, sweeps: u32, flags: u16,
        values in prop::collection::vec(any::<i32>(), 0..=1024), width in width(),
    ) {
        let flags = FrameFlags(flags);
        let patterns = values.len() as u16;
        let values: Vec<i32> = values.iter().map(|&value| fitting(value, width)).collect();
        let head = ready::Head { run, sequence, device_time_us, sweeps, flags, patterns, width };
        let payload = payload_of(&head, &values);
        let mut bytes = seal(&payload, &mut [0; ROOM]).unwrap().to_vec();
        let mut room = [0; ROOM];
        let numbers = values.iter().map(|&value| i64::from(value));
        let samples = Samples::pack(numbers, width, &mut room).unwrap();
        let frame = Frame { run, sequence, device_time_us, sweeps, flags, samples };
        let length = bytes.len() - 1;
        let opened: DeviceMessage<'_> = open(&mut bytes[..length]).unwrap();
        prop_assert_eq!(opened, DeviceMessage::Frame(frame));
    }
}

proptest! {
    #[test]
    fn every_request_comes_back(request in request()) {
        let mut bytes = Vec::new();
        round_trip(&request, &mut bytes)?;
        prop_assert!(bytes.len() <= MAX_HOST_PACKET);
    }

    #[test]
    fn every_device_message_comes_back(message in device_message()) {
        let mut bytes = Vec::new();
        round_trip(&message, &mut bytes)?;
        prop_assert!(bytes.len() <= MAX_DEVICE_PACKET);
    }

    #[test]
    fn a_buffer_one_byte_or_more_too_small_is_refused(
        message in device_message(), short in any::<prop::sample::Index>(),
    ) {
        let whole = packet(&message);
        for length in [short.index(whole.len()), whole.len() - 1] {
            let result = encode(&message, &mut vec![0; length]).map(<[u8]>::to_vec);
            prop_assert_eq!(result, Err(PacketError::BufferTooSmall));
        }
        let mut exact = vec![0; whole.len()];
        prop_assert_eq!(encode(&message, &mut exact), Ok(&whole[..]));
    }

    #[test]
    fn a_damaged_byte_never_becomes_another_message(
        sent in [device_message(), device_message(), device_message()],
        at in any::<prop::sample::Index>(), value: u8,
    ) {
        let [damaged, second, third] = sent.map(|message| (packet(&message), format!("{message:?}")));
        let mut stream = [damaged.0.clone(), second.0, third.0].concat();
        let at = at.index(damaged.0.len());
        prop_assume!(stream[at] != value);
        stream[at] = value;

        let received = receive(&[&stream]);
        let messages = messages_of(&received);
        prop_assert!(is_subsequence(&messages, &[&damaged.1[..], &second.1, &third.1]));
        // Without its delimiter the damaged packet takes the second one down with it, no more.
        let lost_delimiter = at == damaged.0.len() - 1;
        let intact: &[&str] =
            if lost_delimiter { &[&third.1] } else { &[&second.1, &third.1] };
        prop_assert!(messages.ends_with(intact), "{received:?}");
        prop_assert!(received.iter().any(Result::is_err), "the damage went unnoticed");
    }

    #[test]
    fn a_byte_inserted_never_becomes_another_message(
        sent in [device_message(), device_message()],
        at in any::<prop::sample::Index>(), value in prop_oneof![Just(0), any::<u8>()],
    ) {
        let [damaged, second] = sent.map(|message| (packet(&message), format!("{message:?}")));
        let mut stream = [damaged.0.clone(), second.0].concat();
        stream.insert(at.index(damaged.0.len()), value);
        let received = receive(&[&stream]);
        let messages = messages_of(&received);
        prop_assert!(is_subsequence(&messages, &[&damaged.1[..], &second.1]));
        prop_assert!(messages.ends_with(&[&second.1]));
    }

    #[test]
    fn a_stream_with_a_gap_is_in_step_after_the_next_delimiter(
        sent in prop::collection::vec(device_message(), 1..6),
        cut in any::<[prop::sample::Index; 2]>(),
    ) {
        let packets: Vec<_> = sent.iter().map(packet).collect();
        let stream = packets.concat();
        let mut gap = cut.map(|index| index.index(stream.len() + 1));
        gap.sort_unstable();
        let received = receive(&[&stream[..gap[0]], &stream[gap[1]..]]);

        let names: Vec<String> = sent.iter().map(|message| format!("{message:?}")).collect();
        let all: Vec<&str> = names.iter().map(String::as_str).collect();
        let messages = messages_of(&received);
        prop_assert!(is_subsequence(&messages, &all));
        // At most the packets that the gap touches are missing, and the one its end is glued to.
        let mut end = 0;
        let bounds: Vec<_> = packets
            .iter()
            .map(|packet| {
                let start = end;
                end += packet.len();
                (start, end)
            })
            .collect();
        let before = bounds.iter().filter(|(_, end)| *end <= gap[0]).count();
        let next_delimiter =
            stream[gap[1]..].iter().position(|&byte| byte == 0).map_or(end, |at| gap[1] + at);
        let after = bounds.iter().filter(|(start, _)| *start > next_delimiter).count();
        prop_assert!(messages.starts_with(&all[..before]));
        prop_assert!(messages.ends_with(&all[all.len() - after..]));
        if gap[0] == gap[1] {
            prop_assert_eq!(messages, all);
        }
    }

    #[test]
    fn the_size_of_chunks_does_not_matter(
        sent in prop::collection::vec(device_message(), 1..5),
        sizes in prop::collection::vec(1usize..700, 1..20),
        empty_packets in 0usize..3,
    ) {
        let mut stream = vec![0; empty_packets];
        stream.extend(sent.iter().flat_map(packet));
        let mut chunks = Vec::new();
        let mut rest = &stream[..];
        for size in sizes.iter().cycle() {
            if rest.is_empty() {
                break;
            }
            let (chunk, after) = rest.split_at((*size).min(rest.len()));
            chunks.push(chunk);
            rest = after;
        }
        let expected: Vec<_> = sent.iter().map(|message| Ok(format!("{message:?}"))).collect();
        prop_assert_eq!(receive(&chunks), expected);
    }

    #[test]
    fn garbage_longer_than_any_packet_is_reported_once_and_skipped(
        garbage in prop::collection::vec(1u8.., 65..400),
        sizes in 1usize..400, value: u32,
    ) {
        const SHORT: usize = 64;
        let message = (value, value);
        let stream = [&garbage[..], &[0], &packet(&message), &packet(&message)].concat();
        let mut deframer = Deframer::<SHORT>::new();
        let (mut too_long, mut messages) = (0, Vec::new());
        for (i, mut chunk) in stream.chunks(sizes).enumerate() {
            while let Some(found) = deframer.next(&mut chunk) {
                match found {
                    Deframed::TooLong => too_long += 1,
                    Deframed::Packet(packet) => messages.push(open::<(u32, u32)>(packet)),
                }
            }
            let taken = ((i + 1) * sizes).min(stream.len());
            if taken <= garbage.len() {
                prop_assert_eq!(deframer.pending(), taken.min(SHORT));
                prop_assert_eq!(too_long, 0);
            }
        }
        prop_assert_eq!(too_long, 1);
        prop_assert_eq!(messages, [Ok(message), Ok(message)]);
        prop_assert_eq!(deframer.pending(), 0);
    }

    #[test]
    fn any_bytes_are_survived(bytes in prop::collection::vec(any::<u8>(), 0..600)) {
        let _ = open::<Request>(&mut bytes.clone());
        let _ = open::<DeviceMessage>(&mut bytes.clone());
        let mut deframer = Deframer::<100>::new();
        let mut input = &bytes[..];
        while let Some(found) = deframer.next(&mut input) {
            if let Deframed::Packet(packet) = found {
                prop_assert!(!packet.is_empty() && !packet.contains(&0));
                let _ = open::<Request>(packet);
            }
        }
        prop_assert!(input.is_empty());
    }

    /// Behind a right checksum too: another version's messages, say.
    #[test]
    fn any_payload_with_a_right_checksum_is_survived(
        payload in prop::collection::vec(any::<u8>(), 0..64),
    ) {
        let framed = [&payload[..], &nirspi_wire::crc32(&payload).to_le_bytes()].concat();
        let mut bytes = [0; 128];
        let length = cobs::encode(&framed, &mut bytes);
        for result in [
            open::<Request>(&mut bytes[..length].to_vec()).map(|m| format!("{m:?}")),
            open::<DeviceMessage>(&mut bytes[..length].to_vec()).map(|m| format!("{m:?}")),
        ] {
            prop_assert!(matches!(result, Ok(_) | Err(PacketError::Message)), "{result:?}");
        }
    }
}

#[test]
fn the_largest_messages_fit_the_largest_packets() {
    // No zero byte anywhere, so that COBS is at its longest, and every number at its longest.
    let table = [0x03; 2048];
    let configuration = Configuration {
        order: PatternOrder::Table(Words::from_le_bytes(&table).unwrap()),
        patterns: u16::MAX,
        differential: true,
        alternating: true,
        clocks_per_pattern: u16::MAX,
        blanked: u16::MAX,
        adc_latency: u8::MAX,
        sweeps: u32::MAX,
        source: SampleSource::TestPattern,
        over_range_trip: u32::MAX,
    };
    let chunk = GatewareChunk {
        offset: u32::MAX,
        total: u32::MAX,
        crc: u32::MAX,
        data: &[0xFF; GATEWARE_CHUNK_MAX],
    };
    for command in [Command::Configure(configuration), Command::LoadGateware(chunk)] {
        let request = Request { id: u16::MAX, command };
        encode(&request, &mut [0; MAX_HOST_PACKET]).expect("no room for a host's packet");
    }

    let mut buffer = [0; 4096];
    let values = (0u16..1024).map(|k| i64::from(i32::MAX) - (i64::from(k) << 16));
    let frame = DeviceMessage::Frame(Frame {
        run: u16::MAX,
        sequence: u32::MAX,
        device_time_us: u64::MAX,
        sweeps: u32::MAX,
        flags: FrameFlags(u16::MAX),
        samples: Samples::pack(values, Width::Bits32, &mut buffer).unwrap(),
    });
    encode(&frame, &mut [0; MAX_DEVICE_PACKET]).expect("no room for a device's packet");
}

#[test]
fn nothing_but_a_checksum_is_no_message() {
    assert_eq!(open::<Request>(&mut []), Err(PacketError::Cobs));
    assert_eq!(open::<Request>(&mut [1, 1, 1, 1]), Err(PacketError::Crc));
    assert_eq!(open::<Request>(&mut [1, 1, 1, 1, 1]), Err(PacketError::Message));
}

#[test]
fn bytes_after_a_message_are_the_tail_of_a_later_version() {
    let stop = Request { id: 1, command: Command::Stop };
    let mut bytes = packet(&(stop, 0u8));
    let length = bytes.len() - 1;
    assert_eq!(open::<Request>(&mut bytes[..length]), Ok(stop));
}
