//! The place of a panic, for a chip whose flash has no room for panic messages: they take 10 KB
//! with the paths of all source files. `llvm-addr2line -fie ELF ADDRESS...` turns the addresses
//! into lines.

use core::fmt::{Display, Formatter, Result};

/// Number of addresses that the record has room for.
const CALLERS: usize = 8;

/// Words on the stack that look like return addresses, the innermost first.
pub struct Callers;

impl Display for Callers {
    fn fmt(&self, to: &mut Formatter<'_>) -> Result {
        let (stack, code) = bounds();
        let top = cortex_m::register::msp::read() as usize & !3;
        let words = (top..stack).step_by(4).map(word);
        // A return address has its lowest bit set (ARMv7-M ARM, A4.1.1).
        let returns = words.filter(|word| word & 1 == 1 && code.contains(&(*word as usize)));
        for address in returns.take(CALLERS) {
            write!(to, " {address:#x}")?;
        }
        Ok(())
    }
}

#[expect(unsafe_code, reason = "the linker's symbols, of which only the addresses are used")]
mod symbols {
    unsafe extern "C" {
        pub static _stack_start: u32;
        pub static __stext: u32;
        pub static __etext: u32;
    }
}

/// Beginning of the stack, and the range of code.
fn bounds() -> (usize, core::ops::Range<usize>) {
    let code = &raw const symbols::__stext as usize..&raw const symbols::__etext as usize;
    (&raw const symbols::_stack_start as usize, code)
}

fn word(address: usize) -> u32 {
    #[expect(unsafe_code, reason = "reads the stack")]
    // SAFETY: the word is aligned and lies between the stack pointer and the stack's beginning.
    unsafe {
        (address as *const u32).read_volatile()
    }
}
