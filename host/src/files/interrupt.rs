//! Ends the program in order at Ctrl-C or a termination signal.
//!
//! A command that can stop by itself is asked to stop. Any other command ends at once, and what it has staged
//! is removed, as when it fails.
//!
//! # Invariant
//! An interrupted run leaves no staged file and no folder of its own
//! (`tests::what_is_staged_at_an_interrupt_is_removed`).

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, Once, OnceLock, PoisonError};

/// The exit code of a program that ends at Ctrl-C.
const INTERRUPTED: i32 = 130;

static STOP: OnceLock<Arc<AtomicBool>> = OnceLock::new();

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

/// Has signals acted on, once in a program. `set` sets the handler.
///
/// # Errors
/// If `set` fails.
pub fn catch<E>(set: impl FnOnce(fn()) -> Result<(), E>) -> Result<(), E> {
    static CAUGHT: Once = Once::new();
    let mut caught = Ok(());
    CAUGHT.call_once(|| caught = set(act));
    caught
}

/// Acts on a signal, and ends the program unless its command was asked to stop.
fn act() {
    if let Some(code) = interrupt() {
        std::process::exit(code);
    }
}

/// The flag by which a command learns that it must stop. A program that has this flag is asked once
/// before it ends at once.
#[must_use]
pub fn stop_flag() -> Arc<AtomicBool> {
    Arc::clone(STOP.get_or_init(Arc::default))
}

/// Whether the program was started so that the end of the terminal does not end it, as `nohup`
/// does. A handler of signals would end that.
#[must_use]
pub fn ignores_hangup() -> bool {
    let Ok(status) = fs::read_to_string("/proc/self/status") else { return false };
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    // SIGHUP is signal 1, in bit 0.
    ignored.is_some_and(|mask| mask & 1 == 1)
}

/// Acts on a signal. `None`: the command was asked to stop. Otherwise what was staged is removed, and
/// the program must end with this exit code; until then nothing more is staged.
fn interrupt() -> Option<i32> {
    if STOP.get().is_some_and(|stop| !stop.swap(true, Ordering::Relaxed)) {
        return None;
    }
    let (placing, all) = (undisturbed(), unfinished());
    remove(&all);
    std::mem::forget((placing, all));
    Some(INTERRUPTED)
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
    use crate::files::output::OutputDir;

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
