//! Packets as a camera makes them, and those of a recording.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use nirspi::recording::Recording;
use nirspi_wire::packet::MAX_DEVICE_PACKET;
use nirspi_wire::samples::{Samples, Width};
use nirspi_wire::{DeviceMessage, Event, EventKind, Frame, FrameFlags, encode, open};
use std::path::Path;

pub fn packet(message: &DeviceMessage<'_>) -> Vec<u8> {
    encode(message, &mut vec![0; MAX_DEVICE_PACKET + 1]).unwrap().to_vec()
}

/// The frame of one sweep with these differences.
pub fn frame(run: u16, sequence: u32, device_time_us: u64, values: Vec<i64>) -> Vec<u8> {
    let mut buffer = vec![0; 4 * values.len()];
    let samples = Samples::pack(values.into_iter(), Width::Bits32, &mut buffer).unwrap();
    let (sweeps, flags) = (1, FrameFlags::DIFFERENTIAL);
    packet(&DeviceMessage::Frame(Frame { run, sequence, device_time_us, sweeps, flags, samples }))
}

/// A camera's word that a run is over, and that it has sent each frame.
pub fn ended(run: u16, frames_made: u32, device_time_us: u64) -> Vec<u8> {
    let (frames_dropped, fpga_frames_lost, fpga_frames_corrupt) = (0, 0, 0);
    let kind = EventKind::RunEnded {
        run,
        frames_made,
        frames_dropped,
        fpga_frames_lost,
        fpga_frames_corrupt,
    };
    packet(&DeviceMessage::Event(Event { device_time_us, kind }))
}

/// The packets of a recording that are not replies, with their times.
pub fn packets(path: &Path) -> Vec<(Vec<u8>, u64)> {
    let all = Recording::open(path).unwrap().map(|packet| packet.unwrap());
    let is_reply = |bytes: &[u8]| {
        let mut bytes = bytes.to_vec();
        bytes.pop();
        matches!(open(&mut bytes), Ok(DeviceMessage::Reply(_)))
    };
    all.filter(|packet| !is_reply(&packet.bytes)).map(|p| (p.bytes, p.time_ns)).collect()
}

/// The same without their times.
pub fn bytes(path: &Path) -> Vec<Vec<u8>> {
    packets(path).into_iter().map(|(bytes, _)| bytes).collect()
}
