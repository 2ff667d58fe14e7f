//! Merges packets into transfers of one length, because a USB bulk endpoint is fastest with full
//! packets.
//!
//! # Invariant
//! Every byte goes out once and in order, and only the last transfer is short
//! (`tests::merge::every_byte_goes_out_once_in_order_and_only_the_last_transfer_is_short`). Bytes
//! that end with a full transfer are followed by an empty transfer, because a bulk read ends only
//! with a short transfer
//! (`tests::merge::bytes_that_end_with_a_full_transfer_are_followed_by_an_empty_one`).

/// Gathers bytes into transfers of `N`.
#[derive(Debug)]
pub struct Merger<const N: usize> {
    bytes: [u8; N],
    filled: usize,
    /// The last transfer was full, so the reader still waits for a short one.
    open: bool,
}

impl<const N: usize> Merger<N> {
    /// An empty merger.
    #[must_use]
    pub const fn new() -> Self {
        Self { bytes: [0; N], filled: 0, open: false }
    }

    /// Takes bytes while there is room, and returns how many.
    pub fn take(&mut self, bytes: &[u8]) -> usize {
        let Some(room) = self.bytes.get_mut(self.filled..) else { return 0 };
        let length = room.len().min(bytes.len());
        if let (Some(to), Some(from)) = (room.get_mut(..length), bytes.get(..length)) {
            to.copy_from_slice(from);
        }
        self.filled = self.filled.saturating_add(length);
        length
    }

    /// Whether there is no room for more bytes.
    #[must_use]
    pub const fn is_full(&self) -> bool {
        self.filled >= N
    }

    /// Whether nothing waits, not even an empty transfer.
    #[must_use]
    pub const fn is_done(&self) -> bool {
        self.filled == 0 && !self.open
    }

    /// Whether bytes that fill a transfer may pass by without a copy, which they may where nothing is gathered. Their
    /// transfer counts as a full one.
    pub const fn lets_pass(&mut self) -> bool {
        let is_empty = self.filled == 0;
        if is_empty {
            self.open = true;
        }
        is_empty
    }

    /// The transfer to send now, because it is full or no bytes follow. An empty transfer only ends
    /// a bulk read.
    pub fn transfer(&mut self) -> &[u8] {
        let length = core::mem::take(&mut self.filled);
        self.open = length >= N;
        self.bytes.get(..length).unwrap_or(&[])
    }
}

impl<const N: usize> Default for Merger<N> {
    fn default() -> Self {
        Self::new()
    }
}
