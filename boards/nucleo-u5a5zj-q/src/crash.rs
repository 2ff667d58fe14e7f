//! The end after a crash: LEDs off, a record for the next host, restart.
//!
//! Panics end here, and so do ARM's HardFaults, to which all other faults escalate: a stack that
//! ran into its guard, an access to an address that does not exist.
//!
//! The LEDs go off first. Nothing here waits or uses the old stack, which may be the cause of the
//! crash.

use core::cell::Cell;
use core::fmt::Arguments;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};
use cortex_m::peripheral::SCB;
use critical_section::Mutex;

static DYING: AtomicBool = AtomicBool::new(false);

type Action = Option<fn()>;

static LEDS_OFF: Mutex<Cell<Action>> = Mutex::new(Cell::new(None));

/// Sets the function that switches the LEDs off. Call this before anything can switch the LEDs on.
pub fn on_crash(leds_off: fn()) {
    critical_section::with(|token| LEDS_OFF.borrow(token).set(Some(leds_off)));
}

/// Stops all other code and switches the LEDs off.
// A function of its own in the ELF, where `tests/tests/budgets.rs` looks for it.
#[inline(never)]
fn darken() {
    cortex_m::interrupt::disable();
    if let Some(leds_off) = critical_section::with(|token| LEDS_OFF.borrow(token).get()) {
        leds_off();
    }
}

/// Ends the firmware: LEDs off, crash record, restart.
pub fn die(text: Arguments<'_>) -> ! {
    darken();
    // A second crash, for example in a logger that was interrupted, restarts here.
    if DYING.swap(true, Ordering::Relaxed) {
        SCB::sys_reset();
    }
    nirspi_app::crash::store(text);
    defmt::error!("{}", defmt::Display2Format(&text));
    SCB::sys_reset()
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    die(format_args!("{info}"))
}

#[expect(unsafe_code, reason = "an exception handler that must not touch the stack it finds")]
mod entry {
    /// Continues on an empty stack, with the address of the old stack.
    #[unsafe(naked)]
    #[unsafe(export_name = "HardFault")]
    unsafe extern "C" fn hard_fault() -> ! {
        core::arch::naked_asm!(
            "mrs r0, msp",
            "movw r1, #:lower16:_stack_start",
            "movt r1, #:upper16:_stack_start",
            "msr msp, r1",
            "b {fault}",
            fault = sym super::fault,
        )
    }

    /// The clock security system ([`clocks::watch_crystal`](crate::clocks::watch_crystal)): the crystal has stopped, and
    /// the chip runs by its own oscillator.
    #[unsafe(export_name = "NonMaskableInt")]
    extern "C" fn crystal_stopped() -> ! {
        super::die(format_args!("the crystal stopped"))
    }
}

/// Takes the processor's exception frame: r0 to r3, r12, lr, pc, psr (ARMv7-M ARM, B1.5.6).
extern "C" fn fault(frame: *const [u32; 8]) -> ! {
    // Where the stack pointer was wrong, reading the frame is another fault, in which the processor
    // stands still until the watchdog restarts it.
    darken();
    #[expect(
        unsafe_code,
        reason = "what the processor has put on the stack, and its fault register"
    )]
    // SAFETY: the frame is memory at the stack pointer. After a stack overflow that memory holds
    // other data, which the record then shows as if it were a frame. The register may be read at
    // any time.
    let ([.., lr, pc, _], cause) = (unsafe { *frame }, unsafe { (*SCB::PTR).cfsr.read() });
    die(format_args!("fault at {pc:#010x} from {lr:#010x}, cfsr {cause:#010x}"))
}
