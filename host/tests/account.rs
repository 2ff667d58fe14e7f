//! Every frame is counted once, in whatever order the frames of a gap come late.

use nirspi::account::{Arrival, Check, LossAccount, LossCounters};
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

/// A damaged packet does not say which frame it was, so a whole gap may count as corrupt.
#[test]
fn a_late_frame_of_a_gap_that_counts_as_corrupt_takes_back_a_corrupt_one() {
    let mut account = LossAccount::new();
    account.frame(0);
    account.damaged(Check::Crc);
    account.frame(2);
    let counted = LossCounters { received: 2, corrupt: 1, ..LossCounters::default() };
    assert_eq!((account.counters(), account.failed_checks().packets()), (counted, 1));
    assert_eq!(account.frame(1), Arrival::Late);
    let counted = LossCounters { received: 2, late: 1, ..LossCounters::default() };
    assert_eq!(account.counters(), counted);
}

#[test]
fn a_number_before_the_first_frame_counts_as_repeated_and_as_no_frame() {
    let mut account = LossAccount::new();
    for times in 1..3 {
        assert_eq!(account.frame(u32::MAX), Arrival::Repeated);
        assert_eq!((account.repeated(), account.accounted()), (times, 0));
    }
    assert_eq!(
        (account.counters(), account.failed_checks().packets()),
        (LossCounters::default(), 0)
    );
}

#[test]
fn accounts_add_up_counter_by_counter_and_are_complete_if_all_frames_were_received() {
    let one = LossCounters { received: 9, lost: 3, corrupt: 5, late: 7 };
    let other = LossCounters { received: 20, lost: 40, corrupt: 60, late: 80 };
    let both = LossCounters { received: 29, lost: 43, corrupt: 65, late: 87 };
    assert_eq!(one + other, both);
    assert_eq!(both.to_string(), "29 received, 43 lost, 65 corrupt, 87 late");
    assert!(!one.is_complete());
    let received = LossCounters { received: 9, ..LossCounters::default() };
    assert!(received.is_complete() && LossCounters::default().is_complete());
    for missing in [
        LossCounters { lost: 1, ..received },
        LossCounters { corrupt: 1, ..received },
        LossCounters { late: 1, ..received },
    ] {
        assert!(!missing.is_complete() && missing.total() == 10, "{missing}");
    }
}

#[test]
fn a_report_of_no_more_frames_than_have_come_changes_nothing() {
    let mut account = LossAccount::new();
    (0..3).for_each(|sequence| assert_eq!(account.frame(sequence), Arrival::Received));
    account.damaged(Check::Crc);
    let before = account.counters();
    for made in [1, 3] {
        account.made(made);
        assert_eq!((account.counters(), account.accounted()), (before, 3));
    }
    // The damaged packet still belongs to the gap that shows next.
    account.frame(4);
    let counted = LossCounters { received: 4, corrupt: 1, ..LossCounters::default() };
    assert_eq!(account.counters(), counted);
}

#[test]
fn a_late_frame_of_one_of_the_newest_1024_gaps_still_counts() {
    for (gaps, arrival) in [(1024, Arrival::Late), (1025, Arrival::Repeated)] {
        let mut account = LossAccount::new();
        (0..=gaps).for_each(|gap| assert_eq!(account.frame(2 * gap), Arrival::Received));
        assert_eq!(account.frame(1), arrival, "{gaps}");
    }
}
