//! Which pattern is shown k-th: natural order, sequency order, or an order from a table in block
//! RAM.
//!
//! # Invariant
//! The host port cannot write the table during a run
//! (`golden::runs::the_order_table_is_the_sequencers_during_a_run`).

use nirspi_wire::{PATTERNS, register::ORDER_TABLE, walsh};

/// Bits of a pattern number.
const PATTERN_MASK: u32 = PATTERNS as u32 - 1;

/// Source of the order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Order {
    Natural,
    Sequency,
    Table,
}

/// The table: one pattern number for each place.
#[derive(Debug, Clone)]
pub(crate) struct OrderTable([u16; PATTERNS as usize]);

impl OrderTable {
    /// The contents of block RAM after power-up.
    pub(crate) fn new() -> Self {
        Self([0; PATTERNS as usize])
    }

    /// The entry at an address of the host port; `None` if the address is not in the table.
    pub(crate) fn at(&self, address: u16) -> Option<u32> {
        self.0.get(usize::from(address.checked_sub(ORDER_TABLE)?)).map(|&pattern| pattern.into())
    }

    /// Writes the entry at an address of the host port.
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
