//! Chooses the file of a recording, and protects existing files.
//!
//! # Invariant
//! A recording is written into a file that this program has just made, or into a device. An
//! existing file is never opened for writing (`tests::two_recordings_at_once_take_two_names`,
//! `tests::a_file_that_is_there_is_left_alone`). An existing file is replaced only when the new
//! recording is whole and on the disk
//! (`tests::the_old_recording_goes_when_the_new_one_stands_and_not_before`).

use super::split::{Split, name_of, part_path, taken_part};
use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread::JoinHandle;
use std::time::Duration;

/// The longest time before the system is told to write a recording's data to the disk.
const SYNC_EVERY: Duration = Duration::from_secs(5);
/// The most names to try.
const NAMES: u32 = 100_000;

/// The target of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Target {
    /// A file of this name, which must not exist; or a device.
    New(PathBuf),
    /// A file of this name. An existing file is replaced when the new recording is whole. Until
    /// then the new recording is next to the existing file, as `NAME.new.mcap`.
    Replace(PathBuf),
    /// The first free name of `capture-1.mcap`, `capture-2.mcap` ... in this folder.
    FirstFree(PathBuf),
    /// Several files, `NAME-0001.mcap`, `NAME-0002.mcap` ... for this `NAME.mcap`. None of them may exist.
    Parts(PathBuf, Split),
    /// The same for the first name of `capture-1.mcap`, `capture-2.mcap` ... in this folder of which
    /// nothing exists.
    FirstFreeParts(PathBuf, Split),
}

impl Target {
    /// The path of the file or folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        match self {
            Self::New(path) | Self::Replace(path) | Self::FirstFree(path) => path,
            Self::Parts(path, _) | Self::FirstFreeParts(path, _) => path,
        }
    }

    /// When the recording goes on in another file; `None` for a recording in one file.
    #[must_use]
    pub fn split(&self) -> Option<Split> {
        match self {
            Self::New(_) | Self::Replace(_) | Self::FirstFree(_) => None,
            Self::Parts(_, split) | Self::FirstFreeParts(_, split) => Some(*split),
        }
    }

    /// What exists already under a name of this recording, if nothing of that name may exist.
    #[must_use]
    pub fn taken(&self) -> Option<PathBuf> {
        match self {
            Self::New(path) => path.exists().then(|| path.clone()),
            // A folder that cannot be read is an error when the file is made.
            Self::Parts(path, _) => taken_part(path).ok().flatten(),
            Self::Replace(_) | Self::FirstFree(_) | Self::FirstFreeParts(..) => None,
        }
    }
}

/// The file that a recording is written into.
#[derive(Debug)]
pub(super) struct Place {
    path: PathBuf,
    /// The name that the file gets when it is whole.
    replaces: Option<PathBuf>,
    /// Whether the path is a device. A device existed before and is not removed.
    device: bool,
    syncer: Option<Syncer>,
}

impl Place {
    /// Makes the file.
    ///
    /// # Errors
    /// [`io::ErrorKind::AlreadyExists`] if the name is taken, or the system's error.
    pub(super) fn make(target: &Target) -> io::Result<(Self, File)> {
        match target {
            Target::New(path) | Target::Replace(path) if is_device(path) => {
                let file = OpenOptions::new().write(true).open(path)?;
                Ok((Self { path: path.clone(), replaces: None, device: true, syncer: None }, file))
            }
            Target::New(path) => Self::of_new(path.clone(), None).map_err(|error| {
                let taken = error.kind() == io::ErrorKind::AlreadyExists;
                let advice = "the file is there already, choose another name";
                if taken { io::Error::new(error.kind(), advice) } else { error }
            }),
            Target::Replace(path) => match Self::of_new(path.clone(), None) {
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Self::beside(path),
                made => made,
            },
            Target::FirstFree(folder) => {
                first_free(|n| Some(folder.join(format!("capture-{n}.mcap"))), None)
            }
            Target::Parts(whole, _) => {
                if is_device(whole) {
                    let problem = "a device, expected the name of a file to be split";
                    return Err(io::Error::new(io::ErrorKind::InvalidInput, problem));
                }
                match taken_part(whole)? {
                    Some(taken) => Err(is_taken(&taken)),
                    None => Self::of_part(part_path(whole, 1)),
                }
            }
            Target::FirstFreeParts(folder, _) => {
                taken_part(&folder.join("capture.mcap"))?;
                let name = |n: u32| {
                    let whole = folder.join(format!("capture-{n}.mcap"));
                    matches!(taken_part(&whole), Ok(None)).then(|| part_path(&whole, 1))
                };
                first_free(name, None)
            }
        }
    }

    /// Makes a file of a run in several files.
    fn of_part(path: PathBuf) -> io::Result<(Self, File)> {
        Self::of_new(path.clone(), None).map_err(|error| match error.kind() {
            io::ErrorKind::AlreadyExists => is_taken(&path),
            _ => error,
        })
    }

    /// Makes a new file next to the file that it will replace. A link stays, and the file behind
    /// the link is replaced.
    fn beside(path: &Path) -> io::Result<(Self, File)> {
        if path.is_dir() {
            return Err(io::ErrorKind::IsADirectory.into());
        }
        let path = if path.is_symlink() { fs::canonicalize(path)? } else { path.to_owned() };
        let name = |n: u32| {
            let mut name = OsString::from(path.file_stem().unwrap_or_default());
            name.push(if n == 1 { ".new.mcap".to_owned() } else { format!(".new-{n}.mcap") });
            path.with_file_name(name)
        };
        first_free(|n| Some(name(n)), Some(&path))
    }

    fn of_new(path: PathBuf, replaces: Option<PathBuf>) -> io::Result<(Self, File)> {
        let file = File::create_new(&path)?;
        let syncer = Some(Syncer::start(file.try_clone()?));
        Ok((Self { path, replaces, device: false, syncer }, file))
    }

    /// The current path of the file.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Writes the whole file to the disk. With `replace`, the file then takes the name of the file
    /// that it replaces.
    ///
    /// # Errors
    /// The system's error. The file then keeps its current name.
    pub(super) fn settle(&mut self, file: &File, replace: bool) -> io::Result<()> {
        if self.device {
            return Ok(());
        }
        if let Some(syncer) = self.syncer.take() {
            syncer.end()?;
        }
        file.sync_all()?;
        if let Some(target) = self.replaces.take_if(|_| replace) {
            fs::rename(&self.path, &target)?;
            self.path = target;
        }
        sync_folder_of(&self.path)
    }

    /// Removes the file, unless it is a device.
    pub(super) fn remove(self) {
        drop(self.syncer);
        if !self.device {
            // This program made the file, and the file holds no frame, so a failed removal is
            // harmless.
            let _ = fs::remove_file(&self.path);
        }
    }
}

fn is_taken(path: &Path) -> io::Error {
    let problem = format!("{} is there already, choose another name", name_of(path));
    io::Error::new(io::ErrorKind::AlreadyExists, problem)
}

/// The first free name of these names.
fn first_free(
    name: impl Fn(u32) -> Option<PathBuf>,
    replaces: Option<&Path>,
) -> io::Result<(Place, File)> {
    for path in (1..NAMES).filter_map(name) {
        match Place::of_new(path, replaces.map(Path::to_owned)) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            made => return made,
        }
    }
    Err(io::Error::new(io::ErrorKind::AlreadyExists, format!("{NAMES} recordings are there")))
}

/// Whether the path is neither a file nor a folder.
fn is_device(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir())
}

/// Syncs a name to the disk, on systems that can do so.
fn sync_folder_of(path: &Path) -> io::Result<()> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    nirspi_files::output::sync_folder(folder)
}

/// A thread that writes a file to the disk every few seconds, so that a slow disk delays no frame.
#[derive(Debug)]
struct Syncer {
    over: mpsc::Sender<()>,
    thread: JoinHandle<io::Result<()>>,
}

impl Syncer {
    fn start(file: File) -> Self {
        let (over, is_over) = mpsc::channel();
        let thread = std::thread::spawn(move || {
            while is_over.recv_timeout(SYNC_EVERY) == Err(RecvTimeoutError::Timeout) {
                file.sync_data()?;
            }
            Ok(())
        });
        Self { over, thread }
    }

    /// Stops the thread. Returns an error of the disk, because the system reports such an error
    /// only once.
    fn end(self) -> io::Result<()> {
        drop(self.over);
        self.thread.join().unwrap_or_else(|_| Err(io::Error::other("syncing the file panicked")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn two_recordings_at_once_take_two_names() {
        let folder = tempfile::tempdir().unwrap();
        let target = Target::FirstFree(folder.path().to_owned());
        let made: Vec<PathBuf> = std::thread::scope(|scope| {
            let makers: Vec<_> = (0..8)
                .map(|_| scope.spawn(|| Place::make(&target).unwrap().0.path().to_owned()))
                .collect();
            makers.into_iter().map(|maker| maker.join().unwrap()).collect()
        });
        let expected: Vec<String> = (1..=8).map(|n| format!("capture-{n}.mcap")).collect();
        assert_eq!(names(folder.path()), expected);
        assert!(made.iter().all(|path| made.iter().filter(|other| *other == path).count() == 1));
    }

    #[test]
    fn a_file_that_is_there_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rec.mcap");
        fs::write(&path, b"precious").unwrap();
        let error = Place::make(&Target::New(path.clone())).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::AlreadyExists);
        assert_eq!(error.to_string(), "the file is there already, choose another name");
        assert_eq!(fs::read(&path).unwrap(), b"precious");
    }

    #[test]
    fn the_old_recording_goes_when_the_new_one_stands_and_not_before() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rec.mcap");
        fs::write(&path, b"old").unwrap();
        // A file of an earlier run that was killed holds recorded data and stays.
        fs::write(folder.path().join("rec.new.mcap"), b"earlier").unwrap();
        let replace = Target::Replace(path.clone());
        let (mut place, mut file) = Place::make(&replace).unwrap();
        file.write_all(b"new").unwrap();
        assert_eq!(place.path(), folder.path().join("rec.new-2.mcap"));
        assert_eq!(fs::read(&path).unwrap(), b"old");
        place.settle(&file, true).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(names(folder.path()), ["rec.mcap", "rec.new.mcap"]);

        // The new recording is not whole, so both files stay.
        let (mut place, file) = Place::make(&replace).unwrap();
        place.settle(&file, false).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(names(folder.path()), ["rec.mcap", "rec.new-2.mcap", "rec.new.mcap"]);

        // Nothing was recorded, so only the new file is removed.
        let (place, _) = Place::make(&replace).unwrap();
        place.remove();
        assert_eq!(names(folder.path()), ["rec.mcap", "rec.new-2.mcap", "rec.new.mcap"]);
    }

    #[test]
    fn where_nothing_is_there_to_replace_the_recording_has_its_name_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rec.mcap");
        let (place, _) = Place::make(&Target::Replace(path.clone())).unwrap();
        assert_eq!(place.path(), path);
    }

    #[test]
    fn a_target_names_its_file_or_folder() {
        let path = Path::new("lab/rec.mcap");
        for target in [Target::New, Target::Replace, Target::FirstFree] {
            assert_eq!(target(path.to_owned()).path(), path);
        }
    }

    #[test]
    fn a_folder_is_no_file_and_a_missing_folder_is_told_as_missing() {
        let folder = tempfile::tempdir().unwrap();
        let kind = |target| {
            let error = Place::make(&target).unwrap_err();
            assert!(!error.to_string().contains("choose another name"), "{error}");
            error.kind()
        };
        assert_eq!(kind(Target::Replace(folder.path().to_owned())), io::ErrorKind::IsADirectory);
        let gone = folder.path().join("gone");
        assert_eq!(kind(Target::New(gone.join("rec.mcap"))), io::ErrorKind::NotFound);
        assert_eq!(kind(Target::FirstFree(gone)), io::ErrorKind::NotFound);
        assert_eq!(names(folder.path()), Vec::<String>::new());
    }

    #[cfg(unix)]
    #[test]
    fn a_device_is_written_to_and_stays() {
        // A link to the device stands in for the device, because a program that removes the device
        // itself, run as root, breaks the whole machine.
        let folder = tempfile::tempdir().unwrap();
        let device = folder.path().join("null");
        std::os::unix::fs::symlink("/dev/null", &device).unwrap();
        for target in [Target::New(device.clone()), Target::Replace(device.clone())] {
            let (mut place, mut file) = Place::make(&target).unwrap();
            file.write_all(b"frames").unwrap();
            // No system syncs this device.
            place.settle(&file, true).unwrap();
            assert_eq!(place.path(), device);
            place.remove();
            assert!(is_device(&device));
        }
    }

    #[cfg(unix)]
    #[test]
    fn the_folder_of_a_name_is_synced() {
        sync_folder_of(Path::new("a_name_alone.mcap")).unwrap();
        let error = sync_folder_of(Path::new("/no/such/folder/rec.mcap")).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::NotFound);
    }

    #[test]
    fn an_error_of_syncing_is_told_at_the_end() {
        let (over, _) = mpsc::channel();
        let full = || Err(io::ErrorKind::StorageFull.into());
        let syncer = Syncer { over, thread: std::thread::spawn(full) };
        assert_eq!(syncer.end().unwrap_err().kind(), io::ErrorKind::StorageFull);
        Syncer::start(tempfile::tempfile().unwrap()).end().unwrap();
    }
}
