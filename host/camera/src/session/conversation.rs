//! Splits a link's bytes into packets, and matches answers with requests.
//!
//! A conversation does not know the camera yet. [`Session::open`](super::Session::open) greets the
//! camera and makes a session of the conversation.

use super::request::{Hello, Request};
use super::{ANSWER_TIMEOUT, Listener, SessionError};
use crate::link::{Link, Received};
use nirspi_files::clock::Instant;
use nirspi_wire::packet::{
    MAX_DEVICE_PACKET, MAX_HOST_PACKET, hello_of_any_version, parse, unseal,
};
use nirspi_wire::{
    Answer, Command, Deframed, Deframer, DeviceMessage, PacketError, Refusal, Reply, encode,
    version,
};
use std::time::Duration;

/// The longest wait for bytes between two checks of the time while an answer is awaited.
const LOOK: Duration = Duration::from_millis(100);

/// Receives each reply: the number of the request, and its result.
type Answered<'f> = dyn FnMut(u16, Result<&Answer<'_>, Refusal>) + 'f;

/// A link with numbered requests, whose received bytes are split into packets.
pub(super) struct Conversation {
    link: Box<dyn Link>,
    incoming: Incoming,
    next_id: u16,
    /// Time spent in waiting for the link.
    waited: Duration,
}

impl Conversation {
    /// Begins a conversation. A delimiter ends what an earlier host may have left half sent.
    pub(super) fn begin(mut link: Box<dyn Link>) -> Result<Self, SessionError> {
        link.send(&[0])?;
        let (incoming, waited) = (Incoming::new(), Duration::ZERO);
        Ok(Self { link, incoming, next_id: 0, waited })
    }

    /// Time that the link has been waited for.
    pub(super) fn waited(&self) -> Duration {
        self.waited
    }

    /// Sends a command without waiting for its answer. Returns the number that the answer will
    /// repeat.
    pub(super) fn send(&mut self, command: Command<'_>) -> Result<u16, SessionError> {
        let id = self.next_id;
        self.next_id = id.wrapping_add(1);
        let mut packet = vec![0; MAX_HOST_PACKET];
        let packet = encode(&nirspi_wire::Request { id, command }, &mut packet)
            .map_err(|error| std::io::Error::new(std::io::ErrorKind::InvalidInput, error))?;
        match self.link.send(packet) {
            Ok(()) => Ok(id),
            Err(error) if crate::link::is_hangup(&error) => Err(self.closed()),
            Err(error) => Err(error.into()),
        }
    }

    fn closed(&self) -> SessionError {
        SessionError::Closed { mid_packet: self.incoming.deframer.pending() > 0 }
    }

    /// Listens for up to `timeout`, or until a packet has arrived. Every packet goes to `listener`,
    /// and every reply also to `answered`.
    pub(super) fn pump(
        &mut self,
        timeout: Duration,
        listener: &mut dyn Listener,
        answered: &mut Answered<'_>,
    ) -> Result<(), SessionError> {
        let asked = Instant::now();
        let received = self.link.receive(&mut self.incoming.chunk, timeout)?;
        let arrived = Instant::now();
        self.waited += arrived.saturating_duration_since(asked);
        match received {
            Received::Bytes(length) => {
                listener.arrived(arrived);
                self.incoming.take(length, listener, answered);
            }
            Received::Nothing => {}
            Received::Closed => return Err(self.closed()),
        }
        Ok(())
    }

    /// Sends a request and waits for its reply.
    pub(super) fn ask<R: Request>(
        &mut self,
        request: &R,
        listener: &mut dyn Listener,
    ) -> Result<R::Reply, SessionError> {
        let command = R::NAME;
        let id = self.send(request.command())?;
        let deadline = Instant::now() + ANSWER_TIMEOUT;
        let mut outcome = None;
        while let Some(left) = deadline.checked_duration_since(Instant::now()) {
            self.pump(left.min(LOOK), listener, &mut |answered, answer| {
                if answered == id {
                    outcome = Some(answer.map(R::reply));
                }
            })?;
            match outcome {
                None => {}
                Some(Ok(Some(reply))) => return Ok(reply),
                Some(Ok(None)) => return Err(SessionError::WrongAnswer { command }),
                Some(Err(Refusal::Protocol { device }))
                    if command != Hello::NAME && version::speaks(device) =>
                {
                    return Err(SessionError::Ended { command });
                }
                Some(Err(Refusal::Protocol { device })) => {
                    return Err(SessionError::Version { camera: device });
                }
                Some(Err(refusal)) => return Err(SessionError::Refused { command, refusal }),
            }
        }
        Err(SessionError::NoAnswer { command })
    }
}

/// Received bytes that are not split into packets yet.
struct Incoming {
    deframer: Box<Deframer<MAX_DEVICE_PACKET>>,
    chunk: Vec<u8>,
    raw: Vec<u8>,
}

impl Incoming {
    fn new() -> Self {
        Self {
            deframer: Box::default(),
            chunk: vec![0; 1 << 18],
            raw: Vec::with_capacity(MAX_DEVICE_PACKET + 1),
        }
    }

    /// Splits `chunk[..length]` into packets.
    fn take(&mut self, length: usize, listener: &mut dyn Listener, answered: &mut Answered<'_>) {
        let mut bytes = self.chunk.get(..length).unwrap_or(&[]);
        while let Some(found) = self.deframer.next(&mut bytes) {
            self.raw.clear();
            let payload = match found {
                Deframed::TooLong => Err(PacketError::TooLong),
                Deframed::Packet(packet) => {
                    self.raw.extend_from_slice(packet);
                    unseal(packet)
                }
            };
            self.raw.push(0);
            let content = payload.and_then(parse::<DeviceMessage<'_>>);
            listener.packet(&self.raw, &content);
            match (&content, payload) {
                (Ok(DeviceMessage::Reply(Reply { id, outcome })), _) => {
                    answered(*id, outcome.as_ref().map_err(|&refusal| refusal));
                }
                // The packet may be the greeting of a version whose identity cannot be read.
                (Err(_), Ok(payload)) => {
                    if let Some((id, device)) = hello_of_any_version(payload) {
                        answered(id, Err(Refusal::Protocol { device }));
                    }
                }
                _ => {}
            }
        }
    }
}
