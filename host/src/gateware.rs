//! A bitstream on its way into a camera's FPGA, through the firmware.
//!
//! The one law: a piece is sent when the camera has said that it wants it next, so a reply lost on the way costs one more
//! piece and never a wrong bitstream.

use crate::session::{IgnorePackets, Session, SessionError};
use nirspi_mcu::staging;
use nirspi_wire::message::GATEWARE_CHUNK_MAX;
use nirspi_wire::register::{IDENTITY, Register};
use nirspi_wire::{GatewareChunk, Refusal, crc32};
use std::time::{Duration, Instant};
use thiserror::Error;

/// Times in a row that the camera may ask for another piece than the next one, or for none.
const SETBACKS: u32 = 3;
/// An FPGA runs its bitstream this soon after the last piece: half a second of configuration, and as much again.
const START_TIME: Duration = Duration::from_secs(5);

/// Why a bitstream did not get to run.
#[derive(Debug, Error)]
pub enum GatewareError {
    /// Not what `ecppack` or Lattice's tools write.
    #[error("no bitstream for an ECP5: it begins with neither a comment nor the preamble")]
    NotABitstream,
    /// Longer than the protocol can say.
    #[error("{0} bytes are too many for a bitstream")]
    TooLong(usize),
    /// Too much was lost on the way.
    #[error("the camera has lost its place at byte {expected} of {total}, {SETBACKS} times")]
    OutOfStep {
        /// The piece it asked for.
        expected: u32,
        /// Length of the bitstream.
        total: u32,
    },
    /// It was taken, and no FPGA of ours answers.
    #[error(
        "the bitstream was taken, but the FPGA does not run it: its identity register reads {0:#010X}"
    )]
    Silent(u32),
    /// The conversation ended, or the camera refused.
    #[error(transparent)]
    Session(#[from] SessionError),
}

/// Sends a bitstream piece by piece and waits until the FPGA answers; returns its version register. `progress` hears
/// how many bytes the camera has. The camera lights nothing meanwhile, and keeps the old gateware until the new one is
/// there whole.
///
/// # Errors
/// [`GatewareError`].
pub fn load(
    session: &mut Session,
    bitstream: &[u8],
    progress: &mut dyn FnMut(u32),
) -> Result<u32, GatewareError> {
    if staging::stored(bitstream).is_none() {
        return Err(GatewareError::NotABitstream);
    }
    let total =
        u32::try_from(bitstream.len()).map_err(|_| GatewareError::TooLong(bitstream.len()))?;
    let crc = crc32(bitstream);
    // A camera that goes back and forth over the same pieces makes no progress.
    let (mut offset, mut furthest, mut setbacks) = (0, 0, 0);
    while offset < total {
        let rest = bitstream.get(offset as usize..).unwrap_or(&[]);
        let data = rest.get(..GATEWARE_CHUNK_MAX).unwrap_or(rest);
        let piece = GatewareChunk { offset, total, crc, data };
        let next = match session.load_gateware(piece, &mut IgnorePackets) {
            Ok(next) => next,
            // Its reply to the piece before was lost, or the piece itself.
            Err(SessionError::NoAnswer { .. }) => offset,
            Err(SessionError::Refused {
                refusal: Refusal::GatewareOffset { expected }, ..
            }) => expected,
            Err(error) => return Err(error.into()),
        };
        if next > furthest {
            (furthest, setbacks) = (next, 0);
        } else if next <= offset {
            setbacks += 1;
        }
        if setbacks > SETBACKS || next > total {
            return Err(GatewareError::OutOfStep { expected: next, total });
        }
        offset = next;
        progress(offset);
    }
    await_start(session)
}

/// Until the FPGA says who it is.
fn await_start(session: &mut Session) -> Result<u32, GatewareError> {
    let begun = Instant::now();
    loop {
        let identity = match session.register(Register::Identity, &mut IgnorePackets) {
            Ok(IDENTITY) => return Ok(session.register(Register::Version, &mut IgnorePackets)?),
            Ok(other) => other,
            Err(
                SessionError::NoAnswer { .. }
                | SessionError::Refused { refusal: Refusal::Bus | Refusal::Fault(_), .. },
            ) => 0,
            Err(error) => return Err(error.into()),
        };
        if begun.elapsed() > START_TIME {
            return Err(GatewareError::Silent(identity));
        }
        session.listen(Duration::from_millis(50), &mut IgnorePackets)?;
    }
}

#[cfg(test)]
#[cfg(feature = "virtual-camera")]
mod tests {
    use super::*;
    use crate::link::{Link, Received};
    use crate::virtual_camera::{MemoryLink, VirtualCamera, VirtualOptics};
    use nirspi_mcu::{GatewareLoader, LoadError, Micros};
    use nirspi_optics::Scene;
    use std::io;
    use std::sync::{Arc, Mutex};

    /// What a camera was given to load.
    #[derive(Debug, Default)]
    struct Loaded {
        bytes: Vec<u8>,
        is_finished: bool,
    }

    /// Keeps what it is given, and is busy for a while once it has all.
    struct Keeper {
        loaded: Arc<Mutex<Loaded>>,
        busy: u32,
    }

    impl GatewareLoader for Keeper {
        fn begin(&mut self, _: u32) -> Result<(), LoadError> {
            *self.loaded.lock().unwrap() = Loaded::default();
            Ok(())
        }

        fn write(&mut self, data: &[u8]) -> Result<(), LoadError> {
            self.loaded.lock().unwrap().bytes.extend_from_slice(data);
            Ok(())
        }

        fn finish(&mut self) -> Result<(), LoadError> {
            self.loaded.lock().unwrap().is_finished = true;
            self.busy = 100;
            Ok(())
        }

        fn step(&mut self, _: Micros) -> bool {
            self.busy = self.busy.saturating_sub(1);
            self.busy > 0
        }
    }

    fn optics() -> VirtualOptics {
        let sheet = Scene::new(vec![0.9; 32 * 32], 32, 60.0).unwrap();
        VirtualOptics::new(sheet, 300.0).unwrap()
    }

    fn camera() -> (impl Link, Arc<Mutex<Loaded>>) {
        let loaded = Arc::new(Mutex::new(Loaded::default()));
        let keeper = Keeper { loaded: loaded.clone(), busy: 0 };
        let (fpga, depth) = (optics().fpga(1).unwrap(), optics().depth(1).unwrap());
        (MemoryLink::new(VirtualCamera::with_loader(fpga, keeper, depth, "loaded")), loaded)
    }

    fn bitstream() -> Vec<u8> {
        let body = (0..5_000_u32).map(|i| ((i * i) >> 3) as u8);
        [0xFF, 0x00].into_iter().chain(body).chain([0xFF; 40]).collect()
    }

    /// Loses one of the things that go from host to camera.
    struct Lossy<L> {
        link: L,
        sent: u32,
        lost: u32,
    }

    impl<L: Link> Link for Lossy<L> {
        fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
            self.sent += 1;
            if self.sent == self.lost { Ok(()) } else { self.link.send(bytes) }
        }

        fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<Received> {
            self.link.receive(buffer, timeout)
        }
    }

    #[test]
    fn a_bitstream_arrives_whole_and_the_fpga_says_its_version() {
        let (link, loaded) = camera();
        let mut session = Session::open(Box::new(link)).unwrap();
        let mut heard = Vec::new();
        let version = load(&mut session, &bitstream(), &mut |bytes| heard.push(bytes)).unwrap();
        assert_eq!(version, Register::Version.reset());
        let loaded = loaded.lock().unwrap();
        assert!(loaded.is_finished && loaded.bytes == bitstream());
        assert_eq!(heard, [2048, 4096, 5042]);
    }

    #[test]
    fn a_lost_piece_is_sent_again() {
        let (link, loaded) = camera();
        // After a delimiter, the greeting and the first piece.
        let mut session = Session::open(Box::new(Lossy { link, sent: 0, lost: 4 })).unwrap();
        load(&mut session, &bitstream(), &mut |_| {}).unwrap();
        assert!(loaded.lock().unwrap().bytes == bitstream());
    }

    #[test]
    fn what_is_no_bitstream_never_leaves_the_host() {
        let (link, loaded) = camera();
        let mut session = Session::open(Box::new(link)).unwrap();
        let error = load(&mut session, b"\x7fELF and so on", &mut |_| {}).unwrap_err();
        assert!(matches!(error, GatewareError::NotABitstream));
        assert!(loaded.lock().unwrap().bytes.is_empty());
    }

    #[test]
    fn a_board_that_loads_none_says_so() {
        let link = MemoryLink::new(optics().camera(1).unwrap());
        let mut session = Session::open(Box::new(link)).unwrap();
        let error = load(&mut session, &bitstream(), &mut |_| {}).unwrap_err();
        assert!(error.to_string().contains("this board cannot"), "{error}");
    }
}
