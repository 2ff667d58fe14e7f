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
