//! Loads a bitstream into a camera's FPGA, through the firmware.
//!
//! # Invariant
//! A piece is sent only when the camera has asked for this piece. A lost reply costs one more piece
//! and never a wrong bitstream (`tests::a_lost_piece_is_sent_again`). A camera that has the first
//! pieces of this bitstream, from a session that was cut, gets the rest alone
//! (`tests::a_load_that_was_cut_goes_on_where_it_stopped`).

use nirspi::session::{IgnorePackets, Session, SessionError};
use nirspi_mcu::staging;
use nirspi_wire::message::GATEWARE_CHUNK_MAX;
use nirspi_wire::register::{IDENTITY, Register};
use nirspi_wire::{GatewareChunk, Refusal, crc32};
use std::time::{Duration, Instant};
use thiserror::Error;

/// How many times in a row the camera may ask for another piece than the next, or not answer.
const SETBACKS: u32 = 3;
/// The longest time from the last piece to a running FPGA. Configuration takes half a second, and
/// the start as long again.
const START_TIME: Duration = Duration::from_secs(5);

/// Why a bitstream does not run.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum GatewareError {
    /// The file is not one that `ecppack` or Lattice's tools write.
    #[error("no bitstream for an ECP5: it begins with neither a comment nor the preamble")]
    NotABitstream,
    /// The file is longer than the protocol allows.
    #[error("{0} bytes are too many for a bitstream")]
    TooLong(usize),
    /// Too many packets were lost.
    #[error("the camera has lost its place at byte {expected} of {total}, {SETBACKS} times")]
    OutOfStep {
        /// The offset of the requested piece.
        expected: u32,
        /// Length of the bitstream.
        total: u32,
    },
    /// The bitstream was loaded, but the FPGA does not answer with nirspi's identity.
    #[error(
        "the bitstream was taken, but the FPGA does not run it: its identity register reads {0:#010X}"
    )]
    Silent(u32),
    /// The session ended, or the camera refused.
    #[error(transparent)]
    Session(#[from] SessionError),
}

/// Sends a bitstream piece by piece and waits until the FPGA answers. Returns its version register.
/// `progress` receives the number of bytes that the camera has. The LEDs stay off meanwhile, and
/// the camera keeps the old gateware until the new one is complete.
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
    // A camera that asks for the same pieces repeatedly makes no progress.
    let mut offset = first_missing(session, total, crc)?;
    progress(offset);
    let (mut furthest, mut setbacks) = (offset, 0);
    while offset < total {
        let rest = bitstream.get(offset as usize..).unwrap_or(&[]);
        let data = rest.get(..GATEWARE_CHUNK_MAX).unwrap_or(rest);
        let piece = GatewareChunk { offset, total, crc, data };
        let next = match session.load_gateware(piece, &mut IgnorePackets) {
            Ok(next) => next,
            // The reply to the piece before, or the piece itself, was lost.
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

/// The offset of the first byte of this bitstream that the camera does not have: 0, or more after a
/// session that was cut. An empty piece at the end cannot be the next one, so the camera answers with
/// the piece that it waits for.
fn first_missing(session: &mut Session, total: u32, crc: u32) -> Result<u32, GatewareError> {
    let question = GatewareChunk { offset: total, total, crc, data: &[] };
    match session.load_gateware(question, &mut IgnorePackets) {
        Err(SessionError::Refused { refusal: Refusal::GatewareOffset { expected }, .. })
            if expected < total =>
        {
            Ok(expected)
        }
        Ok(_) | Err(SessionError::NoAnswer { .. } | SessionError::Refused { .. }) => Ok(0),
        Err(error) => Err(error.into()),
    }
}

/// Waits until the FPGA identifies itself.
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
pub(crate) mod tests {
    use super::*;
    use nirspi::link::{Link, Received};
    use nirspi_mcu::{GatewareLoader, LoadError, Micros};
    use nirspi_optics::Scene;
    use nirspi_virtual::{MemoryLink, OpticalFpga, SimulatedFpga, VirtualCamera, VirtualOptics};
    use std::io;
    use std::sync::{Arc, Mutex};

    /// The bitstream that a camera was given to load.
    #[derive(Debug, Default)]
    pub(crate) struct Loaded {
        pub bytes: Vec<u8>,
        is_finished: bool,
    }

    /// Keeps the bitstream, and is busy for a while after the last piece.
    pub(crate) struct Keeper {
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

    pub(crate) fn camera() -> (MemoryLink<OpticalFpga, Keeper>, Arc<Mutex<Loaded>>) {
        let loaded = Arc::new(Mutex::new(Loaded::default()));
        let keeper = Keeper { loaded: loaded.clone(), busy: 0 };
        let (fpga, depth) = (optics().fpga(1).unwrap(), optics().depth(1).unwrap());
        (MemoryLink::new(VirtualCamera::with_loader(fpga, keeper, depth, "loaded")), loaded)
    }

    pub(crate) fn bitstream() -> Vec<u8> {
        let body = (0..5_000_u32).map(|i| ((i * i) >> 3) as u8);
        [0xFF, 0x00].into_iter().chain(body).chain([0xFF; 40]).collect()
    }

    /// Loses one of the host's packets to the camera.
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
        assert_eq!(heard, [0, 2048, 4096, 5042]);
    }

    /// A link that a camera outlives, and that breaks after some packets of the host.
    struct Cable<L> {
        camera: Arc<Mutex<L>>,
        packets_left: u32,
    }

    impl<F: SimulatedFpga, G: GatewareLoader + Send> Link for Cable<MemoryLink<F, G>> {
        fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
            let mut camera = self.camera.lock().unwrap();
            let Some(left) = self.packets_left.checked_sub(1) else {
                camera.unplug();
                return Err(io::ErrorKind::BrokenPipe.into());
            };
            self.packets_left = left;
            camera.send(bytes)
        }

        fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<Received> {
            self.camera.lock().unwrap().receive(buffer, timeout)
        }
    }

    #[test]
    fn a_load_that_was_cut_goes_on_where_it_stopped() {
        let (link, loaded) = camera();
        let link = Arc::new(Mutex::new(link));
        let session = |packets_left| {
            Session::open(Box::new(Cable { camera: link.clone(), packets_left })).unwrap()
        };
        // A delimiter, the greeting, the question where to begin, and two of three pieces.
        let error = load(&mut session(5), &bitstream(), &mut |_| {}).unwrap_err();
        assert!(matches!(error, GatewareError::Session(_)), "{error}");
        assert!(!loaded.lock().unwrap().is_finished);
        let mut heard = Vec::new();
        let version = load(&mut session(99), &bitstream(), &mut |bytes| heard.push(bytes)).unwrap();
        assert_eq!((version, &heard[..]), (Register::Version.reset(), &[4096, 5042][..]));
        let loaded = loaded.lock().unwrap();
        assert!(loaded.is_finished && loaded.bytes == bitstream());
    }

    #[test]
    fn a_lost_piece_is_sent_again() {
        let (link, loaded) = camera();
        // The packets before are a delimiter, the greeting, the question where to begin, and the first piece.
        let mut session = Session::open(Box::new(Lossy { link, sent: 0, lost: 5 })).unwrap();
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
