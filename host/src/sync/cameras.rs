//! Frames of several cameras as they come: each clock fitted, all frames in one order.

use super::{Clock, Fit, Heard, Merge, Merged};
use std::time::Duration;

/// A frame of one of several cameras, with its time by the host's clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Timed<T> {
    /// Number of the camera, from 0.
    pub camera: usize,
    /// The host's time of the frame's first pattern, in ns since 1970.
    pub time_ns: u64,
    /// Uncertainty of the time, without the link's shortest delay; `None` until enough frames have
    /// come.
    pub uncertainty_us: Option<f64>,
    /// Whether a frame with a later time went out before.
    pub late: bool,
    /// What the caller gave with the frame, such as the frame itself.
    pub item: T,
}

/// Several cameras at one host.
#[derive(Debug)]
pub struct Cameras<T> {
    clocks: Vec<Clock>,
    merge: Merge<(Option<f64>, T)>,
}

impl<T> Cameras<T> {
    /// Cameras with frames of these durations in ns. A camera that is silent for longer than
    /// `patience` is not waited for.
    #[must_use]
    pub fn new(frame_ns: &[f64], patience: Duration) -> Self {
        let clocks = frame_ns.iter().map(|&frame_ns| Clock::new(frame_ns)).collect();
        Self { clocks, merge: Merge::new(frame_ns.len(), patience) }
    }

    /// Takes a frame of a run, with its device time and the time of its arrival in ns since 1970.
    ///
    /// # Panics
    /// If there is no such camera.
    pub fn arrived(
        &mut self,
        camera: usize,
        run: u16,
        device_time_us: u64,
        arrived_ns: u64,
        item: T,
    ) -> Heard {
        let clock = &mut self.clocks[camera];
        let heard = clock.arrived(run, device_time_us, arrived_ns);
        let device_time_us = clock.device_time_us(device_time_us);
        let (time_ns, uncertainty_us) = match clock.fit() {
            Some(fit) => (fit.host_ns(device_time_us), fit.uncertainty_us(device_time_us)),
            None => (arrived_ns, None),
        };
        self.merge.push(camera, time_ns, arrived_ns, (uncertainty_us, item));
        heard
    }

    /// The camera brings nothing more, until it brings something again.
    ///
    /// # Panics
    /// If there is no such camera.
    pub fn end(&mut self, camera: usize) {
        self.merge.end(camera);
    }

    /// The next frame in the order of common time, if it need not wait at the time `now_ns`.
    pub fn next(&mut self, now_ns: u64) -> Option<Timed<T>> {
        let Merged { camera, time_ns, late, item: (uncertainty_us, item) } =
            self.merge.next(now_ns)?;
        Some(Timed { camera, time_ns, uncertainty_us, late, item })
    }

    /// The clock of a camera; `None` before its first frame.
    ///
    /// # Panics
    /// If there is no such camera.
    #[must_use]
    pub fn fit(&self, camera: usize) -> Option<Fit> {
        self.clocks[camera].fit()
    }

    /// Number of frames that went out late.
    #[must_use]
    pub fn late(&self) -> u64 {
        self.merge.late()
    }
}
