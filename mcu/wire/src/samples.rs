//! The samples of a frame: one signed 32-bit number for each pattern, with one exponent for all.
//!
//! A pattern's integrated ADC sample is the difference of two 48-bit sums. The difference almost
//! always fits into 32 bits (up to 2^17 / window sweeps). Otherwise all samples of the frame are
//! shifted right by the same `shift` and rounded, so that a frame has 4 bytes for each pattern at
//! any number of sweeps.

use serde::{
    Deserialize, Deserializer, Serialize, Serializer, de::Error as _, ser::SerializeTuple,
};

/// Largest shift: 49-bit differences into 32-bit words.
pub const MAX_SHIFT: u8 = 18;

/// Little-endian `i32` words; the sample is `word << shift`, in summed ADC counts.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Samples<'a> {
    shift: u8,
    words: &'a [u8],
}

/// Bytes that are not valid samples, or a buffer that is too small.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SamplesError;

impl<'a> Samples<'a> {
    /// Packs `values` (summed ADC counts) into `buffer`, 4 bytes each, with the smallest shift that
    /// fits.
    ///
    /// # Errors
    /// If the buffer is smaller than `4 * values.len()`.
    pub fn pack<I>(values: I, buffer: &'a mut [u8]) -> Result<Self, SamplesError>
    where
        I: ExactSizeIterator<Item = i64> + Clone,
    {
        let buffer = buffer.get_mut(..4 * values.len()).ok_or(SamplesError)?;
        let mut magnitude = 0u64;
        // Almost always the values fit without a shift, and one pass is enough.
        for (word, value) in buffer.chunks_exact_mut(4).zip(values.clone()) {
            // Negative values are folded so that i32::MIN and i32::MAX need the same width.
            magnitude |= (value ^ (value >> 63)) as u64;
            word.copy_from_slice(&(value as i32).to_le_bytes());
        }
        let mut shift = (64 - magnitude.leading_zeros()).saturating_sub(31) as u8;
        if shift > 0 {
            let rounded = |value: i64, shift: u8| (value + (1i64 << (shift - 1))) >> shift;
            // Rounding up may need one bit more.
            if values.clone().any(|value| i32::try_from(rounded(value, shift)).is_err()) {
                shift += 1;
            }
            for (word, value) in buffer.chunks_exact_mut(4).zip(values) {
                word.copy_from_slice(&(rounded(value, shift) as i32).to_le_bytes());
            }
        }
        Self::packed(shift, buffer)
    }

    /// Samples that [`pack`](Self::pack) has packed with this shift.
    ///
    /// # Errors
    /// If the shift is above [`MAX_SHIFT`], or the bytes are not whole words.
    pub fn packed(shift: u8, words: &'a [u8]) -> Result<Self, SamplesError> {
        if shift > MAX_SHIFT || !words.len().is_multiple_of(4) {
            return Err(SamplesError);
        }
        Ok(Self { shift, words })
    }

    /// Number of samples, one a pattern.
    #[must_use]
    pub fn len(&self) -> usize {
        self.words.len() / 4
    }

    /// Whether there is no sample at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.words.is_empty()
    }

    /// Exponent: values are exact if it is 0, and rounded to multiples of `2^shift` otherwise.
    #[must_use]
    pub fn shift(&self) -> u8 {
        self.shift
    }

    /// The samples in summed ADC counts, in the order shown.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = i64> + Clone + use<'a> {
        let shift = self.shift;
        self.words
            .chunks_exact(4)
            .map(move |w| i64::from(i32::from_le_bytes([w[0], w[1], w[2], w[3]])) << shift)
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
        tuple.serialize_element(&self.shift)?;
        tuple.serialize_element(&Block(self.words))?;
        tuple.end()
    }
}

impl<'de: 'a, 'a> Deserialize<'de> for Samples<'a> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let (shift, Block(words)) = Deserialize::deserialize(deserializer)?;
        Self::packed(shift, words).map_err(|_| D::Error::custom("samples"))
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
        fn samples_come_back_exact_or_rounded_to_the_shift(
            values in prop::collection::vec(-(1i64 << 48)..(1i64 << 48), 0..64),
            narrow in 0u32..48,
        ) {
            let values: Vec<i64> = values.iter().map(|v| v >> narrow).collect();
            let mut buffer = [0; 256];
            let samples = Samples::pack(values.iter().copied(), &mut buffer).unwrap();
            let unit = 1i64 << samples.shift();
            let fits = values.iter().all(|&v| i32::try_from(v).is_ok());
            prop_assert_eq!(samples.shift() == 0, fits);
            for (back, value) in samples.iter().zip(&values) {
                prop_assert!((back - value).abs() <= unit / 2, "{back} for {value}");
            }
        }
    }

    #[test]
    fn the_extremes_of_an_accumulator_fit() {
        let extremes = [(1i64 << 48) - 1, -((1i64 << 48) - 1), i64::from(i32::MAX), 0, -1];
        let mut buffer = [0; 20];
        let samples = Samples::pack(extremes.iter().copied(), &mut buffer).unwrap();
        assert!(samples.shift() <= MAX_SHIFT);
        assert_eq!(samples.len(), 5);
    }

    #[test]
    fn a_short_buffer_is_refused() {
        assert_eq!(Samples::pack([1i64, 2].into_iter(), &mut [0; 7]), Err(SamplesError));
        assert_eq!(Words::pack([1u16, 2].into_iter(), &mut [0; 3]), Err(SamplesError));
    }
}
