#![cfg_attr(not(test), deny(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! # Invariant
//! A file is either read whole and checked, or refused with a one-line [`FileError`] that names the
//! file, the field, what was found and what was expected
//! (`error::tests::every_message_is_one_line`). A result is either written whole or not at all
//! (`output::tests::one_file_is_whole_or_not_there`). A file can claim any size: memory grows with
//! the data that arrived, never with a claim
//! (`array::tests::a_claim_beyond_the_limit_takes_no_memory`).
//!
//! A browser has no files: there, only pictures and tables are built.

#[cfg(not(target_family = "wasm"))]
pub mod archive;
pub mod boards;
pub mod causes;
pub mod clock;
#[cfg(not(target_family = "wasm"))]
pub mod contents;
#[cfg(not(target_family = "wasm"))]
pub mod folder;
pub mod identity;
pub mod image;
pub mod interrupt;
#[cfg(not(target_family = "wasm"))]
pub mod measurement;
#[cfg(not(target_family = "wasm"))]
pub mod npy;
pub mod output;
pub mod provenance;
pub mod table;
#[cfg(not(target_family = "wasm"))]
pub mod trace;

#[cfg(not(target_family = "wasm"))]
mod array;
mod error;
#[cfg(not(target_family = "wasm"))]
mod field;
#[cfg(not(target_family = "wasm"))]
mod fields;
#[cfg(not(target_family = "wasm"))]
mod formats;
#[cfg(not(target_family = "wasm"))]
mod hdf5;
#[cfg(not(target_family = "wasm"))]
mod mat;
#[cfg(not(target_family = "wasm"))]
mod mat4;
mod plain;
#[cfg(not(target_family = "wasm"))]
mod stored;
#[cfg(test)]
mod testing;
#[cfg(not(target_family = "wasm"))]
mod text;

pub use error::{FileError, Shown};
pub use plain::{MAX_MEMORY_BYTES, read_at_most, read_small, read_small_text, read_text};
#[cfg(not(target_family = "wasm"))]
pub use text::parse as parse_number;
