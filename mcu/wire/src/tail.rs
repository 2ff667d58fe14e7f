//! A field that a later version has appended to a message.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// The last field of a message, absent in messages of the versions before it. An absent tail has no
/// bytes.
///
/// # Invariant
/// A message without the bytes of its tail is read as a message with an absent tail, and an absent
/// tail is written as no bytes (`tests/frozen/v2.rs`: `an_absent_tail_has_no_bytes`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Tail<T>(pub Option<T>);

impl<T: Serialize> Serialize for Tail<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match &self.0 {
            Some(value) => value.serialize(serializer),
            // postcard writes no bytes for a unit.
            None => serializer.serialize_unit(),
        }
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Tail<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        // With intact bytes, a tail fails to parse only if the bytes end before it.
        Ok(Self(T::deserialize(deserializer).ok()))
    }
}
