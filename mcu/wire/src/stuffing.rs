//! Encodes COBS (Cheshire and Baker 1999) directly into the caller's buffer. The encoded bytes
//! contain no zero.
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
        fn a_buffer_that_is_too_small_is_an_error(data in data(), short in 1..600usize) {
            let needed = expected(&data).len();
            let mut out = std::vec![0; needed.saturating_sub(short)];
            let mut stuffer = Stuffer::new(&mut out);
            prop_assert!(stuffer.push(&data).and_then(|()| stuffer.finish()).is_err());
        }
    }
}
