//! The length of a capture in seconds.

use super::{Progress, StopCause};
use std::ops::ControlFlow;
use std::str::FromStr;
use std::time::Duration;
use thiserror::Error;

/// The shortest and the longest capture, in seconds.
const RANGE: std::ops::RangeInclusive<f64> = 1e-3..=1e8;

/// How long a capture measures, by this computer's clock. The time of calibration does not count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Seconds(Duration);

/// A text is not a number of seconds for a capture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("expected seconds above 0, like 60")]
pub struct SecondsError;

impl FromStr for Seconds {
    type Err = SecondsError;

    fn from_str(text: &str) -> Result<Self, SecondsError> {
        let seconds = text.parse().ok().filter(|seconds| RANGE.contains(seconds));
        seconds.map(|seconds| Self(Duration::from_secs_f64(seconds))).ok_or(SecondsError)
    }
}

impl Seconds {
    /// Whether so much time is at least as long.
    #[must_use]
    pub fn are_over(self, elapsed: Duration) -> bool {
        elapsed >= self.0
    }

    /// A break if the time is over. A capture that ends so is whole, as if it had all its frames.
    pub fn watch(self, progress: &Progress) -> ControlFlow<StopCause> {
        match progress.waited {
            Some(_) if self.are_over(progress.elapsed) => ControlFlow::Break(StopCause::TimeOver),
            _ => ControlFlow::Continue(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_are_read_and_anything_else_is_refused() {
        assert_eq!("0.5".parse(), Ok(Seconds(Duration::from_millis(500))));
        assert_eq!("1e3".parse(), Ok(Seconds(Duration::from_secs(1000))));
        for text in ["", "0", "-1", "nan", "inf", "1e9", "1min", "soon"] {
            assert_eq!(text.parse::<Seconds>(), Err(SecondsError), "{text}");
        }
    }

    #[test]
    fn the_time_is_over_at_its_end_and_calibration_does_not_count() {
        let minute = Seconds(Duration::from_secs(60));
        let at = |ms, waited| {
            let elapsed = Duration::from_millis(ms);
            minute.watch(&Progress { elapsed, waited, ..Progress::default() })
        };
        let running = Some(Duration::ZERO);
        assert!(at(59_999, running).is_continue());
        assert_eq!(at(60_000, running), ControlFlow::Break(StopCause::TimeOver));
        assert!(at(1_000_000, None).is_continue());
    }
}
