//! The state sent to pages and scripts: the camera's state, the account, the rates and the newest
//! images.
//!
//! Each state is one message made at one moment, so its counters add up and belong to its image.

use super::camera_log::{CameraState, EventLine};
use super::delays::DelayState;
use super::line::LineState;
use super::overload::OverloadState;
use super::picture::Picture;
use super::settings::{MAX_FRAMES, MAX_SWEEPS, Offer, Settings};
use super::slot::Ledger;
use super::stage::SceneState;
use data_encoding::BASE64;
use nirspi::clock::Instant;
use nirspi_recon::Order;
use serde::Serialize;
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

/// The window over which a rate counts frames.
const RATE_WINDOW: Duration = Duration::from_secs(1);

/// The rate of a counter.
#[derive(Debug, Clone, Copy)]
pub struct Rate {
    since: Instant,
    count: u64,
    per_s: f64,
}

impl Rate {
    /// A rate without any counts.
    pub fn new(now: Instant) -> Self {
        Self { since: now, count: 0, per_s: 0.0 }
    }

    /// Updates the rate: the counter has the value `count`. Returns the rate over the last whole
    /// window.
    pub fn at(&mut self, now: Instant, count: u64) -> f64 {
        let passed = now.saturating_duration_since(self.since);
        if passed >= RATE_WINDOW {
            self.per_s = count.saturating_sub(self.count) as f64 / passed.as_secs_f64();
            (self.since, self.count) = (now, count);
        }
        self.per_s
    }
}

/// All rates.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Rates {
    /// Frames received from the camera a second.
    pub camera_frames_per_s: f64,
    /// Images made and shown a second.
    pub images_per_s: f64,
}

/// Whether persons allow light.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Light {
    /// The position of the switch.
    pub allowed: bool,
    /// The number of commands so far.
    pub commands: u64,
}

/// The values that settings can have.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Offered<'s> {
    #[serde(flatten)]
    offer: &'s Offer,
    max_frames: u32,
    max_sweeps: u32,
    orders: [OfferedOrder; ORDERS],
}

/// An order of patterns, and what the order is.
#[derive(Debug, Clone, Copy, Serialize)]
struct OfferedOrder {
    name: &'static str,
    about: &'static str,
}

/// Number of orders that pages offer.
const ORDERS: usize = Order::NAMED.len();

impl<'s> Offered<'s> {
    /// This offer, and what every server offers.
    pub fn new(offer: &'s Offer) -> Self {
        let orders = std::array::from_fn(|at| {
            let order = &Order::NAMED[at];
            OfferedOrder { name: order.name, about: order.about }
        });
        Self { offer, max_frames: MAX_FRAMES, max_sweeps: MAX_SWEEPS, orders }
    }
}

/// The state without pixels; the response of `GET /api/state`.
#[derive(Debug, Serialize)]
pub struct State<'s> {
    /// Number of this state: the first has number 1, each further one the next number.
    pub number: u64,
    /// Version of this program.
    pub program: &'static str,
    /// The camera.
    pub camera: &'s CameraState,
    /// Whether persons allow light.
    pub light: Light,
    /// The account: `frames` and `images`.
    #[serde(flatten)]
    pub ledger: Ledger,
    /// Rates.
    pub rates: Rates,
    /// The current settings.
    pub settings: &'s Settings,
    /// The values that settings can have.
    pub offered: Offered<'s>,
    /// Properties of the images shown; `null` before the first.
    pub picture: Option<&'s Picture>,
    /// Why the newest frame gave no image; `null` if it gave one.
    pub problem: Option<&'s str>,
    /// The scene of a virtual camera; `null` for a real one.
    pub scene: Option<SceneState>,
    /// The line between firmware and host; `null` if its bytes cannot be damaged from the page.
    pub line: Option<LineState>,
    /// How long frames take to each stage.
    pub delays: DelayState,
    /// The load of the camera's thread, and what the page gives up because of the load.
    pub overload: OverloadState,
    /// Number of connected pages.
    pub viewers: usize,
    /// Events, oldest first.
    pub events: &'s VecDeque<EventLine>,
}

/// The message to pages. Images are 32-bit floating-point numbers, little-endian, in base64.
#[derive(Serialize)]
struct Message<'s> {
    state: &'s State<'s>,
    /// (height, width) in the unit of the picture: 32 and ADC counts for a camera.
    image: Option<String>,
    /// (64, 64) shares of white; `null` if the learned stages are switched off.
    enhanced: Option<String>,
    /// (64, 64) shares of white: half-width of the 95 % interval of each pixel of `enhanced`; `null`
    /// without calibrated intervals.
    interval: Option<String>,
    /// (n, n): the reading of Hadamard row `n r + c` at (r, c); NaN for a row that
    /// was not measured. `null` for other patterns.
    readings: Option<String>,
    /// (32, 32) distances in metres; `null` without a depth sensor.
    depth: Option<String>,
    /// (64, 64) 8-bit reflectances of the scene that is shown, in base64; `null` for a real camera.
    drawing: Option<&'s str>,
}

/// One state, encoded for sending.
#[derive(Debug, Default)]
pub struct Published {
    /// The number of the state.
    #[cfg(not(target_family = "wasm"))]
    pub number: u64,
    /// When the state was made; `None` before the first.
    #[cfg(not(target_family = "wasm"))]
    pub made: Option<Instant>,
    /// The state as JSON, without pixels.
    #[cfg(not(target_family = "wasm"))]
    pub state: String,
    /// The state as JSON, with pixels.
    pub message: String,
    /// The images.
    #[cfg(not(target_family = "wasm"))]
    pub picture: Option<Arc<Picture>>,
}

impl Published {
    /// Encodes a state for pages and scripts.
    ///
    /// # Errors
    /// Does not occur: every field can be written as JSON.
    pub fn new(
        state: &State<'_>,
        picture: Option<&Arc<Picture>>,
        drawing: Option<&str>,
    ) -> serde_json::Result<Self> {
        let message = Message {
            state,
            image: picture.map(|picture| numbers(&picture.counts)),
            enhanced: picture.and_then(|picture| picture.enhanced.as_deref().map(numbers)),
            interval: picture.and_then(|picture| picture.half_width.as_deref().map(numbers)),
            readings: picture.and_then(|picture| picture.readings.as_deref().map(numbers)),
            depth: picture.and_then(|picture| Some(numbers(&picture.depth.as_ref()?.pixels_m))),
            drawing,
        };
        Ok(Self {
            message: serde_json::to_string(&message)?,
            #[cfg(not(target_family = "wasm"))]
            number: state.number,
            #[cfg(not(target_family = "wasm"))]
            made: Some(Instant::now()),
            #[cfg(not(target_family = "wasm"))]
            state: serde_json::to_string_pretty(state)?,
            #[cfg(not(target_family = "wasm"))]
            picture: picture.cloned(),
        })
    }
}

fn numbers(pixels: &[f32]) -> String {
    BASE64.encode(&pixels.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<_>>())
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
