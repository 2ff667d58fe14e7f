//! What QEMU needs that hardware would not.
//!
//! Its model of the UART holds one byte and, when that has been read, does not say that it can take the next one
//! (`hw/char/cmsdk-apb-uart.c`, seen in version 7.2): QEMU's main loop finds out when it turns the next time, which
//! is once a millisecond. Restarting a timer makes it turn at once. On the real image this timer counts for nobody.
//!
//! The one law: nothing depends on it but the speed.

use vcell::VolatileCell;

/// TIMER0 of the IoT kit, by its secure alias (Arm ECM0601256, memory map).
const TIMER0: usize = 0x5000_0000;

/// The APB timer of Arm's Cortex-M System Design Kit (Arm DDI 0479, APB timer).
#[repr(C)]
struct Registers {
    ctrl: VolatileCell<u32>,
    value: VolatileCell<u32>,
    reload: VolatileCell<u32>,
}

const CTRL_ENABLE: u32 = 1 << 0;

/// 10 microseconds: the shortest that QEMU times.
const SOON: u32 = 200;

#[expect(unsafe_code, reason = "registers are at an address")]
fn timer() -> &'static Registers {
    // SAFETY: the timer is there as long as the program runs; only volatile accesses of whole words are made.
    unsafe { &*(TIMER0 as *const Registers) }
}

/// Before the first [`look_for_input`].
pub fn prepare() {
    timer().reload.set(u32::MAX);
    timer().ctrl.set(CTRL_ENABLE);
}

/// A byte has been read: QEMU may bring the next one.
pub fn look_for_input() {
    timer().value.set(SOON);
}
