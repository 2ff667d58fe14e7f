//! The host's clock, the time base of its camera.

use nirspi_files::clock::{Instant, since_1970};

/// Nanoseconds since 1970 by a clock that does not jump: the system's time of its start, and what
/// has passed since.
#[derive(Debug, Clone, Copy)]
pub struct HostClock {
    began: Instant,
    began_ns: u64,
}

impl HostClock {
    /// A clock that is set by the system's time now.
    #[must_use]
    pub fn new() -> Self {
        let began_ns = u64::try_from(since_1970().as_nanos()).unwrap_or(u64::MAX);
        Self { began: Instant::now(), began_ns }
    }

    /// The time of a moment, in ns since 1970. A moment before the clock's start counts as its start.
    #[must_use]
    pub fn ns_of(&self, moment: Instant) -> u64 {
        let passed = moment.saturating_duration_since(self.began).as_nanos();
        self.began_ns.saturating_add(u64::try_from(passed).unwrap_or(u64::MAX))
    }
}

impl Default for HostClock {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn moments_are_as_far_apart_as_they_were() {
        let clock = HostClock::new();
        let now = Instant::now();
        let later = clock.ns_of(now + Duration::from_millis(7)) - clock.ns_of(now);
        assert_eq!(later, 7_000_000);
        let since = u64::try_from(since_1970().as_nanos()).unwrap();
        assert!(clock.ns_of(Instant::now()).abs_diff(since) < 1_000_000_000);
    }
}
