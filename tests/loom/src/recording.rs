//! As `nirspi::recording`.

#[path = "../../../host/record/src/recording/spool.rs"]
mod spool;

use std::io::{self, Write};

/// As `std::sync` and `std::thread`.
mod sync {
    pub use loom::sync::{Arc, Mutex, MutexGuard};
    pub use loom::thread::{Builder as ThreadBuilder, JoinHandle};
    use std::sync::{LockResult, PoisonError};

    /// A condition, with the loop that `loom` leaves to its users.
    #[derive(Debug, Default)]
    pub struct Condvar(loom::sync::Condvar);

    impl Condvar {
        /// Wakes all threads.
        pub fn notify_all(&self) {
            self.0.notify_all();
        }

        /// Waits while the condition holds.
        ///
        /// # Errors
        /// If a thread panicked while it held the lock.
        pub fn wait_while<'a, T>(
            &self,
            mut guard: MutexGuard<'a, T>,
            mut condition: impl FnMut(&mut T) -> bool,
        ) -> LockResult<MutexGuard<'a, T>> {
            while condition(&mut guard) {
                guard = self.0.wait(guard).unwrap_or_else(PoisonError::into_inner);
            }
            Ok(guard)
        }
    }
}

/// The two ends of a recording's queue.
#[derive(Debug)]
pub struct Recording {
    spool: Option<spool::Spool>,
    disk: spool::Disk,
}

impl Recording {
    /// A queue of so many buffers in front of this file.
    #[must_use]
    pub fn new(to: impl Write + Send + 'static, most: usize) -> Self {
        let (spool, disk) = spool::start_with(to, most).expect("loom starts threads");
        Self { spool: Some(spool), disk }
    }

    /// Hands the bytes over as a buffer.
    ///
    /// # Errors
    /// Why the disk takes no more.
    pub fn hand_over(&mut self, bytes: &[u8]) -> io::Result<()> {
        let Some(spool) = &mut self.spool else { return Err(io::ErrorKind::NotConnected.into()) };
        spool.write_all(bytes)?;
        spool.flush()
    }

    /// Waits until the disk has taken everything that was handed over.
    ///
    /// # Errors
    /// Why the disk takes no more.
    pub fn settle(&self) -> io::Result<()> {
        self.disk.settle()
    }

    /// Ends both ends.
    ///
    /// # Errors
    /// Why the disk took no more.
    pub fn end(mut self) -> io::Result<()> {
        self.spool = None;
        self.disk.end()
    }
}
