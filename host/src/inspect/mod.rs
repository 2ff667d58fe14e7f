//! Says what is in a file of readings, and guesses aloud how to read it.
//!
//! Each form, order and remedy that an option of `nirspi reconstruct` names is tried. A guess is ranked by how
//! much of the held-back readings it explains, behind the [law of readings](nirspi_recon::law). The command
//! of a guess reads the file as the guess did.
//!
//! # Invariant
//! A guess is read by the reader of `nirspi reconstruct`, with the options of its command
//! (`host/cli/tests/cli/inspect.rs`, `the_first_command_gives_the_image`).

mod command;
mod feed;
mod other;
mod trial;
mod ways;
mod words;

pub use feed::FeedSeen;
pub use other::Finding;
pub use trial::Guess;

use crate::feed::{Address, FeedError};
use crate::files::FileError;
use crate::files::contents::{Array, Contents};
use crate::provenance::Taken;
use crate::recording::{RecordingError, RecordingInfo};
use crate::source::{Source, SourceError, SourceOptions};
use serde::{Serialize, Serializer};
use std::path::{Path, PathBuf};
use thiserror::Error;
use trial::Judge;
use ways::Trials;

/// The most guesses that are kept.
const MOST: usize = 12;

/// The most guesses with a picture.
pub const PICTURES: usize = 4;

/// What is in a file, and how its readings can be read.
#[derive(Debug, Serialize)]
pub struct Inspection {
    /// The file.
    pub input: PathBuf,
    /// Its format, in a few words.
    pub format: &'static str,
    /// Its arrays, or the columns of its table.
    pub arrays: Vec<ArrayReport>,
    /// What a recording holds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recording: Option<RecordingInfo>,
    /// What a feed declares and sends.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub feed: Option<FeedSeen>,
    /// What the file holds beside readings, or instead, with the commands for it.
    pub findings: Vec<Finding>,
    /// What the readings may be if no way fits.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unexplained: Option<Finding>,
    /// How many ways to read the readings were tried.
    pub tried: usize,
    /// The best ways, the best first.
    pub guesses: Vec<Guess>,
    /// Notes for the user.
    pub notes: Vec<String>,
    /// Where the readings come from.
    #[serde(skip)]
    pub taken: Taken,
}

/// An array of the file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ArrayReport {
    /// Its name; empty for the only array of a file without names.
    pub name: String,
    /// Length of each axis.
    pub shape: Vec<usize>,
    /// What kind of numbers it holds, or why there are none.
    pub kind: String,
    /// The least and the greatest number.
    pub range: Option<[f64; 2]>,
    /// Number of NaN.
    pub missing: usize,
}

impl From<&Array> for ArrayReport {
    fn from(array: &Array) -> Self {
        Self {
            name: array.name.clone(),
            shape: array.shape.clone(),
            kind: array.problem.clone().unwrap_or_else(|| array.kind.clone()),
            range: array.numbers.as_ref().and_then(|numbers| numbers.range),
            missing: array.numbers.as_ref().map_or(0, |numbers| numbers.missing),
        }
    }
}

/// Why a file cannot be inspected.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum InspectError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The recording cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The words after `feed:` are no address.
    #[error("{}: {expected}", .path.display())]
    Address {
        /// What was found.
        path: PathBuf,
        /// What was expected.
        expected: String,
    },
    /// The feed did not begin.
    #[error(transparent)]
    Feed(#[from] FeedError),
    /// The feed sends nothing.
    #[error("{address}: no data for {seconds} s, expected a header: one JSON line (docs/feeds.md)")]
    Quiet {
        /// The address.
        address: Address,
        /// For how long nothing came.
        seconds: u64,
    },
}

/// A number in few digits, as JSON has no others than it needs.
fn rounded<S: Serializer>(value: &f64, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_f64((value * 1e4).round() / 1e4)
}

impl Inspection {
    /// Inspects a file of readings, a recording, or the feed of an address such as `feed:HOST:PORT`.
    ///
    /// # Errors
    /// [`InspectError`], one line that names the file, what was found and what was expected.
    pub fn of(path: &Path) -> Result<Self, InspectError> {
        if let Some(address) = path.to_str().and_then(|path| path.strip_prefix("feed:")) {
            let wrong = |expected| InspectError::Address { path: path.to_owned(), expected };
            return Self::of_feed(&address.parse().map_err(wrong)?);
        }
        match SourceOptions::default().fits_recording(path) {
            Ok(true) => Self::of_recording(path),
            _ => Self::of_file(path),
        }
    }

    fn of_recording(path: &Path) -> Result<Self, InspectError> {
        let info = RecordingInfo::read(path)?;
        let judge = Judge::new();
        let (mut notes, mut taken) = (Vec::new(), Taken::of_file(path, None));
        let mut guesses = Vec::new();
        match Source::read(path, &SourceOptions::default()) {
            Ok(source) => {
                guesses.extend(judge.of_recording(path, &info, &source));
                taken = source.taken;
                notes = source.notes;
            }
            Err(SourceError::Recording(error)) => return Err(error.into()),
            Err(error) => notes.push(format!("no image: {}", crate::causes::in_one_line(&error))),
        }
        Ok(Self {
            input: path.to_owned(),
            format: "a recording (MCAP)",
            arrays: Vec::new(),
            recording: Some(info),
            feed: None,
            findings: Vec::new(),
            unexplained: None,
            tried: guesses.len(),
            guesses,
            notes,
            taken,
        })
    }

    fn of_file(path: &Path) -> Result<Self, InspectError> {
        let contents = ways::opened(path)?;
        let finite =
            |array: &Array| array.numbers.as_ref().is_some_and(|look| look.range.is_some());
        if !contents.arrays().iter().any(finite) {
            return Err(FileError::kind(path, "no finite number", "readings").into());
        }
        let (is_text, decimal_comma) = (contents.is_text(), contents.decimal_comma());
        let is_long = contents.arrays().iter().any(other::is_long);
        let found = Self::examined(path, contents);
        if is_text && !is_long && !decimal_comma && found.fitting().is_empty() {
            // One comma a line separates two columns, or is the decimal comma of one.
            let other = Contents::open(path, true).map(|contents| Self::examined(path, contents));
            if let Ok(other) = other
                && !other.fitting().is_empty()
            {
                return Ok(other);
            }
        }
        Ok(found)
    }

    fn examined(path: &Path, mut contents: Contents) -> Self {
        let mut notes: Vec<String> = contents.skipped().map(str::to_owned).into_iter().collect();
        notes.extend(contents.decimal_comma().then(|| "each comma is a decimal comma".to_owned()));
        let taken = contents.taken();
        let judge = Judge::new();
        let mut findings = other::patterns(path, &contents);
        let traces = other::traces(path, &mut contents);
        let stepped = other::stepped(path, &mut contents);
        let mut trials = Trials::new(path, &contents, &judge);
        let is_trace = !traces.is_empty();
        // A file that names rows has a reading for each.
        let is_stepped = !is_trace && !trials.has_rows;
        for trace in traces {
            findings.push(trace.finding());
            trials.of_trace(&trace);
        }
        // Readings do not jump every so many places alone.
        for trace in stepped.iter().filter(|_| is_stepped) {
            if !trials.has_fit() {
                trials.of_trace(trace);
                findings.extend(trials.has_fit().then(|| trace.finding()));
            }
        }
        if !is_trace && !trials.has_fit() {
            trials.of_contents();
        }
        if !is_trace && !trials.has_fit() {
            trials.of_parts();
        }
        let (tried, mut guesses) = trials.finished();
        guesses.truncate(MOST);
        guesses.iter_mut().take(PICTURES).for_each(|guess| judge.shown(guess));
        Self {
            input: path.to_owned(),
            format: contents.format(),
            arrays: contents.arrays().iter().map(ArrayReport::from).collect(),
            recording: None,
            feed: None,
            unexplained: other::unexplained(path, &contents, &findings, &guesses),
            findings,
            tried,
            guesses,
            notes,
            taken,
        }
    }

    /// Whether this is a feed of which no frame has come.
    #[must_use]
    pub fn is_silent(&self) -> bool {
        self.feed.as_ref().is_some_and(|feed| feed.account.frames == 0)
    }

    /// The guesses that explain the readings: better than chance, and not against the law of readings.
    #[must_use]
    pub fn fitting(&self) -> &[Guess] {
        let count = self.guesses.iter().take_while(|guess| guess.fits()).count();
        &self.guesses[..count]
    }

    /// The guesses to show: those that [fit](Self::fitting), or else the best one, if the file holds nothing else.
    #[must_use]
    pub fn shown(&self) -> &[Guess] {
        let least = usize::from(self.findings.is_empty());
        let most = self.fitting().len().min(PICTURES).max(least);
        &self.guesses[..most.min(self.guesses.len())]
    }

    /// The images of the guesses side by side; `None` if there is no guess.
    #[cfg(feature = "pictures")]
    #[must_use]
    pub fn picture(&self) -> Option<crate::picture::SideBySide> {
        use crate::picture::{Panel, SideBySide, Unit};
        let panel = |(at, guess): (usize, &Guess)| {
            let unit = Unit::of_readings(self.recording.is_some());
            let title = format!("{}: {}", at + 1, guess.name());
            Panel {
                caption: vec![guess.explains()],
                warnings: guess.warnings.clone(),
                ..Panel::of_image(&title, &guess.image, unit)
            }
        };
        let panels: Vec<Panel> = self.shown().iter().enumerate().map(panel).collect();
        (!panels.is_empty()).then(|| SideBySide {
            header: format!("Ways to read {}", self.input.display()),
            panels,
            footer: String::new(),
        })
    }
}
