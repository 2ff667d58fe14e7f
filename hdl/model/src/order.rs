//! Which pattern is shown k-th: natural, sequency, or from a table in block RAM.
//!
//! The one law: the table belongs to the host port at rest and to the sequencer during a run.

use nirspi_wire::{PATTERNS, register::ORDER_TABLE, walsh};

/// Bits of a pattern number.
const PATTERN_MASK: u32 = PATTERNS as u32 - 1;

/// Rule of the order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Order {
    Natural,
    Sequency,
    Table,
}

/// The table, one pattern number an entry.
#[derive(Debug, Clone)]
pub(crate) struct OrderTable([u16; PATTERNS as usize]);

impl OrderTable {
    /// As block RAM is after power-up.
    pub(crate) fn new() -> Self {
        Self([0; PATTERNS as usize])
    }

    /// The entry at an address of the host port, if one lies there.
    pub(crate) fn at(&self, address: u16) -> Option<u32> {
        self.0.get(usize::from(address.checked_sub(ORDER_TABLE)?)).map(|&pattern| pattern.into())
    }

    /// The same, to write it.
    pub(crate) fn write(&mut self, address: u16, value: u32) {
        let index = address.checked_sub(ORDER_TABLE).map(usize::from);
        if let Some(entry) = index.and_then(|index| self.0.get_mut(index)) {
            *entry = (value & PATTERN_MASK) as u16;
        }
    }

    /// Pattern shown at this place of the order.
    pub(crate) fn pattern(&self, order: Order, index: u16) -> u16 {
        match order {
            Order::Natural => index,
            Order::Sequency => walsh::sequency(index),
            Order::Table => self.0[usize::from(index)],
        }
    }
}
