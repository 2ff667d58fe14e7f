//! Every frame is counted once, in whatever order the frames of a gap come late.

use nirspi::account::{Arrival, LossAccount, LossCounters};
use proptest::prelude::*;

proptest! {
    #[test]
    fn frames_that_all_come_are_all_counted_and_none_is_lost(
        order in Just((1u32..40).collect::<Vec<_>>()).prop_shuffle(),
    ) {
        let mut account = LossAccount::new();
        prop_assert_eq!(account.frame(0), Arrival::Received);
        let (mut newest, mut late) = (0, 0);
        for &sequence in &order {
            let expected = if sequence > newest { Arrival::Received } else { Arrival::Late };
            prop_assert_eq!(account.frame(sequence), expected);
            prop_assert_eq!(account.frame(sequence), Arrival::Repeated);
            newest = newest.max(sequence);
            late += u64::from(expected == Arrival::Late);
            prop_assert_eq!(account.counters().total(), account.accounted());
        }
        let received = 40 - late;
        prop_assert_eq!(account.counters(), LossCounters { received, late, lost: 0, corrupt: 0 });
        prop_assert_eq!(account.repeated(), 39);
    }
}

/// A late frame says nothing about its neighbours in the gap.
#[test]
fn the_frames_before_and_after_a_late_one_can_still_come() {
    let mut account = LossAccount::new();
    account.frame(0);
    account.frame(4);
    for late in [2, 1, 3] {
        assert_eq!(account.frame(late), Arrival::Late, "{late}");
    }
    assert_eq!(account.counters(), LossCounters { received: 2, late: 3, ..Default::default() });
}
