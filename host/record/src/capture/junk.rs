//! Limits the junk in a run: bytes that do not belong to its frames.
//!
//! # Invariant
//! A recording holds at most [`ALLOWED`] bytes of junk plus as many bytes as its frames, not
//! counting a trickle of other messages (`tests::junk_alone_is_too_much_after_the_allowance`,
//! `tests::frames_pay_for_as_much_junk`), however short the packets are
//! (`tests::short_packets_count_as_long_as_they_are_in_the_recording`).

use nirspi_files::clock::Instant;
use nirspi_wire::{DeviceMessage, PacketError};
use std::time::Duration;

/// Bytes of junk that every run may have.
const ALLOWED: u64 = 64 << 20;
/// Bytes a second of intact messages other than frames: depth maps, replies, events. A depth map is
/// 150 bytes, 60 times a second.
const TRICKLE_PER_S: u64 = 64 << 10;

/// Bytes that a recording adds to each packet: the head of an MCAP message and its place in the index.
const RECORDED: u64 = 31 + 16;

/// Counts a run's frames and junk, in bytes of a recording.
#[derive(Debug)]
pub(super) struct Junk {
    began: Instant,
    frames: u64,
    /// Damaged packets, frames of other runs or of another setup, and frames that arrived twice.
    useless: u64,
    /// Intact messages other than frames.
    messages: u64,
    /// Useless packets and messages, in bytes of the link.
    came: u64,
    too_much: bool,
}

impl Junk {
    pub(super) fn new(began: Instant) -> Self {
        Self { began, frames: 0, useless: 0, messages: 0, came: 0, too_much: false }
    }

    /// Counts a packet of this many bytes at `now`. `new_frame` says whether the packet was a new
    /// frame of the run.
    pub(super) fn packet(
        &mut self,
        bytes: usize,
        content: &Result<DeviceMessage<'_>, PacketError>,
        new_frame: bool,
        now: Instant,
    ) {
        let count = match content {
            _ if new_frame => &mut self.frames,
            Err(_) | Ok(DeviceMessage::Frame(_)) => &mut self.useless,
            Ok(_) => &mut self.messages,
        };
        *count += bytes as u64 + RECORDED;
        self.came += if new_frame { 0 } else { bytes as u64 };
        let elapsed = now.saturating_duration_since(self.began) + Duration::from_secs(1);
        self.too_much |= self.excess(elapsed) > ALLOWED + self.frames;
    }

    fn excess(&self, elapsed: Duration) -> u64 {
        let trickle = TRICKLE_PER_S.saturating_mul(elapsed.as_secs());
        self.useless + self.messages.saturating_sub(trickle)
    }

    /// Whether the run must be stopped.
    pub(super) fn is_too_much(&self) -> bool {
        self.too_much
    }

    /// Number of bytes of junk that came over the link.
    pub(super) fn bytes(&self) -> u64 {
        self.came
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_wire::{Event, EventKind};

    const DAMAGED: Result<DeviceMessage<'_>, PacketError> = Err(PacketError::TooLong);

    #[test]
    fn junk_alone_is_too_much_after_the_allowance() {
        let now = Instant::now();
        let mut junk = Junk::new(now);
        for _ in 0..64 {
            junk.packet((1 << 20) - RECORDED as usize, &DAMAGED, false, now);
            assert!(!junk.is_too_much());
        }
        junk.packet(1, &DAMAGED, false, now);
        assert!(junk.is_too_much());
        assert_eq!(junk.bytes(), (64 << 20) - 64 * RECORDED + 1);
    }

    /// 67 MB of short damaged packets once became a recording of 698 MB.
    #[test]
    fn short_packets_count_as_long_as_they_are_in_the_recording() {
        let now = Instant::now();
        let mut junk = Junk::new(now);
        let mut packets = 0;
        while !junk.is_too_much() {
            junk.packet(5, &DAMAGED, false, now);
            packets += 1;
        }
        // By the specification of MCAP, a message is 1 + 8 bytes of opcode and length, 2 of the channel, 4 of the
        // number, 8 + 8 of the times and the packet, and its place in the index is 8 + 8 bytes.
        assert_eq!(packets, (64 << 20) / 52 + 1);
        assert_eq!(junk.bytes(), 5 * packets);
    }

    #[test]
    fn frames_pay_for_as_much_junk() {
        let now = Instant::now();
        let mut junk = Junk::new(now);
        for _ in 0..1000 {
            junk.packet(1 << 20, &DAMAGED, true, now);
            junk.packet(1 << 20, &DAMAGED, false, now);
        }
        assert!(!junk.is_too_much());
        junk.packet(65 << 20, &DAMAGED, false, now);
        assert!(junk.is_too_much());
    }

    #[test]
    fn depth_maps_and_replies_may_trickle_for_days_and_may_not_flood() {
        let began = Instant::now();
        let mut junk = Junk::new(began);
        let event = Event { device_time_us: 0, kind: EventKind::RawDropped };
        let message = Ok(DeviceMessage::Event(event));
        for hour in 0..100 {
            let now = began + Duration::from_secs(3600 * hour);
            junk.packet(3600 * 60 * 150, &message, false, now);
            assert!(!junk.is_too_much(), "{hour}");
        }
        let mut junk = Junk::new(began);
        (0..70).for_each(|_| junk.packet(1 << 20, &message, false, began));
        assert!(junk.is_too_much());
    }
}
