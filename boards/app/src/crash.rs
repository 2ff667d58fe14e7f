//! The crash record in memory that a restart does not clear.
//!
//! The one law: writing it needs no other part of the firmware to be sound: no lock, no wait, no allocation.

use core::panic::PanicInfo;
use core::sync::atomic::{AtomicU32, Ordering};
use nirspi_mcu::{CRASH_WORDS, Crash, Micros};

// cortex-m-rt's `.uninit` is neither loaded nor cleared at start.
#[cfg_attr(
    target_os = "none",
    expect(unsafe_code, reason = "a section is chosen by an attribute that is unsafe to use"),
    unsafe(link_section = ".uninit.crash")
)]
static RECORD: [AtomicU32; CRASH_WORDS] = [const { AtomicU32::new(0) }; CRASH_WORDS];

/// Leaves a record for [`take`] after the restart. The record of the first crash stands until then.
pub fn store(text: core::fmt::Arguments<'_>) {
    if peek().is_some() {
        return;
    }
    let uptime = Micros(embassy_time::Instant::now().as_micros());
    for (to, word) in RECORD.iter().zip(Crash::new(uptime, text).to_words()) {
        to.store(word, Ordering::Relaxed);
    }
}

/// Leaves a record of a panic: where, and what it said.
pub fn store_panic(info: &PanicInfo<'_>) {
    match info.location() {
        Some(place) => {
            store(format_args!("{}:{}: {}", place.file(), place.line(), info.message()));
        }
        None => store(format_args!("{}", info.message())),
    }
}

/// The record of the crash that led to this start, once.
#[must_use]
pub fn take() -> Option<Crash> {
    let found = peek();
    for word in &RECORD {
        word.store(0, Ordering::Relaxed);
    }
    found
}

fn peek() -> Option<Crash> {
    let mut words = [0; CRASH_WORDS];
    for (to, from) in words.iter_mut().zip(&RECORD) {
        *to = from.load(Ordering::Relaxed);
    }
    Crash::from_words(&words)
}
