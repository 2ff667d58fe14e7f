//! The crash record in memory that a restart does not clear.
//!
//! Writing the record uses no other part of the firmware: no lock, no wait, no allocation. So the
//! record can be written after a failure of any part.

use core::panic::PanicInfo;
use core::sync::atomic::{AtomicU32, Ordering};
use nirspi_mcu::{CRASH_WORDS, Crash, Micros};

// cortex-m-rt neither loads nor clears its `.uninit` section at start.
#[cfg_attr(
    target_os = "none",
    expect(unsafe_code, reason = "a section is chosen by an attribute that is unsafe to use"),
    unsafe(link_section = ".uninit.crash")
)]
static RECORD: [AtomicU32; CRASH_WORDS] = [const { AtomicU32::new(0) }; CRASH_WORDS];

/// Leaves a record for [`take`] after the restart. A record of an earlier crash is kept.
pub fn store(text: core::fmt::Arguments<'_>) {
    if peek().is_some() {
        return;
    }
    let uptime = Micros(embassy_time::Instant::now().as_micros());
    for (to, word) in RECORD.iter().zip(Crash::new(uptime, text).to_words()) {
        to.store(word, Ordering::Relaxed);
    }
}

/// Leaves a record of a panic: its place and its message.
pub fn store_panic(info: &PanicInfo<'_>) {
    match info.location() {
        Some(place) => {
            store(format_args!("{}:{}: {}", place.file(), place.line(), info.message()));
        }
        None => store(format_args!("{}", info.message())),
    }
}

/// The record of the crash that led to this start. The second call gives `None`.
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
