//! The bytes of every protocol version.
//!
//! From the first release on, a new version adds a file `vNN.rs` with the bytes of what is new, and its line below. Bytes are in hexadecimal, in the
//! order in which they are sent; beside each message stands its payload.
//!
//! # Invariant
//! Every variant of every message has frozen bytes in one of the files (`every_variant_is_frozen`): the matches in
//! `variants.rs` are exhaustive, so a new variant does not compile until it is listed there.
#![expect(clippy::unwrap_used, reason = "a failed unwrap in a helper fails its test")]

mod bytes;
mod dissector;
mod later;
mod page;
mod v1;
mod variants;

use nirspi_wire::version;
use std::collections::BTreeSet;

/// The newest version that is frozen here.
const NEWEST: u16 = 1;

#[test]
fn the_version_that_the_crate_speaks_is_frozen() {
    assert_eq!(version::CURRENT, NEWEST);
}

#[test]
fn every_variant_is_frozen() {
    let mut seen = BTreeSet::new();
    for (request, _) in v1::requests() {
        variants::of_request(&request, &mut seen);
    }
    for (message, _) in v1::device_messages() {
        variants::of_device_message(&message, &mut seen);
    }
    let missing: Vec<_> = variants::ALL.iter().filter(|name| !seen.contains(*name)).collect();
    assert!(missing.is_empty(), "no frozen bytes: {missing:?}");
}
