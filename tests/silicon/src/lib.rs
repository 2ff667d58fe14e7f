//! The released ELF of a board on a model of its chip: `docs/log/silicon.md`.
#![cfg_attr(not(test), expect(dead_code, reason = "the tests use all of this, the program a part"))]

mod camera;
mod chip;
mod ecp5;
mod fpga;
mod machine;
mod unicorn;
mod usb;

#[cfg(test)]
mod tests;

pub use camera::serve;
