//! An error and its causes in one line.
//!
//! # Invariant
//! An error of this workspace describes its own level. Its cause is its `source()` and not part of
//! its message, so a printed chain tells every cause once
//! (`tests::every_level_is_told_once_and_in_one_line`).

use std::error::Error;

/// The error's message, then each cause after a colon.
#[must_use]
pub fn in_one_line(error: &(dyn Error + 'static)) -> String {
    let mut line = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        line.push_str(": ");
        line.push_str(&error.to_string());
        cause = error.source();
    }
    line.replace('\n', " ")
}

/// A text from a device as a part of one line: control characters, which could move a terminal's
/// cursor or forge a line, are escaped.
#[must_use]
pub fn printable(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        if c.is_control() || matches!(c, '\u{2028}' | '\u{2029}') {
            shown.extend(c.escape_default());
        } else {
            shown.push(c);
        }
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::CalibrationError;
    use crate::recording::RecordingError;
    use crate::session::SessionError;
    use std::io;

    #[test]
    fn every_level_is_told_once_and_in_one_line() {
        let cause = || io::Error::other("no\ncable");
        let session = CalibrationError::Session(SessionError::Link(cause()));
        assert_eq!(in_one_line(&session), "the link to the camera failed: no cable");
        let recording = RecordingError::Io { path: "a.mcap".into(), source: cause() };
        assert_eq!(in_one_line(&recording), "a.mcap: cannot read the recording: no cable");
    }
}
