//! Replies and events that wait for room on the link.
//!
//! # Invariant
//! Every notice comes out once, in the order in which it was put in. A command is taken only while
//! there is [room](Notices::has_room_for_a_command) for its reply and for every event that the
//! command can cause (`tests::laws::each_command_is_answered_once_and_in_order`).

use crate::packets::send;
use crate::{BoardInfo, Crash, PacketSink};
use heapless::Deque;
use nirspi_wire::message::CRASH_TEXT_MAX;
use nirspi_wire::{
    ADC_BITS, ADC_HZ, Answer, Capabilities, CrashReport, DeviceMessage, Event, Identity, Refusal,
    Reply, SIDE, Version, WAVELENGTH_NM,
};

/// The outcome of a command, without borrowed data.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Outcome {
    /// `Hello`. The rest of the identity is filled in when the reply is sent.
    Hello {
        /// Protocol version of the session, or the newest version of this firmware where there is
        /// no session.
        protocol: u16,
        gateware: Version,
        /// What the FPGA adds to the board's capabilities.
        added: Capabilities,
    },
    Other(Result<Answer<'static>, Refusal>),
}

impl Outcome {
    pub const DONE: Self = Self::Other(Ok(Answer::Done));
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Notice {
    Reply {
        id: u16,
        outcome: Outcome,
    },
    Event(Event),
    /// The report of the crash that ended the last start.
    Crash,
}

/// Number of notices that can wait.
const CAPACITY: usize = 16;

/// Largest number of notices that one command can cause before the next command is taken: its
/// reply, a fault, the end of a run (or the loss of a raw burst), and a crash report.
const NOTICES_OF_A_COMMAND: usize = 4;

/// Longest notice in bytes of postcard: a crash report. An identity with two full names has at most
/// 96 bytes.
const NOTICE_BYTES: usize = 16 + CRASH_TEXT_MAX;

/// Replies and events in the order in which they came.
#[derive(Debug, Default)]
#[cfg_attr(test, derive(Clone))]
pub(crate) struct Notices(Deque<Notice, CAPACITY>);

impl Notices {
    pub fn push(&mut self, notice: Notice) {
        let pushed = self.0.push_back(notice);
        debug_assert!(pushed.is_ok(), "a command was taken without room for what it leads to");
    }

    pub fn has_room_for_a_command(&self) -> bool {
        CAPACITY.saturating_sub(self.0.len()) >= NOTICES_OF_A_COMMAND
    }

    #[cfg(test)]
    pub fn iter(&self) -> impl Iterator<Item = &Notice> {
        self.0.iter()
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub fn clear(&mut self) {
        self.0.clear();
    }

    /// Sends what the link has room for; true if anything was sent.
    pub fn flush(
        &mut self,
        info: &BoardInfo,
        crash: &mut Option<Crash>,
        sink: &mut impl PacketSink,
    ) -> bool {
        let mut worked = false;
        while let Some(notice) = self.0.front() {
            let sent = message(notice, info, crash.as_ref())
                .is_none_or(|message| send(&message, NOTICE_BYTES, sink));
            if !sent {
                break;
            }
            if *notice == Notice::Crash {
                *crash = None;
            }
            self.0.pop_front();
            worked = true;
        }
        worked
    }
}

/// The message of a notice. `None`: a crash that has been reported already.
fn message<'m>(
    notice: &Notice,
    info: &'m BoardInfo,
    crash: Option<&'m Crash>,
) -> Option<DeviceMessage<'m>> {
    Some(match *notice {
        Notice::Crash => {
            let Crash { uptime, text } = crash?;
            DeviceMessage::Crash(CrashReport { uptime_us: uptime.0, text })
        }
        Notice::Event(event) => DeviceMessage::Event(event),
        Notice::Reply { id, outcome: Outcome::Other(outcome) } => {
            DeviceMessage::Reply(Reply { id, outcome })
        }
        Notice::Reply { id, outcome: Outcome::Hello { protocol, gateware, added } } => {
            let identity = Identity {
                protocol,
                firmware: info.firmware,
                gateware,
                board: &info.board,
                serial: &info.serial,
                side: SIDE,
                adc_hz: ADC_HZ,
                adc_bits: ADC_BITS,
                wavelength_nm: WAVELENGTH_NM,
                capabilities: info.capabilities.with(added),
            };
            DeviceMessage::Reply(Reply { id, outcome: Ok(Answer::Hello(identity)) })
        }
    })
}
