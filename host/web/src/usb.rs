//! A camera on USB, which the page opens (`page/usb.js`).
//!
//! The page's functions are promises, and the program waits for them as for any other function: the
//! browser suspends the program meanwhile (JavaScript Promise Integration).

#![allow(unsafe_code, reason = "functions of another language read and write the program's memory")]

use nirspi::link::{Link, Received};
use std::io;
use std::time::Duration;

#[link(wasm_import_module = "page")]
unsafe extern "C" {
    /// Opens the camera. Returns 0 or [`FAILED`].
    safe fn usb_open() -> i32;
    /// Sends bytes of the program's memory. Returns 0 or [`FAILED`].
    safe fn usb_send(bytes: *const u8, length: usize) -> i32;
    /// Writes the next bytes into the program's memory. Returns their number, which is 0 after the
    /// timeout, or [`FAILED`], or [`GONE`].
    fn usb_receive(into: *mut u8, room: usize, timeout_ms: f64) -> i32;
    /// Writes the text of the last error into the program's memory. Returns its length.
    fn usb_problem(into: *mut u8, room: usize) -> usize;
}

const FAILED: i32 = -1;
const GONE: i32 = -2;

/// The camera on USB that a person has chosen on the page.
pub struct PageLink;

impl PageLink {
    /// Opens the camera again.
    ///
    /// # Errors
    /// Why it cannot be opened, in the browser's words.
    pub fn open() -> io::Result<Self> {
        done(usb_open()).map(|_| Self)
    }
}

impl Link for PageLink {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        done(usb_send(bytes.as_ptr(), bytes.len())).map(drop)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<Received> {
        let timeout_ms = 1e3 * timeout.as_secs_f64();
        // SAFETY: the page writes at most `buffer.len()` bytes, into the buffer alone.
        match unsafe { usb_receive(buffer.as_mut_ptr(), buffer.len(), timeout_ms) } {
            GONE => Ok(Received::Closed),
            count => Ok(match done(count)? {
                0 => Received::Nothing,
                bytes => Received::Bytes(bytes),
            }),
        }
    }
}

/// The number that a function of the page returned, or its error.
fn done(returned: i32) -> io::Result<usize> {
    if returned != FAILED {
        return usize::try_from(returned).map_err(io::Error::other);
    }
    let mut text = [0; 256];
    // SAFETY: the page writes at most `text.len()` bytes, into the text alone.
    let length = unsafe { usb_problem(text.as_mut_ptr(), text.len()) };
    Err(io::Error::other(String::from_utf8_lossy(&text[..length.min(text.len())]).into_owned()))
}
