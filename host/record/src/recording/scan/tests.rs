use super::*;
use proptest::prelude::*;
use std::io::{Seek, Write};

fn scan(bytes: &[u8]) -> Scan {
    let mut file = tempfile::tempfile().unwrap();
    file.write_all(bytes).unwrap();
    file.rewind().unwrap();
    Scan::new(file)
}

fn record(kind: u8, body: &[u8]) -> Vec<u8> {
    [&[kind][..], &(body.len() as u64).to_le_bytes(), body].concat()
}

#[test]
fn a_length_beyond_the_file_takes_no_memory() {
    for kind in 0..=u8::MAX {
        for length in [u64::MAX, 1 << 40, LONGEST, 1 << 20] {
            let bytes = [MAGIC, &[kind], &length.to_le_bytes(), &[0; 64]].concat();
            let mut scan = scan(&bytes);
            assert!(scan.begin().unwrap());
            assert!(!matches!(scan.next().unwrap(), Some(Entry::Message { .. })));
            assert!(scan.buffer.capacity() < 4 << 20, "{kind} {length}");
        }
    }
}

#[test]
fn what_lies_between_two_packets_is_passed_over_and_counted() {
    let message = |byte| record(op::MESSAGE, &[&[0; 22][..], &[byte, 0]].concat());
    let bytes = [MAGIC, &message(1), &[0xee; 100], &message(2), &message(3)].concat();
    let mut scan = scan(&bytes);
    assert!(scan.begin().unwrap());
    for expected in 1..=3 {
        let Some(Entry::Message { data, .. }) = scan.next().unwrap() else { panic!() };
        assert_eq!(data, [expected, 0]);
    }
    assert_eq!(scan.next().unwrap(), None);
    let first = Some((MAGIC.len() + message(1).len()) as u64);
    let expected = Damage { places: 1, bytes: 100, first, is_cut: true, ..Damage::default() };
    assert_eq!(scan.damage, expected);
    assert!(expected.to_string().contains("100 bytes lost at 1 place"), "{expected}");
}

proptest! {
    #[test]
    fn any_bytes_are_scanned_to_their_end(bytes: Vec<u8>, kinds in prop::collection::vec(0u8..17, 0..20)) {
        let records: Vec<u8> = kinds.iter().flat_map(|&kind| record(kind, &bytes)).collect();
        for bytes in [&bytes, &records] {
            let mut scan = scan(&[MAGIC, bytes].concat());
            prop_assert!(scan.begin().unwrap());
            let mut entries = 0;
            while scan.next().unwrap().is_some_and(|entry| !matches!(entry, Entry::Compressed(_))) {
                entries += 1;
            }
            prop_assert!(entries <= bytes.len());
        }
    }
}

/// Packets as they come from a camera: no zero byte but the last.
fn packets(count: u8, length: usize) -> Vec<Vec<u8>> {
    let packet =
        |k: u8| (0..length).map(|at| (at * 7 + usize::from(k)) as u8 | 1).chain([0]).collect();
    (0..count).map(packet).collect()
}

/// A file that the `mcap` crate has written as recordings are: the packets on `/wire`, and metadata before and after
/// them.
fn written(packets: &[Vec<u8>], chunk_size: Option<u64>) -> Vec<u8> {
    let options =
        mcap::WriteOptions::new().profile("nirspi").compression(None).disable_seeking(true);
    let options = options.chunk_size(chunk_size).use_chunks(chunk_size.is_some());
    let mut writer = options.create(io::Cursor::new(Vec::new())).unwrap();
    let metadata = mcap::records::Metadata { name: "setup".to_owned(), metadata: setup() };
    let schema = writer.add_schema("packet", "text", b"bytes").unwrap();
    let channel = writer.add_channel(schema, "/wire", "wire-v2", &BTreeMap::new()).unwrap();
    writer.write_metadata(&metadata).unwrap();
    for (packet, sequence) in packets.iter().zip(0..) {
        let time = time_ns(sequence);
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence,
            log_time: time,
            publish_time: time,
        };
        writer.write_to_known_channel(&header, packet).unwrap();
    }
    writer.write_metadata(&metadata).unwrap();
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

fn setup() -> BTreeMap<String, String> {
    BTreeMap::from([
        ("crc32".to_owned(), "9f".to_owned()),
        ("json".to_owned(), "{\"rows\": 7}".to_owned()),
    ])
}

fn time_ns(sequence: u32) -> u64 {
    0x0102_0304_0506_0708 + u64::from(sequence) * 81_920
}

/// The entries of a file, and what was wrong with the file.
fn read(bytes: &[u8]) -> (Vec<Entry>, Damage) {
    let mut scan = scan(bytes);
    assert!(scan.begin().unwrap());
    let mut entries = Vec::new();
    // A scan stays at a chunk that it cannot read.
    while !matches!(entries.last(), Some(Entry::Compressed(_)))
        && let Some(entry) = scan.next().unwrap()
    {
        entries.push(entry);
    }
    (entries, scan.damage)
}

/// The packets among these entries.
fn found(entries: &[Entry]) -> Vec<&[u8]> {
    entries
        .iter()
        .filter_map(|entry| match entry {
            Entry::Message { data, .. } => Some(data.as_slice()),
            _ => None,
        })
        .collect()
}

#[test]
fn a_whole_file_says_what_was_written_and_that_nothing_is_wrong() {
    // The second file is longer than what is read at a time.
    for (count, length, chunk) in [(9, 40, Some(300)), (255, 4100, Some(1 << 20)), (9, 40, None)] {
        let packets = packets(count, length);
        let bytes = written(&packets, chunk);
        let (entries, damage) = read(&bytes);
        assert_eq!(damage, Damage::default());
        assert_eq!(damage.to_string(), "");
        assert_eq!(entries[0], Entry::Header { profile: "nirspi".to_owned() });
        let is_channel = |entry: &Entry| matches!(entry, Entry::Channel { id: 1, topic, encoding } if topic == "/wire" && encoding == "wire-v2");
        assert!(entries.iter().any(is_channel), "{entries:?}");
        let metadata = Entry::Metadata { name: "setup".to_owned(), texts: setup() };
        assert_eq!(entries.iter().filter(|&entry| *entry == metadata).count(), 2);
        assert_eq!(found(&entries), packets);
        let times = entries.iter().filter_map(|entry| match entry {
            &Entry::Message { channel: 1, time_ns, .. } => Some(time_ns),
            _ => None,
        });
        assert!(times.eq((0..u32::from(count)).map(time_ns)));
    }
}

#[test]
fn a_damaged_byte_is_told_and_costs_at_most_two_packets() {
    let packets = packets(30, 40);
    for chunk in [Some(900), None] {
        let whole = written(&packets, chunk);
        // A length that points from the last packets into the index can pass for a right one.
        for at in MAGIC.len()..whole.len() / 2 {
            for flip in [0x01, 0x80] {
                let mut bytes = whole.clone();
                bytes[at] ^= flip;
                let (entries, damage) = read(&bytes);
                let mut rest = packets.iter();
                let is_next = |found: &&[u8]| {
                    let place = rest.clone().position(|packet| packet == found);
                    place.is_some_and(|place| rest.nth(place).is_some())
                };
                let sound = found(&entries).into_iter().filter(is_next).count();
                let told = damage.to_string();
                assert!(sound + 2 >= packets.len(), "{sound} with byte {at} ^ {flip}: {told}");
                assert!(!told.is_empty() && !damage.is_cut, "byte {at} ^ {flip}: {told}");
            }
        }
    }
}

#[test]
fn a_file_that_is_cut_gives_what_is_before_the_cut_and_says_so() {
    let packets = packets(9, 40);
    for chunk in [Some(300), None] {
        let whole = written(&packets, chunk);
        let mut most = 0;
        for length in MAGIC.len()..whole.len() {
            let (entries, damage) = read(&whole[..length]);
            let found = found(&entries);
            assert!(
                damage.is_cut && damage.to_string().ends_with("the file ends early"),
                "{length}"
            );
            assert_eq!(found, packets[..found.len()]);
            assert!(found.len() >= most, "{length}: {} after {most}", found.len());
            most = found.len();
        }
        assert_eq!(most, packets.len());
    }
}

#[test]
fn a_checksum_is_compared_unless_it_is_zero() {
    let packets = packets(9, 40);
    // A bit of a packet whose byte stays other than zero.
    let damaged = |chunk| {
        let mut bytes = written(&packets, chunk);
        let at = bytes.windows(41).position(|part| part == packets[4]).unwrap();
        bytes[at + 5] ^= 0x40;
        bytes
    };
    let (entries, damage) = read(&damaged(Some(300)));
    assert_eq!(found(&entries).len(), 9);
    assert_eq!((damage.chunks, damage.places, damage.checksum), (1, 0, true));
    assert_eq!(damage.to_string(), "wrong checksum of 1 chunk");
    let (_, damage) = read(&damaged(None));
    assert_eq!(damage, Damage { checksum: true, ..Damage::default() });
    assert_eq!(damage.to_string(), "wrong checksum of the file");
    // Zero says that there is no checksum.
    let mut bytes = damaged(None);
    let end = bytes.windows(9).rposition(|head| head == [15, 4, 0, 0, 0, 0, 0, 0, 0]).unwrap();
    bytes[end + HEAD..end + HEAD + 4].fill(0);
    assert_eq!(read(&bytes).1, Damage::default());
    let mut bytes = damaged(Some(300));
    let chunks = (0..bytes.len() - 45)
        .filter(|&at| bytes[at] == op::CHUNK && bytes[at + 37..at + 41] == [0; 4]);
    for at in chunks.collect::<Vec<_>>() {
        bytes[at + 33..at + 37].fill(0);
    }
    assert_eq!(read(&bytes).1.chunks, 0);
}

#[test]
fn what_follows_the_end_is_damage() {
    for chunk in [None, Some(300)] {
        let whole = written(&packets(9, 40), chunk);
        let length = whole.len() as u64;
        assert_eq!(read(&whole).1, Damage::default());
        for behind in [&[0][..], &[0x55; 3 << 20], &MAGIC[..7], &whole] {
            let (entries, damage) = read(&[&whole, behind].concat());
            assert_eq!(found(&entries).len(), 9);
            let (bytes, first) = (behind.len() as u64, Some(length));
            let another = (behind == whole).then_some(length);
            assert_eq!(damage, Damage { places: 1, bytes, first, another, ..Damage::default() });
        }
        let told = read(&[whole.clone(), whole].concat()).1.to_string();
        let place = format!("; another recording begins at byte {length}");
        assert!(told.ends_with(&place), "{told}");
    }
}

#[test]
fn what_is_told_names_the_worst() {
    let none = Damage::default();
    for (damage, told) in [
        (
            Damage {
                places: 2,
                bytes: 30,
                first: Some(7),
                chunks: 1,
                checksum: true,
                is_cut: true,
                another: None,
            },
            "30 bytes lost at 2 places, the first at byte 7; the file ends early",
        ),
        (Damage { chunks: 2, checksum: true, ..none.clone() }, "wrong checksum of 2 chunks"),
        (
            Damage { checksum: true, is_cut: true, ..none.clone() },
            "wrong checksum of the file; the file ends early",
        ),
        (none, ""),
    ] {
        assert_eq!(damage.to_string(), told);
    }
}

#[test]
fn one_byte_of_the_first_eight_may_be_wrong() {
    for wrong in 0..=MAGIC.len() {
        let mut start = MAGIC.to_vec();
        start[..wrong].iter_mut().for_each(|byte| *byte ^= 0x10);
        let mut scan = scan(&[&start[..], &record(op::HEADER, &[0; 8])].concat());
        assert!(!scan.is_empty().unwrap());
        assert_eq!(scan.begin().unwrap(), wrong < 2, "{wrong}");
        let expected = match wrong {
            1 => Damage { places: 1, bytes: 1, first: Some(0), ..Damage::default() },
            _ => Damage::default(),
        };
        assert_eq!(scan.damage, expected);
        if wrong < 2 {
            assert_eq!(scan.next().unwrap(), Some(Entry::Header { profile: String::new() }));
        }
    }
    assert!(scan(&[]).is_empty().unwrap());
    for length in 0..MAGIC.len() {
        assert!(!scan(&MAGIC[..length]).begin().unwrap());
    }
}

/// A record before which nothing was wrong is taken with less proof than a record after damage.
#[test]
fn after_damage_a_record_must_say_more_for_itself() {
    let message = |times: [u8; 2], data: &[u8]| {
        let times = times.map(|time| [time; 8]);
        record(op::MESSAGE, &[&[0; 6], times.as_flattened(), data].concat())
    };
    let (sound, other, odd) =
        (message([3, 3], &[1, 0]), message([3, 4], &[2, 0]), message([3, 3], &[3]));
    let texts = record(op::METADATA, &[0; 8]);
    let after = |junk: &[u8], records: &[&[u8]]| {
        let (entries, damage) = read(&[MAGIC, junk, &records.concat()].concat());
        let data: Vec<Vec<u8>> = found(&entries).into_iter().map(<[u8]>::to_vec).collect();
        (data, entries.len(), damage.bytes)
    };
    assert_eq!(after(&[], &[&other, &sound]), (vec![vec![2, 0], vec![1, 0]], 2, 0));
    // Two times that differ are nirspi's in no file.
    let lost = 5 + other.len() as u64;
    assert_eq!(after(&[0xee; 5], &[&other, &[0xee], &sound]), (vec![vec![1, 0]], 1, lost + 1));
    // What is no packet is taken for the record that follows.
    assert_eq!(after(&[], &[&odd, &sound]), (vec![vec![3], vec![1, 0]], 2, 0));
    assert_eq!(after(&[], &[&odd, &[0xee], &sound]), (vec![vec![1, 0]], 1, odd.len() as u64 + 1));
    // The last record of a file has none after it.
    assert_eq!(after(&[], &[&sound, &texts]), (vec![vec![1, 0]], 2, 0));
    assert_eq!(after(&[0xee; 5], &[&texts]), (vec![], 0, 0));
    assert_eq!(after(&[0xee; 5], &[&texts, &sound]), (vec![vec![1, 0]], 2, 5));
}

#[test]
fn a_packet_is_believed_by_itself_if_its_only_zero_is_its_last_byte_and_it_is_no_longer_than_any() {
    let packet = |length: usize| [vec![1; length], vec![0]].concat();
    let inner = [packet(3), packet(3)].concat();
    for (data, is_believed) in [
        (packet(0), true),
        (packet(MAX_DEVICE_PACKET), true),
        (packet(MAX_DEVICE_PACKET + 1), false),
        (inner, false),
        (vec![1; 4], false),
        (Vec::new(), false),
    ] {
        let message = record(op::MESSAGE, &[&[0; MESSAGE_HEAD][..], &data].concat());
        let mut scan = scan(&[MAGIC, &message, &[0xee; 64]].concat());
        assert!(scan.begin().unwrap());
        assert_eq!(scan.next().unwrap().is_some(), is_believed, "{} bytes", data.len());
    }
}

#[test]
fn a_text_that_is_none_costs_its_record() {
    let header = record(op::HEADER, &[1, 0, 0, 0, 0xff, 0, 0, 0, 0]);
    let message = record(op::MESSAGE, &[&[0; 22][..], &[1, 0]].concat());
    let (entries, damage) = read(&[MAGIC, &header, &message].concat());
    assert_eq!(found(&entries), [[1, 0]]);
    let (bytes, first) = (header.len() as u64, Some(MAGIC.len() as u64));
    assert_eq!(damage, Damage { places: 1, bytes, first, is_cut: true, ..Damage::default() });
}

#[test]
fn a_compressed_chunk_is_named() {
    let chunk = |name: &[u8]| {
        let name = [&(name.len() as u32).to_le_bytes(), name].concat();
        record(op::CHUNK, &[&[0; 28][..], &name, &[9, 0, 0, 0, 0, 0, 0, 0], &[7; 9]].concat())
    };
    let (entries, _) = read(&[MAGIC, &chunk(b"lz4")].concat());
    assert_eq!(entries[0], Entry::Compressed("lz4".to_owned()));
    let (entries, damage) =
        read(&[MAGIC, &chunk(b"l.4"), &record(op::FOOTER, &[0; 20]), MAGIC].concat());
    assert_eq!((entries, damage.places, damage.is_cut), (vec![], 1, false));
}

#[test]
fn a_length_is_one_that_a_record_of_its_kind_can_have() {
    let text = 1 << 16;
    for (kind, possible, not) in [
        (op::HEADER, vec![0, text], vec![text + 1]),
        (op::CHANNEL, vec![0, text], vec![text + 1]),
        (op::FOOTER, vec![20], vec![19, 21]),
        (op::DATA_END, vec![4], vec![3, 5]),
        (op::MESSAGE, vec![22, LONGEST], vec![21, LONGEST + 1]),
        (op::CHUNK, vec![40, (1 << 48) - 1], vec![39, 1 << 48, u64::MAX]),
        (op::SCHEMA, vec![0, LONGEST], vec![LONGEST + 1]),
        (op::METADATA, vec![0, LONGEST], vec![LONGEST + 1]),
        (op::DATA_END + 1, vec![], vec![0, 4]),
        (0, vec![], vec![0, 20]),
    ] {
        for (length, is_possible) in
            possible.iter().map(|&l| (l, true)).chain(not.iter().map(|&l| (l, false)))
        {
            let bytes = [&[0xee; 3][..], &[kind], &u64::to_le_bytes(length)].concat();
            let expected = is_possible.then_some((kind, length.min(LONGEST) as usize));
            assert_eq!(scan(&bytes).head(3).unwrap(), expected, "{kind} {length}");
        }
    }
}

#[test]
fn the_lengths_in_a_record_add_up_to_the_record() {
    let block = |length: u32| [&length.to_le_bytes()[..], &vec![7; length as usize]].concat();
    let [two, four, three] = [block(2), block(4), block(3)];
    for (kind, parts) in [
        (op::HEADER, vec![&two[..], &four]),
        (op::SCHEMA, vec![&[0; 2], &two, &four, &three]),
        (op::CHANNEL, vec![&[0; 4], &two, &four, &three]),
        (op::MESSAGE_INDEX, vec![&[0; 2], &three]),
        (op::CHUNK_INDEX, vec![&[0; 32], &two, &[0; 8], &three, &[0; 16]]),
        (op::STATISTICS, vec![&[0; 42], &three]),
        (op::METADATA, vec![&two, &three]),
        (op::METADATA_INDEX, vec![&[0; 16], &three]),
        (op::SUMMARY_OFFSET, vec![&[0; 17]]),
    ] {
        let body = parts.concat();
        assert!(fits(kind, &body), "{kind}");
        assert!(!fits(kind, &body[..body.len() - 1]), "{kind}, one byte short");
        assert!(!fits(kind, &[&body[..], &[0]].concat()), "{kind}, one byte more");
    }
    assert!(fits(op::MESSAGE, &[1, 2, 3]) && fits(op::FOOTER, &[0; 20]) && fits(op::DATA_END, &[]));
    assert!(!fits(op::ATTACHMENT, &[]));
}
