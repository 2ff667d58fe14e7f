//! What a start knows of the one before: how many restarts there were since power-up that the host did not ask for, and why
//! the last one came.
//!
//! The board keeps a few words in memory that a restart does not clear, and reads the chip's reset flags. This module judges
//! both. A crash that leaves a record ([`Crash`]) explains itself; a watchdog or a supply does not, and is told here.

use crate::{Crash, Micros};

/// Why the chip was reset, by its flags.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ResetCause {
    /// The chip's watchdog was not fed.
    Watchdog,
    /// The supply fell below the brown-out level, or came up.
    Supply,
    /// Anything else: the firmware itself, the reset button, a debugger.
    Other,
}

/// The restarts up to the last start, in memory that a restart keeps: a count and its complement, which shows that the
/// memory was written.
pub type RestartWords = [u32; 2];

/// The words for this count.
#[must_use]
pub const fn restart_words(restarts: u32) -> RestartWords {
    [restarts, !restarts]
}

/// The restarts up to now that no host asked for. `None` at power-up, when the memory holds anything.
#[must_use]
pub const fn restarts(before: RestartWords, asked_for: bool) -> Option<u32> {
    let [count, complement] = before;
    if count != !complement {
        None
    } else if asked_for {
        Some(count)
    } else {
        Some(count.saturating_add(1))
    }
}

/// The report for the next host of a restart that left no record. `alive` is when the firmware of the last start was last
/// known to run.
#[must_use]
pub fn report(cause: ResetCause, alive: Micros) -> Option<Crash> {
    match cause {
        ResetCause::Watchdog => {
            Some(Crash::new(alive, format_args!("the watchdog restarted the chip")))
        }
        ResetCause::Supply => {
            Some(Crash::new(alive, format_args!("the supply fell below the brown-out level")))
        }
        ResetCause::Other => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn restarts_that_no_host_asked_for_are_counted_since_power_up() {
        for memory in [[0; 2], [0xA5A5_A5A5; 2], [7, 7], [u32::MAX; 2], [1, 2]] {
            assert_eq!(restarts(memory, false), None, "{memory:x?}");
        }
        let mut words = restart_words(0);
        for expected in 1..4 {
            let count = restarts(words, false).unwrap_or(0);
            assert_eq!(count, expected);
            words = restart_words(count);
        }
        assert_eq!(restarts(words, true), Some(3));
        assert_eq!(restarts(restart_words(u32::MAX), false), Some(u32::MAX));
    }

    #[test]
    fn a_watchdog_and_a_supply_are_told_and_what_explains_itself_is_not() {
        let told = |cause| report(cause, Micros(5)).map(|crash| (crash.uptime, crash.text));
        let text = |cause| told(cause).map(|(_, text)| text.as_str().contains("supply"));
        assert_eq!(text(ResetCause::Watchdog), Some(false));
        assert_eq!(text(ResetCause::Supply), Some(true));
        assert_eq!(told(ResetCause::Supply).map(|(at, _)| at), Some(Micros(5)));
        assert_eq!(told(ResetCause::Other), None);
    }
}
