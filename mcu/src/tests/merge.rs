//! Tests that packets of any length become transfers of one length.

use crate::Merger;
use proptest::prelude::*;
use std::vec::Vec;

const N: usize = 8;

/// What a reader on the other side gets: the transfers, and the bytes of each bulk read. With `passes`, bytes that
/// fill a transfer go out without a copy where they may.
fn send(packets: &[Vec<u8>], passes: bool) -> (Vec<Vec<u8>>, Vec<Vec<u8>>) {
    let mut merger = Merger::<N>::new();
    let mut transfers = Vec::new();
    for packet in packets {
        let mut rest = &packet[..];
        while !rest.is_empty() {
            if passes && rest.len() >= N && merger.lets_pass() {
                transfers.push(rest[..N].to_vec());
                rest = &rest[N..];
                continue;
            }
            let taken = merger.take(rest);
            rest = &rest[taken..];
            if merger.is_full() {
                transfers.push(merger.transfer().to_vec());
            }
        }
    }
    while !merger.is_done() {
        transfers.push(merger.transfer().to_vec());
    }
    let reads = transfers.split_inclusive(|t| t.len() < N).map(<[_]>::concat).collect();
    (transfers, reads)
}

proptest! {
    #[test]
    fn every_byte_goes_out_once_in_order_and_only_the_last_transfer_is_short(
        packets in proptest::collection::vec(proptest::collection::vec(any::<u8>(), 1..30), 1..10),
        passes: bool,
    ) {
        let (transfers, reads) = send(&packets, passes);
        prop_assert_eq!(transfers.concat(), packets.concat());
        let (last, full) = transfers.split_last().unwrap();
        prop_assert!(full.iter().all(|transfer| transfer.len() == N));
        prop_assert!(last.len() < N, "the reader is told the end");
        prop_assert_eq!(reads.len(), 1);
    }
}

#[test]
fn bytes_that_end_with_a_full_transfer_are_followed_by_an_empty_one() {
    for passes in [false, true] {
        let (transfers, _) = send(&[Vec::from([7; 16])], passes);
        assert_eq!(transfers.iter().map(Vec::len).collect::<Vec<_>>(), [8, 8, 0]);
    }
}

#[test]
fn bytes_pass_by_where_nothing_is_gathered_and_only_there() {
    let mut merger = Merger::<N>::new();
    assert!(merger.lets_pass());
    assert!(!merger.is_done(), "a full transfer has passed");
    merger.take(&[1]);
    assert!(!merger.lets_pass(), "the bytes before would come after these");
}

#[test]
fn nothing_is_sent_where_nothing_was() {
    assert!(Merger::<N>::new().is_done());
    let mut merger = Merger::<N>::new();
    merger.take(&[1]);
    assert_eq!(merger.transfer(), [1]);
    assert!(merger.is_done(), "a short transfer has ended the read already");
}
