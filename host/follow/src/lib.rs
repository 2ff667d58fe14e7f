//! One measurement of a target that moves, from many short frames.
//!
//! A frame that is short enough shows a moving target sharp, and dark. This adds as many frames as the motion that is
//! seen in them allows: it finds the motion of the whole scene, and the scene that explains the readings of all these frames
//! best, as it stands in the newest one. The result is a measurement of the same patterns, for every method of
//! reconstruction. A scene at rest gives the mean of its frames.
//!
//! ```
//! use nirspi_follow::{FollowSettings, Timed, follow};
//! # use nirspi_recon::{Measurements, Rows, Side};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let rows = Rows::natural(Side::new(8)?);
//! # let frames = vec![Measurements::from_differential(&rows, &[1.0; 64])?; 8];
//! let frames: Vec<Timed> = frames.iter().enumerate().map(|(k, frame)| Timed { frame, at: k as f64 }).collect();
//! let followed = follow(&frames, &FollowSettings::default())?;
//! println!("{} frames, {:?} pixels a frame", followed.frames, followed.velocity_px);
//! # Ok(())
//! # }
//! ```
//!
//! # What it does not know
//! The target moves as a whole, at one speed, parallel to the image. Of a target that turns, or comes nearer, fewer frames are
//! added. A background that rests behind the target counts as a scene that does not fit, too.
//!
//! # Invariant
//! The frames of a scene at rest give their mean, whatever their number
//! (`tests::frames_at_rest_give_their_mean`).

mod canvas;
mod fit;
mod frames;
mod search;

use frames::{FEWEST, Frames};
use nirspi_recon::{MeasurementError, Measurements};
use thiserror::Error;

/// A frame and its time.
#[derive(Debug, Clone, Copy)]
pub struct Timed<'a> {
    /// What was measured.
    pub frame: &'a Measurements,
    /// When, in lengths of a frame from any beginning.
    pub at: f64,
}

/// Settings of [`follow`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FollowSettings {
    /// The fastest motion that is looked for, in pixels a frame, down or up and to the right or left.
    pub reach_px: f64,
    /// The motion of the frames before, where the search begins.
    pub before: Option<[f64; 2]>,
}

impl Default for FollowSettings {
    fn default() -> Self {
        Self { reach_px: 2.0, before: None }
    }
}

/// What the frames say together.
#[derive(Debug, Clone, PartialEq)]
pub struct Followed {
    /// The scene of the newest frame, in the frames' units, with its noise.
    pub measurements: Measurements,
    /// Number of frames that were added, the newest ones.
    pub frames: usize,
    /// Motion down and to the right, in pixels a frame; 0 at rest.
    pub velocity_px: [f64; 2],
}

/// Why frames give no measurement.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum FollowError {
    /// There are no frames.
    #[error("no frames to add")]
    Empty,
    /// Frames of different patterns.
    #[error("frame {index} was measured with other patterns than the newest one")]
    Rows {
        /// Index of the frame.
        index: usize,
    },
    /// A frame has a time that is no number, or that is not later than that of the frame before.
    #[error("frame {index} is at {found} frames, expected later than the frame before")]
    Time {
        /// Index of the frame.
        index: usize,
        /// Its time.
        found: f64,
    },
    /// The result is no measurement.
    #[error(transparent)]
    Measurement(#[from] MeasurementError),
}

/// Adds as many of the newest frames as the motion that is seen in them allows. The frames stand in the order of their times.
/// Among all frames, half of them, a quarter and so on, those count whose result has the least error: noise, and what one
/// motion of the whole scene leaves of the readings beyond noise, of all frames and of the newest ones. Fewer than four frames without a known noise are
/// taken to be at rest.
///
/// # Errors
/// [`FollowError`] without frames, or for frames of different patterns.
pub fn follow(frames: &[Timed<'_>], settings: &FollowSettings) -> Result<Followed, FollowError> {
    let frames = Frames::of(frames)?;
    let all = frames.count();
    let Some(noise) = frames.noise() else {
        return frames.followed(frames.at_rest(all, None));
    };
    let mut best = frames.at_rest(1, Some(noise));
    let mut count = all;
    while count > 1 {
        let newest = frames.newest(count);
        // Fewer frames have more noise, however well one motion explains them.
        if best.error.is_some_and(|error| error <= noise * newest.share_of_noise(best.velocity_px))
        {
            break;
        }
        let found = match newest.rests(noise) {
            true => Some(newest.at_rest(count, Some(noise))),
            false => newest.moved(noise, settings),
        };
        if let Some(found) = found.filter(|found| found.error < best.error) {
            best = found;
        }
        count = match count / 2 {
            half if half < FEWEST && count > FEWEST => FEWEST,
            half => half,
        };
    }
    frames.followed(best)
}
