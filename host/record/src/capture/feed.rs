//! Records a feed: the live readings of any bench.

use super::{Seconds, StopCause};
use nirspi_feed::{Account, Address, End, Feed, Mean, Next, Recorder};
use nirspi_files::FileError;
use nirspi_recon::words::{count, count_of};
use serde::Serialize;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// The longest wait between two reports of progress.
const TICK: Duration = Duration::from_millis(100);

/// Where the recording of a feed stands.
#[derive(Debug, Clone, Copy)]
pub struct FeedProgress<'f> {
    /// The account so far.
    pub account: &'f Account,
    /// Time since the recording began.
    pub elapsed: Duration,
    /// How long no number has come; `None` while numbers come.
    pub quiet: Option<Duration>,
}

/// What the recording of a feed gave, and what it lacks.
#[derive(Debug, Serialize)]
pub struct FeedReport {
    /// The name that the bench has in the header.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Side of the image of Hadamard patterns.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub n: Option<usize>,
    /// Height of the image in pixels.
    pub height: usize,
    /// Width of the image in pixels.
    pub width: usize,
    /// The order of the patterns.
    pub order: String,
    /// Number of patterns of a frame.
    pub patterns: usize,
    /// The form of the readings.
    pub readings: &'static str,
    /// The files.
    pub files: Vec<PathBuf>,
    /// What became of the numbers.
    pub account: Account,
    /// Frames requested; `null` for a recording until the end.
    pub asked: Option<u64>,
    /// What ended the recording.
    pub ended: String,
    /// Whether nothing is missing.
    pub complete: bool,
    /// What is missing; `null` if nothing is.
    pub missing: Option<String>,
    /// Duration of the recording.
    pub seconds: f64,
    /// Readings a second.
    pub readings_per_s: f64,
    /// The mean of all frames.
    #[serde(skip)]
    pub mean: Mean,
}

impl FeedReport {
    /// The report in words, a line each.
    #[must_use]
    pub fn words(&self, address: &Address) -> Vec<String> {
        let Self { n, height, width, order, readings, account, ended, .. } = self;
        let Self { seconds, readings_per_s, .. } = self;
        let name = self.name.clone().unwrap_or_else(|| address.to_string());
        let patterns = match n {
            Some(_) => format!("order {order}"),
            None => count_of(self.patterns, "pattern") + " of its own",
        };
        let mut words = vec![
            format!("{name}: {height} x {width}, {patterns}, readings {readings}"),
            format!("{account}; {ended}"),
            format!("{readings_per_s:.0} readings/s over {seconds:.2} s"),
        ];
        let files: Vec<String> = self.files.iter().map(|file| file.display().to_string()).collect();
        let open = match &files[..] {
            [] => return words,
            [file, ..] if n.is_none() => {
                format!("{file} --index all --matrix PATTERNS --size {height}x{width}")
            }
            [file] => format!("{file} --index all"),
            files => files.join(" "),
        };
        let files = files.join(", ");
        words.push(format!("wrote {files}; nirspi reconstruct {open} makes images"));
        words
    }
}

/// Records frames until as many have come as were requested, the time is over, the feed ends, or `watch` breaks.
///
/// # Errors
/// [`FileError`] if the files cannot be written.
pub fn record_feed(
    feed: &mut Feed,
    mut recorder: Recorder,
    frames: Option<u64>,
    seconds: Option<Seconds>,
    mut watch: impl FnMut(&FeedProgress<'_>) -> ControlFlow<StopCause>,
) -> Result<FeedReport, FileError> {
    let began = Instant::now();
    let mut told = began;
    let mut recorded = 0;
    let mut mean = Mean::default();
    let (ended, is_bad) = loop {
        let quiet = match feed.next(TICK) {
            Next::Frame(readings) => {
                recorder.push(readings)?;
                mean.add(readings);
                recorded += 1;
                None
            }
            Next::Quiet(quiet) => Some(quiet),
            Next::End(end) => {
                let is_bad = !matches!(end, End::Closed);
                break match frames {
                    Some(asked) if !is_bad => {
                        let frames = count(asked, "frame");
                        (format!("{end} after {recorded} of {frames}"), true)
                    }
                    _ => (end.to_string(), is_bad),
                };
            }
        };
        if Some(recorded) == frames {
            break ("all requested frames have come".to_owned(), false);
        }
        let elapsed = began.elapsed();
        if seconds.is_some_and(|seconds| seconds.are_over(elapsed)) {
            break ("the time is over".to_owned(), false);
        }
        if quiet.is_none() && told.elapsed() < TICK {
            continue;
        }
        told = Instant::now();
        let quiet = quiet.filter(|quiet| *quiet > TICK);
        let progress = FeedProgress { account: feed.account(), elapsed, quiet };
        if let ControlFlow::Break(cause) = watch(&progress) {
            break match cause {
                StopCause::User | StopCause::TimeOver => ("stopped by the user".to_owned(), false),
                StopCause::Signal(signal) => (format!("stopped by {signal}"), true),
            };
        }
    };
    let seconds = began.elapsed().as_secs_f64();
    let recorded = recorder.finish()?;
    let (header, account) = (feed.header(), feed.account().clone());
    let mut missing: Vec<String> = is_bad.then(|| ended.clone()).into_iter().collect();
    missing.extend(account.missing());
    if recorded.frames == 0 {
        missing.push("no complete frame".to_owned());
    }
    Ok(FeedReport {
        name: header.name.clone(),
        n: header.hadamard().ok().map(|(side, _)| side.pixels()),
        height: header.size().height(),
        width: header.size().width(),
        order: header.order(),
        patterns: header.patterns(),
        readings: header.form.name(),
        files: recorded.files,
        asked: frames,
        ended,
        complete: missing.is_empty(),
        missing: (!missing.is_empty()).then(|| missing.join("; ")),
        seconds,
        readings_per_s: (recorded.frames * header.readings() as u64) as f64 / seconds,
        account,
        mean,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_files::provenance::{Made, Taken};
    use std::io;
    use std::path::Path;

    const HEADER: &str = "{\"n\":2,\"order\":\"natural\",\"readings\":\"single\"}\n";

    fn record(text: &str, frames: Option<u64>) -> FeedReport {
        let folder = tempfile::tempdir().unwrap();
        let reader = io::Cursor::new(text.to_owned());
        let mut feed = Feed::of_reader("feed:test", reader, || true).unwrap();
        let provenance =
            Taken::of_file(Path::new("feed"), None).made(&Made::by("nirspi", None, [""; 0], 0));
        let path = folder.path().join("rec.npz");
        let recorder = Recorder::begin(&path, false, feed.header(), &provenance).unwrap();
        record_feed(&mut feed, recorder, frames, None, |_| ControlFlow::Continue(())).unwrap()
    }

    #[test]
    fn a_recording_says_what_is_missing() {
        let report = record(&format!("{HEADER}1 2 3 4 5 6 7 8\n"), None);
        assert_eq!((report.account.frames, report.complete, report.missing), (2, true, None));
        assert_eq!((&*report.order, report.files.len()), ("natural", 1));
        assert_eq!(report.mean.readings(), [3.0, 4.0, 5.0, 6.0]);
        let report = record(&format!("{HEADER}1 2 3 4 5 6 7 8\n"), Some(1));
        assert_eq!((report.account.frames, report.complete), (1, true));
        let report = record(&format!("{HEADER}1 2 3 4\n"), Some(3));
        assert_eq!(report.missing.unwrap(), "the feed ended after 1 of 3 frames");
        let report = record(&format!("{HEADER}1 two 3 4 5"), None);
        let missing = report.missing.unwrap();
        assert!(missing.starts_with("1 number refused (first \"two\""), "{missing}");
        assert!(missing.ends_with("1 reading of a last frame that is not complete"), "{missing}");
        let report = record(&format!("{HEADER}1 2"), None);
        assert!(report.missing.unwrap().ends_with("no complete frame"));
        assert!(report.files.is_empty());
    }
}
