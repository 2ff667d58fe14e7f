//! What the page gives to the program: its clock, and an ear for a panic's message.

#![allow(unsafe_code, reason = "functions of another language are declared, and both are safe")]

use std::time::Duration;

#[link(wasm_import_module = "page")]
unsafe extern "C" {
    /// Milliseconds since 1970.
    safe fn now_ms() -> f64;
    /// Takes a panic's message from the memory of the program.
    safe fn panicked(text: *const u8, bytes: usize);
}

/// Takes the time from the page, and tells the page of a panic.
pub fn connect() {
    nirspi::clock::set(|| Duration::from_secs_f64(now_ms() * 1e-3));
    std::panic::set_hook(Box::new(|info| {
        let text = info.to_string();
        panicked(text.as_ptr(), text.len());
    }));
}
