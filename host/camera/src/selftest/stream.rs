//! Short runs in which every frame is compared, and runs in which frames are only counted.

use crate::session::{ANSWER_TIMEOUT, IgnorePackets, Listener, Session, SessionError, request};
use crate::setup::MeasurementSetup;
use crate::tally::FrameCount;
use nirspi_wire::{Configuration, DeviceMessage, EventKind, PacketError, RunLength, Status};
use std::time::{Duration, Instant};

/// Interval of the host's messages while it only listens.
const KEEP_ALIVE: Duration = Duration::from_secs(1);
/// The least frames of a run that only counts frames. A simulated camera on a busy computer may need
/// longer for them than the run should last.
const LEAST_FRAMES: u64 = 8;
/// The longest time to wait for these frames.
const LONGEST: Duration = Duration::from_secs(20);

/// A received frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Shot {
    /// The frame's number in the run.
    pub sequence: u32,
    /// Summed ADC counts, one a pattern shown.
    pub samples: Vec<i64>,
}

struct Collector {
    run: u16,
    shots: Vec<Shot>,
    ended: bool,
    last_packet: Instant,
}

impl Listener for Collector {
    fn packet(&mut self, _: &[u8], content: &Result<DeviceMessage<'_>, PacketError>) {
        self.last_packet = Instant::now();
        match content {
            Ok(DeviceMessage::Frame(frame)) if frame.run == self.run => {
                let samples = frame.samples.iter().collect();
                self.shots.push(Shot { sequence: frame.sequence, samples });
            }
            Ok(DeviceMessage::Event(event)) => {
                self.ended |=
                    matches!(event.kind, EventKind::RunEnded { run, .. } if run == self.run);
            }
            _ => {}
        }
    }
}

/// The received frames of a run of `count` frames; some may be missing.
pub fn shots(
    session: &mut Session,
    configuration: Configuration<'_>,
    count: u32,
) -> Result<Vec<Shot>, SessionError> {
    session.command(request::Configure(configuration), &mut IgnorePackets)?;
    let run = session.status(&mut IgnorePackets)?.run.wrapping_add(1);
    let mut collector =
        Collector { run, shots: Vec::new(), ended: false, last_packet: Instant::now() };
    session.command(request::Start(RunLength::Frames(count)), &mut collector)?;
    while !collector.ended && collector.shots.len() < count as usize {
        session.listen(Duration::from_millis(50), &mut collector)?;
        if collector.last_packet.elapsed() > ANSWER_TIMEOUT {
            break;
        }
    }
    // The run is stopped if its end was not received. A run that has ended refuses the stop, which
    // is harmless.
    if !collector.ended {
        match session.command(request::Stop, &mut collector) {
            Ok(()) | Err(SessionError::Refused { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(collector.shots)
}

/// The result of a run that only counts frames.
#[derive(Debug)]
pub struct Stream {
    /// The account of all frames.
    pub count: FrameCount,
    /// Bytes of all packets on the link.
    pub bytes: u64,
    /// Time from start to stop.
    pub elapsed: Duration,
    /// The camera's own status after the run.
    pub status: Status,
    /// The camera's times of the first frame and the newest one.
    device_us: Option<(u64, u64)>,
}

impl Stream {
    /// Frames that arrived in a second of the camera's clock; `None` if there are too few to say.
    pub fn frames_per_device_s(&self) -> Option<f64> {
        let (first, last) = self.device_us?;
        let frames = self.count.arrived().saturating_sub(1);
        let seconds = last.saturating_sub(first) as f64 * 1e-6;
        (frames > 0 && seconds > 0.0).then(|| frames as f64 / seconds)
    }
}

struct Counter {
    count: FrameCount,
    bytes: u64,
    last_packet: Instant,
    device_us: Option<(u64, u64)>,
}

impl Listener for Counter {
    fn packet(&mut self, raw: &[u8], content: &Result<DeviceMessage<'_>, PacketError>) {
        self.last_packet = Instant::now();
        self.bytes += raw.len() as u64;
        if self.count.packet(content) {
            let now = self.count.device_time_us();
            let (first, _) = self.device_us.unwrap_or((now, now));
            self.device_us = Some((first, now));
        }
    }
}

/// Runs the camera for `duration`, or longer until a few frames have arrived, and counts.
pub fn stream(
    session: &mut Session,
    setup: &MeasurementSetup,
    duration: Duration,
) -> Result<Stream, SessionError> {
    setup.with_configuration(|c| session.command(request::Configure(c), &mut IgnorePackets))?;
    let run = session.status(&mut IgnorePackets)?.run.wrapping_add(1);
    let started = Instant::now();
    let count = FrameCount::new(setup, Some(run));
    let mut counter = Counter { count, bytes: 0, last_packet: started, device_us: None };
    session.command(request::Start(RunLength::Continuous), &mut counter)?;
    let (mut kept_alive, mut kept_alive_us) = (started, 0);
    let has_enough = |count: &FrameCount| {
        let least = if count.arrived() < LEAST_FRAMES { LONGEST } else { duration };
        started.elapsed() >= least.max(duration)
    };
    while !has_enough(&counter.count) && !counter.count.has_ended() {
        session.listen(Duration::from_millis(20), &mut counter)?;
        // The time of a simulated camera may run faster than the host's, and the camera measures
        // the host's silence.
        let device_us = counter.count.device_time_us();
        let device_age = Duration::from_micros(device_us.saturating_sub(kept_alive_us));
        if kept_alive.elapsed() > KEEP_ALIVE || device_age > KEEP_ALIVE {
            (kept_alive, kept_alive_us) = (Instant::now(), device_us);
            session.keep_alive()?;
        }
    }
    let (elapsed, bytes) = (started.elapsed(), counter.bytes);
    match session.command(request::Stop, &mut counter) {
        // The run had ended by a fault.
        Ok(()) | Err(SessionError::Refused { .. }) => {}
        Err(error) => return Err(error),
    }
    while !counter.count.has_ended() && counter.last_packet.elapsed() < ANSWER_TIMEOUT {
        session.listen(Duration::from_millis(20), &mut counter)?;
    }
    let status = session.status(&mut counter)?;
    // The packet with the end of the run may be lost.
    if !counter.count.has_ended() {
        counter.count.end(status.frames_made);
    }
    let Counter { count, device_us, .. } = counter;
    Ok(Stream { count, bytes, elapsed, status, device_us })
}
