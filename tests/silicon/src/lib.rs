//! The released ELF of a board on a model of its chip: `docs/silicon.md`.

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
