//! The functions of the program that the page calls.
//!
//! ```text
//! room(n) -> address          the page writes n bytes there
//! begin(seed) -> ok           powers the virtual camera up
//! begin_usb() -> ok           connects to the camera on USB, for which it waits
//! turn() -> ok                one turn, which may wait for the camera; the answer is a message of the live page
//! command(path_bytes) -> ok   the bytes are a path and a body; the answer is the command's
//! answer(), answer_bytes()    address and length of the answer, or of an error in one line
//! ```

#![allow(unsafe_code, reason = "the names of functions that another language calls are exported")]

use crate::page;
use crate::usb::PageLink;
use nirspi::causes::in_one_line;
use nirspi_serve::{Turns, TurnsError};
use std::cell::RefCell;

/// The program and its buffers. A browser calls from one thread.
#[derive(Default)]
struct Program {
    turns: Option<Turns>,
    asked: Vec<u8>,
    answer: String,
}

thread_local! {
    static PROGRAM: RefCell<Program> = RefCell::default();
}

impl Program {
    /// Keeps an answer or an error. Returns whether it is an answer.
    fn says(&mut self, answer: Result<String, String>) -> bool {
        let is_fine = answer.is_ok();
        self.answer = answer.unwrap_or_else(|error| error);
        is_fine
    }
}

/// Makes room for bytes of the page. Returns their address.
#[unsafe(no_mangle)]
extern "C" fn room(bytes: usize) -> *mut u8 {
    PROGRAM.with_borrow_mut(|program| {
        program.asked.clear();
        program.asked.resize(bytes, 0);
        program.asked.as_mut_ptr()
    })
}

/// Powers the virtual camera up. The answer is empty.
#[unsafe(no_mangle)]
extern "C" fn begin(seed: u32) -> bool {
    began(|| Turns::virtual_camera(seed.into()))
}

/// Connects to the camera on USB that a person has chosen. The answer is empty.
#[unsafe(no_mangle)]
extern "C" fn begin_usb() -> bool {
    began(|| Turns::linked("usb", || Ok(Box::new(PageLink::open()?))))
}

fn began(turns: impl FnOnce() -> Result<Turns, TurnsError>) -> bool {
    page::connect();
    PROGRAM.with_borrow_mut(|program| match turns() {
        Ok(turns) => {
            program.turns = Some(turns);
            program.says(Ok(String::new()))
        }
        Err(error) => program.says(Err(in_one_line(&error))),
    })
}

/// Takes one turn. The answer is the page's message.
#[unsafe(no_mangle)]
extern "C" fn turn() -> bool {
    PROGRAM.with_borrow_mut(|program| {
        let message = program.turns.as_mut().map(|turns| turns.turn().to_owned());
        program.says(message.ok_or_else(not_begun))
    })
}

/// Executes the command in the room: a path of `path_bytes` bytes, then a body.
#[unsafe(no_mangle)]
extern "C" fn command(path_bytes: usize) -> bool {
    PROGRAM.with_borrow_mut(|program| {
        let asked = std::mem::take(&mut program.asked);
        let (path, body) = asked.split_at(path_bytes.min(asked.len()));
        let done = match &mut program.turns {
            Some(turns) => turns.command(&String::from_utf8_lossy(path), body),
            None => Err(not_begun()),
        };
        program.says(done)
    })
}

/// The address of the answer.
#[unsafe(no_mangle)]
extern "C" fn answer() -> *const u8 {
    PROGRAM.with_borrow(|program| program.answer.as_ptr())
}

/// The length of the answer.
#[unsafe(no_mangle)]
extern "C" fn answer_bytes() -> usize {
    PROGRAM.with_borrow(|program| program.answer.len())
}

fn not_begun() -> String {
    "the camera is not powered up".to_owned()
}
