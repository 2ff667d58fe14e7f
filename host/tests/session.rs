//! Which answer belongs to which command, when a run is over, and what is left of a session that does not begin.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use super::made;
use nirspi::capture::{Calibration, Capture, CaptureError, CaptureOptions, Record, capture};
use nirspi::link::{Link, Received};
use nirspi::provenance::Made;
use nirspi::recording::Target;
use nirspi::replay::ReplayLink;
use nirspi::session::{IgnorePackets, Session, SessionError, request};
use nirspi::setup::MeasurementSetup;
use nirspi_recon::Order;
use nirspi_wire::{
    Answer, Capabilities, Command, Configuration, DeviceMessage, Identity, Refusal, Reply, Request,
    RunLength, State, Status, Version, open, version,
};
use std::io;
use std::ops::{ControlFlow, Range};
use std::sync::{Arc, Mutex};
use std::time::Duration;

const IDENTITY: Identity<'static> = Identity {
    protocol: version::CURRENT,
    firmware: Version(0, 1, 0),
    gateware: Version(0, 1, 0),
    board: "test",
    serial: "1",
    side: 32,
    adc_hz: 0,
    adc_bits: 14,
    wavelength_nm: 1550,
    capabilities: Capabilities::DEPTH,
};

/// Answers that arrive one at a time, whatever is asked.
struct OneAtATime(Vec<(u16, Answer<'static>)>);

impl Link for OneAtATime {
    fn send(&mut self, _: &[u8]) -> io::Result<()> {
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], _: Duration) -> io::Result<Received> {
        if self.0.is_empty() {
            return Ok(Received::Closed);
        }
        let (id, answer) = self.0.remove(0);
        let reply = DeviceMessage::Reply(Reply { id, outcome: Ok(answer) });
        let packet = made::packet(&reply);
        buffer[..packet.len()].copy_from_slice(&packet);
        Ok(Received::Bytes(packet.len()))
    }
}

/// During a run the program asks for the status without waiting for the answer, so the answer may come when
/// the program waits for that of its next command.
#[test]
fn the_late_answer_to_an_earlier_command_is_not_taken_for_that_of_this_one() {
    let answers = vec![
        (0, Answer::Hello(IDENTITY)),
        (0, Answer::Register(1)),
        (1, Answer::Register(7)),
        (1, Answer::Register(7)),
        (2, Answer::Done),
    ];
    let mut session = Session::open(Box::new(OneAtATime(answers))).unwrap();
    assert_eq!(session.command(request::ReadRegister(0), &mut IgnorePackets).unwrap(), 7);
    session.command(request::Stop, &mut IgnorePackets).unwrap();
}

/// The state of a camera after so many frames of a run.
fn status(state: State, run: u16, frames_made: u32) -> Answer<'static> {
    Answer::Status(Status {
        state,
        fault: None,
        uptime_us: 0,
        run,
        frames_made,
        frames_sent: frames_made,
        frames_dropped: 0,
        fpga_frames_lost: 0,
        fpga_frames_corrupt: 0,
        commands_damaged: 0,
        temperature_centi_celsius: 2500,
        duty_permille: 500,
        leds_on: state == State::Running,
        interlock_closed: true,
        signal: None,
    })
}

/// What a camera has sent and the host has not read.
#[derive(Default)]
struct Waiting(Vec<u8>);

impl Waiting {
    fn reply(&mut self, id: u16, outcome: Result<Answer<'_>, Refusal>) {
        self.0.extend(made::packet(&DeviceMessage::Reply(Reply { id, outcome })));
    }

    /// Frames of one pattern of run 1.
    fn frames(&mut self, sequences: Range<u32>) {
        for sequence in sequences {
            self.0.extend(made::frame(1, sequence, 100 * u64::from(sequence), vec![5]));
        }
    }

    fn ended(&mut self, frames_made: u32) {
        self.0.extend(made::ended(1, frames_made, 0));
    }
}

/// A camera that greets and takes a configuration, and does with the commands of a run what a test says.
struct Scripted<F> {
    waiting: Waiting,
    starts: bool,
    run: F,
}

impl<F: FnMut(u16, Command<'_>, &mut Waiting)> Scripted<F> {
    fn new(run: F) -> Self {
        Self { waiting: Waiting::default(), starts: false, run }
    }
}

impl<F: FnMut(u16, Command<'_>, &mut Waiting) + Send> Link for Scripted<F> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        // The first byte of a session ends what another host has left.
        let mut packet = bytes.strip_suffix(&[0]).unwrap_or(bytes).to_vec();
        let Ok(Request { id, command }) = open(&mut packet) else { return Ok(()) };
        self.starts |= matches!(command, Command::Start(_));
        match command {
            _ if self.starts => (self.run)(id, command, &mut self.waiting),
            Command::Hello { .. } => self.waiting.reply(id, Ok(Answer::Hello(IDENTITY))),
            Command::Status => self.waiting.reply(id, Ok(status(State::Configured, 0, 0))),
            _ => self.waiting.reply(id, Ok(Answer::Done)),
        }
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<Received> {
        let waiting = std::mem::take(&mut self.waiting.0);
        buffer[..waiting.len()].copy_from_slice(&waiting);
        if waiting.is_empty() {
            std::thread::sleep(timeout);
            return Ok(Received::Nothing);
        }
        Ok(Received::Bytes(waiting.len()))
    }
}

/// Captures so many frames of one pattern.
fn capture_of(
    camera: impl Link + 'static,
    frames: u32,
    record: Option<Target>,
) -> Result<Capture, CaptureError> {
    let mut session = Session::open(Box::new(camera)).unwrap();
    let options = CaptureOptions {
        setup: MeasurementSetup::new(&Order::Natural, 0.001).unwrap(),
        frames: Some(frames),
        calibration: Calibration::None,
        record: record
            .map(|target| Record { target, made: Made::by("a test", None, ["a test"], 0) }),
    };
    capture(&mut session, &options, &mut |_| ControlFlow::Continue(()))
}

/// An empty file would take the name of the capture that works the next time.
#[test]
fn a_run_that_the_camera_does_not_start_leaves_no_recording() {
    let folder = tempfile::tempdir().unwrap();
    let camera = Scripted::new(|id, _, host: &mut Waiting| {
        host.reply(id, Err(Refusal::State(State::Configured)));
    });
    let record = Target::New(folder.path().join("rec.mcap"));
    assert!(capture_of(camera, 1, Some(record)).is_err());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

/// Frames, and a report of how many there are, of which one number is not the number asked for.
#[test]
fn a_run_is_complete_if_the_frames_and_the_cameras_report_are_both_as_many_as_asked_for() {
    for (sent, reported, words) in [
        (5, 5, None),
        (6, 5, Some("the camera made 6 frames, 5 were asked for")),
        (5, 4, Some("the camera made 4 frames, 5 were asked for")),
        (5, 6, Some("1 lost")),
    ] {
        let camera = Scripted::new(move |id, command, host: &mut Waiting| match command {
            Command::Start(_) => {
                host.reply(id, Ok(Answer::Done));
                host.frames(0..sent);
                host.ended(reported);
            }
            _ => host.reply(id, Ok(status(State::Configured, 1, reported))),
        });
        let missing = capture_of(camera, 5, None).unwrap().missing();
        match words {
            None => assert_eq!(missing, None),
            Some(words) => {
                assert!(missing.as_ref().is_some_and(|m| m.contains(words)), "{missing:?}");
            }
        }
    }
}

#[test]
fn the_status_of_an_earlier_run_does_not_end_this_one() {
    let mut asked = 0;
    let camera = Scripted::new(move |id, command, host: &mut Waiting| match command {
        Command::Start(_) => {
            host.reply(id, Ok(Answer::Done));
            host.frames(0..3);
        }
        // The host asks each second in which it only listens.
        Command::Status if asked == 0 => {
            asked += 1;
            host.reply(id, Ok(status(State::Configured, 0, 99)));
        }
        _ => {
            if asked == 1 {
                asked += 1;
                host.frames(3..10);
                host.ended(10);
            }
            host.reply(id, Ok(status(State::Configured, 1, 10)));
        }
    });
    let captured = capture_of(camera, 10, None).unwrap();
    assert_eq!((captured.missing(), captured.counters.received), (None, 10));
}

/// A serial port stays open when the firmware restarts, and the firmware then asks for a greeting.
#[test]
fn a_camera_that_restarts_in_a_run_ends_it() {
    let camera = Scripted::new(|id, command, host: &mut Waiting| match command {
        Command::Start(_) => {
            host.reply(id, Ok(Answer::Done));
            host.frames(0..3);
        }
        _ => host.reply(id, Err(Refusal::Protocol { device: version::CURRENT })),
    });
    let captured = capture_of(camera, 10, None).unwrap();
    let missing = captured.missing().unwrap();
    assert!(missing.contains("the camera ended the session"), "{missing}");
    assert_eq!(captured.counters.received, 3);
}

/// A replay that outlives its host.
#[derive(Clone)]
struct Kept(Arc<Mutex<ReplayLink>>);

impl Link for Kept {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.lock().unwrap().send(bytes)
    }

    fn receive(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<Received> {
        self.0.lock().unwrap().receive(buffer, timeout)
    }
}

/// A camera ends the run of the host before at a greeting, and a replay is a camera.
#[test]
fn a_host_that_greets_in_the_middle_of_a_replay_can_start_it_again() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/recordings/v1.mcap");
    // So slow that the run goes on.
    let address = format!("{file},0.001").parse().unwrap();
    let link = Kept(Arc::new(Mutex::new(ReplayLink::open(&address).unwrap())));
    let setup = link.0.lock().unwrap().recorded().setup.clone();
    let start = |session: &mut Session| -> Result<(), SessionError> {
        let configure = |configuration: Configuration<'_>| {
            session.command(request::Configure(configuration), &mut IgnorePackets)
        };
        setup.with_configuration(configure)?;
        session.command(request::Start(RunLength::Continuous), &mut IgnorePackets)
    };
    for _ in 0..2 {
        let mut session = Session::open(Box::new(link.clone())).unwrap();
        start(&mut session).unwrap();
        assert_eq!(session.status(&mut IgnorePackets).unwrap().state, State::Running);
    }
}
