//! A stack that runs over ends in a fault, not in the memory below it.

/// Sets the processor's stack limit (ARMv8-M ARM, MSPLIM) to the end of the memory that is used otherwise.
pub fn guard() {
    #[expect(unsafe_code, reason = "the linker's symbol, and a register of the processor")]
    // SAFETY: only the symbol's address is used; the limit lies below everything that the stack holds now.
    unsafe {
        unsafe extern "C" {
            static _stack_end: u32;
        }
        cortex_m::register::msplim::write(&raw const _stack_end as u32);
    }
}
