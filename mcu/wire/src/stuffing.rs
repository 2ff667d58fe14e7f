//! Encodes COBS (Cheshire and Baker 1999) directly into the caller's buffer, and decodes it in
//! place. The encoded bytes contain no zero.
//!
//! A block is a code byte, which is the distance to the next code byte, and the bytes in between.
//! Each zero ends a block, and so do 254 bytes without a zero.
//!
//! # Invariant
//! The encoded bytes are the same for any division of the input into pieces
//! (`tests::any_pieces_come_back_from_the_decoder_of_others`).

/// The longest distance. A block of this length does not encode a zero.
const FULL: usize = 0xFF;

/// Error: the bytes do not fit into the buffer.
#[derive(Debug)]
pub(crate) struct Overflow;

/// Encodes into `out`.
pub(crate) struct Stuffer<'b> {
    out: &'b mut [u8],
    /// Position of the open block's code byte.
    code: usize,
    /// Position of the next byte.
    next: usize,
}

impl<'b> Stuffer<'b> {
    pub fn new(out: &'b mut [u8]) -> Self {
        Self { out, code: 0, next: 1 }
    }

    pub fn push(&mut self, data: &[u8]) -> Result<(), Overflow> {
        let mut rest = data;
        while !rest.is_empty() {
            if self.next - self.code == FULL {
                self.close()?;
            }
            // This many bytes cannot fill the block, wherever their zeros are.
            let length = rest.len().min(FULL - (self.next - self.code));
            let (part, after) = rest.split_at(length);
            self.push_part(part)?;
            rest = after;
        }
        Ok(())
    }

    /// Adds a part up to a zero. The zero is left out, and the code of the next block takes its
    /// place.
    fn push_part(&mut self, part: &[u8]) -> Result<(), Overflow> {
        let (before, room) = self.out.split_at_mut_checked(self.next).ok_or(Overflow)?;
        let room = room.get_mut(..part.len()).ok_or(Overflow)?;
        let mut code = before.get_mut(self.code).ok_or(Overflow)?;
        let mut distance = self.next - self.code;
        for (place, &byte) in room.iter_mut().zip(part) {
            if byte == 0 {
                *code = distance as u8;
                code = place;
                distance = 1;
            } else {
                *place = byte;
                distance += 1;
            }
        }
        self.next += part.len();
        self.code = self.next - distance;
        Ok(())
    }

    /// Ends the open block and begins another.
    fn close(&mut self) -> Result<(), Overflow> {
        *self.out.get_mut(self.code).ok_or(Overflow)? = (self.next - self.code) as u8;
        self.code = self.next;
        self.next += 1;
        Ok(())
    }

    /// Closes the last block. Returns the total length.
    pub fn finish(self) -> Result<usize, Overflow> {
        *self.out.get_mut(self.code).ok_or(Overflow)? = (self.next - self.code) as u8;
        Ok(self.next)
    }
}

/// Decodes in place. Returns the number of decoded bytes, or `None` if the blocks do not end where
/// the bytes end.
///
/// Up to a full block, the decoded bytes are the encoded bytes one place further, with zeros where
/// codes were. So whole stretches are moved at once, and not each byte by itself, which took a third
/// of a capture's processor time.
pub(crate) fn unstuff(packet: &mut [u8]) -> Option<usize> {
    let (mut length, mut from, mut at) = (0, 1, 0);
    while let Some(place) = packet.get_mut(at) {
        let distance = usize::from(*place);
        // Also stops a walk that would stay at a zero for ever.
        if distance == 0 {
            return None;
        }
        *place = 0;
        at += distance;
        if distance == FULL && at < packet.len() {
            // The next code encodes no zero.
            move_down(packet, from..at, length);
            length += at - from;
            from = at + 1;
        }
    }
    if packet.is_empty() || at != packet.len() {
        return None;
    }
    move_down(packet, from..at, length);
    Some(length + at - from)
}

/// Moves bytes to a lower place.
fn move_down(bytes: &mut [u8], from: core::ops::Range<usize>, to: usize) {
    if cfg!(target_os = "none") {
        // The packets of a host are short, and the library's function takes 900 bytes of flash.
        move_down_bytewise(bytes, from, to);
    } else {
        bytes.copy_within(from, to);
    }
}

fn move_down_bytewise(bytes: &mut [u8], from: core::ops::Range<usize>, to: usize) {
    let down = from.start - to;
    for at in from {
        bytes[at - down] = bytes[at];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    /// Bytes with some zeros, and runs without zeros of about a block's length.
    fn data() -> impl Strategy<Value = Vec<u8>> {
        let run = (0..=600usize, any::<bool>(), 1u8..).prop_map(|(length, ends, byte)| {
            let mut run = std::vec![byte; length];
            run.extend(ends.then_some(0));
            run
        });
        prop::collection::vec(run, 0..5).prop_map(|runs| runs.concat())
    }

    /// The result of another encoder.
    fn expected(data: &[u8]) -> Vec<u8> {
        let mut out = std::vec![0; cobs::max_encoding_length(data.len()) + 1];
        let length = cobs::encode(data, &mut out);
        out.truncate(length);
        out
    }

    #[test]
    fn nothing_and_a_zero_are_refused() {
        assert_eq!(unstuff(&mut []), None);
        assert_eq!(unstuff(&mut [0]), None);
        assert_eq!(unstuff(&mut [2, 7, 0, 1]), None);
        assert_eq!(unstuff(&mut [1]), Some(0));
    }

    #[test]
    fn bytes_move_down_on_a_microcontroller_as_elsewhere() {
        for (from, to) in [(1..1, 0), (1..2, 0), (1..20, 0), (9..20, 2), (19..20, 19), (5..17, 4)] {
            let mut here: Vec<u8> = (1..=20).collect();
            let mut there = here.clone();
            move_down_bytewise(&mut here, from.clone(), to);
            there.copy_within(from, to);
            assert_eq!(here, there);
        }
    }

    proptest! {
        #[test]
        fn any_pieces_come_back_from_the_decoder_of_others(
            data in data(), at: prop::sample::Index,
        ) {
            let (a, b) = data.split_at(at.index(data.len() + 1));
            let mut out = std::vec![0xEE; cobs::max_encoding_length(data.len()) + 1];
            let mut stuffer = Stuffer::new(&mut out);
            stuffer.push(a).unwrap();
            stuffer.push(b).unwrap();
            let length = stuffer.finish().unwrap();
            out.truncate(length);
            prop_assert!(!out.contains(&0));
            prop_assert_eq!(&out, &expected(&data));
            let length = cobs::decode_in_place(&mut out).unwrap();
            prop_assert_eq!(&out[..length], &data[..]);
        }

        #[test]
        fn the_bytes_of_another_encoder_come_back(data in data()) {
            let mut bytes = expected(&data);
            prop_assert_eq!(unstuff(&mut bytes), Some(data.len()));
            prop_assert_eq!(&bytes[..data.len()], &data[..]);
        }

        /// Any bytes without a zero: what another decoder refuses is refused, and all else is equal.
        #[test]
        fn any_bytes_are_decoded_as_by_another_decoder(
            bytes in prop::collection::vec(prop_oneof![4 => 1..8u8, 1 => 1..=255u8, 1 => Just(255)], 0..900),
        ) {
            let (mut ours, mut theirs) = (bytes.clone(), bytes);
            let length = cobs::decode_in_place(&mut theirs).ok();
            prop_assert_eq!(unstuff(&mut ours), length);
            let length = length.unwrap_or(0);
            prop_assert_eq!(&ours[..length], &theirs[..length]);
        }

        #[test]
        fn a_buffer_that_is_too_small_is_an_error(data in data(), short in 1..600usize) {
            let needed = expected(&data).len();
            let mut out = std::vec![0; needed.saturating_sub(short)];
            let mut stuffer = Stuffer::new(&mut out);
            prop_assert!(stuffer.push(&data).and_then(|()| stuffer.finish()).is_err());
        }
    }
}
