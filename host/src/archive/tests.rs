use super::*;
use crate::files::measurement::encode;
use crate::provenance::tests::provenance;
use crate::provenance::{Origin, Taken};
use crate::reconstruct::{Recipe, Solver};
use crate::source::{FirstPatterns, Index, Source, SourceOptions};
use nirspi_recon::reconstruct::{Method, MethodSettings};
use nirspi_recon::{Measurements, Order, Sampling, Side};
use std::io::{Seek, SeekFrom};

fn solver() -> Solver {
    let recipe = Recipe {
        method: Method::default(),
        settings: MethodSettings::default(),
        dictionary: None,
        first: FirstPatterns::default(),
        sampling: Sampling::HALF,
    };
    Solver::new(recipe).unwrap()
}

pub(super) fn reader() -> RowReader {
    RowReader::new(SourceOptions::default(), solver())
}

/// A folder with `count` measurements of 4 x 4, and a folder for results.
pub(super) fn folder_of(count: usize) -> (tempfile::TempDir, PathBuf, PathBuf) {
    let root = tempfile::tempdir().unwrap();
    let (files, out) = (root.path().join("files"), root.path().join("table.parquet"));
    std::fs::create_dir(&files).unwrap();
    let rows = Order::ZigZag.rows(Side::new(4).unwrap()).unwrap();
    for k in 0..count {
        let d: Vec<f64> = (0..16).map(|i| ((k * 31 + i * 17) % 23) as f64 - 7.0).collect();
        let measured = Measurements::from_differential(&rows, &d).unwrap();
        let path = files.join(format!("{k:04}.npz"));
        let origin = if k % 2 == 0 { Origin::Simulated } else { Origin::Measured };
        let (origin, made) = (Taken::without_camera(origin), provenance().made);
        std::fs::write(&path, encode(&path, &measured, &origin.made(&made)).unwrap()).unwrap();
    }
    (root, files, out)
}

pub(super) fn options(out: &Path, jobs: usize, resume: bool) -> ArchiveOptions {
    let jobs = NonZeroUsize::new(jobs);
    ArchiveOptions { out: out.to_owned(), jobs, resume, shard: Shard::WHOLE }
}

fn run(work: &impl Work, options: &ArchiveOptions) -> Result<ArchiveReport, ArchiveError> {
    archive(work, options, &AtomicBool::new(false), &mut |_| {})
}

/// Items that count how often they are made, and stop the run at one of them.
pub(super) struct Stopping<'w> {
    pub(super) files: &'w ImageFiles,
    pub(super) stop: &'w AtomicBool,
    pub(super) at: usize,
    pub(super) made: std::sync::Mutex<Vec<usize>>,
}

impl Work for Stopping<'_> {
    fn names(&self) -> &[String] {
        self.files.names()
    }

    fn settings(&self) -> Map<String, Value> {
        self.files.settings()
    }

    fn rows(&self, item: usize) -> Result<Vec<Row>, String> {
        if item == self.at {
            self.stop.store(true, Ordering::Relaxed);
        }
        self.made.lock().unwrap().push(item);
        self.files.rows(item)
    }
}

#[test]
fn jobs_and_interruptions_change_no_byte() {
    let (_root, folder, out) = folder_of(600);
    let files = ImageFiles::of(&folder, reader()).unwrap();
    let report = run(&files, &options(&out, 1, false)).unwrap();
    assert_eq!((report.rows, report.files, report.files_before), (600, 600, 0));
    let one = std::fs::read(&out).unwrap();
    for jobs in [2, 5] {
        run(&files, &options(&out, jobs, false)).unwrap();
        assert!(std::fs::read(&out).unwrap() == one, "{jobs} jobs");
    }
    std::fs::remove_file(&out).unwrap();
    for at in [100, 290, 530] {
        let stop = AtomicBool::new(false);
        let work = Stopping { files: &files, stop: &stop, at, made: Vec::new().into() };
        let ended = archive(&work, &options(&out, 3, true), &stop, &mut |_| {});
        assert!(matches!(ended, Err(ArchiveError::Stopped { .. })), "{at}");
        assert!(!out.exists());
    }
    let report = run(&files, &options(&out, 3, true)).unwrap();
    assert_eq!((report.rows, report.files_before), (600, 512));
    assert!(std::fs::read(&out).unwrap() == one);
    assert!(!shelf::folder_of(&out).exists());
    // The table is whole: nothing is done again.
    let again = run(&files, &options(&out, 3, true)).unwrap();
    assert_eq!((again.rows, again.files_before, again.jobs), (600, 600, 0));
}

#[test]
fn a_killed_run_loses_the_group_in_hand_alone() {
    let (_root, folder, out) = folder_of(600);
    let files = ImageFiles::of(&folder, reader()).unwrap();
    run(&files, &options(&out, 2, false)).unwrap();
    let whole = std::fs::read(&out).unwrap();
    std::fs::remove_file(&out).unwrap();
    let stop = AtomicBool::new(false);
    let work = Stopping { files: &files, stop: &stop, at: 599, made: Vec::new().into() };
    archive(&work, &options(&out, 1, false), &stop, &mut |_| {}).unwrap_err();

    // What a kill leaves: a torn line, a part that no line names, or a part that is cut.
    let folder = shelf::folder_of(&out);
    let list = folder.join("list.jsonl");
    let text = std::fs::read_to_string(&list).unwrap();
    assert_eq!(text.lines().count(), 3, "a head and two parts");
    let second = text.lines().take(2).map(|line| line.len() + 1).sum::<usize>();
    let kept = |cut: usize, damage: &dyn Fn()| {
        std::fs::write(&list, &text[..cut]).unwrap();
        damage();
        let work = Stopping { files: &files, stop: &stop, at: 599, made: Vec::new().into() };
        stop.store(false, Ordering::Relaxed);
        archive(&work, &options(&out, 1, true), &stop, &mut |_| {}).unwrap_err();
        work.made.into_inner().unwrap()[0]
    };
    assert_eq!(kept(text.len(), &|| {}), 512);
    for cut in [second, second + 1, second + 40, text.len() - 1] {
        assert_eq!(kept(cut, &|| {}), 256, "{cut}");
    }
    let part = folder.join("000001.rows");
    let cut_part = || {
        let bytes = std::fs::read(&part).unwrap();
        std::fs::write(&part, &bytes[..bytes.len() - 1]).unwrap();
    };
    assert_eq!(kept(text.len(), &cut_part), 256);
    assert_eq!(kept(text.len(), &|| std::fs::remove_file(&part).unwrap()), 256);
    assert_eq!(run(&files, &options(&out, 2, true)).unwrap().rows, 600);
    assert!(std::fs::read(&out).unwrap() == whole);
}

#[test]
fn bad_files_are_listed_and_the_others_are_there() {
    let (root, folder, out) = folder_of(5);
    std::fs::write(folder.join("0001.npz"), b"PK damaged").unwrap();
    std::fs::write(folder.join("cut.mcap"), b"no recording").unwrap();
    let files = ImageFiles::of(&folder, reader()).unwrap();
    let report = run(&files, &options(&out, 2, false)).unwrap();
    assert_eq!((report.rows, report.files), (4, 6));
    let named: Vec<&str> = report.skipped.iter().map(|skipped| &*skipped.file).collect();
    assert_eq!(named, ["0001.npz", "cut.mcap"]);
    assert!(report.skipped.iter().all(|s| s.reason.contains(&s.file)), "{:?}", report.skipped);
    assert_eq!(report.complaint().unwrap(), "2 of 6 files gave no image and have no row");
    let again = run(&files, &options(&out, 2, true)).unwrap();
    assert_eq!((again.skipped, again.rows), (report.skipped, 4));

    // Files that come and go during an interrupted run.
    let out = root.path().join("other.parquet");
    let stop = AtomicBool::new(true);
    archive(&files, &options(&out, 1, false), &stop, &mut |_| {}).unwrap_err();
    std::fs::rename(folder.join("0002.npz"), folder.join("9999.npz")).unwrap();
    let files = ImageFiles::of(&folder, reader()).unwrap();
    let report = run(&files, &options(&out, 1, true)).unwrap();
    assert_eq!((report.rows, report.files), (3, 6));
    assert_eq!(report.skipped[1].reason, "the file is no longer there");
}

#[test]
fn a_row_is_what_reconstruct_gives_of_the_file() {
    let (_root, folder, _) = folder_of(1);
    let path = folder.join("0000.npz");
    let rows = reader().rows(&path, "0000.npz").unwrap();
    let source = Source::read(&path, &SourceOptions::default()).unwrap();
    let solved = solver().solve(&path, &source).unwrap();
    let [row] = &rows[..] else { panic!("{rows:?}") };
    assert_eq!(row.image.as_deref(), Some(solved.image.pixels()));
    assert_eq!((row.d.as_slice(), row.simulated), (source.measurements.values(), Some(true)));
    assert_eq!((row.n, row.image_id.as_str(), row.index), (4, "0000.npz", Some(0)));
    let meta: Value = serde_json::from_str(&row.meta).unwrap();
    assert_eq!(meta["reconstruction"]["used"], 8);

    let recording = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/recordings/v1.mcap");
    let sum = reader().rows(&recording, "rec").unwrap();
    let source = Source::read(&recording, &SourceOptions::default()).unwrap();
    let solved = solver().solve(&recording, &source).unwrap();
    assert_eq!(sum.len(), 1);
    assert_eq!(sum[0].image.as_deref(), Some(solved.image.pixels()));
    assert!(sum[0].serial.is_some() && sum[0].time_ns.is_none());
    let all = SourceOptions { index: Some(Index::All), ..SourceOptions::default() };
    let frames = RowReader::new(all.clone(), solver()).rows(&recording, "rec").unwrap();
    let sources = Source::read_all(&recording, &all).unwrap();
    assert_eq!((frames.len(), sources.len()), (12, 12));
    for (frame, source) in frames.iter().zip(&sources) {
        let solved = solver().solve(&recording, source).unwrap();
        assert_eq!(frame.image.as_deref(), Some(solved.image.pixels()));
        assert!(frame.time_ns.is_some() && frame.sequence.is_some());
    }
    assert_eq!(frames[3].image_id, "rec#3");
}

#[test]
fn a_run_that_does_not_fit_is_refused_and_nothing_is_lost() {
    let (_root, folder, out) = folder_of(3);
    let files = ImageFiles::of(&folder, reader()).unwrap();
    let stop = AtomicBool::new(true);
    archive(&files, &options(&out, 1, false), &stop, &mut |_| {}).unwrap_err();
    let error = run(&files, &options(&out, 1, false)).unwrap_err().to_string();
    assert!(error.contains("an earlier run was interrupted: continue it with --resume"), "{error}");
    let mut other = options(&out, 1, true);
    other.shard = "1/2".parse().unwrap();
    let error = run(&files, &other).unwrap_err().to_string();
    assert!(error.contains(r#"(shard: found "1/1", expected "1/2")"#), "{error}");

    let list = std::fs::File::open(shelf::folder_of(&out).join("list.jsonl")).unwrap();
    list.lock().unwrap();
    let error = run(&files, &options(&out, 1, true)).unwrap_err().to_string();
    assert!(error.contains("another process writes this table"), "{error}");
    list.unlock().unwrap();

    assert_eq!(run(&files, &options(&out, 1, true)).unwrap().rows, 3);
    let error = run(&files, &other).unwrap_err().to_string();
    assert!(error.contains("made with other settings"), "{error}");
    std::fs::write(&out, b"PAR1 no table PAR1").unwrap();
    let error = run(&files, &options(&out, 1, true)).unwrap_err().to_string();
    assert!(error.contains("no table of `nirspi reconstruct`"), "{error}");
}

#[test]
fn a_part_has_the_rows_of_the_whole_table() {
    let (root, folder, out) = folder_of(9);
    std::fs::write(folder.join("0004.npz"), b"PK damaged").unwrap();
    let files = ImageFiles::of(&folder, reader()).unwrap();
    run(&files, &options(&out, 2, false)).unwrap();
    let stop = AtomicBool::new(false);
    let part = |items, name| {
        let out = root.path().join(name);
        (archive_part(&files, items, &out, &stop).unwrap(), std::fs::read(out).unwrap())
    };
    let (report, bytes) = part(3..9, "a.parquet");
    assert_eq!((report.rows, report.files, &*report.skipped[0].file), (5, 6, "0004.npz"));
    assert_eq!(part(3..9, "b.parquet").1, bytes);
    // One column of the table is stored as it is: readings follow one another in both.
    let whole = std::fs::read(&out).unwrap();
    let d = Source::read(&folder.join("0007.npz"), &SourceOptions::default()).unwrap();
    let d: Vec<u8> = d.measurements.values().iter().flat_map(|value| value.to_le_bytes()).collect();
    for table in [&whole, &bytes] {
        assert!(table.windows(d.len()).any(|window| window == d));
    }
    let error = archive_part(&files, 3..10, &out, &stop).unwrap_err().to_string();
    assert_eq!(error, "items 3 to 10, expected a part of 0 to 9");
    stop.store(true, Ordering::Relaxed);
    let none = root.path().join("none.parquet");
    archive_part(&files, 0..2, &none, &stop).unwrap_err();
    assert!(!none.exists());
}

#[test]
fn shards_together_hold_every_file_once() {
    let (root, folder, _) = folder_of(7);
    let files = ImageFiles::of(&folder, reader()).unwrap();
    let mut rows = 0;
    for part in 1..=9 {
        let out = root.path().join(format!("{part}.parquet"));
        let shard = format!("{part}/9").parse().unwrap();
        let report = run(&files, &ArchiveOptions { shard, ..options(&out, 2, false) }).unwrap();
        assert_eq!(report.rows, u64::from(part <= 7), "share {part}");
        rows += report.rows;
        let mut file = std::fs::File::open(&out).unwrap();
        file.seek(SeekFrom::Start(0)).unwrap();
        assert!(crate::parquet::about(&mut file, journal::ABOUT).unwrap().is_some());
    }
    assert_eq!(rows, 7);
}
