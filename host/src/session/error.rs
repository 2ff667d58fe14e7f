//! Why a conversation with a camera ends, and why a camera refuses, in words.

use super::ANSWER_TIMEOUT;
use super::request::{Hello, Request};
use nirspi_wire::{Refusal, version};
use thiserror::Error;

/// Why a conversation ended.
#[derive(Debug, Error)]
pub enum SessionError {
    /// The link failed.
    #[error("the link to the camera failed")]
    Link(#[from] std::io::Error),
    /// The camera has gone.
    #[error("the camera closed the link{}", if *.mid_packet { " in the middle of a packet" } else { "" })]
    Closed {
        /// Whether part of a packet had come.
        mid_packet: bool,
    },
    /// The camera has gone before it said who it is.
    #[error(
        "the link closed before the camera answered: another program may be using it, or this is not a nirspi camera"
    )]
    TurnedAway,
    /// The two sides speak different versions.
    #[error(
        "the camera speaks protocol version {camera}, this program versions {} to {}: update {}",
        version::MIN,
        version::CURRENT,
        if *.camera > version::CURRENT { "this program" } else { "the camera's firmware (nirspi flash)" }
    )]
    Version {
        /// The camera's.
        camera: u16,
    },
    /// The camera would not do it.
    #[error("the camera refused {command}: {}", refusal_in_words(.refusal))]
    Refused {
        /// What it was asked to do.
        command: &'static str,
        /// Why not.
        refusal: Refusal,
    },
    /// No answer.
    #[error(
        "no answer to {command} within {} s{}",
        ANSWER_TIMEOUT.as_secs(),
        if *.command == Hello::NAME { ": is this a nirspi camera?" } else { "" }
    )]
    NoAnswer {
        /// What was asked.
        command: &'static str,
    },
    /// An answer that belongs to another command.
    #[error("the camera answered {command} with something else")]
    WrongAnswer {
        /// What was asked.
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
            "its firmware does not know this command: update the firmware (nirspi flash)".to_owned()
        }
    }
}
