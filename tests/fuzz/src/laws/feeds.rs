//! Feeds: the live readings of any bench.

use crate::{Law, MIB, read};
use nirspi::feed::{Account, Frames, Header};

pub const LAWS: &[Law] = &[Law {
    name: "feeds",
    reads: "a feed: a header of JSON, then numbers as text or bytes",
    readers: &["host/feed/src/header.rs", "host/feed/src/frames.rs"],
    holds: feeds,
    seeds,
    longest: 2048,
    most_memory: 32 * MIB,
}];

/// A feed is refused in one line, or its numbers give the same frames however its bytes are cut, and each frame has as many
/// readings as the header says, of which none is infinite.
fn feeds(bytes: &[u8]) {
    let end = bytes.iter().position(|&byte| byte == b'\n').unwrap_or(bytes.len());
    let Ok(line) = std::str::from_utf8(&bytes[..end]) else { return };
    let Some(header) = read(line.parse::<Header>()) else { return };
    assert!(header.patterns() > 0 && header.samples.settle < header.samples.each);
    if let Ok((side, rows)) = header.hadamard() {
        assert!(rows.iter().all(|&row| (row as usize) < side.area()));
    }
    let numbers = bytes.get(end + 1..).unwrap_or_default();
    let whole = frames(&header, [numbers]);
    let cut = frames(&header, numbers.chunks(3));
    assert_eq!(whole, cut);
    assert!(whole.1.frames as usize == whole.0.len());
}

/// The bits of all frames, and the account.
fn frames<'b>(
    header: &Header,
    pieces: impl IntoIterator<Item = &'b [u8]>,
) -> (Vec<Vec<u64>>, Account) {
    let mut frames = Frames::new(header);
    let mut found = Vec::new();
    let mut keep = |frames: &Frames| {
        let frame = frames.frame();
        assert_eq!(frame.len(), header.readings());
        assert!(frame.iter().all(|reading| !reading.is_infinite()));
        found.push(frame.iter().map(|reading| reading.to_bits()).collect());
    };
    for mut piece in pieces {
        while !piece.is_empty() {
            let Some(taken) = read(frames.take(piece)) else {
                return (found, frames.account().clone());
            };
            piece = &piece[taken.bytes..];
            if taken.complete {
                keep(&frames);
            }
        }
    }
    if read(frames.end()) == Some(true) {
        keep(&frames);
    }
    let account = frames.account().clone();
    (found, account)
}

fn seeds() -> Vec<Vec<u8>> {
    let feed = |header: &str, numbers: &[u8]| [header.as_bytes(), b"\n", numbers].concat();
    vec![
        feed(
            r#"{"n":2,"order":"zig-zag","readings":"pairs","unit":"V","name":"DMD"}"#,
            b"1 2 3 4 5e-1 nan OL word\n9 8 7 6 5 4 3 2 1",
        ),
        feed(
            r#"{"n":4,"h_row":[0,3,3],"readings":"single","numbers":"i16","samples":2,"settle":1}"#,
            &[7; 31],
        ),
        feed(
            r#"{"height":2,"width":3,"patterns":2,"readings":"single","samples":3,"trigger":[1,2]}"#,
            b"7 0 1 5 2 5 3 0 4 0 1 5 x 3 2 0 9 9 nan 0 0 5\n5 0 5 5 5",
        ),
        feed(
            r#"{"n":2,"order":"natural","patterns":2,"readings":"halves","numbers":"f32"}"#,
            &1.5_f32.to_le_bytes().repeat(9),
        ),
    ]
}
