#![cfg_attr(not(test), deny(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! A [`Feed`] reads the bytes at an [`Address`]. [`Sweeps`](nirspi_files::measurement::Sweeps) makes of each frame what a
//! measurement file with the same numbers gives, and [`Recorder`] writes frames as measurement files.
//!
//! # Invariant
//! Every number of a feed has its place in one frame, or is counted in the [`Account`]
//! (`frames::tests::every_number_has_its_place_however_the_bytes_are_cut`). A number that is no number takes the place of a
//! reading that was not read, so that the readings after it keep their patterns
//! (`frames::tests::a_word_takes_the_place_of_one_reading`). A feed can send anything, and takes memory for one header, one frame
//! and a few blocks at most (`stream::tests::a_header_without_end_is_refused_before_it_fills_the_memory`).

mod account;
mod address;
mod frames;
mod header;
mod record;
mod stream;
mod trigger;

pub use account::Account;
pub use address::{Address, AddressError};
pub use frames::{Frames, Mean, SecondHeader, Taken, mean};
pub use header::{FeedPatterns, Header, HeaderError, Numbers, OwnPatterns, Samples, Trigger};
pub use record::{Recorded, Recorder};
pub use stream::{End, Feed, FeedError, Giver, MAX_HEADER_BYTES, Next};
