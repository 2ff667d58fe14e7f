//! The filter LZF, which h5py alone uses to compress arrays.
//!
//! Format: Marc Lehmann, LibLZF 3.6, `lzf_d.c`; h5py's filter 32000, whose third value is the length of a chunk.

use hdf5_reader::error::Error;
use hdf5_reader::messages::filter_pipeline::FilterDescription;

/// The number of the filter.
pub(super) const LZF: u16 = 32000;

/// Unpacks a chunk, of at most the length that its filter states.
pub(super) fn unpacked(
    filter: &FilterDescription,
    packed: &[u8],
    most: usize,
) -> Result<Vec<u8>, Error> {
    let length = filter.client_data.get(2).map_or(most, |&length| length as usize);
    let cut = || Error::DecompressionError("LZF: the chunk is damaged".to_owned());
    let mut bytes = Vec::new();
    let mut packed = packed.iter().map(|&byte| usize::from(byte));
    while let Some(control) = packed.next() {
        if control < 32 {
            let run = packed.by_ref().take(control + 1).map(|byte| byte as u8);
            let before = bytes.len();
            bytes.extend(run);
            if bytes.len() != before + control + 1 {
                return Err(cut());
            }
        } else {
            let more = if control >> 5 == 7 { packed.next().ok_or_else(cut)? } else { 0 };
            let back = ((control & 31) << 8) + packed.next().ok_or_else(cut)? + 1;
            let start = bytes.len().checked_sub(back).ok_or_else(cut)?;
            // What is copied may reach into itself.
            for at in start..start + (control >> 5) + more + 2 {
                bytes.push(bytes[at]);
            }
        }
        if bytes.len() > length.min(most) {
            return Err(cut());
        }
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chunk_is_unpacked_or_refused() {
        let of =
            |length| FilterDescription { id: LZF, name: None, client_data: vec![4, 261, length] };
        // "abc", six bytes from three before, and twelve times the last one.
        let packed = [2, b'a', b'b', b'c', 4 << 5, 2, 7 << 5, 3, 0];
        let found = unpacked(&of(21), &packed, 100).unwrap();
        assert_eq!(found, [&b"abcabcabc"[..], &[b'c'; 12]].concat());
        for end in [2, 5, 7, 8] {
            assert!(unpacked(&of(21), &packed[..end], 100).is_err(), "{end}");
        }
        assert!(
            unpacked(&of(20), &packed, 100).is_err() && unpacked(&of(21), &packed, 20).is_err()
        );
        assert!(unpacked(&of(21), &[32, 5], 100).is_err());
        assert!(unpacked(&of(21), &[], 100).unwrap().is_empty());
    }
}
