//! What pages and scripts are told: the camera's state, the account, the rates, and the newest images.
//!
//! The one law: what goes out is one message made at one moment, so that its counters add up and its image is theirs.

use super::camera_log::{CameraState, EventLine};
use super::imaging::Picture;
use super::settings::{MAX_FRAMES, Settings};
use super::slot::Ledger;
use crate::files::image::to_level;
use data_encoding::BASE64;
use serde::Serialize;
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How long frames are counted for a rate.
const RATE_WINDOW: Duration = Duration::from_secs(1);

/// How fast a counter counts.
#[derive(Debug, Clone, Copy)]
pub struct Rate {
    since: Instant,
    count: u64,
    per_s: f64,
}

impl Rate {
    /// Nothing counted yet.
    pub fn new(now: Instant) -> Self {
        Self { since: now, count: 0, per_s: 0.0 }
    }

    /// The counter stands at `count`: how fast it went over the last whole window.
    pub fn at(&mut self, now: Instant, count: u64) -> f64 {
        let passed = now.saturating_duration_since(self.since);
        if passed >= RATE_WINDOW {
            self.per_s = count.saturating_sub(self.count) as f64 / passed.as_secs_f64();
            (self.since, self.count) = (now, count);
        }
        self.per_s
    }
}

/// How fast everything goes.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Rates {
    /// Frames received from the camera.
    pub camera_frames_per_s: f64,
    /// Images made and shown.
    pub images_per_s: f64,
}

/// What settings can be.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Offered<'s> {
    methods: &'s [&'static str],
    max_frames: u32,
}

impl<'s> Offered<'s> {
    /// These methods.
    pub fn new(methods: &'s [&'static str]) -> Self {
        Self { methods, max_frames: MAX_FRAMES }
    }
}

/// Everything but pixels; `GET /api/state`.
#[derive(Debug, Serialize)]
pub struct State<'s> {
    /// Version of this program.
    pub program: &'static str,
    /// The camera.
    pub camera: &'s CameraState,
    /// The account: `frames` and `images`.
    #[serde(flatten)]
    pub ledger: Ledger,
    /// Rates.
    pub rates: Rates,
    /// What is set.
    pub settings: Settings,
    /// What could be.
    pub offered: Offered<'s>,
    /// About the images shown; `null` before the first.
    pub picture: Option<&'s Picture>,
    /// Why the newest frame gave no image.
    pub problem: Option<&'s str>,
    /// Pages that look.
    pub viewers: usize,
    /// Oldest first.
    pub events: &'s VecDeque<EventLine>,
}

/// What pages are sent.
#[derive(Serialize)]
struct Message<'s> {
    state: &'s State<'s>,
    /// 8-bit grey levels of 32 x 32 pixels in base64.
    image: Option<String>,
    /// 64 x 64 likewise; `null` where it is switched off.
    enhanced: Option<String>,
}

/// One moment, ready to be sent.
#[derive(Debug, Default)]
pub struct Published {
    /// As JSON, without pixels.
    pub state: String,
    /// As JSON, with pixels.
    pub message: String,
    /// The images.
    pub picture: Option<Arc<Picture>>,
}

impl Published {
    /// Puts a moment into the words of pages and scripts.
    ///
    /// # Errors
    /// Never: all of it can be said in JSON.
    pub fn new(state: &State<'_>, picture: Option<&Arc<Picture>>) -> serde_json::Result<Self> {
        let message = Message {
            state,
            image: picture.map(|picture| levels(&picture.image)),
            enhanced: picture.and_then(|picture| picture.enhanced.as_deref().map(levels)),
        };
        Ok(Self {
            message: serde_json::to_string(&message)?,
            state: serde_json::to_string_pretty(state)?,
            picture: picture.cloned(),
        })
    }
}

fn levels(pixels: &[f32]) -> String {
    BASE64.encode(&pixels.iter().map(|&value| to_level(value)).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_is_that_of_the_last_whole_window() {
        let start = Instant::now();
        let after = |ms| start + Duration::from_millis(ms);
        let mut rate = Rate::new(start);
        assert_eq!(rate.at(after(500), 40), 0.0);
        assert_eq!(rate.at(after(1000), 100), 100.0);
        assert_eq!(rate.at(after(1900), 100), 100.0);
        assert_eq!(rate.at(after(3000), 120), 10.0);
        assert_eq!(rate.at(after(4000), 120), 0.0);
    }
}
