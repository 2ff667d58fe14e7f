//! What befell a camera while nobody listened, in words: it reports that right after the greeting.

use nirspi_wire::EventKind;

/// One such event, as people read it; `None` for what an earlier host has left behind.
#[must_use]
pub fn at_greeting(kind: &EventKind) -> Option<String> {
    match kind {
        EventKind::Fault(fault) => Some(format!("the camera switched its LEDs off: {fault:?}")),
        EventKind::RunEnded { .. } | EventKind::RawDropped | EventKind::CommandDamaged => None,
    }
}
