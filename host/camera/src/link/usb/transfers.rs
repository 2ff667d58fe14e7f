//! Bulk transfers as a byte stream: several transfers in flight, with recycled buffers.
//!
//! The controller fills the queued transfers while the host is busy. The device waits only when all
//! transfers are full.
//!
//! # Invariant
//! Bytes come out once and in the order in which the device sent them
//! (`tests::bytes_come_in_order_whatever_the_sizes_of_transfers_and_pieces`), including the bytes
//! of a transfer that failed half-way
//! (`tests::a_device_that_goes_in_the_middle_of_a_transfer_leaves_what_it_sent_then_closed`).

use crate::link::Received;
use std::collections::VecDeque;
use std::io;
use std::ops::Deref;
use std::time::{Duration, Instant};

/// Bytes of one IN transfer: 32 high-speed packets. A camera whose USB core reads packets by DMA ends a transfer with
/// each packet of the wire protocol, of at most 4 KB of samples.
pub const TRANSFER_BYTES: usize = 16 << 10;
/// Number of IN transfers in flight. While the host is busy they hold 64 frames of such a camera, 8 ms of 8000 frames a
/// second; of another camera 1 MB.
pub const TRANSFERS: usize = 64;
/// The longest time in which a device must take a command.
const SEND_TIMEOUT: Duration = Duration::from_secs(5);
/// An endpoint counts as broken after this many stalls in a row without a byte.
const STALLS_MAX: u32 = 4;

/// Why a transfer failed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TransferProblem {
    /// The host cancelled the transfer.
    Cancelled,
    /// The endpoint has halted. Clearing the halt lets it continue.
    Stalled,
    /// The device is gone.
    Gone,
    /// Another reason, in the system's words.
    Other(String),
}

/// A bulk endpoint, reduced to moving bytes. Transfers complete in the order in which they were
/// submitted.
pub trait Endpoint: Send {
    /// The memory of a transfer. Dereferences to the transferred bytes.
    type Buffer: Deref<Target = [u8]> + Send;

    /// Queues a transfer. An `Out` transfer sends the buffer's bytes, an `In` transfer fills the
    /// buffer.
    fn submit(&mut self, buffer: Self::Buffer);

    /// Number of transfers that are queued, or complete but not fetched.
    fn pending(&self) -> usize;

    /// Fetches the next complete transfer, waiting for up to `timeout`. At least one transfer must
    /// be pending.
    fn complete(
        &mut self,
        timeout: Duration,
    ) -> Option<(Self::Buffer, Result<(), TransferProblem>)>;

    /// Asks all pending transfers to end now.
    fn cancel_all(&mut self);

    /// Clears a halt. No transfer may be pending.
    ///
    /// # Errors
    /// If the device does not answer.
    fn clear_halt(&mut self) -> io::Result<()>;
}

/// The stream of bytes from the device.
pub struct InStream<E: Endpoint> {
    endpoint: E,
    /// Transfers with bytes, oldest first. `taken` bytes of the first transfer have been read.
    ready: VecDeque<E::Buffer>,
    taken: usize,
    stalls: u32,
    /// Why no more bytes arrive once `ready` is empty.
    end: Option<TransferProblem>,
}

impl<E: Endpoint> InStream<E> {
    /// Submits these buffers, each a whole number of packets long.
    pub fn new(mut endpoint: E, buffers: impl IntoIterator<Item = E::Buffer>) -> Self {
        for buffer in buffers {
            endpoint.submit(buffer);
        }
        Self { endpoint, ready: VecDeque::new(), taken: 0, stalls: 0, end: None }
    }

    /// As [`Link::receive`](crate::link::Link::receive).
    ///
    /// # Errors
    /// If transfers fail in another way than by disconnection of the device.
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
            // A packet of length 0 after a full packet marks the end of the device's data.
            empty.into_iter().for_each(|buffer| self.endpoint.submit(buffer));
        }
    }

    /// Restarts a halted endpoint. The bytes of the transfers behind the halted one are kept.
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

    /// Copies from the oldest transfer. An empty transfer is queued again.
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

/// Sends one command and waits until the device has taken the command.
///
/// # Errors
/// If the device does not take the command; [`io::ErrorKind::BrokenPipe`] if the device is gone.
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
            // The endpoint must work again for the next command.
            endpoint.clear_halt()?;
            Err(io::Error::other("the camera refused the transfer"))
        }
        Err(TransferProblem::Other(reason)) => Err(io::Error::other(reason)),
    }
}

#[cfg(test)]
mod tests;
