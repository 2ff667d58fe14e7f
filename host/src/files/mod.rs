//! Reads and writes files.
//!
//! # Invariant
//! A file is either read whole and checked, or refused with a one-line [`FileError`] that names the
//! file, the field, what was found and what was expected
//! (`error::tests::every_message_is_one_line`). A result is either written whole or not at all
//! (`output::tests::one_file_is_whole_or_not_there`). A file can claim any size: memory grows with
//! the data that arrived, never with a claim
//! (`array::tests::a_claim_beyond_the_limit_takes_no_memory`).

#[cfg(feature = "training")]
pub mod characters;
#[cfg(feature = "pictures")]
pub mod image;
pub mod interrupt;
pub mod measurement;
pub mod npy;
pub mod order_table;
pub mod output;
pub mod problem;
pub mod settings;
#[cfg(feature = "pictures")]
pub mod stack;
pub mod table;

mod archive;
mod array;
mod error;
mod fields;
#[cfg(feature = "hdf5")]
mod hdf5;
mod mat;
#[cfg(test)]
mod testing;
mod text;

#[cfg(feature = "training")]
pub(crate) use archive::encode as encode_archive;
pub use archive::read_small;
pub use error::FileError;
