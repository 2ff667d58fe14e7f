//! How long a transfer to the host may wait, and what follows.
//!
//! A host that does not fetch data watches no picture, whatever commands it still sends. After
//! [`PATIENCE`] its session ends, and with the session the light. A transfer that then waits in the
//! next session too, before any other got through, says that the link itself is stuck: the device
//! leaves the bus and comes back.
//!
//! # Invariant
//! A link on which transfers end is never restarted, and a link on which none ends is restarted at
//! every second session (`tests::patience::only_a_link_that_carries_nothing_is_restarted`).

use crate::Micros;
use nirspi_wire::message::HOST_SILENCE_US;

/// Longest time for one transfer: the same as for a host that sends no command.
pub const PATIENCE: Micros = Micros(HOST_SILENCE_US);

/// What follows when a transfer has waited for longer than [`PATIENCE`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Remedy {
    /// End the session, drop what waits, and begin another session.
    EndSession,
    /// The same, and leave the bus for a moment.
    LeaveBus,
}

/// Judges the transfers to the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Patience {
    began: Micros,
    /// The board has taken a transfer of this session. The transfer is known to be over when the board
    /// takes the next one.
    handed_over: bool,
    /// The last session ended by a stuck transfer, and no transfer has got through since.
    stuck: bool,
}

impl Patience {
    /// A link of which nothing is known.
    #[must_use]
    pub const fn new() -> Self {
        Self { began: Micros(0), handed_over: false, stuck: false }
    }

    /// A session begins, with nothing on its way to the host.
    pub fn session_begins(&mut self) {
        self.handed_over = false;
    }

    /// A transfer begins to wait for the one before. Returns the time until which it may wait.
    pub fn begins(&mut self, now: Micros) -> Micros {
        self.began = now;
        Micros(now.0.saturating_add(PATIENCE.0))
    }

    /// The transfer was handed over, so the one before has reached the host.
    pub fn ends(&mut self) {
        if core::mem::replace(&mut self.handed_over, true) {
            self.stuck = false;
        }
    }

    /// The transfer has reached the host.
    pub fn fetched(&mut self) {
        (self.handed_over, self.stuck) = (true, false);
    }

    /// What to do about a transfer that still waits; `None` if it may wait longer.
    pub fn judge(&mut self, now: Micros) -> Option<Remedy> {
        if now.since(self.began) < PATIENCE {
            return None;
        }
        let again = core::mem::replace(&mut self.stuck, true);
        if again {
            self.stuck = false;
        }
        Some(if again { Remedy::LeaveBus } else { Remedy::EndSession })
    }
}
