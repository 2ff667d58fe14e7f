//! As `nirspi_serve`.

#[path = "../../../host/serve/src/light.rs"]
pub mod light;
#[path = "../../../host/serve/src/slot.rs"]
pub mod slot;

use loom::sync::{Mutex, MutexGuard};
use std::sync::PoisonError;

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// As `std::sync`.
pub mod sync {
    pub use loom::sync::Mutex;
    use loom::sync::MutexGuard;
    pub use loom::sync::atomic::{AtomicU64, Ordering};
    use std::sync::PoisonError;
    use std::time::Duration;

    /// A condition whose waits have no end but a notification. Where none comes, `loom` reports a deadlock.
    #[derive(Debug, Default)]
    pub struct Condvar(loom::sync::Condvar);

    impl Condvar {
        /// Wakes one thread.
        pub fn notify_one(&self) {
            self.0.notify_one();
        }

        /// Waits while the condition holds.
        ///
        /// # Errors
        /// If a thread panicked while it held the lock.
        pub fn wait_timeout_while<'a, T>(
            &self,
            mut guard: MutexGuard<'a, T>,
            _patience: Duration,
            mut condition: impl FnMut(&mut T) -> bool,
        ) -> Result<(MutexGuard<'a, T>, ()), PoisonError<(MutexGuard<'a, T>, ())>> {
            while condition(&mut guard) {
                guard = self.0.wait(guard).unwrap_or_else(PoisonError::into_inner);
            }
            Ok((guard, ()))
        }
    }
}
