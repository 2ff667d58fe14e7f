//! Why a session with a camera ends, and why a camera refuses, in words.

use super::ANSWER_TIMEOUT;
use super::request::{Hello, Request};
use nirspi_wire::message::HOST_SILENCE_US;
use nirspi_wire::{Refusal, version};
use thiserror::Error;

/// Why a session ended.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SessionError {
    /// The link failed.
    #[error("the link to the camera failed")]
    Link(#[from] std::io::Error),
    /// The camera has closed the link.
    #[error("the camera closed the link{}", if *.mid_packet { " in the middle of a packet" } else { "" })]
    Closed {
        /// Whether part of a packet had arrived.
        mid_packet: bool,
    },
    /// The link closed before the camera identified itself.
    #[error(
        "the link closed before the camera answered: another program may be using it, or this is not a nirspi camera"
    )]
    TurnedAway,
    /// The two sides speak different versions.
    #[error(
        "the camera speaks protocol version {camera}, this program {}: update {}",
        version::Spoken,
        if *.camera > version::CURRENT { "this program" } else { "the camera's firmware (nirspi camera flash)" }
    )]
    Version {
        /// The camera's version.
        camera: u16,
    },
    /// The camera has ended the session, and asks for a greeting.
    #[error(
        "the camera ended the session before {command}: its firmware restarted, the bus was asleep, or this program \
         read nothing for {} s; start again",
        HOST_SILENCE_US / 1_000_000
    )]
    Ended {
        /// The name of the command.
        command: &'static str,
    },
    /// The camera refused a command.
    #[error("the camera refused {command}: {}", refusal_in_words(.refusal))]
    Refused {
        /// The name of the command.
        command: &'static str,
        /// The camera's reason.
        refusal: Refusal,
    },
    /// The camera did not answer.
    #[error(
        "no answer to {command} within {} s{}",
        ANSWER_TIMEOUT.as_secs(),
        if *.command == Hello::NAME { ": is this a nirspi camera?" } else { "" }
    )]
    NoAnswer {
        /// The name of the command.
        command: &'static str,
    },
    /// The answer belongs to another command.
    #[error("the camera answered {command} with something else")]
    WrongAnswer {
        /// The name of the command.
        command: &'static str,
    },
}

fn refusal_in_words(refusal: &Refusal) -> String {
    use nirspi_wire::ConfigProblem;
    match refusal {
        Refusal::Protocol { device } => format!("it speaks protocol version {device}"),
        Refusal::State(state) => format!("it is {state}"),
        Refusal::Configuration(ConfigProblem::OutOfRange { field, found, min, max }) => {
            format!("{field} is {found}, expected {min} to {max}")
        }
        Refusal::Configuration(ConfigProblem::OrderEntry { index, found }) => {
            format!("entry {index} of the order, {found}, is repeated or no pattern")
        }
        Refusal::Fault(fault) => format!("a fault stands: {fault}"),
        Refusal::NoSuchRegister { address } => format!("there is no register {address:#06x}"),
        Refusal::RawLength { max } => format!("a raw burst has 1 to {max} samples"),
        Refusal::GatewareOffset { expected } => format!("it expected the piece at {expected}"),
        Refusal::GatewareCrc => "the gateware's checksum is wrong".to_owned(),
        Refusal::Unsupported => "this board cannot do that".to_owned(),
        Refusal::Bus => "its FPGA does not answer".to_owned(),
        Refusal::Unknown => {
            "its firmware does not know this command: update the firmware (nirspi camera flash)"
                .to_owned()
        }
    }
}
