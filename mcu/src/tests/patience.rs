//! Laws of transfers that wait for the host.

use crate::{Micros, PATIENCE, Patience, Remedy};
use proptest::prelude::*;

#[test]
fn a_transfer_may_wait_as_long_as_a_silent_host() {
    let mut patience = Patience::new();
    patience.session_begins();
    let due = patience.begins(Micros(1_000));
    assert_eq!(due, Micros(1_000 + PATIENCE.0));
    assert_eq!(patience.judge(Micros(due.0 - 1)), None);
    assert_eq!(patience.judge(due), Some(Remedy::EndSession));
}

#[test]
fn the_first_transfer_of_a_session_says_nothing_of_the_link() {
    let mut patience = Patience::new();
    for expected in [Remedy::EndSession, Remedy::LeaveBus, Remedy::EndSession] {
        patience.session_begins();
        patience.begins(Micros(0));
        // Handed over, and never fetched.
        patience.ends();
        let due = patience.begins(Micros(0));
        assert_eq!(patience.judge(due), Some(expected));
    }
}

/// Sessions of so many fetched transfers each, of which `more` are handed over besides, and then one that does not end.
/// `end` tells of a transfer's end.
fn sessions_get_their_remedies(
    sessions: &[u8],
    more: u8,
    end: fn(&mut Patience),
) -> Result<(), TestCaseError> {
    let mut patience = Patience::new();
    let mut now = Micros(0);
    let mut stuck_before = false;
    for &fetched in sessions {
        patience.session_begins();
        for _ in 0..fetched + more {
            patience.begins(now);
            end(&mut patience);
            prop_assert_eq!(patience.judge(now), None);
        }
        now = patience.begins(now);
        let restart = stuck_before && fetched == 0;
        let expected = if restart { Remedy::LeaveBus } else { Remedy::EndSession };
        prop_assert_eq!(patience.judge(now), Some(expected));
        stuck_before = !restart;
    }
    Ok(())
}

proptest! {
    /// An endpoint that copies ends a transfer when the one before is fetched, so one more is handed over than is fetched.
    #[test]
    fn only_a_link_that_carries_nothing_is_restarted(sessions in prop::collection::vec(0_u8..4, 1..20)) {
        sessions_get_their_remedies(&sessions, 1, Patience::ends)?;
    }

    /// An endpoint that takes packets whole ends a transfer when the host has it.
    #[test]
    fn a_transfer_that_was_fetched_needs_no_other_to_tell(sessions in prop::collection::vec(0_u8..4, 1..20)) {
        sessions_get_their_remedies(&sessions, 0, Patience::fetched)?;
    }
}
