//! Work-around for the speed of QEMU's UART.
//!
//! QEMU's model of the UART holds one byte. When that byte has been read, the model does not say
//! that it can take the next one (`hw/char/cmsdk-apb-uart.c`, seen in version 7.2): QEMU's main
//! loop notices in its next turn, which comes once a millisecond. Restarting a timer makes the main
//! loop turn at once. On a real chip the timer has no effect.
//!
//! The firmware's results do not depend on this module, only its speed in QEMU.

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

/// 10 microseconds: the shortest time that QEMU's timer can have.
const SOON: u32 = 200;

#[expect(unsafe_code, reason = "registers are at an address")]
fn timer() -> &'static Registers {
    // SAFETY: the timer exists as long as the program runs, and the code makes only volatile
    // accesses of whole words.
    unsafe { &*(TIMER0 as *const Registers) }
}

/// Prepares the timer; call this before the first [`look_for_input`].
pub fn prepare() {
    timer().reload.set(u32::MAX);
    timer().ctrl.set(CTRL_ENABLE);
}

/// Makes QEMU deliver the next byte, after a byte has been read.
pub fn look_for_input() {
    timer().value.set(SOON);
}
