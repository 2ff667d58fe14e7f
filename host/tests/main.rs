//! Tests of the library as its users see it.

mod account;
mod damaged_recordings;
#[cfg(feature = "enhance")]
mod export;
mod exported_frames;
mod glossary;
mod made;
mod recordings;
mod replay;
mod session;
mod split;
#[cfg(feature = "enhance")]
mod stacks;
