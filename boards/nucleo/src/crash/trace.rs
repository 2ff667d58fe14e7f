//! Where a panic came from, for a chip whose flash has no room for the texts of panics: 10 KB, with the paths of
//! all source files. `llvm-addr2line -fie ELF ADDRESS...` turns the addresses into lines.

use core::fmt::{Display, Formatter, Result};

/// As many as the record has room for.
const CALLERS: usize = 8;

/// What looks like return addresses on the stack, the innermost first.
pub struct Callers;

impl Display for Callers {
    fn fmt(&self, to: &mut Formatter<'_>) -> Result {
        let (stack, code) = bounds();
        let top = cortex_m::register::msp::read() as usize & !3;
        let words = (top..stack).step_by(4).map(word);
        // Code is entered with the lowest bit set (ARMv7-M ARM, A4.1.1).
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

/// Where the stack begins, and where code is.
fn bounds() -> (usize, core::ops::Range<usize>) {
    let code = &raw const symbols::__stext as usize..&raw const symbols::__etext as usize;
    (&raw const symbols::_stack_start as usize, code)
}

fn word(address: usize) -> u32 {
    #[expect(unsafe_code, reason = "reads the stack")]
    // SAFETY: an aligned word between the stack pointer and the stack's beginning.
    unsafe {
        (address as *const u32).read_volatile()
    }
}
