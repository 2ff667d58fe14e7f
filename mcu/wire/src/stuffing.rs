//! COBS (Cheshire and Baker 1999), on its way into the caller's buffer: no zero is left in what comes out.
//!
//! A block is a code byte, the distance to the next one, and the bytes in between; each zero is the end of a block, and
//! so are 254 bytes without one. The one law: the same bytes come out, whatever pieces went in.

/// Longest distance, which stands for no zero.
const FULL: usize = 0xFF;

/// The bytes do not fit.
#[derive(Debug)]
pub(crate) struct Overflow;

/// Encodes into `out`.
pub(crate) struct Stuffer<'b> {
    out: &'b mut [u8],
    /// Where the open block's code byte is.
    code: usize,
    /// Where the next byte goes.
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
            // So many cannot fill the block, wherever its zeros are.
            let length = rest.len().min(FULL - (self.next - self.code));
            let (part, after) = rest.split_at(length);
            self.push_part(part)?;
            rest = after;
        }
        Ok(())
    }

    /// A zero is left out; in its place will be the code of the block after it.
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

    /// Closes the last block; length of all.
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

    /// Zeros here and there, and runs of about a block's length without.
    fn data() -> impl Strategy<Value = Vec<u8>> {
        let run = (0..=600usize, any::<bool>(), 1u8..).prop_map(|(length, ends, byte)| {
            let mut run = std::vec![byte; length];
            run.extend(ends.then_some(0));
            run
        });
        prop::collection::vec(run, 0..5).prop_map(|runs| runs.concat())
    }

    /// By the encoder of others.
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
