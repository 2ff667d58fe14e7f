//! The settings that a page can change while the camera runs, and the message that changes them.
//!
//! # Invariant
//! A change is applied whole, or refused whole with a one-line reason
//! (`tests::what_cannot_be_is_refused_in_one_line_that_names_it`).

use nirspi_recon::words::count;
use serde::{Deserialize, Serialize};
use std::fmt;
use thiserror::Error;

/// The most frames that one image can sum.
pub const MAX_FRAMES: u32 = 1024;

/// How images are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Settings {
    /// Name of the method of reconstruction.
    pub method: &'static str,
    /// Whether the learned stages run.
    pub enhance: bool,
    /// Number of newest frames that are summed into one image.
    pub frames: u32,
}

/// A change that a page asks for. Fields that are left out keep their values.
#[derive(Debug, Clone, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Change {
    /// Another method of reconstruction.
    pub method: Option<String>,
    /// Switches the learned stages on or off.
    pub enhance: Option<bool>,
    /// Another number of frames.
    pub frames: Option<u32>,
    /// Switches the LEDs on (and measures) or off. Of two changes the later one counts.
    #[serde(alias = "resume")]
    pub run: Option<bool>,
}

/// Why a change is refused.
#[derive(Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum ChangeError {
    /// The method does not exist.
    #[error("method is {found:?}, expected {}", alternatives(.offered))]
    Method {
        /// The requested method.
        found: String,
        /// The methods that exist.
        offered: Vec<&'static str>,
    },
    /// The number of frames is 0 or too large.
    #[error("frames is {found}, expected 1 to {MAX_FRAMES}")]
    Frames {
        /// The requested number.
        found: u32,
    },
    /// The message does not have the form of a change.
    #[error("{0}, expected for example {{\"method\": \"tv\", \"enhance\": true, \"frames\": 64}}")]
    Form(String),
}

/// A list for an error message: `a, b or c`.
fn alternatives(words: &[&str]) -> String {
    match words {
        [others @ .., last] if !others.is_empty() => format!("{} or {last}", others.join(", ")),
        words => words.concat(),
    }
}

impl Change {
    /// Parses a message.
    ///
    /// # Errors
    /// [`ChangeError::Form`] if the message is not JSON of a change.
    pub fn parse(json: &[u8]) -> Result<Self, ChangeError> {
        serde_json::from_slice(json).map_err(|error| ChangeError::Form(error.to_string()))
    }
}

impl Settings {
    /// The settings after this change. `offered` are the methods that exist.
    ///
    /// # Errors
    /// [`ChangeError`] that names the field.
    pub fn with(self, change: &Change, offered: &[&'static str]) -> Result<Self, ChangeError> {
        let method = match &change.method {
            None => self.method,
            Some(found) => {
                offered.iter().find(|name| *name == found).copied().ok_or_else(|| {
                    ChangeError::Method { found: found.clone(), offered: offered.to_vec() }
                })?
            }
        };
        let frames = change.frames.unwrap_or(self.frames);
        if !(1..=MAX_FRAMES).contains(&frames) {
            return Err(ChangeError::Frames { found: frames });
        }
        Ok(Self { method, enhance: change.enhance.unwrap_or(self.enhance), frames })
    }
}

impl fmt::Display for Settings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { method, enhance, frames } = self;
        let enhanced = if *enhance { "enhanced" } else { "not enhanced" };
        let frames = count(*frames, "frame");
        write!(f, "{method}, sum of {frames}, {enhanced}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OFFERED: [&str; 2] = ["hadamard", "omp"];
    const SETTINGS: Settings = Settings { method: "omp", enhance: true, frames: 64 };

    fn asked(json: &str) -> Result<Settings, ChangeError> {
        SETTINGS.with(&Change::parse(json.as_bytes())?, &OFFERED)
    }

    #[test]
    fn what_is_left_out_stays() {
        assert_eq!(asked("{}"), Ok(SETTINGS));
        assert_eq!(asked(r#"{"enhance": false}"#), Ok(Settings { enhance: false, ..SETTINGS }));
        let all = asked(r#"{"method": "hadamard", "frames": 1024, "run": true}"#);
        assert_eq!(all, Ok(Settings { method: "hadamard", frames: 1024, ..SETTINGS }));
    }

    #[test]
    fn what_cannot_be_is_refused_in_one_line_that_names_it() {
        for (json, words) in [
            (r#"{"method": "magic"}"#, "method is \"magic\", expected hadamard or omp"),
            (r#"{"frames": 0}"#, "frames is 0, expected 1 to 1024"),
            (r#"{"frames": 1025}"#, "frames is 1025"),
            (r#"{"frames": -1}"#, "-1"),
            (r#"{"laser": true}"#, "laser"),
            ("[1", "expected for example"),
            ("", "expected for example"),
        ] {
            let line = asked(json).unwrap_err().to_string();
            assert!(line.contains(words) && line.lines().count() == 1, "{json}: {line}");
        }
    }
}
