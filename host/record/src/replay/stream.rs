//! The packets of a recording as the replayed camera sends them, each with the time at which it is
//! due.

use super::Speed;
use crate::recording::{Packet, Recording, RecordingError};
use nirspi_wire::packet::MAX_DEVICE_PACKET;
use nirspi_wire::{Answer, DeviceMessage, Event, EventKind, Reply, Status, encode, open};
use std::time::{Duration, Instant};

/// A run that is being played.
pub(super) struct Playing {
    packets: Recording,
    run: u16,
    speed: Speed,
    /// Frames that the host asked for.
    asked: Option<u32>,
    /// The camera's time of the first packet that has one, and the time at which the packet was
    /// sent.
    began: Option<(u64, Instant)>,
    /// The camera's time of the newest packet that was sent.
    newest_us: u64,
    /// The packet that is due next, with the camera's time if the packet has one.
    next: Option<Next>,
    /// Number of the recording's first frame in the run.
    first: u64,
    /// Frames of the run that were sent, by their numbers. A recording in the middle of a run counts
    /// the frames before its first one.
    pub(super) made: u32,
    /// The status that the recorded camera reported last.
    pub(super) reported: Option<Status>,
    /// Whether the end of the run was sent.
    pub(super) has_ended: bool,
    /// Whether the run ends before the recorded one, so that nothing follows.
    is_short: bool,
}

struct Next {
    bytes: Vec<u8>,
    device_time_us: Option<u64>,
    /// Frames of the run that are made with this packet.
    made: u32,
    ends: bool,
}

/// What the stream has now.
pub(super) enum Turn {
    /// These bytes.
    Send(Vec<u8>),
    /// Nothing until then.
    Wait(Instant),
    /// No more packets.
    Over,
}

impl Playing {
    pub(super) fn new(packets: Recording, run: u16, speed: Speed, asked: Option<u32>) -> Self {
        let first = packets.first_frame();
        Self {
            packets,
            first,
            run,
            speed,
            asked,
            began: None,
            newest_us: 0,
            next: None,
            made: first as u32,
            reported: None,
            has_ended: false,
            is_short: false,
        }
    }

    /// The next packet, if it is due at `now`.
    pub(super) fn turn(&mut self, now: Instant) -> Result<Turn, RecordingError> {
        let next = match self.next.take() {
            Some(next) => next,
            None => match self.read()? {
                Some(next) => next,
                None => return Ok(Turn::Over),
            },
        };
        let due = self.due(&next, now);
        if due > now {
            self.next = Some(next);
            return Ok(Turn::Wait(due));
        }
        self.has_ended |= next.ends;
        self.made = next.made;
        self.newest_us = next.device_time_us.unwrap_or(self.newest_us);
        Ok(Turn::Send(next.bytes))
    }

    fn due(&mut self, next: &Next, now: Instant) -> Instant {
        let (Speed::Times(times), Some(time), false) =
            (self.speed, next.device_time_us, self.has_ended)
        else {
            return now;
        };
        let (first, began) = *self.began.get_or_insert((time, now));
        let age_s = time.saturating_sub(first) as f64 * 1e-6 / times;
        // Hundred years are as good as for ever.
        began + Duration::from_secs_f64(age_s.min(3e9))
    }

    /// Reads the next packet that the camera sends by itself.
    fn read(&mut self) -> Result<Option<Next>, RecordingError> {
        let mut scratch = Vec::new();
        let mut made = self.made;
        while !self.is_short
            && let Some(packet) = self.packets.next().transpose()?
        {
            scratch.clear();
            scratch.extend_from_slice(packet.bytes.strip_suffix(&[0]).unwrap_or(&packet.bytes));
            let (device_time_us, ends) = match open::<DeviceMessage<'_>>(&mut scratch) {
                Ok(DeviceMessage::Reply(Reply { outcome, .. })) => {
                    if let Ok(Answer::Status(status)) = outcome {
                        self.reported = Some(status);
                    }
                    continue;
                }
                Ok(DeviceMessage::Frame(frame)) => {
                    if frame.run == self.run {
                        if self.has_enough_before(frame.sequence) {
                            return Ok(self.end(frame.device_time_us));
                        }
                        made = made.max(frame.sequence.saturating_add(1));
                    }
                    (Some(frame.device_time_us), false)
                }
                Ok(DeviceMessage::Depth(depth)) => (Some(depth.device_time_us), false),
                Ok(DeviceMessage::Event(Event { device_time_us, kind })) => {
                    let ends = match kind {
                        EventKind::RunEnded { run, frames_made, .. } if run == self.run => {
                            if self.has_enough_before(frames_made.saturating_sub(1)) {
                                return Ok(self.end(device_time_us));
                            }
                            made = frames_made;
                            true
                        }
                        _ => false,
                    };
                    (Some(device_time_us), ends)
                }
                _ => (None, false),
            };
            return Ok(Some(Next { bytes: as_sent(packet), device_time_us, made, ends }));
        }
        let account = self.packets.end().account.as_ref();
        let goes_on = account.is_some_and(|account| account.continues.is_some());
        // The recorded run goes on in another file, and the replayed one ends with this file.
        if goes_on && !self.is_short && !self.has_ended {
            return Ok(self.end_after(self.made, self.newest_us));
        }
        Ok(None)
    }

    /// Whether the run has all frames that were asked for before the frame of this number.
    fn has_enough_before(&self, sequence: u32) -> bool {
        let ahead = sequence.wrapping_sub(self.first as u32);
        // A frame from before the recording's first one is a straggler.
        let is_before = self.first > 0 && ahead > u32::MAX / 2;
        !is_before && self.asked.is_some_and(|asked| ahead >= asked)
    }

    /// The end of a run that is shorter than the recorded one.
    fn end(&mut self, device_time_us: u64) -> Option<Next> {
        let made = self.asked.map_or(self.made, |asked| asked.wrapping_add(self.first as u32));
        self.end_after(made, device_time_us)
    }

    fn end_after(&mut self, made: u32, device_time_us: u64) -> Option<Next> {
        self.is_short = true;
        let bytes = run_ended(self.run, made, device_time_us);
        Some(Next { bytes, device_time_us: Some(device_time_us), made, ends: true })
    }

    /// The end of a run that the host has stopped.
    pub(super) fn stopped(&self) -> Vec<u8> {
        let time = self.next.as_ref().and_then(|next| next.device_time_us);
        let first = self.began.map_or(0, |(first, _)| first);
        run_ended(self.run, self.made, time.unwrap_or(first))
    }
}

fn run_ended(run: u16, frames_made: u32, device_time_us: u64) -> Vec<u8> {
    let kind = EventKind::RunEnded {
        run,
        frames_made,
        frames_dropped: 0,
        fpga_frames_lost: 0,
        fpga_frames_corrupt: 0,
    };
    let mut packet = vec![0; MAX_DEVICE_PACKET + 1];
    let message = DeviceMessage::Event(Event { device_time_us, kind });
    encode(&message, &mut packet).map(<[u8]>::to_vec).unwrap_or_default()
}

/// The bytes on the link that give this packet again. A recorder keeps only the delimiter of a
/// packet that was too long.
fn as_sent(packet: Packet) -> Vec<u8> {
    if packet.bytes.len() > 1 {
        return packet.bytes;
    }
    let mut bytes = vec![1; MAX_DEVICE_PACKET + 1];
    bytes.push(0);
    bytes
}
