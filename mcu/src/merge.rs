//! Packets into transfers of one length: what a USB bulk endpoint moves fastest is full packets.
//!
//! The one law: every byte goes out once, in order, and none waits while nothing follows it: the last transfer
//! is a short one, or an empty one where the bytes end with a full transfer, since only that ends a bulk read.

/// Gathers bytes into transfers of `N`.
#[derive(Debug)]
pub struct Merger<const N: usize> {
    bytes: [u8; N],
    filled: usize,
    /// The last transfer was full, so the reader still waits for the end.
    open: bool,
}

impl<const N: usize> Merger<N> {
    /// With nothing in it.
    #[must_use]
    pub const fn new() -> Self {
        Self { bytes: [0; N], filled: 0, open: false }
    }

    /// Takes bytes as far as there is room; returns how many.
    pub fn take(&mut self, bytes: &[u8]) -> usize {
        let Some(room) = self.bytes.get_mut(self.filled..) else { return 0 };
        let length = room.len().min(bytes.len());
        if let (Some(to), Some(from)) = (room.get_mut(..length), bytes.get(..length)) {
            to.copy_from_slice(from);
        }
        self.filled = self.filled.saturating_add(length);
        length
    }

    /// There is no room for more.
    #[must_use]
    pub const fn is_full(&self) -> bool {
        self.filled >= N
    }

    /// Nothing is to be sent, not even an end.
    #[must_use]
    pub const fn is_done(&self) -> bool {
        self.filled == 0 && !self.open
    }

    /// The transfer to send now that it is full or nothing follows; empty where it only ends a bulk read.
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
