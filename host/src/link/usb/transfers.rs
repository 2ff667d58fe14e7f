//! Bulk transfers as a byte stream: several in flight, buffers used again and again.
//!
//! While the host looks elsewhere the controller goes on filling the queued transfers; only when all are full does the
//! device have to wait. The one law: bytes come out in the order in which the device sent them, each once, those of a
//! transfer that failed half-way too.

use crate::link::Received;
use std::collections::VecDeque;
use std::io;
use std::ops::Deref;
use std::time::{Duration, Instant};

/// Bytes of one IN transfer: 32 high-speed packets, 4 ms of a 4 MB/s stream.
pub const TRANSFER_BYTES: usize = 16 << 10;
/// IN transfers in flight: 64 ms of a 4 MB/s stream may wait for a host that is busy elsewhere.
pub const TRANSFERS: usize = 16;
/// A command that the device does not take within this, it does not take at all.
const SEND_TIMEOUT: Duration = Duration::from_secs(5);
/// Stalls in a row, with no byte between, after which an endpoint counts as broken.
const STALLS_MAX: u32 = 4;

/// How a transfer ended that did not end well.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TransferProblem {
    /// We gave it up.
    Cancelled,
    /// The endpoint has halted; clearing that lets it go on.
    Stalled,
    /// The device is not there any more.
    Gone,
    /// Anything else, in the system's words.
    Other(String),
}

/// A bulk endpoint, as far as moving bytes needs one. Transfers complete in the order in which they were submitted.
pub trait Endpoint: Send {
    /// Memory of a transfer. Reads as what was transferred.
    type Buffer: Deref<Target = [u8]> + Send;

    /// Queues a transfer. `Out` sends what the buffer holds, `In` fills it.
    fn submit(&mut self, buffer: Self::Buffer);

    /// Transfers queued or complete, and not fetched.
    fn pending(&self) -> usize;

    /// Fetches the next complete transfer, waiting for up to `timeout`. There is one pending.
    fn complete(
        &mut self,
        timeout: Duration,
    ) -> Option<(Self::Buffer, Result<(), TransferProblem>)>;

    /// Asks for all pending transfers to end now.
    fn cancel_all(&mut self);

    /// Ends a halt. No transfer is pending.
    ///
    /// # Errors
    /// When the device does not answer.
    fn clear_halt(&mut self) -> io::Result<()>;
}

/// What comes from the device.
pub struct InStream<E: Endpoint> {
    endpoint: E,
    /// Transfers that brought bytes, oldest first; of the first, `taken` bytes have been handed on.
    ready: VecDeque<E::Buffer>,
    taken: usize,
    stalls: u32,
    /// Why no more will come once `ready` is empty.
    end: Option<TransferProblem>,
}

impl<E: Endpoint> InStream<E> {
    /// Starts listening with these buffers, each a whole number of packets long.
    pub fn new(mut endpoint: E, buffers: impl IntoIterator<Item = E::Buffer>) -> Self {
        for buffer in buffers {
            endpoint.submit(buffer);
        }
        Self { endpoint, ready: VecDeque::new(), taken: 0, stalls: 0, end: None }
    }

    /// As [`Link::receive`](crate::link::Link::receive).
    ///
    /// # Errors
    /// When transfers fail other than by the device's going away.
    pub fn receive(&mut self, into: &mut [u8], timeout: Duration) -> io::Result<Received> {
        let deadline = Instant::now() + timeout;
        while self.ready.is_empty() {
            match &self.end {
                Some(TransferProblem::Other(reason)) => {
                    return Err(io::Error::other(reason.clone()));
                }
                Some(_) => return Ok(Received::Closed),
                None => {}
            }
            let left = deadline.saturating_duration_since(Instant::now());
            let Some((buffer, outcome)) = self.endpoint.complete(left) else {
                return Ok(Received::Nothing);
            };
            self.completed(buffer, outcome);
        }
        Ok(self.hand_on(into))
    }

    fn completed(&mut self, buffer: E::Buffer, outcome: Result<(), TransferProblem>) {
        let stalled = outcome == Err(TransferProblem::Stalled);
        if !stalled {
            self.end = self.end.take().or(outcome.err());
        }
        let mut empty = None;
        if buffer.is_empty() {
            empty = Some(buffer);
        } else {
            self.stalls = 0;
            self.ready.push_back(buffer);
        }
        if stalled {
            self.restart(empty.into_iter().collect());
        } else if self.end.is_none() {
            // The device had nothing more to say: a packet of no length ends a full one.
            empty.into_iter().for_each(|buffer| self.endpoint.submit(buffer));
        }
    }

    /// Gets a halted endpoint going again. What the transfers behind the halted one brought is kept.
    fn restart(&mut self, mut empty: Vec<E::Buffer>) {
        self.stalls += 1;
        self.endpoint.cancel_all();
        while self.endpoint.pending() > 0 {
            match self.endpoint.complete(SEND_TIMEOUT) {
                Some((buffer, _)) if buffer.is_empty() => empty.push(buffer),
                Some((buffer, _)) => self.ready.push_back(buffer),
                None => break,
            }
        }
        match self.endpoint.clear_halt() {
            _ if self.stalls >= STALLS_MAX => {
                self.end = Some(TransferProblem::Other("the endpoint keeps stalling".to_owned()));
            }
            Err(error) => self.end = Some(TransferProblem::Other(error.to_string())),
            Ok(()) => empty.into_iter().for_each(|buffer| self.endpoint.submit(buffer)),
        }
    }

    /// Copies from the oldest transfer; an emptied one goes back to the queue.
    fn hand_on(&mut self, into: &mut [u8]) -> Received {
        let Some(first) = self.ready.front() else { return Received::Nothing };
        let rest = first.get(self.taken..).unwrap_or(&[]);
        let length = rest.len().min(into.len());
        if let (Some(to), Some(from)) = (into.get_mut(..length), rest.get(..length)) {
            to.copy_from_slice(from);
        }
        self.taken += length;
        if self.taken == first.len() {
            self.taken = 0;
            let emptied = self.ready.pop_front();
            if self.end.is_none() {
                emptied.into_iter().for_each(|buffer| self.endpoint.submit(buffer));
            }
        }
        Received::Bytes(length)
    }
}

/// Sends one command and waits until the device has taken it.
///
/// # Errors
/// When it is not taken; [`io::ErrorKind::BrokenPipe`] when the device has gone.
pub fn send<E: Endpoint>(endpoint: &mut E, buffer: E::Buffer) -> io::Result<()> {
    endpoint.submit(buffer);
    let outcome = match endpoint.complete(SEND_TIMEOUT) {
        Some((_, outcome)) => outcome,
        None => {
            endpoint.cancel_all();
            while endpoint.pending() > 0 && endpoint.complete(SEND_TIMEOUT).is_some() {}
            Err(TransferProblem::Cancelled)
        }
    };
    match outcome {
        Ok(()) => Ok(()),
        Err(TransferProblem::Gone) => Err(io::ErrorKind::BrokenPipe.into()),
        Err(TransferProblem::Cancelled) => {
            Err(io::Error::new(io::ErrorKind::TimedOut, "the camera takes no command"))
        }
        Err(TransferProblem::Stalled) => {
            // The next command may find it well again.
            endpoint.clear_halt()?;
            Err(io::Error::other("the camera refused the transfer"))
        }
        Err(TransferProblem::Other(reason)) => Err(io::Error::other(reason)),
    }
}

#[cfg(test)]
mod tests;
