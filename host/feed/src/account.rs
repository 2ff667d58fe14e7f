//! What became of the numbers of a feed.

use nirspi_recon::words::count;
use serde::Serialize;
use std::fmt;

/// What became of the numbers of a feed: every frame and every number that is missing is counted.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Account {
    /// Complete frames with at least one reading.
    pub frames: u64,
    /// Complete frames without any reading, which are left out.
    pub empty_frames: u64,
    /// Numbers that were none: words and infinite numbers. Their readings count as not read.
    pub refused: u64,
    /// The first of them, and where it was.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_refused: Option<String>,
    /// Readings that the feed itself says were not read: NaN.
    pub not_read: u64,
    /// Readings whose edge of the trigger was lost: they were not read.
    pub lost: u64,
    /// Edges of the trigger that came too early and begin no reading.
    pub early: u64,
    /// Readings of a last frame that is not complete.
    pub cut: u64,
}

impl Account {
    /// Whether every frame arrived with every reading.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        let Self { empty_frames, refused, not_read, lost, cut, .. } = self;
        [empty_frames, refused, not_read, lost, cut].into_iter().all(|&count| count == 0)
    }

    /// What is missing, in one line; `None` if nothing is.
    #[must_use]
    pub fn missing(&self) -> Option<String> {
        let mut parts = Vec::new();
        if self.empty_frames > 0 {
            parts.push(format!("{} without any reading", count(self.empty_frames, "frame")));
        }
        if self.refused > 0 {
            let first = self.first_refused.as_deref().unwrap_or_default();
            parts.push(format!("{} refused (first {first})", count(self.refused, "number")));
        }
        if self.not_read > 0 {
            parts.push(format!("{} not read (NaN)", count(self.not_read, "reading")));
        }
        if self.lost > 0 {
            parts.push(format!("{} whose trigger was lost", count(self.lost, "reading")));
        }
        if self.cut > 0 {
            parts.push(format!(
                "{} of a last frame that is not complete",
                count(self.cut, "reading")
            ));
        }
        (!parts.is_empty()).then(|| parts.join(", "))
    }
}

impl fmt::Display for Account {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&count(self.frames, "frame"))?;
        if let Some(missing) = self.missing() {
            write!(f, "; {missing}")?;
        }
        match self.early {
            0 => Ok(()),
            early => write!(f, "; {} that came too early", count(early, "edge")),
        }
    }
}
