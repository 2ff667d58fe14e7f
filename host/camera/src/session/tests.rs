//! A camera with scripted answers.

use super::*;
use crate::link::Received;
use nirspi_wire::Identity;
use nirspi_wire::packet::MAX_DEVICE_PACKET;
use nirspi_wire::{
    Answer, Capabilities, CrashReport, Event, EventKind, Fault, Refusal, Reply, State, Version,
    encode,
};
use std::io;

/// Answers each request with the next of these chunks.
struct Scripted(Vec<Vec<u8>>);

impl Link for Scripted {
    fn send(&mut self, _: &[u8]) -> io::Result<()> {
        Ok(())
    }
    fn receive(&mut self, buffer: &mut [u8], _: Duration) -> io::Result<Received> {
        if self.0.is_empty() {
            return Ok(Received::Closed);
        }
        let chunk = self.0.remove(0);
        buffer[..chunk.len()].copy_from_slice(&chunk);
        Ok(Received::Bytes(chunk.len()))
    }
}

fn packet(message: DeviceMessage<'_>) -> Vec<u8> {
    let mut buffer = vec![0; MAX_DEVICE_PACKET + 1];
    encode(&message, &mut buffer).unwrap().to_vec()
}

fn event(kind: EventKind) -> Vec<u8> {
    packet(DeviceMessage::Event(Event { device_time_us: 0, kind }))
}

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

const STATUS: Status = Status {
    state: State::Idle,
    fault: None,
    uptime_us: 0,
    run: 0,
    frames_made: 0,
    frames_sent: 0,
    frames_dropped: 0,
    fpga_frames_lost: 0,
    fpga_frames_corrupt: 0,
    commands_damaged: 1,
    temperature_centi_celsius: 0,
    duty_permille: 0,
    leds_on: false,
    interlock_closed: true,
    signal: None,
};

fn reply(id: u16, answer: Answer<'_>) -> Vec<u8> {
    packet(DeviceMessage::Reply(Reply { id, outcome: Ok(answer) }))
}

/// A session with a camera that answers its commands with these chunks.
fn session(chunks: Vec<Vec<u8>>) -> Session {
    let greeting = vec![reply(0, Answer::Hello(IDENTITY))];
    Session::open(Box::new(Scripted([greeting, chunks].concat()))).unwrap()
}

#[test]
fn what_a_camera_reports_with_its_greeting_is_kept_and_an_earlier_hosts_mess_is_not() {
    let greeting = [
        event(EventKind::CommandDamaged),
        reply(0, Answer::Hello(IDENTITY)),
        event(EventKind::Fault(Fault::HostSilent)),
    ];
    let later = [event(EventKind::Fault(Fault::Duty)), reply(1, Answer::Status(STATUS))].concat();
    let link = Scripted(vec![greeting.concat(), later]);
    let mut session = Session::open(Box::new(link)).unwrap();
    assert_eq!(session.reports().lines.len(), 1, "{:?}", session.reports());
    let reports = &session.await_reports().unwrap().lines;
    assert!(
        reports[0].contains("no command") && reports[1].contains("lit over time"),
        "{reports:?}"
    );
}

#[test]
fn a_camera_that_never_stops_reporting_fills_no_memory() {
    let fault = event(EventKind::Fault(Fault::Duty));
    let greeting = [fault.repeat(5000), reply(0, Answer::Hello(IDENTITY))].concat();
    let mut chunks: Vec<Vec<u8>> = greeting.chunks(4096).map(<[u8]>::to_vec).collect();
    let crash = packet(DeviceMessage::Crash(CrashReport { uptime_us: 1, text: "main.rs:7" }));
    chunks.push([fault.repeat(1000), crash, reply(1, Answer::Status(STATUS))].concat());
    let mut session = Session::open(Box::new(Scripted(chunks))).unwrap();
    let Reports { lines, crash } = session.await_reports().unwrap();
    assert_eq!(lines.len(), Reports::MOST);
    assert!(lines.last().unwrap().contains("more"), "{lines:?}");
    assert!(crash.as_ref().is_some_and(|told| told.contains("main.rs:7")), "{crash:?}");
}

/// Counts the received packets, with a separate count of damaged ones.
#[derive(Default)]
struct Count {
    whole: usize,
    damaged: usize,
}

impl Listener for Count {
    fn packet(&mut self, _: &[u8], content: &Result<DeviceMessage<'_>, PacketError>) {
        match content {
            Ok(_) => self.whole += 1,
            Err(_) => self.damaged += 1,
        }
    }
}

#[test]
fn every_packet_is_heard_while_an_answer_is_awaited() {
    let chunk = [
        event(EventKind::RawDropped),
        vec![1, 2, 3, 0],
        reply(1, Answer::Done),
        event(EventKind::CommandDamaged),
    ];
    let mut heard = Count::default();
    session(vec![chunk.concat()]).command(request::Stop, &mut heard).unwrap();
    assert_eq!((heard.whole, heard.damaged), (3, 1));
}

#[test]
fn an_answer_counts_whatever_other_answers_come_with_it() {
    let chunk = [reply(0, Answer::Done), reply(1, Answer::Register(7)), reply(2, Answer::Done)];
    let mut session = session(vec![chunk.concat()]);
    assert_eq!(session.command(request::ReadRegister(0), &mut IgnorePackets).unwrap(), 7);
}

#[test]
fn an_answer_that_belongs_to_another_command_names_the_command_that_was_asked() {
    let mut session = session(vec![reply(1, Answer::Done)]);
    let error = session.status(&mut IgnorePackets).unwrap_err();
    assert!(matches!(error, SessionError::WrongAnswer { command: "Status" }), "{error}");
}

#[test]
fn a_camera_that_has_ended_the_session_is_not_taken_for_one_of_another_version() {
    let refused = |device| {
        let outcome = Err(Refusal::Protocol { device });
        let mut session = session(vec![packet(DeviceMessage::Reply(Reply { id: 1, outcome }))]);
        session.status(&mut IgnorePackets).unwrap_err()
    };
    let ended = refused(version::CURRENT);
    assert!(matches!(ended, SessionError::Ended { command: "Status" }), "{ended}");
    assert!(ended.to_string().contains(" 5 s; start again"), "{ended}");
    let foreign = refused(version::CURRENT + 1);
    assert!(matches!(foreign, SessionError::Version { .. }), "{foreign}");
}

#[test]
fn a_camera_that_no_longer_speaks_our_version_says_what_to_update() {
    let new = Identity { protocol: version::CURRENT + 1, ..IDENTITY };
    let answers = vec![reply(0, Answer::Hello(new))];
    let error = Session::open(Box::new(Scripted(answers))).err().unwrap().to_string();
    let newer = format!("protocol version {}", version::CURRENT + 1);
    assert!(error.contains(&newer) && error.contains("update this program"), "{error}");
}

#[test]
fn what_a_camera_can_do_is_named() {
    let capabilities = Capabilities(Capabilities::DEPTH.0 | 1 << 31);
    let identity = CameraIdentity::from(&Identity { capabilities, ..IDENTITY });
    assert_eq!(identity.capabilities, ["depth", "capability 31"]);
}

#[test]
fn a_message_of_a_later_version_is_passed_over() {
    // Event 0x7f of a device message, which every version has.
    let mut room = [0; 32];
    let later = encode(&[4u8, 0, 0x7F], &mut room).unwrap().to_vec();
    let chunk = [later, reply(1, Answer::Register(7))].concat();
    let mut session = session(vec![chunk]);
    let mut heard = Count::default();
    assert_eq!(session.command(request::ReadRegister(0), &mut heard).unwrap(), 7);
    assert_eq!((heard.whole, heard.damaged), (1, 1), "heard, as unknown");
}

#[test]
fn the_names_of_a_camera_cannot_steer_a_terminal() {
    let forged = Identity { serial: "\u{1b}[2J\nnirspi: all is well", ..IDENTITY };
    let greeting = reply(0, Answer::Hello(forged));
    let session = Session::open(Box::new(Scripted(vec![greeting]))).unwrap();
    assert_eq!(session.identity().serial, "\\u{1b}[2J\\nnirspi: all is well");
}
