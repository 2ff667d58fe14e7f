//! Restarts the chip, into the firmware or into the chip's own boot loader.
//!
//! The boot loader must find the chip as after a reset. So [`restart`] leaves a request in memory
//! that a restart does not clear, and `main` carries out the request before anything else.
//!
//! Restarts that no host asked for are counted there too ([`begin`]): `nirspi_mcu` judges what the memory and the chip's reset
//! flags say.

use core::sync::atomic::{AtomicU32, Ordering};
use cortex_m::peripheral::SCB;
use embassy_stm32::pac::RCC;
use nirspi_mcu::{Crash, Micros, ResetCause, report, restart_words, restarts};
use nirspi_wire::RebootInto;

/// `"BOOT"` and `"APPL"` in ASCII.
const BOOT: u32 = 0x424F_4F54;
const APPLICATION: u32 = 0x4150_504C;

#[expect(unsafe_code, reason = "a section is chosen by an attribute that is unsafe to use")]
#[unsafe(link_section = ".uninit.restart")]
static WISHED: AtomicU32 = AtomicU32::new(0);

/// The count of restarts, and its complement.
#[expect(unsafe_code, reason = "a section is chosen by an attribute that is unsafe to use")]
#[unsafe(link_section = ".uninit.restarts")]
static RESTARTS: [AtomicU32; 2] = [const { AtomicU32::new(0) }; 2];

/// Milliseconds since the start when the watchdog was last fed.
#[expect(unsafe_code, reason = "a section is chosen by an attribute that is unsafe to use")]
#[unsafe(link_section = ".uninit.alive")]
static ALIVE_MS: AtomicU32 = AtomicU32::new(0);

/// What this start knows of the one before.
pub struct Start {
    /// Restarts since power-up that no host asked for.
    pub restarts: u32,
    /// What the next host is told of a restart that left no record.
    pub report: Option<Crash>,
}

/// Judges the start, once, after [`enter_bootloader_if_wished`].
pub fn begin() -> Start {
    let flags = RCC.csr().read();
    RCC.csr().modify(|flags| flags.set_rmvf(true));
    let cause = if flags.iwdgrstf() {
        ResetCause::Watchdog
    } else if flags.borrstf() {
        ResetCause::Supply
    } else {
        ResetCause::Other
    };
    let before = RESTARTS.each_ref().map(|word| word.load(Ordering::Relaxed));
    let asked_for = WISHED.swap(0, Ordering::Relaxed) == APPLICATION;
    let counted = restarts(before, asked_for);
    let alive = Micros(u64::from(ALIVE_MS.swap(0, Ordering::Relaxed)) * 1_000);
    for (to, word) in RESTARTS.iter().zip(restart_words(counted.unwrap_or(0))) {
        to.store(word, Ordering::Relaxed);
    }
    Start {
        restarts: counted.unwrap_or(0),
        // At power-up there is nothing to tell.
        report: counted.and_then(|_| report(cause, alive)),
    }
}

/// Notes that the firmware runs, and how long after its start, in milliseconds.
pub fn is_alive(ms: u32) {
    ALIVE_MS.store(ms, Ordering::Relaxed);
}

/// Restarts the chip.
pub fn restart(into: RebootInto) -> ! {
    let wish = if into == RebootInto::Bootloader { BOOT } else { APPLICATION };
    WISHED.store(wish, Ordering::Relaxed);
    SCB::sys_reset()
}

/// Enters the boot loader whose vector table is at this address, if [`restart`] has requested the
/// boot loader. This must be the first call in `main`.
pub fn enter_bootloader_if_wished(vectors: usize) {
    if WISHED.load(Ordering::Relaxed) == BOOT {
        WISHED.store(0, Ordering::Relaxed);
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
