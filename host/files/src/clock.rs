//! The clock of this program: the operating system's, or the page's where a browser runs the program.
//!
//! WebAssembly without an operating system has no clock. The page gives one with `set`; until then,
//! time stands still.

use std::time::Duration;

#[cfg(not(target_family = "wasm"))]
pub use std::time::Instant;

#[cfg(target_family = "wasm")]
pub use page::{Instant, set};

/// Time since 1970.
#[must_use]
pub fn since_1970() -> Duration {
    #[cfg(not(target_family = "wasm"))]
    return std::time::UNIX_EPOCH.elapsed().unwrap_or_default();
    #[cfg(target_family = "wasm")]
    return page::now();
}

/// Year, month, day, hour, minute and second of a moment, in UTC. The Gregorian calendar is computed
/// with years that begin in March, so that a leap day is the last day of a year (H. Hinnant,
/// *chrono-Compatible Low-Level Date Algorithms*, `civil_from_days`).
fn calendar(unix_s: u64) -> [u64; 6] {
    // Days from 1 March of year 0 to 1 January 1970; an era is 400 years.
    const DAYS_BEFORE_1970: u64 = 719_468;
    const DAYS_OF_ERA: u64 = 146_097;
    let (days, seconds) = (unix_s / 86_400 + DAYS_BEFORE_1970, unix_s % 86_400);
    let (era, day) = (days / DAYS_OF_ERA, days % DAYS_OF_ERA);
    let year = (day - day / 1460 + day / 36_524 - day / (DAYS_OF_ERA - 1)) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let month_from_march = (5 * day + 2) / 153;
    let day = day - (153 * month_from_march + 2) / 5 + 1;
    let month = (month_from_march + 2) % 12 + 1;
    let year = era * 400 + year + u64::from(month <= 2);
    [year, month, day, seconds / 3600, seconds / 60 % 60, seconds % 60]
}

/// A moment as `2026-11-20 08:30 UTC`.
#[must_use]
pub fn date(unix_s: u64) -> String {
    let [year, month, day, hour, minute, _] = calendar(unix_s);
    format!("{year}-{month:02}-{day:02} {hour:02}:{minute:02} UTC")
}

/// A moment in UTC as RFC 3339 writes it: `2026-11-25T08:30:00Z`.
#[must_use]
pub fn rfc3339(unix_s: u64) -> String {
    let [year, month, day, hour, minute, second] = calendar(unix_s);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
}

#[cfg(target_family = "wasm")]
mod page {
    use std::ops::{Add, AddAssign};
    use std::sync::OnceLock;
    use std::time::Duration;

    static CLOCK: OnceLock<fn() -> Duration> = OnceLock::new();

    /// Takes the time since 1970 from this function from now on. The first function stays.
    pub fn set(clock: fn() -> Duration) {
        CLOCK.get_or_init(|| clock);
    }

    pub(super) fn now() -> Duration {
        CLOCK.get().map_or(Duration::ZERO, |clock| clock())
    }

    /// A moment, as [`std::time::Instant`] is one.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
    pub struct Instant(Duration);

    impl Instant {
        /// This moment.
        #[must_use]
        pub fn now() -> Self {
            Self(now())
        }

        /// Time since this moment.
        #[must_use]
        pub fn elapsed(&self) -> Duration {
            Self::now().saturating_duration_since(*self)
        }

        /// Time from `earlier` to this moment; `None` if this moment was before.
        #[must_use]
        pub fn checked_duration_since(&self, earlier: Self) -> Option<Duration> {
            self.0.checked_sub(earlier.0)
        }

        /// Time from `earlier` to this moment; 0 if this moment was before.
        #[must_use]
        pub fn saturating_duration_since(&self, earlier: Self) -> Duration {
            self.0.saturating_sub(earlier.0)
        }
    }

    impl Add<Duration> for Instant {
        type Output = Self;

        fn add(self, time: Duration) -> Self {
            Self(self.0 + time)
        }
    }

    impl AddAssign<Duration> for Instant {
        fn add_assign(&mut self, time: Duration) {
            self.0 += time;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_moment_is_written_as_rfc_3339_says() {
        assert_eq!(rfc3339(0), "1970-01-01T00:00:00Z");
        assert_eq!(rfc3339(1_709_251_199), "2024-02-29T23:59:59Z");
    }

    #[test]
    fn dates_are_those_of_the_calendar() {
        for (unix_s, expected) in [
            (0, "1970-01-01 00:00 UTC"),
            (951_827_696, "2000-02-29 12:34 UTC"),
            (1_709_251_199, "2024-02-29 23:59 UTC"),
            (1_709_251_200, "2024-03-01 00:00 UTC"),
            (4_107_542_400, "2100-03-01 00:00 UTC"),
        ] {
            assert_eq!(date(unix_s), expected);
        }
    }
}
