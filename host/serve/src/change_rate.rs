//! Limits how often one client may change the camera: settings, scene, and light that goes on.
//!
//! Every change may restart a run, so a program that sends changes without end would leave other
//! clients no image.
//!
//! # Invariant
//! A client has [`BURST`] changes at once, and [`PER_SECOND`] a second in the long run; other
//! clients are not affected (`tests::a_client_has_a_burst_and_then_its_rate`). Switching the light off
//! is no change and is never refused
//! (`a_client_that_changes_settings_without_end_is_slowed_down_and_can_always_stop` in
//! `host/serve/src/tests.rs`).

use std::collections::BTreeMap;
use std::net::IpAddr;
use std::time::{Duration, Instant};

/// The changes of one client in a second, in the long run. A slider that is dragged sends fewer.
pub const PER_SECOND: u32 = 20;
/// The changes that a client may send at once.
pub const BURST: u32 = 100;

/// What one change takes from the burst, until so much time has passed.
const PRICE: Duration = Duration::from_nanos(1_000_000_000 / PER_SECOND as u64);

/// The changes of all clients.
#[derive(Debug, Default)]
pub struct ChangeRate {
    /// For each client the moment at which it has its whole burst again.
    whole_at: BTreeMap<IpAddr, Instant>,
}

impl ChangeRate {
    /// Counts a change of this client. Returns `false` if the change must be refused; then it does
    /// not count.
    pub fn admit(&mut self, client: IpAddr, now: Instant) -> bool {
        // A client that has its whole burst is like one that has never come.
        self.whole_at.retain(|_, whole_at| *whole_at > now);
        let whole_at = self.whole_at.get(&client).copied().unwrap_or(now) + PRICE;
        let admitted = whole_at - now <= PRICE * BURST;
        if admitted {
            self.whole_at.insert(client, whole_at);
        }
        admitted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: IpAddr = IpAddr::V4(std::net::Ipv4Addr::LOCALHOST);
    const B: IpAddr = IpAddr::V6(std::net::Ipv6Addr::LOCALHOST);

    #[test]
    fn a_client_has_a_burst_and_then_its_rate() {
        let (mut rate, start) = (ChangeRate::default(), Instant::now());
        let mut admitted = |client, ms| {
            let now = start + Duration::from_millis(ms);
            (0..1000).filter(|_| rate.admit(client, now)).count() as u32
        };
        assert_eq!(admitted(A, 0), BURST);
        assert_eq!(admitted(B, 0), BURST, "another client");
        for second in 1..5 {
            assert_eq!(admitted(A, 1000 * second), PER_SECOND);
        }
        // After a rest the whole burst is there, and no more.
        assert_eq!(admitted(A, 60_000), BURST);
    }

    #[test]
    fn clients_that_are_gone_take_no_memory() {
        let (mut rate, start) = (ChangeRate::default(), Instant::now());
        for number in 0..10_000_u32 {
            let now = start + Duration::from_millis(number.into());
            assert!(rate.admit(IpAddr::from(number.to_be_bytes()), now));
            assert!(rate.whole_at.len() <= 1 + PRICE.as_millis() as usize);
        }
    }
}
