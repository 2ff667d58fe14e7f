//! The samples of a frame: one signed number of 24 or 32 bits for each pattern, with one exponent for all.
//!
//! A pattern's integrated ADC sample is the difference of two 48-bit sums. The difference almost
//! always fits into 32 bits (up to 2^17 / window sweeps). Otherwise all samples of the frame are
//! shifted right by the same `shift` and rounded, so that a frame has 4 bytes for each pattern at
//! any number of sweeps.
//!
//! A host may ask for samples of 24 bits ([`Configuration::narrow`](crate::Configuration::narrow)). It gets
//! them in packets of the FPGA, where no difference of the run can leave 24 bits
//! ([`MAX_NARROW_SAMPLES`](crate::ready::MAX_NARROW_SAMPLES)). The values are the same in both widths.

use serde::{
    Deserialize, Deserializer, Serialize, Serializer, de::Error as _, ser::SerializeTuple,
};

/// Largest shift: 49-bit differences into 32-bit words.
pub const MAX_SHIFT: u8 = 18;

/// What stands in the place of the shift before samples of 24 bits, which have none.
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
    /// The first protocol version that has [`Width::Bits24`].
    pub const NARROW_SINCE: u16 = 4;

    /// Bytes of a sample.
    #[must_use]
    pub const fn bytes(self) -> usize {
        match self {
            Self::Bits32 => 4,
            Self::Bits24 => 3,
        }
    }

    /// The byte before samples of this width that have no shift.
    #[must_use]
    pub const fn form(self) -> u8 {
        match self {
            Self::Bits32 => 0,
            Self::Bits24 => NARROW,
        }
    }
}

/// Little-endian signed words of 24 or 32 bits; the sample is `word << shift`, in summed ADC counts.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Samples<'a> {
    /// The shift of words of 32 bits, or [`NARROW`].
    form: u8,
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

    /// Packs `values` (summed ADC counts) into `buffer`, 3 bytes each.
    ///
    /// # Errors
    /// If the buffer is smaller than `3 * values.len()`, or a value has more than 24 bits.
    pub fn pack_narrow<I>(values: I, buffer: &'a mut [u8]) -> Result<Self, SamplesError>
    where
        I: ExactSizeIterator<Item = i64>,
    {
        let buffer = buffer.get_mut(..3 * values.len()).ok_or(SamplesError)?;
        let mut magnitude = 0u64;
        for (word, value) in buffer.chunks_exact_mut(3).zip(values) {
            magnitude |= (value ^ (value >> 63)) as u64;
            let [low, middle, high, _] = (value as i32).to_le_bytes();
            word.copy_from_slice(&[low, middle, high]);
        }
        // Folded as in `pack`, a value of 24 bits has 23.
        if magnitude >> 23 == 0 { Self::packed(NARROW, buffer) } else { Err(SamplesError) }
    }

    /// Samples that were packed with this [`form`](Self::form).
    ///
    /// # Errors
    /// If the form is neither [`NARROW`] nor a shift of at most [`MAX_SHIFT`], or the bytes are not whole words.
    pub fn packed(form: u8, words: &'a [u8]) -> Result<Self, SamplesError> {
        let samples = Self { form, words };
        let exists = form == NARROW || form <= MAX_SHIFT;
        if !exists || !words.len().is_multiple_of(samples.width().bytes()) {
            return Err(SamplesError);
        }
        Ok(samples)
    }

    /// The byte before the words: the shift of words of 32 bits, or [`NARROW`].
    #[must_use]
    pub fn form(&self) -> u8 {
        self.form
    }

    /// Bits of a word.
    #[must_use]
    pub const fn width(&self) -> Width {
        if self.form == NARROW { Width::Bits24 } else { Width::Bits32 }
    }

    /// Number of samples, one a pattern.
    #[must_use]
    pub fn len(&self) -> usize {
        self.words.len() / self.width().bytes()
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

    /// Exponent: values are exact if it is 0, and rounded to multiples of `2^shift` otherwise.
    #[must_use]
    pub fn shift(&self) -> u8 {
        if self.form == NARROW { 0 } else { self.form }
    }

    /// The samples in summed ADC counts, in the order shown.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = i64> + Clone + use<'a> {
        let shift = self.shift();
        self.words.chunks_exact(self.width().bytes()).map(move |word| match *word {
            [b0, b1, b2, b3] => i64::from(i32::from_le_bytes([b0, b1, b2, b3])) << shift,
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
        tuple.serialize_element(&self.form)?;
        tuple.serialize_element(&Block(self.words))?;
        tuple.end()
    }
}

impl<'de: 'a, 'a> Deserialize<'de> for Samples<'a> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let (form, Block(words)) = Deserialize::deserialize(deserializer)?;
        Self::packed(form, words).map_err(|_| D::Error::custom("samples"))
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

    proptest! {
        #[test]
        fn narrow_samples_come_back_exact_or_are_refused(
            values in prop::collection::vec(-(1i64 << 26)..(1i64 << 26), 0..64), narrow in 0u32..27,
        ) {
            let values: Vec<i64> = values.iter().map(|v| v >> narrow).collect();
            let mut buffer = [0; 192];
            let packed = Samples::pack_narrow(values.iter().copied(), &mut buffer);
            let fits = values.iter().all(|v| (-(1 << 23)..1 << 23).contains(v));
            prop_assert_eq!(packed.is_ok(), fits);
            if let Ok(samples) = packed {
                prop_assert_eq!((samples.form(), samples.shift()), (NARROW, 0));
                prop_assert_eq!(samples.len(), values.len());
                prop_assert_eq!(samples.iter().collect::<Vec<_>>(), values);
            }
        }
    }

    #[test]
    fn the_ends_of_24_bits_are_the_last_values_that_fit() {
        let (least, most) = (-(1i64 << 23), (1i64 << 23) - 1);
        let mut buffer = [0; 6];
        let samples = Samples::pack_narrow([least, most].into_iter(), &mut buffer).unwrap();
        assert!(samples.iter().eq([least, most]));
        for over in [least - 1, most + 1, i64::MIN, i64::MAX] {
            assert_eq!(Samples::pack_narrow([over].into_iter(), &mut [0; 3]), Err(SamplesError));
        }
        assert_eq!(Samples::pack_narrow([1, 2].into_iter(), &mut [0; 5]), Err(SamplesError));
    }

    #[test]
    fn the_extremes_of_an_accumulator_fit() {
        let extremes = [(1i64 << 48) - 1, -((1i64 << 48) - 1), i64::from(i32::MAX), 0, -1];
        let mut buffer = [0; 20];
        let samples = Samples::pack(extremes.iter().copied(), &mut buffer).unwrap();
        assert!(samples.shift() <= MAX_SHIFT);
        assert_eq!((samples.len(), samples.byte_len(), samples.is_empty()), (5, 20, false));
        let none = Samples::pack([].into_iter(), &mut []).unwrap();
        assert_eq!((none.len(), none.byte_len(), none.is_empty()), (0, 0, true));
    }

    /// With the shift that their bits ask for, these would round up to 2^31, which is no `i32`.
    #[test]
    fn a_sample_that_rounds_up_out_of_its_bits_gets_a_shift_more() {
        for bits in 32..=48 {
            let value = (1i64 << bits) - 1;
            let mut buffer = [0; 8];
            let samples = Samples::pack([value, 0].into_iter(), &mut buffer).unwrap();
            assert_eq!(samples.shift(), bits - 30);
            assert!(samples.iter().eq([value + 1, 0]), "{samples:?}");
        }
    }

    #[test]
    fn a_short_buffer_is_refused() {
        assert_eq!(Samples::pack([1i64, 2].into_iter(), &mut [0; 7]), Err(SamplesError));
        assert_eq!(Words::pack([1u16, 2].into_iter(), &mut [0; 3]), Err(SamplesError));
    }
}
