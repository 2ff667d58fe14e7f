//! The line between firmware and host, whose bytes a person can damage to see what is lost.
//!
//! Damage is drawn by a seed, so that the same commands give the same damage.

use super::lock;
use nirspi::link::{Link, Received};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};
use std::io;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use thiserror::Error;

/// The largest share of bytes that can be damaged. With more, no command reaches the camera.
const MOST: f64 = 0.01;
/// Damaged bytes that are lost; the others have one wrong bit.
const DROPPED: f64 = 0.25;

/// A change that a page asks for.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct Change {
    damage: f64,
}

/// Why a change of the line is refused.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LineError {
    /// The line cannot be reached from the page.
    #[error("line: the bytes of this camera's line cannot be damaged")]
    Real,
    /// The share of damaged bytes is out of range.
    #[error("damage is {0}, expected 0 to {MOST}: the share of bytes to damage")]
    Damage(f64),
    /// The message does not have the form of a change.
    #[error("{0}, expected for example {{\"damage\": 0.0001}}")]
    Form(#[from] serde_json::Error),
}

/// The state of the line, for pages.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct LineState {
    /// Share of bytes that are damaged from now on.
    damage: f64,
    /// Bytes that went through the line, in both directions.
    bytes: u64,
    /// Bytes of which one bit was flipped.
    flipped: u64,
    /// Bytes that were lost.
    dropped: u64,
}

#[derive(Debug)]
struct Inner {
    state: LineState,
    random: Pcg64Mcg,
}

/// A line, shared by the page and the links of all sessions.
#[derive(Debug, Clone)]
pub struct Line(Arc<Mutex<Inner>>);

impl Line {
    /// A line without damage, whose later damage is drawn by this seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(Arc::new(Mutex::new(Inner {
            state: LineState::default(),
            random: Pcg64Mcg::seed_from_u64(seed),
        })))
    }

    /// Changes the share of damaged bytes. Returns the line's state.
    ///
    /// # Errors
    /// [`LineError`]; then nothing is changed.
    pub(super) fn change(&self, json: &[u8]) -> Result<LineState, LineError> {
        let Change { damage } = serde_json::from_slice(json)?;
        if !(0.0..=MOST).contains(&damage) {
            return Err(LineError::Damage(damage));
        }
        let mut inner = lock(&self.0);
        inner.state.damage = damage;
        Ok(inner.state)
    }

    /// The line's state.
    pub(super) fn state(&self) -> LineState {
        lock(&self.0).state
    }

    /// A link whose bytes go through this line.
    #[must_use]
    pub fn through(&self, link: Box<dyn Link>) -> Box<dyn Link> {
        Box::new(Through { link, line: self.clone() })
    }

    /// Damages bytes in place. Returns how many are left.
    fn pass(&self, bytes: &mut [u8]) -> usize {
        let inner = &mut *lock(&self.0);
        inner.state.bytes += bytes.len() as u64;
        if inner.state.damage == 0.0 {
            return bytes.len();
        }
        let mut kept = 0;
        for at in 0..bytes.len() {
            let mut byte = bytes[at];
            if inner.random.random_bool(inner.state.damage) {
                if inner.random.random_bool(DROPPED) {
                    inner.state.dropped += 1;
                    continue;
                }
                byte ^= 1 << inner.random.random_range(0..8);
                inner.state.flipped += 1;
            }
            bytes[kept] = byte;
            kept += 1;
        }
        kept
    }
}

/// A link whose bytes go through a line.
struct Through {
    link: Box<dyn Link>,
    line: Line,
}

impl Link for Through {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut bytes = bytes.to_vec();
        let kept = self.line.pass(&mut bytes);
        self.link.send(&bytes[..kept])
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<Received> {
        Ok(match self.link.receive(buffer, timeout)? {
            Received::Bytes(length) => match self.line.pass(&mut buffer[..length]) {
                0 => Received::Nothing,
                kept => Received::Bytes(kept),
            },
            other => other,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_steady_line_changes_nothing_and_a_shaken_one_counts_what_it_changes() {
        let line = Line::new(1);
        let sent: Vec<u8> = (0..100_000u32).map(|at| at as u8).collect();
        let mut bytes = sent.clone();
        assert_eq!(line.pass(&mut bytes), sent.len());
        assert_eq!(bytes, sent);

        line.change(br#"{"damage": 0.01}"#).unwrap();
        let kept = line.pass(&mut bytes);
        let LineState { flipped, dropped, bytes: counted, .. } = line.state();
        assert_eq!((counted, kept as u64), (2 * sent.len() as u64, sent.len() as u64 - dropped));
        // 1000 damaged bytes are expected, with a standard deviation of 31; a fourth is lost.
        assert!(
            (800..1200).contains(&(flipped + dropped)) && dropped < flipped,
            "{flipped} {dropped}"
        );

        let again = Line::new(1);
        again.change(br#"{"damage": 0.01}"#).unwrap();
        let mut same = sent;
        assert_eq!((again.pass(&mut same), &same[..kept]), (kept, &bytes[..kept]));
    }

    #[test]
    fn a_share_that_no_line_can_have_is_refused() {
        let line = Line::new(1);
        for (json, words) in [
            (r#"{"damage": 0.5}"#, "damage is 0.5, expected 0 to 0.01"),
            (r#"{"damage": -1}"#, "damage is -1"),
            (r#"{"damage": "much"}"#, "expected for example"),
            ("{}", "expected for example"),
        ] {
            let error = line.change(json.as_bytes()).unwrap_err().to_string();
            assert!(error.contains(words) && error.lines().count() == 1, "{json}: {error}");
        }
    }
}
