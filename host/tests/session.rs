//! Which answer belongs to which command, and what is left of a session that does not begin.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use nirspi::capture::{Calibration, CaptureOptions, capture};
use nirspi::link::{Link, Received};
use nirspi::recording::Target;
use nirspi::replay::ReplayLink;
use nirspi::session::{IgnorePackets, Session, SessionError, request};
use nirspi::setup::MeasurementSetup;
use nirspi_recon::Order;
use nirspi_wire::packet::MAX_DEVICE_PACKET;
use nirspi_wire::{
    Answer, Capabilities, Command, Configuration, DeviceMessage, Identity, Refusal, Reply, Request,
    RunLength, State, Status, Tail, Version, encode, open, version,
};
use std::io;
use std::ops::ControlFlow;
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
    capabilities: Tail(Some(Capabilities::DEPTH)),
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
        let mut room = [0; MAX_DEVICE_PACKET];
        let packet = encode(&reply, &mut room).map_err(io::Error::other)?;
        buffer[..packet.len()].copy_from_slice(packet);
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

/// A camera that does everything but start.
#[derive(Default)]
struct NeverStarts(Vec<u8>);

impl Link for NeverStarts {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        // The first byte of a session ends what another host has left.
        let mut packet = bytes.strip_suffix(&[0]).unwrap_or(bytes).to_vec();
        let Ok(Request { id, command }) = open(&mut packet) else { return Ok(()) };
        let state = State::Configured;
        let status = Status {
            state,
            fault: None,
            uptime_us: 0,
            run: 0,
            frames_made: 0,
            frames_sent: 0,
            frames_dropped: 0,
            fpga_frames_lost: 0,
            fpga_frames_corrupt: 0,
            commands_damaged: 0,
            temperature_centi_celsius: 2500,
            duty_permille: 500,
            leds_on: false,
            interlock_closed: true,
            signal: Tail(None),
        };
        let outcome = match command {
            Command::Hello { .. } => Ok(Answer::Hello(IDENTITY)),
            Command::Status => Ok(Answer::Status(status)),
            Command::Start(_) => Err(Refusal::State(state)),
            _ => Ok(Answer::Done),
        };
        let reply = DeviceMessage::Reply(Reply { id, outcome });
        self.0.extend(encode(&reply, &mut [0; MAX_DEVICE_PACKET]).map_err(io::Error::other)?);
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], _: Duration) -> io::Result<Received> {
        let waiting = std::mem::take(&mut self.0);
        buffer[..waiting.len()].copy_from_slice(&waiting);
        Ok(if waiting.is_empty() { Received::Nothing } else { Received::Bytes(waiting.len()) })
    }
}

/// An empty file would take the name of the capture that works the next time.
#[test]
fn a_run_that_the_camera_does_not_start_leaves_no_recording() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = Session::open(Box::new(NeverStarts::default())).unwrap();
    let options = CaptureOptions {
        setup: MeasurementSetup::new(&Order::Natural, 1.0).unwrap(),
        frames: Some(1),
        calibration: Calibration::None,
        record: Some(Target::New(folder.path().join("rec.mcap"))),
    };
    let captured = capture(&mut session, &options, &mut |_| ControlFlow::Continue(()));
    assert!(captured.is_err());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
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
