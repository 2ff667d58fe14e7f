//! Versions of the wire protocol, and the rules by which the protocol grows.
//!
//! Nothing has been released. Until the first release, version 1 is whatever the sources say.
//!
//! # Rules
//! From the first release on:
//!
//! * A variant is appended to its enum, never inserted, renumbered or removed.
//! * A field is appended to the end of a message, never inserted, changed or removed. A reader ignores bytes after the
//!   fields that it knows.
//! * Each change of this kind makes a new version, which is [`CURRENT`]. A new file `tests/frozen/vNN.rs` freezes the bytes
//!   of what is new; the files of released versions stay as they are.
//! * A camera sends nothing that is newer than the version of its session.
//! * A camera answers a request that it does not know with [`Refusal::Unknown`](crate::Refusal::Unknown). A host counts a
//!   message that it does not know and goes on.
//! * A recording names the version of its session. Every program reads the recordings of all versions from [`MIN`] on.
//!
//! # Greeting
//! A host greets with its own [`CURRENT`]. A camera answers with the version that the session will have: the host's
//! version if the camera speaks that version, the camera's `CURRENT` otherwise. A host that reads an older version than
//! its own in the answer, and still speaks that version, greets again with that version.
//!
//! # Invariant
//! `Hello`, the first field of its answer and [`Refusal::Protocol`](crate::Refusal::Protocol) have the same bytes in every
//! version, so two sides that cannot talk can still say so (`tests/frozen/v1.rs`:
//! `what_two_versions_tell_each_other_has_these_bytes`).

/// The oldest version that is still spoken and read.
pub const MIN: u16 = 1;

/// The version of this crate: what a host greets with.
pub const CURRENT: u16 = 1;

/// Whether this crate speaks `version`.
#[must_use]
pub const fn speaks(version: u16) -> bool {
    MIN <= version && version <= CURRENT
}

/// The versions that this crate speaks, in words: `version 1`, or `versions 1 to 3`.
#[derive(Debug, Clone, Copy)]
pub struct Spoken;

impl core::fmt::Display for Spoken {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        in_words(MIN, CURRENT, f)
    }
}

fn in_words(oldest: u16, newest: u16, f: &mut impl core::fmt::Write) -> core::fmt::Result {
    match oldest == newest {
        true => write!(f, "version {newest}"),
        false => write!(f, "versions {oldest} to {newest}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::{String, ToString};

    #[test]
    fn the_versions_are_told_in_words() {
        let (mut one, mut three) = (String::new(), String::new());
        in_words(1, 1, &mut one).unwrap();
        in_words(1, 3, &mut three).unwrap();
        assert_eq!((&one[..], &three[..]), ("version 1", "versions 1 to 3"));
        assert!(Spoken.to_string().ends_with(&CURRENT.to_string()));
    }
}
