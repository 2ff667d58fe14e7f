//! Runs the tasks and sleeps by WFI. Embassy's own executor sleeps by WFE, which QEMU ignores.
//!
//! A task that an interrupt wakes is polled before the next sleep.

use core::sync::atomic::{AtomicBool, Ordering};
use cortex_m::{asm, interrupt};
use embassy_executor::{Spawner, raw};
use static_cell::StaticCell;

static WOKEN: AtomicBool = AtomicBool::new(false);

#[expect(unsafe_code, reason = "embassy looks for this name")]
#[unsafe(export_name = "__pender")]
fn pender(_context: *mut ()) {
    WOKEN.store(true, Ordering::Release);
}

/// Runs the tasks that `init` spawns, for ever.
pub fn run(init: impl FnOnce(Spawner)) -> ! {
    static EXECUTOR: StaticCell<raw::Executor> = StaticCell::new();
    let executor: &'static raw::Executor = EXECUTOR.init(raw::Executor::new(core::ptr::null_mut()));
    init(executor.spawner());
    loop {
        #[expect(unsafe_code, reason = "an executor is polled by its owner")]
        // SAFETY: this is the only call, and the pender does not make it.
        unsafe {
            executor.poll();
        }
        // An interrupt between the check and the sleep ends the sleep at once.
        interrupt::free(|_| {
            if !WOKEN.swap(false, Ordering::Acquire) {
                asm::wfi();
            }
        });
    }
}
