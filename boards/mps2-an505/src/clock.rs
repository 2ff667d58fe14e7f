//! Embassy's time from SysTick: one interrupt a millisecond, and microseconds from the counter
//! between interrupts.
//!
//! Time never goes back. Time is 0 until the clock is started.

use core::cell::{Cell, RefCell};
use core::task::Waker;
use cortex_m::Peripherals;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{SCB, SYST};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_time_driver::Driver;
use embassy_time_queue_utils::Queue;

/// The processor's clock in the AN505 image, and in QEMU.
const CORE_HZ: u32 = 20_000_000;
const TICK_HZ: u32 = 1_000;
const CLOCKS_PER_MICRO: u32 = CORE_HZ / 1_000_000;
const MICROS_PER_TICK: u64 = 1_000_000 / TICK_HZ as u64;
const RELOAD: u32 = CORE_HZ / TICK_HZ - 1;

struct SysTickDriver {
    ticks: Mutex<CriticalSectionRawMutex, Cell<u64>>,
    queue: Mutex<CriticalSectionRawMutex, RefCell<Queue>>,
}

embassy_time_driver::time_driver_impl!(static DRIVER: SysTickDriver = SysTickDriver {
    ticks: Mutex::new(Cell::new(0)),
    queue: Mutex::new(RefCell::new(Queue::new())),
});

/// Starts the clock.
pub fn start(peripherals: &mut Peripherals) {
    let syst = &mut peripherals.SYST;
    syst.set_clock_source(SystClkSource::Core);
    syst.set_reload(RELOAD);
    syst.clear_current();
    syst.enable_interrupt();
    syst.enable_counter();
}

/// The SysTick interrupt.
pub fn on_tick() {
    DRIVER.ticks.lock(|ticks| ticks.set(ticks.get() + 1));
    let now = DRIVER.now();
    // Wakes the tasks whose time has come.
    DRIVER.queue.lock(|queue| queue.borrow_mut().next_expiration(now));
}

impl Driver for SysTickDriver {
    fn now(&self) -> u64 {
        self.ticks.lock(|ticks| {
            let mut count = SYST::get_current();
            let mut whole = ticks.get();
            if SCB::is_pendst_pending() {
                // The counter has wrapped, and the interrupt waits for this lock.
                count = SYST::get_current();
                whole += 1;
            }
            // The counter is 0 until its first load.
            let elapsed = if count == 0 { 0 } else { RELOAD - count.min(RELOAD) };
            whole * MICROS_PER_TICK + u64::from(elapsed / CLOCKS_PER_MICRO)
        })
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        self.queue.lock(|queue| {
            // The next tick checks the queue; there is no alarm to set.
            let _ = queue.borrow_mut().schedule_wake(at, waker);
        });
    }
}
