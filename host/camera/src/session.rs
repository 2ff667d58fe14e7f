//! A session with a camera: greeting, commands and their answers, and the stream between them.
//!
//! # Invariant
//! The listener receives every packet as it arrived, also while an answer is awaited, and damaged
//! packets too (`tests::every_packet_is_heard_while_an_answer_is_awaited`).

mod conversation;
mod error;
pub mod request;

pub use error::SessionError;
pub use request::Request;

use crate::events;
use crate::link::Link;
use crate::response::Settling;
use crate::setup::MeasurementSetup;
use conversation::Conversation;
use nirspi_files::clock::Instant;
use nirspi_files::identity::{CameraIdentity, in_words};
use nirspi_wire::register::{Design, Register};
use nirspi_wire::{
    Capabilities, Command, DeviceMessage, GatewareChunk, PacketError, SelfTestReport, Status,
    version,
};
use std::time::Duration;

/// The longest time in which a camera must answer a command.
pub const ANSWER_TIMEOUT: Duration = Duration::from_secs(5);

/// What a recording knows of its measurement. A capture of a replay uses this in place of its own
/// setup and calibration.
#[derive(Debug, Clone)]
pub struct Recorded {
    /// The setup of the measurement.
    pub setup: MeasurementSetup,
    /// The settling of the camera, if the recording holds it.
    pub settling: Option<Settling>,
    /// Number of the recording's first frame in its run: 0, unless an earlier file of the run has the
    /// frames before.
    pub first_frame: u64,
}

/// Receives every packet of a session.
pub trait Listener {
    /// Receives a packet. `raw` are the bytes on the wire, delimiter included.
    fn packet(&mut self, raw: &[u8], content: &Result<DeviceMessage<'_>, PacketError>);

    /// The last bytes of the next packets came out of the link at this moment.
    fn arrived(&mut self, _at: Instant) {}

    /// Whether to go on waiting; called several times a second during a long wait.
    fn goes_on(&mut self) -> bool {
        true
    }
}

/// Ignores every packet, for a command of which only the reply counts.
#[derive(Debug, Default)]
pub struct IgnorePackets;

impl Listener for IgnorePackets {
    fn packet(&mut self, _: &[u8], _: &Result<DeviceMessage<'_>, PacketError>) {}
}

/// Keeps the reports that a camera sends with its greeting, in words. At most [`Reports::MOST`]
/// lines are kept, and the last line says that more arrived. A crash is kept after any number of
/// lines, because light depends on it.
#[derive(Debug, Clone, Default)]
pub struct Reports {
    /// The reports, one line each.
    pub lines: Vec<String>,
    /// The firmware's last crash, in one line.
    pub crash: Option<String>,
}

impl Reports {
    /// The most lines that are kept.
    pub const MOST: usize = 100;

    fn keep(&mut self, report: Option<String>) {
        match (report, self.lines.len() + 1) {
            (Some(report), ..Self::MOST) => self.lines.push(report),
            (Some(_), Self::MOST) => {
                self.lines.push("the camera reported more than is shown".to_owned());
            }
            _ => {}
        }
    }
}

impl Listener for Reports {
    fn packet(&mut self, _: &[u8], content: &Result<DeviceMessage<'_>, PacketError>) {
        if let Ok(DeviceMessage::Crash(report)) = content {
            self.crash = Some(events::crash(report));
        }
        self.keep(match content {
            Ok(DeviceMessage::Event(event)) => events::at_greeting(&event.kind),
            Ok(DeviceMessage::Crash(report)) => Some(events::crash(report)),
            // The packet is intact but unknown: its sender has a newer version.
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
    reports: Reports,
    recorded: Option<Recorded>,
}

impl Session {
    /// Greets the camera behind `link`.
    ///
    /// # Errors
    /// [`SessionError::Version`] if there is no common version; other errors if the device does not
    /// answer as a camera.
    pub fn open(link: Box<dyn Link>) -> Result<Self, SessionError> {
        let mut conversation = Conversation::begin(link)?;
        let mut reports = Reports::default();
        match conversation.ask(&request::Hello(version::CURRENT), &mut reports) {
            Ok(identity) if version::speaks(identity.protocol) => {
                // Every command shows it: such a picture is not of the scene.
                let can = |wanted| {
                    in_words(wanted).iter().all(|name| identity.capabilities.contains(name))
                };
                if can(Capabilities::BRING_UP) {
                    let design = Design::BringUp;
                    reports.keep(Some(format!("the camera runs the gateware for {design}")));
                }
                Ok(Self { conversation, identity, reports, recorded: None })
            }
            Ok(identity) => Err(SessionError::Version { camera: identity.protocol }),
            Err(SessionError::Closed { mid_packet: false }) => Err(SessionError::TurnedAway),
            Err(error) => Err(error),
        }
    }

    /// The same session, with a camera that plays back this measurement.
    #[must_use]
    pub fn with_recorded(self, recorded: Recorded) -> Self {
        Self { recorded: Some(recorded), ..self }
    }

    /// The measurement that the camera plays back; `None` for a camera that measures.
    #[must_use]
    pub fn recorded(&self) -> Option<&Recorded> {
        self.recorded.as_ref()
    }

    /// The camera's identity.
    #[must_use]
    pub fn identity(&self) -> &CameraIdentity {
        &self.identity
    }

    /// Reports that the camera sent with its greeting: events while no host was connected, in
    /// words.
    #[must_use]
    pub fn reports(&self) -> &Reports {
        &self.reports
    }

    /// Waits until all reports of the greeting have arrived.
    ///
    /// # Errors
    /// As [`command`](Self::command).
    pub fn await_reports(&mut self) -> Result<&Reports, SessionError> {
        // Reports come before the answer to the next command.
        let mut reports = std::mem::take(&mut self.reports);
        let answered = self.status(&mut reports);
        self.reports = reports;
        answered.map(|_| self.reports())
    }

    /// Time that the link has been waited for since the session began. In the rest of the time this
    /// program was busy with packets, or with other work.
    #[must_use]
    pub fn waited(&self) -> Duration {
        self.conversation.waited()
    }

    /// Listens for up to `timeout`, or until a packet has arrived. Every packet goes to `listener`.
    ///
    /// # Errors
    /// If the link ends.
    pub fn listen(
        &mut self,
        timeout: Duration,
        listener: &mut dyn Listener,
    ) -> Result<(), SessionError> {
        self.conversation.pump(timeout, listener, &mut |_, _| {})
    }

    /// Executes a command on the camera and returns the reply to this command.
    ///
    /// # Errors
    /// [`SessionError::Refused`] with the camera's reason, or another error if the link ends.
    pub fn command<R: Request>(
        &mut self,
        request: R,
        listener: &mut dyn Listener,
    ) -> Result<R::Reply, SessionError> {
        self.conversation.ask(&request, listener)
    }

    /// The camera's status.
    ///
    /// # Errors
    /// As [`command`](Self::command).
    pub fn status(&mut self, listener: &mut dyn Listener) -> Result<Status, SessionError> {
        self.command(request::Status, listener)
    }

    /// The results of the device's own checks.
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

    /// Sends a piece of a bitstream. Returns the offset of the next piece.
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

    /// Requests the camera's status without waiting for the answer, which tells the camera that the
    /// host is alive.
    ///
    /// # Errors
    /// If the link ends.
    pub fn keep_alive(&mut self) -> Result<(), SessionError> {
        self.conversation.send(Command::Status).map(|_| ())
    }
}

#[cfg(test)]
mod tests;
