//! Files that come in and files that go out.
//!
//! The law: what comes in is either whole and checked, or refused with one line that names the
//! file, the field, what was found and what was expected ([`FileError`]); what goes out is either
//! whole or not there ([`output`]). A file can claim any size: memory is taken for data that
//! arrived, never for a claim.

#[cfg(feature = "training")]
pub mod characters;
#[cfg(feature = "pictures")]
pub mod image;
pub mod measurement;
pub mod npy;
pub mod order_table;
pub mod output;
pub mod problem;
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
pub use error::FileError;
