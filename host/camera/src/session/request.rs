//! The host's commands, each bound to the type of its reply.
//!
//! A new command is a new type with its [`Request`] in this file. No other file lists commands and
//! their replies.

use super::CameraIdentity;
use nirspi_wire::{
    Answer, Command, Configuration, GatewareChunk, RebootInto, RunLength, SelfTestReport,
};

/// A command, its name, and its reply.
pub trait Request {
    /// The command's name in error messages.
    const NAME: &'static str;
    /// The type of the camera's reply.
    type Reply;

    /// The command in the wire's form.
    fn command(&self) -> Command<'_>;

    /// The reply in this answer; `None` if the answer belongs to another command.
    fn reply(answer: &Answer<'_>) -> Option<Self::Reply>;
}

/// Greets the camera with the protocol version of this program.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hello(pub u16);

/// Sets up a measurement. The command also acknowledges a fault whose cause is gone.
#[derive(Debug, Clone, Copy)]
pub struct Configure<'c>(pub Configuration<'c>);

/// Starts frames. The LEDs go on.
#[derive(Debug, Clone, Copy)]
pub struct Start(pub RunLength);

/// Stops frames. The LEDs go off.
#[derive(Debug, Clone, Copy)]
pub struct Stop;

/// Requests the camera's status.
#[derive(Debug, Clone, Copy)]
pub struct Status;

/// Runs the device's own checks.
#[derive(Debug, Clone, Copy)]
pub struct SelfTest;

/// Reads the FPGA register at this address.
#[derive(Debug, Clone, Copy)]
pub struct ReadRegister(pub u16);

/// Sends a piece of a bitstream. The reply is the offset of the next piece.
#[derive(Debug, Clone, Copy)]
pub struct LoadGateware<'c>(pub GatewareChunk<'c>);

/// Records this many raw ADC samples.
#[derive(Debug, Clone, Copy)]
pub struct RawBurst(pub u16);

/// Restarts the device.
#[derive(Debug, Clone, Copy)]
pub struct Reboot(pub RebootInto);

/// One row of the table: `type, name, |request| command, answer => reply: type of the reply`.
macro_rules! request {
    ($request:ty, $name:literal, |$this:ident| $command:expr, $answer:pat => $reply:expr, $type:ty) => {
        impl Request for $request {
            const NAME: &'static str = $name;
            type Reply = $type;

            fn command(&self) -> Command<'_> {
                let $this = self;
                $command
            }

            fn reply(answer: &Answer<'_>) -> Option<$type> {
                match *answer {
                    $answer => Some($reply),
                    _ => None,
                }
            }
        }
    };
}

request!(Hello, "Hello", |hello| Command::Hello { protocol: hello.0 },
    Answer::Hello(identity) => CameraIdentity::from(&identity), CameraIdentity);
request!(Configure<'_>, "Configure", |configure| Command::Configure(configure.0),
    Answer::Done => (), ());
request!(Start, "Start", |start| Command::Start(start.0), Answer::Done => (), ());
request!(Stop, "Stop", |_stop| Command::Stop, Answer::Done => (), ());
request!(Status, "Status", |_status| Command::Status,
    Answer::Status(status) => status, nirspi_wire::Status);
request!(SelfTest, "SelfTest", |_test| Command::SelfTest,
    Answer::SelfTest(report) => report, SelfTestReport);
request!(ReadRegister, "ReadRegister", |read| Command::ReadRegister { address: read.0 },
    Answer::Register(value) => value, u32);
request!(LoadGateware<'_>, "LoadGateware", |load| Command::LoadGateware(load.0),
    Answer::Gateware { next_offset } => next_offset, u32);
request!(RawBurst, "RawBurst", |burst| Command::RawBurst { samples: burst.0 },
    Answer::Done => (), ());
request!(Reboot, "Reboot", |reboot| Command::Reboot(reboot.0), Answer::Done => (), ());
