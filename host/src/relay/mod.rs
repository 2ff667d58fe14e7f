//! The frames of a camera for other programs: one program runs the camera and publishes what comes,
//! others take it as a camera of their own.
//!
//! * [`Publishing`] is an observer of a capture that publishes every intact packet, and announces
//!   the setup of each run,
//! * [`RelayLink`] is what was published, as a link to a camera: greeting, setup and start are
//!   answered here, frames are numbered from the start of the host's own run.
//!
//! The way between them is a [`Publish`] and a [`Subscribe`]. With the feature `zenoh`, the module
//! `relay::zenoh` is one.
//!
//! # Invariant
//! A host that joins in the middle of a run counts the frames from its own start on, and every frame
//! that the way between loses counts as lost
//! (`tests::a_late_host_counts_from_its_start_and_every_gap_is_a_loss`).

mod link;
#[cfg(test)]
mod tests;
#[cfg(feature = "zenoh")]
pub mod zenoh;

pub use link::RelayLink;

use crate::account::LossCounters;
use crate::calibration::{CalibrationError, Settling};
use crate::capture::{Observer, Progress};
use crate::clock::Instant;
use crate::session::CameraIdentity;
use crate::setup::MeasurementSetup;
use nirspi_wire::packet::MAX_DEVICE_PACKET;
use nirspi_wire::{Answer, DeviceMessage, Frame, Reply, encode};
use serde::{Deserialize, Serialize};
use std::io;
use std::ops::ControlFlow;
use std::time::Duration;

/// What a host must know before it can use the packets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Announcement {
    /// The camera.
    pub identity: CameraIdentity,
    /// The setup of the run.
    pub setup: MeasurementSetup,
    /// Settling of the camera, if it is known.
    pub settling: Option<Settling>,
}

/// The sending end. It never makes the camera's thread wait: what has no room is dropped.
pub trait Publish: Send {
    /// Makes the announcement known to those that listen now and to those that come later.
    fn announce(&mut self, json: &str);
    /// Sends one wire packet, delimiter included.
    fn packet(&mut self, raw: &[u8]);
}

/// The receiving end.
pub trait Subscribe: Send {
    /// The next packet as it was sent; `None` if none comes within this time.
    ///
    /// # Errors
    /// If no packet can come any more.
    fn packet(&mut self, timeout: Duration) -> io::Result<Option<Vec<u8>>>;
}

/// Publishes a capture beside another observer.
pub struct Publishing<'o, P> {
    identity: CameraIdentity,
    to: P,
    beside: &'o mut dyn Observer,
    room: Vec<u8>,
}

impl<'o, P: Publish> Publishing<'o, P> {
    /// Publishes the capture that `beside` observes.
    #[must_use]
    pub fn new(identity: &CameraIdentity, to: P, beside: &'o mut dyn Observer) -> Self {
        Self { identity: identity.clone(), to, beside, room: vec![0; MAX_DEVICE_PACKET + 1] }
    }

    fn publish(&mut self, message: &DeviceMessage<'_>) {
        // Every message of a camera has room.
        if let Ok(raw) = encode(message, &mut self.room) {
            self.to.packet(raw);
        }
    }
}

impl<P: Publish> Observer for Publishing<'_, P> {
    fn begins(
        &mut self,
        setup: &MeasurementSetup,
        settling: Option<&Settling>,
        problem: Option<&CalibrationError>,
    ) {
        let announcement = Announcement {
            identity: self.identity.clone(),
            setup: setup.clone(),
            settling: settling.cloned(),
        };
        if let Ok(json) = serde_json::to_string(&announcement) {
            self.to.announce(&json);
        }
        self.beside.begins(setup, settling, problem);
    }

    fn arrived(&mut self, at: Instant) {
        self.beside.arrived(at);
    }

    fn frame(&mut self, frame: &Frame<'_>, counters: &LossCounters) {
        self.publish(&DeviceMessage::Frame(*frame));
        self.beside.frame(frame, counters);
    }

    fn message(&mut self, message: &DeviceMessage<'_>) {
        // Other replies answer requests of this host alone.
        let is_ours = matches!(message, DeviceMessage::Reply(Reply { outcome, .. })
            if !matches!(outcome, Ok(Answer::Status(_))));
        if !is_ours {
            self.publish(message);
        }
        self.beside.message(message);
    }

    fn watch(&mut self, progress: &Progress) -> ControlFlow<()> {
        self.beside.watch(progress)
    }
}
