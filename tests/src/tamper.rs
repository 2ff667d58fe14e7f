//! A link that damages the packets passing through it.

use nirspi::link::{Link, Received};
use std::io;
use std::time::Duration;

/// What happens to a packet on its way to the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// It arrives.
    Pass,
    /// It is lost.
    Drop,
    /// One bit of the byte at this share of its length (in 256ths) flips.
    Flip(u8),
    /// The byte at this share of its length (in 256ths) is lost.
    Lose(u8),
    /// It arrives after the next packet that is at least half as long.
    Delay,
    /// It arrives twice.
    Repeat,
    /// It arrives after so many looks that find nothing.
    Hold(u32),
    /// The link ends in the middle of the packet.
    Unplug,
    /// The link ends before the packet.
    Close,
}

/// Chooses the fate of a packet from its number and length.
pub type Judge = Box<dyn FnMut(usize, usize) -> Fate + Send>;

/// A link that applies a [`Fate`] to each packet.
pub struct Tampered {
    inner: Box<dyn Link>,
    judge: Judge,
    count: usize,
    partial: Vec<u8>,
    delayed: Vec<u8>,
    ready: Vec<u8>,
    unplugged: bool,
    /// Looks that find nothing.
    held: u32,
}

impl Tampered {
    /// Puts `judge` between host and camera.
    pub fn new(
        inner: Box<dyn Link>,
        judge: impl FnMut(usize, usize) -> Fate + Send + 'static,
    ) -> Self {
        Self {
            inner,
            judge: Box::new(judge),
            count: 0,
            partial: Vec::new(),
            delayed: Vec::new(),
            ready: Vec::new(),
            unplugged: false,
            held: 0,
        }
    }

    fn pass(&mut self, mut packet: Vec<u8>) {
        let fate = (self.judge)(self.count, packet.len());
        self.count += 1;
        match fate {
            Fate::Drop => return,
            Fate::Delay => return self.delayed.append(&mut packet),
            Fate::Pass => {}
            Fate::Repeat => self.ready.extend_from_slice(&packet),
            Fate::Hold(looks) => self.held += looks,
            Fate::Close => {
                self.unplugged = true;
                return;
            }
            Fate::Flip(share) => {
                let at = usize::from(share) * (packet.len() - 1) / 256;
                // A delimiter is never hit: that would damage two packets, and has a test of its
                // own.
                packet[at] ^= if packet[at] == 1 { 2 } else { 1 };
            }
            Fate::Lose(share) => {
                packet.remove(usize::from(share) * (packet.len() - 1) / 256);
            }
            Fate::Unplug => {
                packet.truncate(packet.len() / 2);
                self.unplugged = true;
            }
        }
        let overtakes = 2 * packet.len() >= self.delayed.len();
        self.ready.append(&mut packet);
        if overtakes {
            self.ready.append(&mut self.delayed);
        }
    }
}

impl Link for Tampered {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.inner.send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<Received> {
        if self.held > 0 {
            self.held -= 1;
            return Ok(Received::Nothing);
        }
        if self.ready.is_empty() && !self.unplugged {
            let mut chunk = vec![0; 1 << 16];
            match self.inner.receive(&mut chunk, timeout)? {
                Received::Bytes(length) => {
                    for &byte in &chunk[..length] {
                        self.partial.push(byte);
                        if byte == 0 && !self.unplugged {
                            let packet = std::mem::take(&mut self.partial);
                            self.pass(packet);
                        }
                    }
                }
                other => return Ok(other),
            }
        }
        if self.ready.is_empty() {
            return Ok(if self.unplugged { Received::Closed } else { Received::Nothing });
        }
        let length = self.ready.len().min(buffer.len());
        buffer[..length].copy_from_slice(&self.ready[..length]);
        self.ready.drain(..length);
        Ok(Received::Bytes(length))
    }
}

/// A judge for frames of 1024 patterns, by their number; all other packets pass.
pub fn only_frames(
    mut judge: impl FnMut(usize) -> Fate + Send + 'static,
) -> impl FnMut(usize, usize) -> Fate + Send {
    let mut frame = 0;
    move |_, length| {
        // No other packet of the device is nearly as long.
        if length < 3000 {
            return Fate::Pass;
        }
        frame += 1;
        judge(frame - 1)
    }
}
