//! Storage of the read-write registers.
//!
//! # Invariant
//! A register reads as it was written, whatever the value
//! (`golden::registers::a_register_holds_what_its_access_says`). Values are checked at a start
//! (`golden::runs::every_setting_is_checked_at_a_start_and_only_there`).

use nirspi_wire::register::{Access, Register};

/// One 32-bit word for each register. Only the words of read-write registers are used.
#[derive(Debug, Clone)]
pub(crate) struct Registers([u32; Register::ALL.len()]);

impl Registers {
    /// All at their reset values.
    pub(crate) fn new() -> Self {
        let mut words = [0; Register::ALL.len()];
        for &register in Register::ALL {
            words[register as usize] = register.reset();
        }
        Self(words)
    }

    pub(crate) fn get(&self, register: Register) -> u32 {
        self.0[register as usize]
    }

    /// Writes a read-write register; does nothing for any other register.
    pub(crate) fn set(&mut self, register: Register, value: u32) {
        if register.access() == Access::ReadWrite {
            self.0[register as usize] = value;
        }
    }
}
