//! What a camera reports unasked, in words.

use nirspi_wire::EventKind;

/// One event, as people read it.
#[must_use]
pub fn in_words(kind: &EventKind) -> String {
    match kind {
        EventKind::Fault(fault) => format!("the camera switched its LEDs off: {fault:?}"),
        EventKind::RunEnded { run, frames_made, .. } => {
            format!("run {run} has ended after {frames_made} frames")
        }
        EventKind::RawDropped => "a raw burst was dropped: the link had no room".to_owned(),
        EventKind::CommandDamaged => "the camera got bytes that were no command".to_owned(),
    }
}
