//! Writes frames of a feed as measurement files.
//!
//! # Invariant
//! A file is there whole or not at all, and `nirspi reconstruct FILE --index all` opens it without another option
//! (`tests::frames_are_files_that_say_what_they_hold`). The memory holds one piece, however many frames come; frames
//! beyond what one file may hold go into the next (`tests::what_one_file_cannot_hold_goes_into_the_next`).

use super::header::{FeedPatterns, Header};
use nirspi_files::FileError;
use nirspi_files::MAX_MEMORY_BYTES;
use nirspi_files::archive::{MAX_FIELD_BYTES, Members, write_members};
use nirspi_files::measurement::{READINGS, most_together};
use nirspi_files::npy::{encode, encode_text, header_of};
use nirspi_files::output::{Existing, Spool};
use nirspi_files::provenance::{self, Provenance};
use nirspi_recon::law::Form;
use std::io::{BufWriter, IntoInnerError, Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::JoinHandle;

/// Bytes that are copied at a time.
const PIECE: usize = 1 << 16;

/// Writes the frames of one feed.
#[derive(Debug)]
pub struct Recorder {
    path: PathBuf,
    overwrite: bool,
    about: Arc<About>,
    /// The most frames of a file.
    most: u64,
    spool: BufWriter<Spool>,
    /// Frames in the spool.
    held: u64,
    bytes: Vec<u8>,
    /// The file that is being completed.
    completing: Option<JoinHandle<Result<PathBuf, FileError>>>,
    recorded: Recorded,
}

/// What was written.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Recorded {
    /// The files, in the order of their frames.
    pub files: Vec<PathBuf>,
    /// Number of frames in all of them.
    pub frames: u64,
}

/// What a file says beside its readings.
#[derive(Debug)]
struct About {
    header: Header,
    provenance: Provenance,
}

impl Recorder {
    /// The first of `capture-1.npz`, `capture-2.npz`, ... that a folder has not.
    #[must_use]
    pub fn first_free(folder: &Path) -> PathBuf {
        let mut names = (1_u32..).map(|number| folder.join(format!("capture-{number}.npz")));
        names.find(|name| !name.exists()).unwrap_or_default()
    }

    /// Begins a recording. The first file is `path`; the next are `NAME-2.npz`, `NAME-3.npz` and so on. Without
    /// `overwrite`, a `path` that is taken is refused, and later names that are taken are left out.
    ///
    /// # Errors
    /// [`FileError`] if the name is taken, or the system refuses.
    pub fn begin(
        path: &Path,
        overwrite: bool,
        header: &Header,
        provenance: &Provenance,
    ) -> Result<Self, FileError> {
        Existing::of(overwrite, None).check(path)?;
        let (readings, kind) = (header.readings() as u64, header.recorded());
        // What a reader takes of a field, as it is in the file and as it is in memory.
        let numbers = (MAX_FIELD_BYTES / kind.bytes() as u64).min(MAX_MEMORY_BYTES / 8);
        let together = most_together(header.patterns(), header.size().area());
        let most = (numbers / readings).min(together).max(1);
        let about = About { header: header.clone(), provenance: provenance.clone() };
        Ok(Self {
            path: path.to_owned(),
            overwrite,
            about: Arc::new(about),
            most,
            spool: BufWriter::with_capacity(PIECE, Spool::beside(path)?),
            held: 0,
            bytes: Vec::new(),
            completing: None,
            recorded: Recorded::default(),
        })
    }

    /// Adds a frame.
    ///
    /// # Errors
    /// [`FileError`] if the system refuses.
    ///
    /// # Panics
    /// If these are not the readings of a frame.
    pub fn push(&mut self, readings: &[f64]) -> Result<(), FileError> {
        assert_eq!(readings.len(), self.about.header.readings(), "readings of a frame");
        if self.held == self.most {
            self.complete()?;
        }
        let kind = self.about.header.recorded();
        self.bytes.clear();
        readings.iter().for_each(|&reading| kind.append(reading, &mut self.bytes));
        self.spool
            .write_all(&self.bytes)
            .map_err(|error| FileError::io(&self.path, "write", error))?;
        self.held += 1;
        self.recorded.frames += 1;
        Ok(())
    }

    /// Completes the last file. Without any frame, none is written.
    ///
    /// # Errors
    /// [`FileError`] if a name is taken, or the system refuses.
    pub fn finish(mut self) -> Result<Recorded, FileError> {
        if self.held > 0 {
            self.complete()?;
        }
        self.completed()?;
        Ok(self.recorded)
    }

    /// Lets a thread complete the file of the frames so far, while frames go on into the next.
    fn complete(&mut self) -> Result<(), FileError> {
        self.completed()?;
        let path = match self.recorded.files.len() {
            0 => self.path.clone(),
            written => self.next_name(written + 1),
        };
        let failed = |error| FileError::io(&self.path, "write", error);
        let next = BufWriter::with_capacity(PIECE, Spool::beside(&self.path)?);
        let full = std::mem::replace(&mut self.spool, next);
        let spool = full.into_inner().map_err(IntoInnerError::into_error).map_err(failed)?;
        let (about, frames, overwrite) = (Arc::clone(&self.about), self.held, self.overwrite);
        self.held = 0;
        let completing = std::thread::Builder::new()
            .name("recording".to_owned())
            .spawn(move || about.write(path, overwrite, frames, spool))
            .map_err(failed)?;
        self.completing = Some(completing);
        Ok(())
    }

    /// The name of a further file. A name that is taken must not cost its frames.
    fn next_name(&self, number: usize) -> PathBuf {
        let stem = self.path.file_stem().unwrap_or_default().to_string_lossy();
        let mut names = (number..).map(|at| self.path.with_file_name(format!("{stem}-{at}.npz")));
        names.find(|name| self.overwrite || !name.exists()).unwrap_or_default()
    }

    /// Waits for the file that is being completed.
    fn completed(&mut self) -> Result<(), FileError> {
        let Some(completing) = self.completing.take() else { return Ok(()) };
        let died = |_| {
            let died = std::io::Error::other("the thread of the recording died");
            FileError::io(&self.path, "write", died)
        };
        let path = completing.join().map_err(died)??;
        self.recorded.files.push(path);
        Ok(())
    }
}

impl About {
    fn write(
        &self,
        path: PathBuf,
        overwrite: bool,
        frames: u64,
        spool: Spool,
    ) -> Result<PathBuf, FileError> {
        let Self { header, provenance } = self;
        let existing = Existing::of(overwrite, None);
        write_members(&path, existing, |zip| {
            let one = |number: usize| encode(&[], &[number as i64]);
            match &header.shown {
                FeedPatterns::Hadamard { side, rows } => {
                    let rows: Vec<i64> = rows.iter().map(|&row| row.into()).collect();
                    zip.add("n", &one(side.pixels()))?;
                    zip.add("h_row", &encode(&[rows.len()], &rows))?;
                }
                FeedPatterns::Own { size, .. } => {
                    zip.add("height", &one(size.height()))?;
                    zip.add("width", &one(size.width()))?;
                }
            }
            zip.add(provenance::FIELD, &encode_text(&provenance.json()))?;
            for (field, text) in [("unit", &header.unit), ("name", &header.name)] {
                text.as_ref().map_or(Ok(()), |text| zip.add(field, &encode_text(text)))?;
            }
            if let Some(simulated) = header.simulated {
                zip.add("simulated", &encode(&[], &[i64::from(simulated)]))?;
            }
            let field = match header.form {
                Form::Differences => "d",
                form => {
                    zip.add(READINGS, &encode_text(form.name()))?;
                    "y"
                }
            };
            zip.begin(field)?;
            let shape = [frames as usize, header.readings()];
            zip.write(&header_of(header.recorded().descr(), &shape))?;
            copy(&path, spool, zip)
        })?;
        Ok(path)
    }
}

/// Copies everything in the spool into the member that was begun.
fn copy(path: &Path, mut spool: Spool, zip: &mut Members<'_>) -> Result<(), FileError> {
    let failed = |error| FileError::io(path, "write", error);
    spool.rewind().map_err(failed)?;
    let mut piece = vec![0; PIECE];
    loop {
        match spool.read(&mut piece).map_err(failed)? {
            0 => return Ok(()),
            count => zip.write(&piece[..count])?,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_files::measurement::{self, Readings, Selection};
    use nirspi_files::provenance::{Made, Taken};

    fn provenance() -> Provenance {
        Taken::of_file(Path::new("feed"), None).made(&Made::by("nirspi", None, [""; 0], 0))
    }

    fn header(form: &str, more: &str) -> Header {
        let text = format!("{{\"n\":2,\"h_row\":[0,3],\"readings\":\"{form}\"{more}}}");
        text.parse().unwrap()
    }

    #[test]
    fn frames_are_files_that_say_what_they_hold() {
        let folder = tempfile::tempdir().unwrap();
        for (form, kind) in
            [("pairs", "i16"), ("halves", "f32"), ("single", "text"), ("differences", "i32")]
        {
            let header =
                header(form, &format!(",\"numbers\":\"{kind}\",\"simulated\":true,\"unit\":\"V\""));
            let path = folder.path().join(format!("{form}.npz"));
            let mut recorder = Recorder::begin(&path, false, &header, &provenance()).unwrap();
            let frames = [[1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, -8.0]];
            for frame in frames {
                recorder.push(&frame[..header.readings()]).unwrap();
                assert!(!path.exists(), "not before it is whole");
            }
            let recorded = recorder.finish().unwrap();
            assert_eq!(recorded, Recorded { files: vec![path.clone()], frames: 2 });
            let want = Selection { index: Some(1), ..Selection::default() };
            let found = measurement::read(&path, &want).unwrap();
            let expected = match form {
                "pairs" => Readings::Pairs(vec![5.0, 6.0, 7.0, -8.0]),
                "halves" => Readings::Pairs(vec![5.0, 7.0, 6.0, -8.0]),
                "single" => Readings::Single(vec![5.0, 6.0]),
                _ => Readings::Differential(vec![5.0, 6.0]),
            };
            assert_eq!((found.readings, found.claim.form.name()), (expected, form));
            assert_eq!((&*found.h_row, found.taken.simulated()), (&[0, 3][..], Some(true)));
            // What the user says beats what the file says.
            let form = Some(Form::Single);
            if header.form == Form::Halves {
                let refused = measurement::read(&path, &Selection { form, ..want }).unwrap_err();
                assert!(refused.to_string().contains("`y` has shape (2, 4)"), "{refused}");
            }
        }
        let left = std::fs::read_dir(folder.path()).unwrap().count();
        assert_eq!(left, 4, "hidden files are gone");
    }

    #[test]
    fn what_one_file_cannot_hold_goes_into_the_next() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rec.npz");
        let mut recorder =
            Recorder::begin(&path, false, &header("single", ""), &provenance()).unwrap();
        // As many as fit into memory with their images; of larger frames, as many numbers as are read.
        assert_eq!(recorder.most, most_together(2, 4));
        let large = r#"{"n":64,"order":"natural","readings":"pairs","numbers":"i16"}"#;
        let other = folder.path().join("other.npz");
        let large = Recorder::begin(&other, false, &large.parse().unwrap(), &provenance()).unwrap();
        assert_eq!(large.most, (512 << 20) / 8 / 8192);
        drop(large);
        recorder.most = 2;
        std::fs::write(folder.path().join("rec-3.npz"), b"somebody's").unwrap();
        for frame in 0..5 {
            recorder.push(&[f64::from(frame), 1.0]).unwrap();
        }
        let recorded = recorder.finish().unwrap();
        let names: Vec<_> =
            recorded.files.iter().map(|file| file.file_name().unwrap().to_str().unwrap()).collect();
        assert_eq!((names, recorded.frames), (vec!["rec.npz", "rec-2.npz", "rec-4.npz"], 5));
        let want = Selection { index: Some(0), ..Selection::default() };
        let last = measurement::read(&recorded.files[2], &want).unwrap();
        assert_eq!(last.readings, Readings::Single(vec![4.0, 1.0]));
        let taken = Recorder::begin(&path, false, &header("single", ""), &provenance());
        assert!(taken.unwrap_err().to_string().contains("is there already"));
    }

    #[test]
    fn a_recording_without_frames_or_that_is_dropped_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rec.npz");
        let begin = || Recorder::begin(&path, false, &header("single", ""), &provenance()).unwrap();
        assert_eq!(begin().finish().unwrap(), Recorded::default());
        let mut recorder = begin();
        recorder.push(&[1.0, 2.0]).unwrap();
        drop(recorder);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
