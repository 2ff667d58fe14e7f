//! Checks that the lengths in a record fit into the record.
//!
//! The mcap crate reserves memory for a string's claimed length before it checks that the string
//! exists. One flipped length costs up to 4 GiB of memory (0.26).
//!
//! # Invariant
//! A record that passes claims no string longer than itself
//! (`tests::a_length_beyond_the_record_is_noticed`).

use mcap::records::op;

/// Whether all strings of a record of this kind lie within `record`.
pub(super) fn fit(opcode: u8, record: &[u8]) -> bool {
    let mut rest = Rest(record);
    let read = match opcode {
        // The profile and the library.
        op::HEADER => rest.string().and_then(|()| rest.string()),
        // Two numbers of 16 bits, then topic, encoding and metadata.
        op::CHANNEL => rest
            .take(4)
            .and_then(|_| rest.string())
            .and_then(|()| rest.string())
            .and_then(|()| rest.strings()),
        // The name, then the metadata.
        op::METADATA => rest.string().and_then(|()| rest.strings()),
        _ => Some(()),
    };
    read.is_some()
}

/// The part of a record that is not read yet.
struct Rest<'r>(&'r [u8]);

impl<'r> Rest<'r> {
    fn take(&mut self, length: usize) -> Option<&'r [u8]> {
        let (taken, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(taken)
    }

    /// Reads a length of 32 bits, and as many bytes.
    fn block(&mut self) -> Option<&'r [u8]> {
        let length = u32::from_le_bytes(*self.take(4)?.first_chunk()?);
        self.take(usize::try_from(length).ok()?)
    }

    fn string(&mut self) -> Option<()> {
        self.block().map(drop)
    }

    /// Reads a block of strings.
    fn strings(&mut self) -> Option<()> {
        let mut block = Rest(self.block()?);
        while !block.0.is_empty() {
            block.string()?;
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn string(text: &str) -> Vec<u8> {
        let length = u32::try_from(text.len()).unwrap().to_le_bytes();
        [&length[..], text.as_bytes()].concat()
    }

    fn map(texts: &[String]) -> Vec<u8> {
        let strings: Vec<u8> = texts.iter().flat_map(|text| string(text)).collect();
        let length = u32::try_from(strings.len()).unwrap().to_le_bytes();
        [&length[..], &strings].concat()
    }

    proptest! {
        #[test]
        fn a_length_beyond_the_record_is_noticed(
            texts in prop::collection::vec("[a-z]{0,8}", 2..6), more in 1u32..=u32::MAX / 2,
        ) {
            let (first, second) = (string(&texts[0]), string(&texts[1]));
            let metadata = map(&texts[2..]);
            let records = [
                (op::HEADER, [first.clone(), second.clone()].concat(), 0),
                (op::CHANNEL, [vec![0; 4], first.clone(), second, metadata.clone()].concat(), 4),
                (op::METADATA, [first, metadata].concat(), 0),
            ];
            for (opcode, mut record, at) in records {
                prop_assert!(fit(opcode, &record), "{opcode}");
                let rest = u32::try_from(record.len() - at - 4).unwrap();
                record[at..at + 4].copy_from_slice(&(rest + more).to_le_bytes());
                prop_assert!(!fit(opcode, &record), "{opcode}");
            }
        }

        #[test]
        fn any_bytes_are_judged(opcode: u8, record: Vec<u8>) {
            let _ = fit(opcode, &record);
        }
    }
}
