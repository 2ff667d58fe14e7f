//! How long a frame takes from its arrival at this computer to each stage of the page.
//!
//! Each delay counts from the moment at which the link gave the frame's last bytes to this program.
//! An image has the delay of its newest frame. The clock is an argument.

mod window;

pub use window::{Percentiles, Window};

use nirspi::clock::Instant;
use serde::Serialize;
use std::fmt;

/// A stage that a frame or its image has passed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Passed {
    /// The frame is counted, and the recording has it if there is one.
    Counted,
    /// The image is reconstructed.
    Reconstructed,
    /// The image is enlarged and deblurred.
    Enhanced,
    /// The image is handed to the connection of a page.
    Sent,
}

/// The delays of all stages over the last seconds.
#[derive(Debug)]
pub struct Delays([Window; 4]);

/// The delays as scripts and pages get them. A stage without a frame in the window is `null`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DelayState {
    /// Seconds over which the delays are collected.
    window_s: f64,
    /// Until the frame was counted and the recording had it.
    counted: Option<Percentiles>,
    /// Until the image was reconstructed.
    reconstructed: Option<Percentiles>,
    /// Until the image was enhanced.
    enhanced: Option<Percentiles>,
    /// Until the image was handed to the connection of a page, all pages together.
    sent: Option<Percentiles>,
}

impl Delays {
    /// No delays yet.
    pub fn new(now: Instant) -> Self {
        Self(std::array::from_fn(|_| Window::new(now)))
    }

    /// A frame that arrived at this moment has passed this stage now.
    pub fn passed(&mut self, stage: Passed, arrived: Instant, now: Instant) {
        self.0[stage as usize].add(now, now.saturating_duration_since(arrived));
    }

    /// The delays of the last seconds.
    pub fn state(&mut self, now: Instant) -> DelayState {
        let mut of = |stage: Passed| self.0[stage as usize].percentiles(now);
        DelayState {
            window_s: Window::LENGTH.as_secs_f64(),
            counted: of(Passed::Counted),
            reconstructed: of(Passed::Reconstructed),
            enhanced: of(Passed::Enhanced),
            sent: of(Passed::Sent),
        }
    }
}

/// The delay of the last stage that a frame has passed, in words; nothing without any.
impl fmt::Display for DelayState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let stages =
            [(self.sent, "page"), (self.enhanced, "enhanced image"), (self.reconstructed, "image")];
        match stages.into_iter().find_map(|(delay, to)| Some((delay?, to))) {
            Some((Percentiles { p50_ms, p99_ms, .. }, to)) => {
                write!(f, "; delay from frame to {to} {p50_ms:.1} ms (p50), {p99_ms:.1} ms (p99)")
            }
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn each_stage_has_its_own_delay_since_the_frame_arrived() {
        let arrived = Instant::now();
        let after = |ms| arrived + Duration::from_millis(ms);
        let mut delays = Delays::new(arrived);
        delays.passed(Passed::Counted, arrived, after(1));
        delays.passed(Passed::Reconstructed, arrived, after(10));
        let state = delays.state(after(20));
        let p99 = |of: Option<Percentiles>| of.map_or(0, |of| of.p99_ms.round() as u64);
        assert_eq!((p99(state.counted), p99(state.reconstructed), state.sent), (1, 10, None));
        assert!(state.to_string().starts_with("; delay from frame to image 10."), "{state}");
        delays.passed(Passed::Sent, arrived, after(30));
        assert!(delays.state(after(40)).to_string().contains("to page 3"));
        assert_eq!(Delays::new(arrived).state(arrived).to_string(), "");
    }
}
