//! Published packets as a link to a camera.

use super::{Announcement, Subscribe};
use crate::link::{Link, Received};
use crate::replay::Recorded;
use crate::replay::answers::{identity, misfit, status};
use crate::session::CameraIdentity;
use nirspi_wire::packet::{MAX_DEVICE_PACKET, MAX_HOST_PACKET};
use nirspi_wire::{
    Answer, Channel, Command, Deframed, Deframer, DeviceMessage, Event, EventKind, Frame, Refusal,
    Reply, Request, RunLength, State, Status, encode, open, version,
};
use std::collections::VecDeque;
use std::io::{self, Read};
use std::time::{Duration, Instant};

/// The longest time without any packet. The program at the camera publishes a status each second.
const SILENCE: Duration = Duration::from_secs(30);
/// Bytes that are collected before the host gets them.
const WAITING_BYTES: usize = 1 << 16;
/// The most packets that are taken before the host gets something.
const AT_ONCE: usize = 1024;

/// The published run that the host listens to.
#[derive(Debug, Clone, Copy)]
struct Joined {
    /// The run's number at the camera.
    run: u16,
    /// The number of the first frame that came.
    base: u32,
}

/// A camera that another program runs.
pub struct RelayLink {
    source: Box<dyn Subscribe>,
    identity: CameraIdentity,
    recorded: Recorded,
    incoming: Box<Deframer<MAX_HOST_PACKET>>,
    /// Bytes that the host has yet to read.
    waiting: VecDeque<u8>,
    /// Number of the host's own run.
    run: u16,
    running: bool,
    asked: Option<u32>,
    joined: Option<Joined>,
    made: u32,
    configured: bool,
    /// The newest status that was published.
    status: Option<Status>,
    heard: Instant,
}

impl RelayLink {
    /// A link to the camera of this announcement, whose packets come from `source`.
    #[must_use]
    pub fn new(announced: Announcement, source: Box<dyn Subscribe>) -> Self {
        let Announcement { identity, setup, settling } = announced;
        Self {
            source,
            identity,
            recorded: Recorded { setup, settling },
            incoming: Box::default(),
            waiting: VecDeque::new(),
            run: 0,
            running: false,
            asked: None,
            joined: None,
            made: 0,
            configured: false,
            status: None,
            heard: Instant::now(),
        }
    }

    /// The measurement that goes on at the camera.
    #[must_use]
    pub fn recorded(&self) -> &Recorded {
        &self.recorded
    }

    fn send_on(&mut self, message: &DeviceMessage<'_>) {
        let mut packet = vec![0; MAX_DEVICE_PACKET + 1];
        // Every message of a camera has room.
        if let Ok(packet) = encode(message, &mut packet) {
            self.waiting.extend(packet.iter());
        }
    }

    fn reply(&mut self, id: u16, outcome: Result<Answer<'_>, Refusal>) {
        self.send_on(&DeviceMessage::Reply(Reply { id, outcome }));
    }

    /// The status of the camera, with the run of this host.
    fn own_status(&self) -> Status {
        let state = match (self.running, self.configured) {
            (true, _) => State::Running,
            (false, true) => State::Configured,
            (false, false) => State::Idle,
        };
        let (run, made) = (self.run, self.made);
        let known = self.status.unwrap_or_else(|| status(run));
        Status { state, run, frames_made: made, frames_sent: made, fault: None, ..known }
    }

    fn answer(&mut self, request: &Request<'_>) {
        let Request { id, command } = *request;
        let outcome = match command {
            Command::Hello { protocol } if version::speaks(protocol) => {
                (self.running, self.configured, self.joined) = (false, false, None);
                let camera = self.identity.clone();
                self.reply(id, Ok(Answer::Hello(identity(&camera))));
                return;
            }
            Command::Hello { .. } => Err(Refusal::Protocol { device: self.identity.protocol }),
            Command::Status => Ok(Answer::Status(self.own_status())),
            _ if self.running && command != Command::Stop => Err(Refusal::State(State::Running)),
            Command::Configure(asked) => match misfit(&asked, &self.recorded) {
                Some(problem) => Err(Refusal::Configuration(problem)),
                None => {
                    self.configured = true;
                    Ok(Answer::Done)
                }
            },
            Command::Start(length) if self.configured => {
                self.asked = match length {
                    RunLength::Frames(frames) => Some(frames),
                    RunLength::Continuous => None,
                };
                self.run = self.run.wrapping_add(1);
                (self.running, self.joined, self.made) = (true, None, 0);
                self.heard = Instant::now();
                Ok(Answer::Done)
            }
            Command::Stop if self.running => {
                self.reply(id, Ok(Answer::Done));
                self.end(0);
                return;
            }
            Command::Start(_) | Command::Stop => Err(Refusal::State(self.own_status().state)),
            _ => Err(Refusal::Unsupported),
        };
        self.reply(id, outcome);
    }

    /// Ends the host's run.
    fn end(&mut self, device_time_us: u64) {
        let kind = EventKind::RunEnded {
            run: self.run,
            frames_made: self.made,
            frames_dropped: 0,
            fpga_frames_lost: 0,
            fpga_frames_corrupt: 0,
        };
        self.send_on(&DeviceMessage::Event(Event { device_time_us, kind }));
        (self.running, self.joined) = (false, None);
    }

    /// Takes a published packet.
    fn take(&mut self, mut raw: Vec<u8>) {
        self.heard = Instant::now();
        if raw.len() > MAX_DEVICE_PACKET + 1 {
            return;
        }
        raw.pop_if(|last| *last == 0);
        let Ok(message) = open::<DeviceMessage<'_>>(&mut raw) else { return };
        if let DeviceMessage::Reply(Reply { outcome: Ok(Answer::Status(status)), .. }) = message {
            self.status = Some(status);
        }
        if !self.running {
            return;
        }
        match message {
            DeviceMessage::Frame(frame) => self.frame(frame),
            DeviceMessage::Channel(channel) => self.channel(channel),
            DeviceMessage::Event(Event {
                device_time_us,
                kind: EventKind::RunEnded { run, frames_made, .. },
            }) => {
                // The end of an earlier run comes before the first frame of the one to join.
                if let Some(joined) = self.joined.filter(|joined| joined.run == run) {
                    let made = frames_made.wrapping_sub(joined.base);
                    self.made = self.asked.map_or(made, |asked| asked.min(made));
                    self.end(device_time_us);
                }
            }
            DeviceMessage::Reply(_) => {}
            other => self.send_on(&other),
        }
    }

    fn frame(&mut self, frame: Frame<'_>) {
        let first = Joined { run: frame.run, base: frame.sequence };
        let joined = *self.joined.get_or_insert(first);
        let sequence = frame.sequence.wrapping_sub(joined.base);
        if joined.run != frame.run {
            // The program at the camera has begun another run.
            self.end(frame.device_time_us);
            return;
        }
        // A frame from before the start, which came late.
        if sequence > u32::MAX / 2 && self.made < u32::MAX / 4 {
            return;
        }
        if let Some(asked) = self.asked.filter(|&asked| sequence >= asked) {
            // The last frames of the host's run were lost.
            self.made = asked;
            self.end(frame.device_time_us);
            return;
        }
        self.made = self.made.max(sequence.wrapping_add(1));
        self.send_on(&DeviceMessage::Frame(Frame { run: self.run, sequence, ..frame }));
        // Further detectors speak after the first one.
        if self.asked == Some(self.made) && self.identity.detectors <= 1 {
            self.end(frame.device_time_us);
        }
    }

    /// Sends the frame of a further detector on, if the frame of detector 0 was sent on.
    fn channel(&mut self, Channel { detector, frame }: Channel<'_>) {
        let Some(joined) = self.joined.filter(|joined| joined.run == frame.run) else { return };
        let sequence = frame.sequence.wrapping_sub(joined.base);
        if sequence >= self.made {
            return;
        }
        let frame = Frame { run: self.run, sequence, ..frame };
        self.send_on(&DeviceMessage::Channel(Channel { detector, frame }));
        let is_last = detector >= self.identity.detectors.saturating_sub(1);
        if is_last && self.asked == Some(sequence + 1) {
            self.end(frame.device_time_us);
        }
    }
}

impl Link for RelayLink {
    fn send(&mut self, mut bytes: &[u8]) -> io::Result<()> {
        let mut incoming = std::mem::take(&mut self.incoming);
        while let Some(found) = incoming.next(&mut bytes) {
            if let Deframed::Packet(packet) = found
                && let Ok(request) = open::<Request<'_>>(packet)
            {
                self.answer(&request);
            }
        }
        self.incoming = incoming;
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<Received> {
        let until = Instant::now() + timeout;
        loop {
            // Without waiting, if the host has something to read already.
            for _ in 0..AT_ONCE {
                let has_some = !self.waiting.is_empty();
                let left = until.saturating_duration_since(Instant::now());
                match self.source.packet(if has_some { Duration::ZERO } else { left }) {
                    Ok(Some(raw)) => self.take(raw),
                    Ok(None) => break,
                    Err(_) if has_some => break,
                    Err(_) => return Ok(Received::Closed),
                }
                if self.waiting.len() > WAITING_BYTES || (left.is_zero() && !has_some) {
                    break;
                }
            }
            if !self.waiting.is_empty() {
                return self.waiting.read(buffer).map(Received::Bytes);
            }
            if self.running && self.heard.elapsed() > SILENCE {
                return Ok(Received::Closed);
            }
            if Instant::now() >= until {
                return Ok(Received::Nothing);
            }
        }
    }
}
