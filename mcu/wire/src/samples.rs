//! The samples of a frame: one signed number of 24 or 32 bits for each pattern.
//!
//! A pattern's integrated ADC sample is the difference of two sums. A camera accepts only configurations in which every
//! difference fits into 32 bits ([`MAX_SUMMED_SAMPLES`](crate::ready::MAX_SUMMED_SAMPLES)), so samples are exact. In a
//! run in which every difference fits into 24 bits
//! ([`MAX_NARROW_SAMPLES`](crate::ready::MAX_NARROW_SAMPLES)), samples have 24 bits. The values are the same in both
//! widths.

use serde::{
    Deserialize, Deserializer, Serialize, Serializer, de::Error as _, ser::SerializeTuple,
};

/// The byte before samples of 24 bits. Before samples of 32 bits, the byte is 0.
pub const NARROW: u8 = 0x80;

/// How many bits a sample has on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Width {
    /// Four bytes a sample.
    #[default]
    Bits32,
    /// Three bytes a sample.
    Bits24,
}

impl Width {
    /// Bytes of a sample.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self {
            Self::Bits32 => 4,
            Self::Bits24 => 3,
        }
    }

    /// The byte before samples of this width.
    #[must_use]
    pub const fn form(self) -> u8 {
        match self {
            Self::Bits32 => 0,
            Self::Bits24 => NARROW,
        }
    }
}

/// Little-endian signed words of 24 or 32 bits, in summed ADC counts.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Samples<'a> {
    width: Width,
    words: &'a [u8],
}

/// Bytes that are not valid samples, a value that its width does not hold, or a buffer that is too small.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SamplesError;

impl<'a> Samples<'a> {
    /// Packs `values` (summed ADC counts) into `buffer`, 3 or 4 bytes each.
    ///
    /// # Errors
    /// If the buffer is too small, or a value has more bits than the width.
    pub fn pack<I>(values: I, width: Width, buffer: &'a mut [u8]) -> Result<Self, SamplesError>
    where
        I: ExactSizeIterator<Item = i64>,
    {
        let bytes = width.bytes();
        let buffer = buffer.get_mut(..bytes * values.len()).ok_or(SamplesError)?;
        let mut magnitude = 0u64;
        for (word, value) in buffer.chunks_exact_mut(bytes).zip(values) {
            // Negative values are folded so that the least and the most of a width need the same bits.
            magnitude |= (value ^ (value >> 63)) as u64;
            let all = (value as i32).to_le_bytes();
            word.copy_from_slice(all.get(..bytes).unwrap_or_default());
        }
        // One bit is the sign.
        if magnitude >> (8 * bytes - 1) == 0 {
            Ok(Self { width, words: buffer })
        } else {
            Err(SamplesError)
        }
    }

    /// Samples of bytes that are already little-endian words.
    ///
    /// # Errors
    /// If the bytes are not whole words.
    pub fn packed(width: Width, words: &'a [u8]) -> Result<Self, SamplesError> {
        if words.len().is_multiple_of(width.bytes()) {
            Ok(Self { width, words })
        } else {
            Err(SamplesError)
        }
    }

    /// Bits of a word.
    #[must_use]
    pub const fn width(&self) -> Width {
        self.width
    }

    /// Number of samples, one a pattern.
    #[must_use]
    pub fn len(&self) -> usize {
        self.words.len() / self.width.bytes()
    }

    /// Number of bytes of all samples.
    #[must_use]
    pub fn byte_len(&self) -> usize {
        self.words.len()
    }

    /// Whether there is no sample at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.words.is_empty()
    }

    /// The samples in summed ADC counts, in the order shown.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = i64> + Clone + use<'a> {
        self.words.chunks_exact(self.width.bytes()).map(|word| match *word {
            [b0, b1, b2, b3] => i64::from(i32::from_le_bytes([b0, b1, b2, b3])),
            [b0, b1, b2] => i64::from(i32::from_le_bytes([0, b0, b1, b2]) >> 8),
            _ => 0,
        })
    }
}

impl core::fmt::Debug for Samples<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

/// Bytes as one block. Without this type, postcard would process one byte at a time.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Block<'a>(pub &'a [u8]);

impl Serialize for Block<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_bytes(self.0)
    }
}

impl<'de: 'a, 'a> Deserialize<'de> for Block<'a> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        <&'a [u8]>::deserialize(deserializer).map(Self)
    }
}

impl Serialize for Samples<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut tuple = serializer.serialize_tuple(2)?;
        tuple.serialize_element(&self.width.form())?;
        tuple.serialize_element(&Block(self.words))?;
        tuple.end()
    }
}

impl<'de: 'a, 'a> Deserialize<'de> for Samples<'a> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let (form, Block(words)): (u8, _) = Deserialize::deserialize(deserializer)?;
        [Width::Bits24, Width::Bits32]
            .into_iter()
            .find(|width| width.form() == form)
            .and_then(|width| Self::packed(width, words).ok())
            .ok_or_else(|| D::Error::custom("samples"))
    }
}

/// Little-endian `u16` words: an order table, raw ADC samples, distances in mm.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Words<'a>(&'a [u8]);

impl<'a> Words<'a> {
    /// Packs `values` into `buffer`, 2 bytes each.
    ///
    /// # Errors
    /// If the buffer is too small.
    pub fn pack<I: ExactSizeIterator<Item = u16>>(
        values: I,
        buffer: &'a mut [u8],
    ) -> Result<Self, SamplesError> {
        let buffer = buffer.get_mut(..2 * values.len()).ok_or(SamplesError)?;
        for (word, value) in buffer.chunks_exact_mut(2).zip(values) {
            word.copy_from_slice(&value.to_le_bytes());
        }
        Ok(Self(buffer))
    }

    /// Wraps bytes that are already little-endian words.
    ///
    /// # Errors
    /// If the number of bytes is odd.
    pub fn from_le_bytes(bytes: &'a [u8]) -> Result<Self, SamplesError> {
        if bytes.len().is_multiple_of(2) { Ok(Self(bytes)) } else { Err(SamplesError) }
    }

    /// Number of words.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.len() / 2
    }

    /// Whether there is no word.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The words in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = u16> + Clone + use<'a> {
        self.0.chunks_exact(2).map(|w| u16::from_le_bytes([w[0], w[1]]))
    }
}

impl core::fmt::Debug for Words<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

impl Serialize for Words<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Block(self.0).serialize(serializer)
    }
}

impl<'de: 'a, 'a> Deserialize<'de> for Words<'a> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let Block(bytes) = Block::deserialize(deserializer)?;
        Self::from_le_bytes(bytes).map_err(|_| D::Error::custom("words"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    proptest! {
        #[test]
        fn samples_come_back_exact_or_are_refused(
            values in prop::collection::vec(-(1i64 << 48)..(1i64 << 48), 0..64), fewer in 0u32..48,
        ) {
            let values: Vec<i64> = values.iter().map(|v| v >> fewer).collect();
            for (width, bits) in [(Width::Bits24, 24), (Width::Bits32, 32)] {
                let mut buffer = [0; 256];
                let packed = Samples::pack(values.iter().copied(), width, &mut buffer);
                let ends = -(1i64 << (bits - 1))..1 << (bits - 1);
                prop_assert_eq!(packed.is_ok(), values.iter().all(|v| ends.contains(v)));
                if let Ok(samples) = packed {
                    prop_assert_eq!(samples.width(), width);
                    prop_assert_eq!(samples.byte_len(), width.bytes() * values.len());
                    prop_assert_eq!((samples.len(), samples.is_empty()), (values.len(), values.is_empty()));
                    prop_assert_eq!(samples.iter().collect::<Vec<_>>(), values.clone());
                }
            }
        }
    }

    #[test]
    fn the_ends_of_a_width_are_the_last_values_that_fit() {
        for (width, bits) in [(Width::Bits24, 24), (Width::Bits32, 32)] {
            let (least, most) = (-(1i64 << (bits - 1)), (1i64 << (bits - 1)) - 1);
            let mut buffer = [0; 8];
            let samples = Samples::pack([least, most].into_iter(), width, &mut buffer).unwrap();
            assert!(samples.iter().eq([least, most]));
            for over in [least - 1, most + 1, i64::MIN, i64::MAX] {
                let mut room = [0; 4];
                assert_eq!(Samples::pack([over].into_iter(), width, &mut room), Err(SamplesError));
            }
        }
    }

    #[test]
    fn a_short_buffer_is_refused() {
        for width in [Width::Bits24, Width::Bits32] {
            let mut buffer = [0; 8];
            let short = &mut buffer[..2 * width.bytes() - 1];
            assert_eq!(Samples::pack([1i64, 2].into_iter(), width, short), Err(SamplesError));
        }
        assert_eq!(Words::pack([1u16, 2].into_iter(), &mut [0; 3]), Err(SamplesError));
    }
}
