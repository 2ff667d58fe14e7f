//! A camera's line that keeps every byte the camera sends, and the frames in those bytes.
#![expect(clippy::unwrap_used, reason = "a failed unwrap here fails the test that uses it")]

use nirspi::capture::{Calibration, Capture, CaptureOptions, capture};
use nirspi::link::{Link, Received};
use nirspi::session::Session;
use nirspi::setup::MeasurementSetup;
use nirspi_wire::packet::MAX_DEVICE_PACKET;
use nirspi_wire::{Deframed, Deframer, DeviceMessage, Frame, FrameFlags, open};
use std::io;
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// A frame without its time, so that cameras with different clocks give equal shots.
#[derive(Debug, Clone, PartialEq)]
pub struct Shot {
    /// Number of the run.
    pub run: u16,
    /// Number of the frame in its run.
    pub sequence: u32,
    /// Sweeps summed in the frame.
    pub sweeps: u32,
    /// The FPGA's flags of the frame.
    pub flags: FrameFlags,
    /// One sample for each pattern.
    pub samples: Vec<i64>,
}

/// A camera's line and every byte that the camera has sent over it.
pub struct Tapped {
    line: Option<Box<dyn Link>>,
    came: Arc<Mutex<Vec<u8>>>,
}

impl Tapped {
    /// A tap on `line`.
    #[must_use]
    pub fn new(line: Box<dyn Link>) -> Self {
        Self { line: Some(line), came: Arc::default() }
    }

    /// The line, for the one session that uses it.
    ///
    /// # Panics
    /// On the second call.
    pub fn link(&mut self) -> Box<dyn Link> {
        Box::new(Tap { line: self.line.take().unwrap(), came: Arc::clone(&self.came) })
    }

    /// What `of` finds in the messages that arrived whole.
    fn find<T>(&self, of: impl Fn(&DeviceMessage<'_>) -> Option<T>) -> Vec<T> {
        let came = self.came.lock().unwrap();
        let mut deframer: Box<Deframer<MAX_DEVICE_PACKET>> = Box::default();
        let (mut rest, mut all) = (&came[..], Vec::new());
        while let Some(found) = deframer.next(&mut rest) {
            if let Deframed::Packet(packet) = found
                && let Ok(message) = open::<DeviceMessage<'_>>(packet)
            {
                all.extend(of(&message));
            }
        }
        all
    }

    /// Every frame that arrived whole, in the order of arrival.
    ///
    /// # Panics
    /// If a thread that used the line has panicked.
    #[must_use]
    pub fn shots(&self) -> Vec<Shot> {
        self.find(|message| {
            let DeviceMessage::Frame(frame) = message else { return None };
            let &Frame { run, sequence, sweeps, flags, ref samples, .. } = frame;
            Some(Shot { run, sequence, sweeps, flags, samples: samples.iter().collect() })
        })
    }

    /// The text of every crash report.
    ///
    /// # Panics
    /// If a thread that used the line has panicked.
    #[must_use]
    pub fn crashes(&self) -> Vec<String> {
        self.find(|message| {
            let DeviceMessage::Crash(report) = message else { return None };
            Some(report.text.to_owned())
        })
    }
}

struct Tap {
    line: Box<dyn Link>,
    came: Arc<Mutex<Vec<u8>>>,
}

impl Link for Tap {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.line.send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<Received> {
        let received = self.line.receive(buffer, timeout)?;
        if let Received::Bytes(length) = received {
            self.came.lock().unwrap().extend_from_slice(&buffer[..length]);
        }
        Ok(received)
    }
}

/// Measures so many frames, without calibration.
///
/// # Panics
/// If the capture fails.
#[must_use]
pub fn measure(session: &mut Session, setup: &MeasurementSetup, frames: u32) -> Capture {
    let setup = setup.clone();
    let options = CaptureOptions {
        setup,
        frames: Some(frames),
        calibration: Calibration::None,
        record: None,
    };
    capture(session, &options, &mut |_| ControlFlow::Continue(())).unwrap()
}

/// As [`measure`], in a session of its own on `line`; also returns the frames that arrived.
///
/// # Panics
/// If the camera does not answer or the capture fails.
#[must_use]
pub fn run(line: Box<dyn Link>, setup: &MeasurementSetup, frames: u32) -> (Capture, Vec<Shot>) {
    let mut tapped = Tapped::new(line);
    let mut session = Session::open(tapped.link()).unwrap();
    let captured = measure(&mut session, setup, frames);
    (captured, tapped.shots())
}
