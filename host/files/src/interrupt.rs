//! Ends the program in order at Ctrl-C or another signal.
//!
//! One rule for all commands: a signal that was ignored when the program began, as `nohup` does with the end
//! of the terminal, stays ignored. At any other, a command that can stop by itself is asked to stop, and any
//! other command ends at once, and what it has staged is removed, as when it fails. Ctrl-C is the user's wish;
//! the end of the terminal and a termination are not ([`Signal::is_wish`]).
//!
//! # Invariant
//! An interrupted run leaves no staged file and no folder of its own
//! (`tests::what_is_staged_at_an_interrupt_is_removed`).

use std::fmt;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

static STOP: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// The number of the first signal that has come; 0 before.
static FIRST: AtomicI32 = AtomicI32::new(0);

/// A signal at which the program ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Signal {
    /// Ctrl-C, SIGINT.
    Interrupt,
    /// SIGTERM, by which a service manager or a shutdown ends a program.
    Terminate,
    /// SIGHUP, the end of the terminal.
    Hangup,
}

impl Signal {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Interrupt, Self::Terminate, Self::Hangup];

    /// The number of the signal.
    #[must_use]
    pub fn number(self) -> i32 {
        match self {
            Self::Hangup => 1,
            Self::Interrupt => 2,
            Self::Terminate => 15,
        }
    }

    /// Whether the signal is the wish of the user at the terminal.
    #[must_use]
    pub fn is_wish(self) -> bool {
        self == Self::Interrupt
    }

    /// Whether the program was started so that this signal does nothing. Known on Linux alone.
    #[must_use]
    #[allow(
        clippy::disallowed_methods,
        reason = "a file of the system that says that it has 0 bytes"
    )]
    pub fn is_ignored(self) -> bool {
        let Ok(status) = fs::read_to_string("/proc/self/status") else { return false };
        let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
        let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
        // Signal 1 is bit 0.
        ignored.is_some_and(|mask| mask >> (self.number() - 1) & 1 == 1)
    }
}

impl fmt::Display for Signal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Interrupt => "Ctrl-C",
            Self::Terminate => "a termination (SIGTERM)",
            Self::Hangup => "the end of the terminal (SIGHUP)",
        })
    }
}

/// The first signal that has come.
#[must_use]
pub fn first() -> Option<Signal> {
    let number = FIRST.load(Ordering::Relaxed);
    Signal::ALL.into_iter().find(|signal| signal.number() == number)
}

/// Files and folders of runs that are under way, in the order in which they were made.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Held while results take their names, so that an interrupt leaves all of them or none.
static PLACING: Mutex<()> = Mutex::new(());

pub(super) fn undisturbed() -> MutexGuard<'static, ()> {
    PLACING.lock().unwrap_or_else(PoisonError::into_inner)
}

fn unfinished() -> MutexGuard<'static, Vec<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A file or folder that an interrupted run removes, as long as this value lives.
#[derive(Debug)]
pub(crate) struct Noted(PathBuf);

impl Noted {
    /// Makes it, so that no interrupt comes between the making and the note.
    pub(crate) fn make<T>(
        path: &Path,
        make: impl FnOnce() -> io::Result<T>,
    ) -> io::Result<(T, Self)> {
        let mut all = unfinished();
        let made = make()?;
        all.push(path.to_owned());
        Ok((made, Self(path.to_owned())))
    }
}

impl Drop for Noted {
    fn drop(&mut self) {
        let mut all = unfinished();
        if let Some(at) = all.iter().rposition(|path| *path == self.0) {
            all.remove(at);
        }
    }
}

/// Acts on a signal, and ends the program unless its command was asked to stop. For a handler of signals.
pub fn act(signal: Signal) {
    let _ = FIRST.compare_exchange(0, signal.number(), Ordering::Relaxed, Ordering::Relaxed);
    if interrupt() {
        // As shells report a program that a signal has ended.
        std::process::exit(128 + signal.number());
    }
}

/// The flag by which a command learns that it must stop. A program that has this flag is asked once
/// before it ends at once.
#[must_use]
pub fn stop_flag() -> Arc<AtomicBool> {
    Arc::clone(STOP.get_or_init(Arc::default))
}

/// Returns whether the program must end. Then what was staged is removed, and nothing more is staged.
/// Otherwise the command was asked to stop.
fn interrupt() -> bool {
    if STOP.get().is_some_and(|stop| !stop.swap(true, Ordering::Relaxed)) {
        return false;
    }
    let (placing, all) = (undisturbed(), unfinished());
    remove(&all);
    std::mem::forget((placing, all));
    true
}

fn remove(paths: &[PathBuf]) {
    // Files were made after their folders. What cannot be removed stays.
    for path in paths.iter().rev() {
        let _ = if path.is_dir() { fs::remove_dir(path) } else { fs::remove_file(path) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::OutputDir;

    #[test]
    fn what_is_staged_at_an_interrupt_is_removed() {
        let root = tempfile::tempdir().unwrap();
        let names = |folder: &Path| fs::read_dir(folder).unwrap().count();
        let mut done = OutputDir::create(&root.path().join("done")).unwrap();
        done.write("a.npy", b"1").unwrap();
        done.commit().unwrap();
        let out = root.path().join("made/for/it");
        let mut dir = OutputDir::create(&out).unwrap();
        dir.write("a.npy", b"1").unwrap();
        dir.write("b.npy", b"2").unwrap();
        assert_eq!(names(&out), 2);
        // Other tests of this process stage files too.
        let ours: Vec<PathBuf> =
            unfinished().iter().filter(|path| path.starts_with(root.path())).cloned().collect();
        assert_eq!(ours.len(), 5, "three folders and two files: {ours:?}");
        remove(&ours);
        assert!(!root.path().join("made").exists());
        assert!(root.path().join("done/a.npy").exists());
        drop(dir);
        assert!(!unfinished().iter().any(|path| path.starts_with(root.path())));
    }
}
