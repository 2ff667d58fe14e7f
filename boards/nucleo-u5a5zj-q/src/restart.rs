//! Restarts the chip, into the firmware or into the chip's own boot loader.
//!
//! The boot loader must find the chip as after a reset. So [`restart`] leaves a request in memory
//! that a restart does not clear, and `main` carries out the request before anything else.

use core::sync::atomic::{AtomicU32, Ordering};
use cortex_m::peripheral::SCB;
use nirspi_wire::RebootInto;

/// `"BOOT"` in ASCII.
const WISH: u32 = 0x424F_4F54;

#[expect(unsafe_code, reason = "a section is chosen by an attribute that is unsafe to use")]
#[unsafe(link_section = ".uninit.restart")]
static WISHED: AtomicU32 = AtomicU32::new(0);

/// Restarts the chip.
pub fn restart(into: RebootInto) -> ! {
    let wish = if into == RebootInto::Bootloader { WISH } else { 0 };
    WISHED.store(wish, Ordering::Relaxed);
    SCB::sys_reset()
}

/// Enters the boot loader whose vector table is at this address, if [`restart`] has requested the
/// boot loader. This must be the first call in `main`.
pub fn enter_bootloader_if_wished(vectors: usize) {
    if WISHED.swap(0, Ordering::Relaxed) == WISH {
        #[expect(unsafe_code, reason = "jumps into code that is not ours")]
        // SAFETY: the chip is as after a reset but for what cortex-m-rt has set, which is undone
        // here: the boot loader's stack lies below our limit, and its interrupts are in its own
        // table. The chip's reference manual gives the address of the boot loader, whose vector
        // table begins with a stack pointer and an entry.
        unsafe {
            cortex_m::register::msplim::write(0);
            (*SCB::PTR).vtor.write(vectors as u32);
            cortex_m::asm::bootload(vectors as *const u32)
        }
    }
}
