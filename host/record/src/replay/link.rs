//! A recording as a link to a camera.

use super::answers::{misfit, status};
use super::stream::{Playing, Turn};
use super::{ReplayAddress, Speed};
use crate::recording::{Recording, RecordingError};
use nirspi_camera::link::{Link, Received};
use nirspi_camera::session::Recorded;
use nirspi_files::identity::CameraIdentity;
use nirspi_wire::packet::{MAX_DEVICE_PACKET, MAX_HOST_PACKET};
use nirspi_wire::{
    Answer, Command, Deframed, Deframer, DeviceMessage, Refusal, Reply, Request, RunLength, State,
    Status, encode, open, version,
};
use std::collections::VecDeque;
use std::io::{self, Read};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Bytes that wait for the host at most, before the next packet is read.
const WAITING_BYTES: usize = 1 << 16;

/// A recording as a link: answers the host's requests, and sends the recorded packets in the
/// camera's time.
pub struct ReplayLink {
    path: PathBuf,
    speed: Speed,
    identity: CameraIdentity,
    recorded: Recorded,
    /// Number of the recorded run.
    run: u16,
    status: Status,
    incoming: Box<Deframer<MAX_HOST_PACKET>>,
    /// Bytes that the host has yet to read.
    waiting: VecDeque<u8>,
    playing: Option<Playing>,
    /// Whether the recording ended before its run did. The camera is gone then.
    is_gone: bool,
}

impl ReplayLink {
    /// Opens a recording.
    ///
    /// # Errors
    /// [`RecordingError`] if the file is not a recording.
    pub fn open(address: &ReplayAddress) -> Result<Self, RecordingError> {
        let mut recording = Recording::open(&address.path)?;
        let run = match recording.run {
            Some(run) => run,
            None => first_run(&mut recording)?,
        };
        let first_frame = recording.first_frame();
        let Recording { identity, setup, settling, .. } = recording;
        Ok(Self {
            path: address.path.clone(),
            speed: address.speed,
            identity,
            recorded: Recorded { setup, settling, first_frame },
            run,
            status: status(run.wrapping_sub(1)),
            incoming: Box::default(),
            waiting: VecDeque::new(),
            playing: None,
            is_gone: false,
        })
    }

    /// The recorded measurement.
    #[must_use]
    pub fn recorded(&self) -> &Recorded {
        &self.recorded
    }

    fn reply(&mut self, id: u16, outcome: Result<Answer<'_>, Refusal>) {
        append(&mut self.waiting, &DeviceMessage::Reply(Reply { id, outcome }));
    }

    fn answer(&mut self, request: &Request<'_>) -> io::Result<()> {
        let Request { id, command } = *request;
        let outcome = match command {
            Command::Hello { protocol } if version::speaks(protocol) => {
                (self.playing, self.is_gone) = (None, false);
                self.status = status(self.run.wrapping_sub(1));
                let identity = self.identity.clone();
                self.reply(id, Ok(Answer::Hello(super::answers::identity(&identity))));
                return Ok(());
            }
            Command::Hello { .. } => Err(Refusal::Protocol { device: self.identity.protocol }),
            Command::Status => Ok(Answer::Status(self.status)),
            _ if self.playing.is_some() && command != Command::Stop => {
                Err(Refusal::State(State::Running))
            }
            Command::Configure(asked) => match misfit(&asked, &self.recorded) {
                Some(problem) => Err(Refusal::Configuration(problem)),
                None => {
                    let number = self.run.wrapping_sub(1);
                    self.status = Status { state: State::Configured, ..status(number) };
                    Ok(Answer::Done)
                }
            },
            Command::Start(length) if self.status.state == State::Configured => {
                let asked = match length {
                    RunLength::Frames(frames) => Some(frames),
                    RunLength::Continuous => None,
                };
                let recording = Recording::open(&self.path).map_err(io::Error::other)?;
                self.playing = Some(Playing::new(recording, self.run, self.speed, asked));
                self.status = Status { state: State::Running, run: self.run, ..self.status };
                Ok(Answer::Done)
            }
            Command::Stop if self.playing.is_some() => {
                self.reply(id, Ok(Answer::Done));
                if let Some(playing) = self.playing.take() {
                    self.waiting.extend(playing.stopped());
                    self.rest(&playing);
                }
                return Ok(());
            }
            Command::Start(_) | Command::Stop => Err(Refusal::State(self.status.state)),
            _ => Err(Refusal::Unsupported),
        };
        self.reply(id, outcome);
        Ok(())
    }

    /// The camera after a run: as the recorded camera reported, or at rest.
    fn rest(&mut self, playing: &Playing) {
        let run = self.run;
        let at_rest = Status {
            state: State::Configured,
            run,
            frames_made: playing.made,
            frames_sent: playing.made,
            ..self.status
        };
        let reported = playing.reported.filter(|reported| {
            reported.run == run
                && reported.state != State::Running
                && reported.frames_made == playing.made
        });
        self.status = reported.unwrap_or(at_rest);
    }

    /// Takes packets that are due. Returns the time at which the next one is due.
    fn play(&mut self, now: Instant) -> io::Result<Option<Instant>> {
        let Some(mut playing) = self.playing.take() else { return Ok(None) };
        while self.waiting.len() < WAITING_BYTES || playing.has_ended {
            match playing.turn(now).map_err(io::Error::other)? {
                Turn::Send(bytes) => self.waiting.extend(bytes),
                Turn::Wait(due) => {
                    self.playing = Some(playing);
                    return Ok(Some(due));
                }
                Turn::Over => {
                    self.is_gone = !playing.has_ended;
                    self.rest(&playing);
                    return Ok(None);
                }
            }
        }
        self.playing = Some(playing);
        Ok(None)
    }
}

/// The number of the first frame's run, for a recording that does not say it.
fn first_run(recording: &mut Recording) -> Result<u16, RecordingError> {
    for packet in recording {
        let mut bytes = packet?.bytes;
        bytes.pop_if(|last| *last == 0);
        if let Ok(DeviceMessage::Frame(frame)) = open(&mut bytes) {
            return Ok(frame.run);
        }
    }
    Ok(0)
}

fn append(bytes: &mut VecDeque<u8>, message: &DeviceMessage<'_>) {
    let mut packet = vec![0; MAX_DEVICE_PACKET + 1];
    // A reply is shorter than the longest packet.
    if let Ok(packet) = encode(message, &mut packet) {
        bytes.extend(packet.iter());
    }
}

impl Link for ReplayLink {
    fn send(&mut self, mut bytes: &[u8]) -> io::Result<()> {
        let mut incoming = std::mem::take(&mut self.incoming);
        let mut done = Ok(());
        while let Some(found) = incoming.next(&mut bytes) {
            if let (Deframed::Packet(packet), Ok(())) = (found, &done)
                && let Ok(request) = open::<Request<'_>>(packet)
            {
                done = self.answer(&request);
            }
        }
        self.incoming = incoming;
        done
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<Received> {
        let until = Instant::now() + timeout;
        loop {
            let now = Instant::now();
            let due = self.play(now)?;
            if !self.waiting.is_empty() {
                return self.waiting.read(buffer).map(Received::Bytes);
            }
            if self.is_gone {
                return Ok(Received::Closed);
            }
            if now >= until {
                return Ok(Received::Nothing);
            }
            std::thread::sleep(due.map_or(until, |due| due.min(until)) - now);
        }
    }
}
