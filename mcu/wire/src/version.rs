//! Versions of the wire protocol, and the rules by which the protocol grows.
//!
//! # Rules
//! * A variant is appended to its enum, never inserted, renumbered or removed.
//! * A field is appended to the end of a message as a [`Tail`](crate::Tail), never inserted, changed or removed. A reader
//!   of an older version ignores the bytes of a tail that it does not know.
//! * The first version that has a new variant or tail is one more than the last released version: [`CURRENT`]. A new
//!   file `tests/frozen/vNN.rs` freezes the bytes of what is new; the files of older versions stay as they are.
//! * A camera sends nothing that is newer than the version of its session
//!   ([`DeviceMessage::since`](crate::DeviceMessage::since)).
//! * Samples of 24 bits came with version 4: a value of the byte before the samples that earlier versions refuse, as they
//!   refuse a variant that they do not know. A camera sends them only to a host that asks for them.
//! * A camera answers a request that it does not know with [`Refusal::Unknown`](crate::Refusal::Unknown). A host counts a
//!   message that it does not know and goes on.
//! * Version 3 was of cameras with several detectors, which no gateware has. It adds nothing to version 2.
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
pub const CURRENT: u16 = 4;

/// Whether this crate speaks `version`.
#[must_use]
pub const fn speaks(version: u16) -> bool {
    MIN <= version && version <= CURRENT
}
