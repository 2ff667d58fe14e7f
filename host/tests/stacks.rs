//! Stacks of more images than are worked on together: every image is there, in its order, and where one cannot be made,
//! those before it are.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use nirspi::files::{archive, npy};
use nirspi::picture::FigureStyle;
use nirspi::provenance::Made;
use nirspi::reconstruct::{Pipeline, PipelineError, Recipe, ResultFolder, Solver, StackReport};
use nirspi::source::{FirstPatterns, Source, SourceOptions, Sources};
use nirspi::stage_times::StageTimes;
use nirspi_recon::reconstruct::{AT_A_TIME, Method, MethodSettings};
use nirspi_recon::{Backend, Sampling};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

const PATTERNS: usize = 16;

fn made() -> Made {
    Made::by("nirspi 0.1.0", None, ["nirspi", "reconstruct"], 1_764_059_400)
}

fn solver(method: Method) -> Solver {
    let (first, sampling) = (FirstPatterns::Recorded, Sampling::ALL);
    let settings = MethodSettings::default();
    Solver::new(Recipe { method, settings, dictionary: None, first, sampling }).unwrap()
}

/// The differences of one measurement of 4 x 4.
fn readings(number: usize) -> Vec<f64> {
    (0..PATTERNS).map(|k| if k == 0 { 900.0 } else { ((k * 7 + number) % 31) as f64 }).collect()
}

/// A file of so many measurements, of which `spoil` changes some.
fn file(folder: &Path, count: usize, spoil: impl Fn(usize, &mut Vec<f64>)) -> PathBuf {
    let mut values = Vec::new();
    for number in 0..count {
        let mut one = readings(number);
        spoil(number, &mut one);
        values.extend(one);
    }
    let rows: Vec<i64> = (0..PATTERNS as i64).collect();
    let members = [
        ("n", npy::encode(&[], &[4_i64])),
        ("h_row", npy::encode(&[PATTERNS], &rows)),
        ("d", npy::encode(&[count, PATTERNS], &values)),
    ];
    let path = folder.join("many.npz");
    std::fs::write(&path, archive::encode(&path, &members).unwrap()).unwrap();
    path
}

/// The images of all measurements, as they are in image.npy, and the report.
fn images(
    file: &Path,
    going_on: impl Fn() -> bool + Sync,
) -> Result<(Vec<Vec<f32>>, StackReport), PipelineError> {
    let out = file.with_file_name("out");
    let (options, made) = (SourceOptions::default(), made());
    let folder = ResultFolder::of_file(file, &out, &made, FigureStyle::Paper);
    let sources = Sources::open(file, &options)?;
    let pipeline = Pipeline::new(solver(Method::HADAMARD));
    let report = pipeline.all(sources, &folder, &|_| going_on(), StageTimes::default())?;
    let stack = npy::read_stack(&out.join("image.npy")).unwrap();
    assert_eq!((stack.count, stack.height, stack.width), (report.frames.len(), 4, 4));
    let text = std::fs::read_to_string(out.join("report.json")).unwrap();
    let written: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(written["frames"].as_array().unwrap().len(), stack.count);
    assert_eq!(written["ended"].as_str(), report.ended.as_deref());
    Ok((stack.values.chunks(16).map(<[f32]>::to_vec).collect(), report))
}

/// The image of one measurement alone.
fn alone(number: usize) -> Vec<f32> {
    let folder = tempfile::tempdir().unwrap();
    let path = file(folder.path(), 1, |_, values| *values = readings(number));
    let source = Source::read(&path, &SourceOptions::default()).unwrap();
    solver(Method::HADAMARD).solve(&path, &source).unwrap().image.pixels().to_vec()
}

#[test]
fn a_stack_of_several_batches_has_all_images_in_their_order() {
    let folder = tempfile::tempdir().unwrap();
    let count = AT_A_TIME + 77;
    let path = file(folder.path(), count, |_, _| ());
    let steps = AtomicUsize::new(0);
    let (images, report) =
        images(&path, || steps.fetch_add(1, Ordering::Relaxed) < usize::MAX).unwrap();
    assert_eq!((images.len(), report.ended), (count, None));
    assert_eq!(steps.into_inner(), count, "one step for each image");
    for number in [0, 1, AT_A_TIME - 1, AT_A_TIME, count - 1] {
        assert_eq!(images[number], alone(number), "{number}");
    }
}

#[test]
fn images_before_a_wrong_measurement_are_written_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    for at in [33, AT_A_TIME, AT_A_TIME + 5] {
        let spoil = |number, values: &mut Vec<f64>| {
            if number == at {
                values.fill(f64::NAN);
            }
        };
        let path = file(folder.path(), AT_A_TIME + 9, spoil);
        let (images, report) = images(&path, || true).unwrap();
        let ended = report.ended.unwrap();
        assert!(ended.contains("many.npz") && ended.contains("NaN"), "{ended}");
        assert_eq!(images.len(), at, "{ended}");
        assert_eq!(images[at - 1], alone(at - 1));
    }
    let path = file(folder.path(), 3, |_, values| values.fill(f64::NAN));
    assert!(matches!(images(&path, || true), Err(PipelineError::Source(_))));
}

#[test]
fn a_stack_that_cannot_be_written_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = file(folder.path(), AT_A_TIME + 9, |_, _| ());
    // Taken while the images are made: those of the first batch are written beside the second.
    let image = folder.path().join("out/image.npy");
    let begun = AtomicUsize::new(0);
    let take = || {
        if begun.fetch_add(1, Ordering::Relaxed) == AT_A_TIME {
            while !image.parent().unwrap().exists() {
                std::thread::sleep(Duration::from_millis(1));
            }
            std::fs::write(&image, b"mine").unwrap();
        }
        true
    };
    assert!(matches!(images(&path, take), Err(PipelineError::File(_))));
    let left = |folder: &Path| std::fs::read_dir(folder).unwrap().count();
    assert_eq!((left(&folder.path().join("out")), left(folder.path())), (1, 2));
    assert_eq!(std::fs::read(&image).unwrap(), b"mine");
    // The folders that a run has made go with it: networks take no images of 4 x 4.
    let (options, made) = (SourceOptions::default(), made());
    let out = folder.path().join("made/for/it");
    let results = ResultFolder::of_file(&path, &out, &made, FigureStyle::Paper);
    let pipeline = Pipeline::new(solver(Method::HADAMARD)).with_networks(Backend::Cpu).unwrap();
    let sources = Sources::open(&path, &options).unwrap();
    let refused = pipeline.all(sources, &results, &|_| true, StageTimes::default());
    assert!(matches!(refused, Err(PipelineError::Networks(_))));
    assert!(!folder.path().join("made").exists());
}

#[test]
fn a_user_who_stops_gets_the_batches_before() {
    let folder = tempfile::tempdir().unwrap();
    let path = file(folder.path(), AT_A_TIME + 9, |_, _| ());
    for (most, images_made) in [(AT_A_TIME + 1, Some(AT_A_TIME)), (3, None)] {
        let steps = AtomicUsize::new(0);
        let made = images(&path, || steps.fetch_add(1, Ordering::Relaxed) < most);
        match images_made {
            Some(count) => {
                let (images, report) = made.unwrap();
                assert_eq!((images.len(), report.ended.as_deref()), (count, Some("stopped")));
            }
            None => assert!(matches!(made, Err(PipelineError::Stopped))),
        }
    }
}

#[test]
fn frames_of_a_recording_come_in_batches_as_they_come_together() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/recordings/v1.mcap");
    let options = SourceOptions::default();
    let together = Source::read_all(&path, &options).unwrap();
    assert_eq!(together.len(), 12);
    for most in [1, 5, 6, 12, 13] {
        let mut sources = Sources::open(&path, &options).unwrap();
        assert_eq!(sources.len(), 12);
        let batches: Vec<Vec<Source>> =
            sources.batches(most).unwrap().collect::<Result<_, _>>().unwrap();
        assert!(batches.iter().all(|batch| (1..=most).contains(&batch.len())));
        let all: Vec<&Source> = batches.iter().flatten().collect();
        assert_eq!(all.len(), 12, "{most} at a time");
        for (one, other) in all.into_iter().zip(&together) {
            assert_eq!(one.measurements, other.measurements);
            assert_eq!((&one.notes, one.frames), (&other.notes, other.frames));
        }
    }
    // Whoever stops in the middle leaves no thread that waits for ever.
    let mut sources = Sources::open(&path, &options).unwrap();
    assert_eq!(sources.batches(2).unwrap().next().unwrap().unwrap().len(), 2);
}
