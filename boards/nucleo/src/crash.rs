//! The end after a crash: LEDs off, a record for the next host, restart.
//!
//! Panics end here, and faults (ARM: HardFault, to which all others escalate): a stack that ran into its guard, an
//! address that is not there.
//!
//! The one law: nothing comes before the LEDs, and nothing here waits or needs the stack that may be the trouble.

#[cfg(feature = "terse")]
mod trace;

use core::cell::Cell;
use core::fmt::Arguments;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};
use cortex_m::peripheral::SCB;
use critical_section::Mutex;

static DYING: AtomicBool = AtomicBool::new(false);

type Action = Option<fn()>;

static LEDS_OFF: Mutex<Cell<Action>> = Mutex::new(Cell::new(None));

/// Says how to turn the LEDs off. To be called before anything can turn them on.
pub fn on_crash(leds_off: fn()) {
    critical_section::with(|token| LEDS_OFF.borrow(token).set(Some(leds_off)));
}

/// Ends it here and now.
pub fn die(text: Arguments<'_>) -> ! {
    cortex_m::interrupt::disable();
    if let Some(leds_off) = critical_section::with(|token| LEDS_OFF.borrow(token).get()) {
        leds_off();
    }
    // A crash of what comes below, as of a logger that was interrupted, ends here.
    if DYING.swap(true, Ordering::Relaxed) {
        SCB::sys_reset();
    }
    nirspi_app::crash::store(text);
    defmt::error!("{}", defmt::Display2Format(&text));
    SCB::sys_reset()
}

#[cfg(not(feature = "terse"))]
#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    die(format_args!("{info}"))
}

#[cfg(feature = "terse")]
#[panic_handler]
fn panic(_info: &PanicInfo<'_>) -> ! {
    die(format_args!("panic{}", trace::Callers))
}

#[expect(unsafe_code, reason = "an exception handler that must not touch the stack it finds")]
mod entry {
    /// Starts over on an empty stack, with the address of the old one.
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
}

/// With the processor's exception frame: r0 to r3, r12, lr, pc, psr (ARMv7-M ARM, B1.5.6).
extern "C" fn fault(frame: *const [u32; 8]) -> ! {
    #[expect(
        unsafe_code,
        reason = "what the processor has put on the stack, and its fault register"
    )]
    // SAFETY: the frame is memory that the stack pointer pointed at; where the stack has overflowed it holds
    // something else than a frame, which is then told as such. The register may be read at any time.
    let ([.., lr, pc, _], cause) = (unsafe { *frame }, unsafe { (*SCB::PTR).cfsr.read() });
    die(format_args!("fault at {pc:#010x} from {lr:#010x}, cfsr {cause:#010x}"))
}
