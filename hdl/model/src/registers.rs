//! Storage of the read-write registers.
//!
//! The one law: reads give what was written, whatever it was; what it means is checked at a start.

use nirspi_wire::register::{Access, Register};

/// One 32-bit word a register; only the words of read-write ones are used.
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

    /// Does nothing if the register is not a read-write one.
    pub(crate) fn set(&mut self, register: Register, value: u32) {
        if register.access() == Access::ReadWrite {
            self.0[register as usize] = value;
        }
    }
}
