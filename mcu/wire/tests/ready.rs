//! A packet that the FPGA has made, as the firmware reads it: by its first bytes, and sample by sample.
#![expect(clippy::unwrap_used, reason = "a failed unwrap in a helper fails its test")]

use nirspi_wire::packet::{overhead, seal};
use nirspi_wire::ready::{
    BEGINNING_BYTES, FAST_LEAD_BYTES, HEADER_BYTES, Head, LEAD_BYTES, MAX_READ_BYTES, NUMBER_BYTES,
    Reader, fast_read_bytes, numbers, read_bytes,
};
use nirspi_wire::samples::Width;
use nirspi_wire::{DeviceMessage, Frame, FrameFlags, PATTERNS, open};
use proptest::prelude::*;

/// The packet with this head of samples from these words, which is a word for each pattern.
fn packet(head: &Head, words: &[i32]) -> Vec<u8> {
    let bytes = head.width.bytes();
    let words = words.iter().flat_map(|word| word.to_le_bytes()[..bytes].to_vec());
    let payload: Vec<u8> = head.to_bytes().into_iter().chain(words).collect();
    let mut room = vec![0; payload.len() + overhead(payload.len())];
    seal(&payload, &mut room).unwrap().to_vec()
}

/// What a host makes of such a packet.
fn as_frame<T>(packet: &[u8], look: impl FnOnce(Frame<'_>) -> T) -> T {
    let mut encoded = packet[..packet.len() - 1].to_vec();
    match open(&mut encoded) {
        Ok(DeviceMessage::Frame(frame)) => look(frame),
        other => panic!("{other:?} of a frame"),
    }
}

/// Numbers of few and of many bits, since zeros of a number change where COBS puts its codes.
fn number() -> impl Strategy<Value = u64> {
    (any::<u64>(), 0..64u32).prop_map(|(number, shift)| number >> shift)
}

/// Words that are often zero or short, so that blocks of COBS are of all lengths.
fn word() -> impl Strategy<Value = i32> {
    (any::<i32>(), 0..32u32).prop_map(|(word, shift)| word >> shift)
}

prop_compose! {
    fn head()(
        run in number(), sequence in number(), device_time_us in number(), sweeps in number(), flags in number(),
        narrow: bool, patterns in 1..=300u16,
    ) -> Head {
        let width = if narrow { Width::Bits24 } else { Width::Bits32 };
        let (run, flags) = (run as u16, FrameFlags(flags as u16));
        Head { run, sequence: sequence as u32, device_time_us, sweeps: sweeps as u32, flags, patterns, width }
    }
}

prop_compose! {
    fn head_and_words()(head in head())(
        words in prop::collection::vec(word(), usize::from(head.patterns)), head in Just(head),
    ) -> (Head, Vec<i32>) {
        let shift = 32 - 8 * head.width.bytes() as u32;
        (head, words.iter().map(|word| word >> shift).collect())
    }
}

proptest! {
    #[test]
    fn a_hosts_frame_has_the_fields_of_the_head((head, words) in head_and_words()) {
        as_frame(&packet(&head, &words), |frame| {
            prop_assert_eq!((frame.run, frame.sequence), (head.run, head.sequence));
            prop_assert_eq!((frame.device_time_us, frame.sweeps), (head.device_time_us, head.sweeps));
            prop_assert_eq!(frame.flags, head.flags);
            prop_assert!(frame.samples.iter().eq(words.iter().map(|&word| i64::from(word))));
            Ok(())
        })?;
    }

    #[test]
    fn run_and_sequence_are_read_from_the_first_bytes((head, words) in head_and_words()) {
        let packet = packet(&head, &words);
        prop_assert_eq!(numbers(packet.first_chunk().unwrap()), (head.run, head.sequence));
    }

    #[test]
    fn samples_are_read_one_by_one((head, words) in head_and_words()) {
        let packet = packet(&head, &words);
        let mut reader = Reader::new(&packet, head.patterns);
        prop_assert_eq!((reader.sequence, reader.flags), (head.sequence, head.flags));
        for &word in &words {
            prop_assert!(!reader.is_intact(), "before the last sample");
            prop_assert_eq!(reader.sample(), word);
        }
        prop_assert_eq!(reader.sample(), 0, "after the last");
        prop_assert!(reader.is_intact());
    }

    /// The light of a damaged frame must not count. A wrong code of COBS behind which nothing follows changes no byte of
    /// the message, so such a packet may count as intact.
    #[test]
    fn whatever_happens_to_a_packet_what_counts_as_intact_is_what_was_sent(
        (head, words) in head_and_words(), place: prop::sample::Index, damage in 1..=255u8, ends: bool,
    ) {
        let mut packet = packet(&head, &words);
        // The delimiter is no part of what the checksum covers.
        let place = place.index(packet.len() - 1);
        if ends {
            packet.truncate(place);
        } else {
            packet[place] ^= damage;
        }
        let mut reader = Reader::new(&packet, head.patterns);
        let read: Vec<i32> = words.iter().map(|_| reader.sample()).collect();
        if reader.is_intact() {
            prop_assert_eq!((reader.sequence, reader.flags), (head.sequence, head.flags));
            prop_assert_eq!(read, words);
        }
    }
}

#[test]
fn a_packet_with_a_wrong_sample_is_not_intact() {
    let width = Width::Bits32;
    let flags = FrameFlags(0);
    let head =
        Head { run: 1, sequence: 2, device_time_us: 3, sweeps: 4, flags, patterns: 60, width };
    let sound = packet(&head, &[0x0102_0304; 60]);
    // Behind the head, and before the checksum and the delimiter.
    for place in 50..sound.len() - 5 {
        let mut packet = sound.clone();
        packet[place] ^= 0x80;
        let mut reader = Reader::new(&packet, head.patterns);
        for _ in 0..head.patterns {
            reader.sample();
        }
        assert!(!reader.is_intact(), "byte {place}");
    }
}

/// A block of 254 bytes is the only one that stands for no zero.
#[test]
fn bright_light_has_bytes_without_a_zero_for_longer_than_a_block() {
    for width in [Width::Bits24, Width::Bits32] {
        let head = Head {
            run: 1,
            sequence: 2,
            device_time_us: 3,
            sweeps: 4,
            flags: FrameFlags(5),
            patterns: 400,
            width,
        };
        let packet = packet(&head, &[0x005A_A55A | 0x1B00_0000; 400]);
        assert!(packet.contains(&0xFF), "a long block");
        let mut reader = Reader::new(&packet, head.patterns);
        let word = if width == Width::Bits24 { 0x005A_A55A } else { 0x1B5A_A55A };
        assert!((0..400).all(|_| reader.sample() == word) && reader.is_intact(), "{width:?}");
    }
}

/// Two frames are told apart by what is read of them.
#[test]
fn the_beginning_holds_the_numbers_and_the_time() {
    let width = Width::Bits32;
    let head = |run, sequence, device_time_us| {
        let flags = FrameFlags(0);
        packet(&Head { run, sequence, device_time_us, sweeps: 1, flags, patterns: 1, width }, &[5])
    };
    let packets = [head(1, 1, 1), head(u16::MAX, 1, 1), head(1, u32::MAX, 1), head(1, 1, u64::MAX)];
    for (one, other) in [(0, 1), (0, 2), (0, 3)] {
        let length = if other == 3 { BEGINNING_BYTES } else { NUMBER_BYTES };
        assert_ne!(packets[one][..length], packets[other][..length], "{other}");
    }
    // Head and first code of COBS, without sweeps, flags, and the form and length of the samples.
    assert_eq!(BEGINNING_BYTES, 1 + HEADER_BYTES - 5 - 3 - 1 - 2);
}

#[test]
fn a_read_that_is_clocked_by_sck_has_room_for_a_longer_lead() {
    for width in [Width::Bits24, Width::Bits32] {
        for patterns in 1..=PATTERNS {
            let packet = read_bytes(patterns, width) - LEAD_BYTES;
            assert_eq!(fast_read_bytes(patterns, width), FAST_LEAD_BYTES + packet);
        }
    }
    assert_eq!(MAX_READ_BYTES, fast_read_bytes(PATTERNS, Width::Bits32));
}
