//! Floats whose first one begins a cache line.
//!
//! A vector of 64 bytes that begins elsewhere lies in two cache lines, and each load or store of
//! it takes twice as long.

use std::ops::{Deref, DerefMut};

/// Bytes of a cache line, and of the widest vector.
const LINE: usize = 64;

/// Floats of a cache line. Rows of matrices are padded to a multiple of this.
pub(super) const LINE_FLOATS: usize = LINE / size_of::<f32>();

/// A slice of floats that begins at the start of a cache line.
#[derive(Debug, Default)]
pub(super) struct Aligned {
    values: Vec<f32>,
    first: usize,
    count: usize,
}

impl Aligned {
    /// `count` zeros.
    pub fn zeros(count: usize) -> Self {
        let values = vec![0.0; count + LINE_FLOATS - 1];
        let first = values.as_ptr().align_offset(LINE).min(LINE_FLOATS - 1);
        Self { values, first, count }
    }

    /// The first `count` floats, after new memory is taken if there are fewer. Their values are
    /// those of an earlier use, or zeros.
    pub fn at_least(&mut self, count: usize) -> &mut [f32] {
        if self.count < count {
            *self = Self::zeros(count);
        }
        &mut self[..count]
    }
}

impl Clone for Aligned {
    fn clone(&self) -> Self {
        let mut copy = Self::zeros(self.count);
        copy.copy_from_slice(self);
        copy
    }
}

impl Deref for Aligned {
    type Target = [f32];

    fn deref(&self) -> &[f32] {
        &self.values[self.first..][..self.count]
    }
}

impl DerefMut for Aligned {
    fn deref_mut(&mut self) -> &mut [f32] {
        &mut self.values[self.first..][..self.count]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floats_begin_a_cache_line_in_copies_too() {
        for count in [1, 15, 16, 1000] {
            let mut floats = Aligned::zeros(count);
            floats[count - 1] = 3.0;
            let copy = floats.clone();
            assert_eq!(*copy, *floats);
            for floats in [&floats, &copy] {
                assert_eq!((floats.as_ptr() as usize % LINE, floats.len()), (0, count));
            }
        }
    }

    #[test]
    fn a_buffer_grows_and_never_shrinks() {
        let mut buffer = Aligned::default();
        buffer.at_least(8).fill(1.0);
        assert_eq!(buffer.at_least(4), [1.0; 4]);
        assert_eq!(buffer.len(), 8);
        assert_eq!(buffer.at_least(9), [0.0; 9]);
    }
}
