//! A conversation with a camera: greeting, commands and their answers, the stream in between.
//!
//! # Invariant
//! Nothing of the stream is skipped while an answer is awaited: every packet goes to the listener as it came, damaged
//! packets too (`tests::every_packet_is_heard_while_an_answer_is_awaited`).

mod conversation;
mod error;
pub mod request;

pub use error::SessionError;
pub use request::Request;

use crate::events;
use crate::link::Link;
use conversation::Conversation;
use nirspi_wire::register::Register;
use nirspi_wire::{
    Capabilities, Command, DeviceMessage, GatewareChunk, Identity, PacketError, SelfTestReport,
    Status, version,
};
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// A camera answers a command within this, or something is wrong.
pub(crate) const ANSWER_TIMEOUT: Duration = Duration::from_secs(5);

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
    /// What the camera can do, in words; empty for a camera of protocol version 1, which does not say.
    #[serde(default)]
    pub capabilities: Vec<String>,
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
            capabilities: in_words(identity.capabilities.0.unwrap_or_default()),
        }
    }
}

/// The name of each capability; the number of the bit where this program does not know the capability.
fn in_words(capabilities: Capabilities) -> Vec<String> {
    let bits = (0..u32::BITS).filter(|bit| capabilities.contains(Capabilities(1 << bit)));
    bits.map(|bit| {
        let known = Capabilities::NAMES.iter().find(|(known, _)| known.0 == 1 << bit);
        known.map_or_else(|| format!("capability {bit}"), |(_, name)| (*name).to_owned())
    })
    .collect()
}

/// Hears every packet of a session.
pub trait Listener {
    /// A packet came. `raw` is as it stood on the wire, delimiter included.
    fn packet(&mut self, raw: &[u8], content: &Result<DeviceMessage<'_>, PacketError>);

    /// Whether to go on waiting for what comes next; asked several times a second where a wait may be long.
    fn goes_on(&mut self) -> bool {
        true
    }
}

/// Ignores every packet: for a command of which only the reply counts.
#[derive(Debug, Default)]
pub struct IgnorePackets;

impl Listener for IgnorePackets {
    fn packet(&mut self, _: &[u8], _: &Result<DeviceMessage<'_>, PacketError>) {}
}

/// Keeps what a camera reports with its greeting, in words: at most [`Reports::MOST`] lines, the last of which says that
/// more came.
#[derive(Debug, Default)]
pub struct Reports(pub Vec<String>);

impl Reports {
    /// Most lines that are kept, whatever a camera sends.
    pub const MOST: usize = 100;

    fn keep(&mut self, report: Option<String>) {
        match (report, self.0.len() + 1) {
            (Some(report), ..Self::MOST) => self.0.push(report),
            (Some(_), Self::MOST) => {
                self.0.push("the camera reported more than is shown".to_owned())
            }
            _ => {}
        }
    }
}

impl Listener for Reports {
    fn packet(&mut self, _: &[u8], content: &Result<DeviceMessage<'_>, PacketError>) {
        self.keep(match content {
            Ok(DeviceMessage::Event(event)) => events::at_greeting(&event.kind),
            Ok(DeviceMessage::Crash(report)) => Some(events::crash(report)),
            // Intact, and yet no message: of a version that has more to say.
            Err(PacketError::Message) => Some(
                "the camera reported something that this program does not know: update it"
                    .to_owned(),
            ),
            _ => None,
        });
    }
}

/// A camera that has answered the greeting.
pub struct Session {
    conversation: Conversation,
    identity: CameraIdentity,
    reports: Vec<String>,
}

impl Session {
    /// Greets the camera behind `link`, and settles the protocol version: the newest that both sides speak.
    ///
    /// # Errors
    /// [`SessionError::Version`] where the two cannot talk; the others where nothing sensible answers.
    pub fn open(link: Box<dyn Link>) -> Result<Self, SessionError> {
        let mut conversation = Conversation::begin(link)?;
        let mut reports = Reports::default();
        let mut greet = |protocol| conversation.ask(&request::Hello(protocol), &mut reports);
        let identity = match greet(version::CURRENT) {
            // The camera is older than this program, and this program still speaks its version.
            Ok(identity) if identity.protocol < version::CURRENT => {
                let protocol = identity.protocol;
                if version::speaks(protocol) { greet(protocol) } else { Ok(identity) }
            }
            answer => answer,
        };
        match identity {
            Ok(identity) if version::speaks(identity.protocol) => {
                Ok(Self { conversation, identity, reports: reports.0 })
            }
            Ok(identity) => Err(SessionError::Version { camera: identity.protocol }),
            Err(SessionError::Closed { mid_packet: false }) => Err(SessionError::TurnedAway),
            Err(error) => Err(error),
        }
    }

    /// Who answered.
    #[must_use]
    pub fn identity(&self) -> &CameraIdentity {
        &self.identity
    }

    /// What the camera has reported with its greeting: what befell it while no host listened, in words.
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

    /// Listens for up to `timeout`, or until something has come; gives every packet to `listener`.
    ///
    /// # Errors
    /// When the link ends.
    pub fn listen(
        &mut self,
        timeout: Duration,
        listener: &mut dyn Listener,
    ) -> Result<(), SessionError> {
        self.conversation.pump(timeout, listener, &mut |_, _| {})
    }

    /// Has the camera carry out a command; returns the reply that belongs to this command.
    ///
    /// # Errors
    /// [`SessionError::Refused`] with the camera's reason, or when the link ends.
    pub fn command<R: Request>(
        &mut self,
        request: R,
        listener: &mut dyn Listener,
    ) -> Result<R::Reply, SessionError> {
        self.conversation.ask(&request, listener)
    }

    /// How the camera is.
    ///
    /// # Errors
    /// As [`command`](Self::command).
    pub fn status(&mut self, listener: &mut dyn Listener) -> Result<Status, SessionError> {
        self.command(request::Status, listener)
    }

    /// What the device's checks of itself say.
    ///
    /// # Errors
    /// As [`command`](Self::command).
    pub fn self_test(
        &mut self,
        listener: &mut dyn Listener,
    ) -> Result<SelfTestReport, SessionError> {
        self.command(request::SelfTest, listener)
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
        self.command(request::ReadRegister(register.address()), listener)
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
        self.command(request::LoadGateware(piece), listener)
    }

    /// Asks for the camera's status without waiting for the answer: tells the camera that the host is alive.
    ///
    /// # Errors
    /// When the link ends.
    pub fn keep_alive(&mut self) -> Result<(), SessionError> {
        self.conversation.send(Command::Status).map(|_| ())
    }
}

#[cfg(test)]
mod tests;
