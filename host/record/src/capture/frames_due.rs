//! Ends a run whose camera says that it measures and sends no frame.
//!
//! # Invariant
//! A run waits for its next frame for 5 s and ten frames of the camera's clock, or for a minute and
//! ten frames of the host's: the clock of a simulated camera may be slower, and that of a defective one
//! may stand still (`tests::a_run_without_frames_ends_by_either_clock`).
//!
//! The camera's wait is that between two of its statuses. A frame has the time of the FPGA's clock, which
//! is slower than the processor's where the FPGA is simulated
//! (`tests::the_times_of_frames_do_not_count`).

use nirspi_files::clock::Instant;
use std::time::Duration;

/// How long a camera may go without a frame by its own clock, besides ten frames.
const BY_CAMERA: Duration = Duration::from_secs(5);
/// How long by the host's clock.
const BY_HOST: Duration = Duration::from_secs(60);
/// The frames that a camera may be late.
const FRAMES: f64 = 10.0;

/// When the next frame of a run is overdue.
#[derive(Debug)]
pub(super) struct FramesDue {
    /// The time of ten frames.
    late: Duration,
    /// When the newest frame came, or the run began.
    last: Instant,
    /// The camera's time in the first status after it; `None` before that status.
    last_device_us: Option<u64>,
    /// The camera's time in its newest status.
    device_us: u64,
}

impl FramesDue {
    /// A run that begins now, of frames of this duration.
    pub(super) fn new(frame_ns: f64, now: Instant) -> Self {
        let late = Duration::from_secs_f64(FRAMES * frame_ns / 1e9);
        Self { late, last: now, last_device_us: None, device_us: 0 }
    }

    /// A new frame has come.
    pub(super) fn frame(&mut self, now: Instant) {
        (self.last, self.last_device_us) = (now, None);
    }

    /// The camera has told its time.
    pub(super) fn status(&mut self, uptime_us: u64) {
        self.device_us = uptime_us;
        self.last_device_us.get_or_insert(uptime_us);
    }

    /// This program stood still: what the camera sent meanwhile is read next.
    pub(super) fn stood_still(&mut self, now: Instant) {
        (self.last, self.last_device_us) = (now, None);
    }

    /// How long the camera has sent no frame, if that is too long.
    pub(super) fn overdue(&self, now: Instant) -> Option<Duration> {
        let by_host = now.saturating_duration_since(self.last);
        let since = self.last_device_us.map_or(0, |last| self.device_us.saturating_sub(last));
        let by_camera = Duration::from_micros(since);
        if by_camera > BY_CAMERA + self.late {
            return Some(by_camera);
        }
        (by_host > BY_HOST + self.late).then_some(by_host)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    #[test]
    fn a_run_without_frames_ends_by_either_clock() {
        let began = Instant::now();
        let mut due = FramesDue::new(1e8, began);
        due.status(1_000_000);
        // Ten frames take a second.
        due.status(7_000_000);
        assert_eq!(due.overdue(began + 6 * SECOND), None);
        due.status(7_000_001);
        assert_eq!(due.overdue(began), Some(Duration::from_micros(6_000_001)));
        // A clock that stands still.
        let due = FramesDue::new(1e8, began);
        assert_eq!(due.overdue(began + 61 * SECOND), None);
        assert_eq!(due.overdue(began + 62 * SECOND), Some(62 * SECOND));
    }

    #[test]
    fn each_frame_begins_the_wait_anew_and_so_does_a_sleep_of_the_host() {
        let began = Instant::now();
        let mut due = FramesDue::new(1e6, began);
        for frame in 1..100_u32 {
            let now = began + frame * 4 * SECOND;
            due.frame(now);
            due.status(u64::from(frame) * 4_000_000);
            due.status(u64::from(frame) * 4_000_000 + 3_999_999);
            assert_eq!(due.overdue(now + 3 * SECOND), None, "{frame}");
        }
        due.stood_still(began + 4000 * SECOND);
        due.status(4_000_000_000);
        assert_eq!(due.overdue(began + 4001 * SECOND), None);
        due.status(4_006_000_000);
        assert!(due.overdue(began + 4007 * SECOND).is_some());
    }

    /// Statuses ten seconds apart in the camera's time, with a frame between each two.
    #[test]
    fn the_times_of_frames_do_not_count() {
        let began = Instant::now();
        let mut due = FramesDue::new(1e6, began);
        for turn in 1..100_u32 {
            let now = began + turn * SECOND;
            due.status(u64::from(turn) * 10_000_000);
            assert_eq!(due.overdue(now), None, "{turn}");
            due.frame(now);
        }
    }
}
