//! The released ELF of a board on a model of its chip: `docs/log/silicon.md`.
//!
//! `cargo run -p nirspi-tests-silicon -- 127.0.0.1:1550` makes it a camera behind TCP.
#![cfg_attr(not(test), expect(dead_code, reason = "the tests use all of this, the program a part"))]

mod camera;
mod chip;
mod ecp5;
mod fpga;
mod machine;
#[cfg(test)]
mod tests;
mod unicorn;
mod usb;

use std::process::ExitCode;

fn main() -> ExitCode {
    let address = std::env::args().nth(1).unwrap_or_else(|| "127.0.0.1:1550".to_owned());
    match camera::serve(&address) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
