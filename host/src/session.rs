//! A conversation with a camera: greeting, commands and their answers, the stream in between.
//!
//! The one law: nothing of the stream is skipped while waiting for an answer; every packet goes to the
//! listener as it came, damaged ones too.

mod error;

pub use error::SessionError;

use crate::events;
use crate::link::{Link, Received};
use nirspi_wire::packet::{MAX_DEVICE_PACKET, MAX_HOST_PACKET, hello_of_any_version};
use nirspi_wire::register::Register;
use nirspi_wire::{
    Answer, Command, Deframed, Deframer, DeviceMessage, GatewareChunk, Identity, PROTOCOL_VERSION,
    PacketError, Refusal, Reply, Request, SelfTestReport, Status, Version, encode, open,
};
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};

/// A camera answers a command within this, or something is wrong.
pub(crate) const ANSWER_TIMEOUT: Duration = Duration::from_secs(5);

/// The first command of a conversation.
const HELLO: &str = "Hello";
const LOAD_GATEWARE: &str = "LoadGateware";

/// Who a camera is: the wire's [`Identity`], owned.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct CameraIdentity {
    /// Protocol version it speaks.
    pub protocol: u16,
    /// Firmware version.
    pub firmware: String,
    /// Gateware version.
    pub gateware: String,
    /// Board name.
    pub board: String,
    /// Serial number.
    pub serial: String,
    /// Rate of the ADC.
    pub adc_hz: u32,
    /// Resolution of the ADC.
    pub adc_bits: u8,
    /// Wavelength of the LEDs.
    pub wavelength_nm: u16,
}

impl From<&Identity<'_>> for CameraIdentity {
    fn from(identity: &Identity<'_>) -> Self {
        Self {
            protocol: identity.protocol,
            firmware: identity.firmware.to_string(),
            gateware: identity.gateware.to_string(),
            board: identity.board.to_owned(),
            serial: identity.serial.to_owned(),
            adc_hz: identity.adc_hz,
            adc_bits: identity.adc_bits,
            wavelength_nm: identity.wavelength_nm,
        }
    }
}

/// Hears every packet of a session.
pub trait Listener {
    /// A packet came. `raw` is as it stood on the wire, delimiter included.
    fn packet(&mut self, raw: &[u8], content: &Result<DeviceMessage<'_>, PacketError>);
}

/// Hears nothing.
#[derive(Debug, Default)]
pub struct Deaf;

impl Listener for Deaf {
    fn packet(&mut self, _: &[u8], _: &Result<DeviceMessage<'_>, PacketError>) {}
}

/// Keeps what a camera reports with its greeting, in words.
#[derive(Debug, Default)]
pub struct Reports(pub Vec<String>);

impl Listener for Reports {
    fn packet(&mut self, _: &[u8], content: &Result<DeviceMessage<'_>, PacketError>) {
        match content {
            Ok(DeviceMessage::Event(event)) => self.0.extend(events::at_greeting(&event.kind)),
            Ok(DeviceMessage::Crash(report)) => self.0.push(events::crash(report)),
            // Intact, and yet no message: of a version that has more to say.
            Err(PacketError::Message) => self.0.push(
                "the camera reported something that this program does not know: update it"
                    .to_owned(),
            ),
            _ => {}
        }
    }
}

/// An answer without borrowed parts.
#[derive(Debug, Clone, PartialEq)]
enum OwnedAnswer {
    Hello(CameraIdentity),
    Done,
    Status(Status),
    SelfTest(SelfTestReport),
    Register(u32),
    Gateware { next_offset: u32 },
}

impl From<&Answer<'_>> for OwnedAnswer {
    fn from(answer: &Answer<'_>) -> Self {
        match answer {
            Answer::Hello(identity) => Self::Hello(identity.into()),
            Answer::Done => Self::Done,
            Answer::Status(status) => Self::Status(*status),
            Answer::SelfTest(report) => Self::SelfTest(*report),
            Answer::Register(value) => Self::Register(*value),
            &Answer::Gateware { next_offset } => Self::Gateware { next_offset },
        }
    }
}

/// Which request was answered, and how.
type Answered = (u16, Result<OwnedAnswer, Refusal>);

/// A camera that has answered the greeting.
pub struct Session {
    link: Box<dyn Link>,
    incoming: Incoming,
    next_id: u16,
    identity: CameraIdentity,
    reports: Vec<String>,
}

/// Bytes on their way to packets.
struct Incoming {
    deframer: Box<Deframer<MAX_DEVICE_PACKET>>,
    chunk: Vec<u8>,
    raw: Vec<u8>,
}

impl Incoming {
    /// Cuts `chunk[..length]` into packets; returns the last reply among them.
    fn take(&mut self, length: usize, listener: &mut dyn Listener) -> Option<Answered> {
        let mut reply = None;
        let mut bytes = self.chunk.get(..length).unwrap_or(&[]);
        while let Some(found) = self.deframer.next(&mut bytes) {
            self.raw.clear();
            let content = match found {
                Deframed::TooLong => Err(PacketError::TooLong),
                Deframed::Packet(packet) => {
                    self.raw.extend_from_slice(packet);
                    open::<DeviceMessage<'_>>(packet)
                }
            };
            self.raw.push(0);
            listener.packet(&self.raw, &content);
            match &content {
                Ok(DeviceMessage::Reply(Reply { id, outcome })) => {
                    reply = Some((*id, outcome.as_ref().map(OwnedAnswer::from).map_err(|&r| r)));
                }
                // Perhaps the greeting of a version that says more than ours.
                Err(PacketError::Message) => {
                    self.raw.pop();
                    if let Some((id, device)) = hello_of_any_version(&mut self.raw) {
                        reply = Some((id, Err(Refusal::Protocol { device })));
                    }
                }
                _ => {}
            }
        }
        reply
    }
}

impl Session {
    /// Greets the camera behind `link`.
    ///
    /// # Errors
    /// [`SessionError::Version`] where the two cannot talk; the others where nothing sensible answers.
    pub fn open(mut link: Box<dyn Link>) -> Result<Self, SessionError> {
        // Cuts off whatever an earlier session may have left half sent.
        link.send(&[0])?;
        let mut session = Self {
            link,
            incoming: Incoming {
                deframer: Box::default(),
                chunk: vec![0; 1 << 18],
                raw: Vec::with_capacity(MAX_DEVICE_PACKET + 1),
            },
            next_id: 0,
            identity: CameraIdentity::from(&Identity {
                protocol: 0,
                firmware: Version(0, 0, 0),
                gateware: Version(0, 0, 0),
                board: "",
                serial: "",
                side: 0,
                adc_hz: 0,
                adc_bits: 0,
                wavelength_nm: 0,
            }),
            reports: Vec::new(),
        };
        let mut reports = Reports::default();
        let hello = Command::Hello { protocol: PROTOCOL_VERSION };
        match session.ask(HELLO, hello, &mut reports) {
            Ok(OwnedAnswer::Hello(identity)) if identity.protocol == PROTOCOL_VERSION => {
                session.identity = identity;
                session.reports = reports.0;
                Ok(session)
            }
            Ok(OwnedAnswer::Hello(identity)) => {
                Err(SessionError::Version { camera: identity.protocol })
            }
            Ok(_) => Err(SessionError::WrongAnswer { command: HELLO }),
            Err(SessionError::Closed { mid_packet: false }) => Err(SessionError::TurnedAway),
            Err(error) => Err(error),
        }
    }

    /// Who answered.
    #[must_use]
    pub fn identity(&self) -> &CameraIdentity {
        &self.identity
    }

    /// What the camera has reported with its greeting: what befell it while nobody listened, in words.
    #[must_use]
    pub fn reports(&self) -> &[String] {
        &self.reports
    }

    /// Waits until all that the camera had to report with its greeting has come.
    ///
    /// # Errors
    /// As [`command`](Self::command).
    pub fn await_reports(&mut self) -> Result<&[String], SessionError> {
        // Reports come before the answer to the next command.
        let mut reports = Reports(std::mem::take(&mut self.reports));
        let answered = self.status(&mut reports);
        self.reports = reports.0;
        answered.map(|_| self.reports())
    }

    fn send(&mut self, command: Command<'_>) -> Result<u16, SessionError> {
        let id = self.next_id;
        self.next_id = id.wrapping_add(1);
        let mut packet = vec![0; MAX_HOST_PACKET];
        let packet = encode(&Request { id, command }, &mut packet)
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

    /// Listens for up to `timeout`, or until something has come; gives every packet to `listener`.
    ///
    /// # Errors
    /// When the link ends.
    pub fn listen(
        &mut self,
        timeout: Duration,
        listener: &mut dyn Listener,
    ) -> Result<(), SessionError> {
        self.pump(timeout, listener).map(|_| ())
    }

    fn pump(
        &mut self,
        timeout: Duration,
        listener: &mut dyn Listener,
    ) -> Result<Option<Answered>, SessionError> {
        match self.link.receive(&mut self.incoming.chunk, timeout)? {
            Received::Bytes(length) => Ok(self.incoming.take(length, listener)),
            Received::Nothing => Ok(None),
            Received::Closed => Err(self.closed()),
        }
    }

    fn ask(
        &mut self,
        name: &'static str,
        command: Command<'_>,
        listener: &mut dyn Listener,
    ) -> Result<OwnedAnswer, SessionError> {
        let id = self.send(command)?;
        let deadline = Instant::now() + ANSWER_TIMEOUT;
        while let Some(left) = deadline.checked_duration_since(Instant::now()) {
            match self.pump(left.min(Duration::from_millis(100)), listener)? {
                Some((answered, Ok(answer))) if answered == id => return Ok(answer),
                Some((answered, Err(Refusal::Protocol { device }))) if answered == id => {
                    return Err(SessionError::Version { camera: device });
                }
                Some((answered, Err(refusal))) if answered == id => {
                    return Err(SessionError::Refused { command: name, refusal });
                }
                _ => {}
            }
        }
        Err(SessionError::NoAnswer { command: name })
    }

    /// Carries out a command whose answer is "done": `Configure`, `Start`, `Stop`, `RawBurst`.
    ///
    /// # Errors
    /// [`SessionError::Refused`] with the camera's reason, or when the link ends.
    pub fn command(
        &mut self,
        command: Command<'_>,
        listener: &mut dyn Listener,
    ) -> Result<(), SessionError> {
        let name = match command {
            Command::Configure(_) => "Configure",
            Command::Start(_) => "Start",
            Command::Stop => "Stop",
            Command::RawBurst { .. } => "RawBurst",
            Command::Reboot(_) => "Reboot",
            _ => "the command",
        };
        match self.ask(name, command, listener)? {
            OwnedAnswer::Done => Ok(()),
            _ => Err(SessionError::WrongAnswer { command: name }),
        }
    }

    /// How the camera is.
    ///
    /// # Errors
    /// As [`command`](Self::command).
    pub fn status(&mut self, listener: &mut dyn Listener) -> Result<Status, SessionError> {
        match self.ask("Status", Command::Status, listener)? {
            OwnedAnswer::Status(status) => Ok(status),
            _ => Err(SessionError::WrongAnswer { command: "Status" }),
        }
    }

    /// What the device's checks of itself say.
    ///
    /// # Errors
    /// As [`command`](Self::command).
    pub fn self_test(
        &mut self,
        listener: &mut dyn Listener,
    ) -> Result<SelfTestReport, SessionError> {
        match self.ask("SelfTest", Command::SelfTest, listener)? {
            OwnedAnswer::SelfTest(report) => Ok(report),
            _ => Err(SessionError::WrongAnswer { command: "SelfTest" }),
        }
    }

    /// The value of an FPGA register.
    ///
    /// # Errors
    /// As [`command`](Self::command).
    pub fn register(
        &mut self,
        register: Register,
        listener: &mut dyn Listener,
    ) -> Result<u32, SessionError> {
        let command = Command::ReadRegister { address: register.address() };
        match self.ask("ReadRegister", command, listener)? {
            OwnedAnswer::Register(value) => Ok(value),
            _ => Err(SessionError::WrongAnswer { command: "ReadRegister" }),
        }
    }

    /// Hands over a piece of a bitstream; returns where the next one belongs.
    ///
    /// # Errors
    /// As [`command`](Self::command).
    pub fn load_gateware(
        &mut self,
        piece: GatewareChunk<'_>,
        listener: &mut dyn Listener,
    ) -> Result<u32, SessionError> {
        match self.ask(LOAD_GATEWARE, Command::LoadGateware(piece), listener)? {
            OwnedAnswer::Gateware { next_offset } => Ok(next_offset),
            _ => Err(SessionError::WrongAnswer { command: LOAD_GATEWARE }),
        }
    }

    /// Asks for the camera's status without waiting for it: tells the camera that the host is alive.
    ///
    /// # Errors
    /// When the link ends.
    pub fn keep_alive(&mut self) -> Result<(), SessionError> {
        self.send(Command::Status).map(|_| ())
    }
}

#[cfg(test)]
mod tests;
