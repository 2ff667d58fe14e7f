//! Replies and events that wait for room on the link.
//!
//! # Invariant
//! What is put in comes out once, in order. A command is taken only while there is
//! [room](Notices::has_room_for_a_command) for its reply and for every event that the command can lead to:
//! `tests::laws::each_command_is_answered_once_and_in_order`.

use crate::packets::send;
use crate::{BoardInfo, Crash, PacketSink};
use heapless::Deque;
use nirspi_wire::message::CRASH_TEXT_MAX;
use nirspi_wire::{
    ADC_BITS, ADC_HZ, Answer, Capabilities, CrashReport, DeviceMessage, Event, Identity, Refusal,
    Reply, SIDE, Tail, Version, WAVELENGTH_NM,
};

/// A command's outcome that borrows nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Outcome {
    /// The rest of the identity is filled in when it is sent.
    Hello {
        /// Of the session, or the newest of this firmware where there is no session.
        protocol: u16,
        gateware: Version,
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
    /// Of the last start.
    Crash,
}

/// Notices that wait.
const CAPACITY: usize = 16;

/// The most that one command can lead to before the next one is taken: its reply, a fault, the end of a
/// run (or the loss of a raw burst), a crash report.
const NOTICES_OF_A_COMMAND: usize = 4;

/// Bytes of postcard of the longest notice, a crash report; an identity with two full names is 96 at most.
const NOTICE_BYTES: usize = 16 + CRASH_TEXT_MAX;

/// Replies and events in the order in which they came.
#[derive(Debug, Default)]
pub(crate) struct Notices(Deque<Notice, CAPACITY>);

impl Notices {
    pub fn push(&mut self, notice: Notice) {
        let pushed = self.0.push_back(notice);
        debug_assert!(pushed.is_ok(), "a command was taken without room for what it leads to");
    }

    pub fn has_room_for_a_command(&self) -> bool {
        CAPACITY.saturating_sub(self.0.len()) >= NOTICES_OF_A_COMMAND
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub fn clear(&mut self) {
        self.0.clear();
    }

    /// Sends what the link has room for; whether that was anything. What a session of version `protocol` does not have
    /// is dropped.
    pub fn flush(
        &mut self,
        protocol: u16,
        info: &BoardInfo,
        crash: &mut Option<Crash>,
        sink: &mut impl PacketSink,
    ) -> bool {
        let mut worked = false;
        while let Some(notice) = self.0.front() {
            let sent = message(notice, info, crash.as_ref())
                .filter(|message| message.since() <= protocol)
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

/// `None`: a crash that has been reported already.
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
        Notice::Reply { id, outcome: Outcome::Hello { protocol, gateware } } => {
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
                capabilities: Tail((protocol >= Capabilities::SINCE).then_some(info.capabilities)),
            };
            DeviceMessage::Reply(Reply { id, outcome: Ok(Answer::Hello(identity)) })
        }
    })
}
