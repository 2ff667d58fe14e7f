//! What a feed declares in its header, and whether its readings fit it.
//!
//! # Invariant
//! An inspection waits [`LONGEST`] at most for the first frame, and says so if none comes
//! (`tests::a_feed_without_frames_is_not_waited_for`).

use super::trial::{Guess, Judge};
use super::ways::Trials;
use super::{InspectError, Inspection, MOST, PICTURES};
use crate::feed::{Account, Address, Feed, FeedError, Header, Mean, Next};
use crate::files::contents::Contents;
use crate::files::measurement::Sweeps;
use nirspi_recon::words::count;
use serde::Serialize;
use std::path::Path;
use std::time::{Duration, Instant};

/// The longest time without a header, and then without enough frames.
const LONGEST: Duration = Duration::from_secs(8);

/// Frames and time that are enough, and the time after which one frame is.
const FRAMES: u64 = 4;
const ENOUGH: Duration = Duration::from_secs(1);
const LONG: Duration = Duration::from_secs(3);

/// Readings that come within this time were there before: they say nothing of the rate.
const AT_ONCE: Duration = Duration::from_millis(50);

/// The longest wait between two looks at the time.
const TICK: Duration = Duration::from_millis(100);

/// What a feed declares, and what it sends.
#[derive(Debug, Clone, Serialize)]
pub struct FeedSeen {
    /// The name of the bench.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// The unit of the readings.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// Height of the image in pixels.
    pub height: usize,
    /// Width of the image in pixels.
    pub width: usize,
    /// The order of the patterns: its name, `h_row`, or `own`.
    pub order: String,
    /// Number of patterns of a frame.
    pub patterns: usize,
    /// The form of the readings.
    pub readings: &'static str,
    /// What the numbers are.
    pub numbers: String,
    /// Numbers of a reading.
    pub samples: u32,
    /// Numbers at the beginning of each reading that are left out.
    pub settle: u32,
    /// Whether a trigger says where readings begin.
    pub trigger: bool,
    /// What became of the numbers.
    pub account: Account,
    /// Readings of a frame that is not complete.
    pub begun: usize,
    /// Readings a second; `None` if all were there before.
    pub readings_per_s: Option<f64>,
    /// How long no number has come, in seconds, if that is why there is no frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_data_s: Option<u64>,
    /// Why the feed has ended, if it has.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ended: Option<String>,
    /// What the readings say of the header's form and order; `None` without a frame, and for patterns of the bench's
    /// own.
    pub declared: Option<Guess>,
    /// What the header should say instead.
    pub warnings: Vec<String>,
}

impl FeedSeen {
    fn new(header: &Header) -> Self {
        Self {
            name: header.name.clone(),
            unit: header.unit.clone(),
            height: header.size().height(),
            width: header.size().width(),
            order: header.order(),
            patterns: header.patterns(),
            readings: header.form.name(),
            numbers: header.numbers.to_string(),
            samples: header.samples.each,
            settle: header.samples.settle,
            trigger: header.trigger.is_some(),
            account: Account::default(),
            begun: 0,
            readings_per_s: None,
            no_data_s: None,
            ended: None,
            declared: None,
            warnings: Vec::new(),
        }
    }

    /// Receives frames until there are enough, the time is over, or the feed ends. The first may take the `longest` time.
    fn receive(&mut self, feed: &mut Feed, longest: Duration) -> Mean {
        let (began, mut mean, mut frames) = (Instant::now(), Mean::default(), 0);
        let (mut quiet, mut last) = (Duration::ZERO, Duration::ZERO);
        loop {
            let elapsed = began.elapsed();
            let is_enough = match frames {
                0 => elapsed >= longest,
                1..FRAMES => elapsed >= LONG,
                FRAMES.. => elapsed >= ENOUGH,
            };
            if is_enough {
                break;
            }
            match feed.next(TICK) {
                Next::Frame(readings) => {
                    mean.add(readings);
                    frames += 1;
                    last = began.elapsed();
                }
                Next::Quiet(time) => quiet = time,
                Next::End(end) => {
                    self.ended = Some(end.to_string());
                    break;
                }
            }
        }
        let each = feed.header().readings() as u64;
        self.account = feed.account().clone();
        self.begun = feed.begun();
        let rate = (frames * each) as f64 / last.as_secs_f64();
        self.readings_per_s = (last > AT_ONCE).then_some(rate);
        let is_quiet = frames == 0 && self.ended.is_none() && quiet >= ENOUGH.min(longest / 2);
        self.no_data_s = is_quiet.then_some(quiet.as_secs());
        mean
    }

    /// The feed in words, a line each.
    pub(super) fn words(&self) -> Vec<String> {
        let Self { height, width, order, patterns, readings, numbers, samples, settle, .. } = self;
        let shown = match &**order {
            "own" => count(*patterns as u64, "pattern") + " of its own",
            order => format!("{} in the order {order}", count(*patterns as u64, "pattern")),
        };
        let more = |is_so: bool, words: String| if is_so { words } else { String::new() };
        let unit = self.unit.as_ref().map(|unit| format!(" in {unit}")).unwrap_or_default();
        let name = self.name.as_ref().map(|name| format!("{name}: ")).unwrap_or_default();
        let mut lines = vec![format!(
            "  the header declares {name}{height} x {width}, {shown}, readings {readings}{unit}, numbers {numbers}{}{}{}",
            more(*samples > 1, format!(", {samples} samples a reading")),
            more(*settle > 0, format!(", the first {settle} left out")),
            more(self.trigger, ", a trigger".to_owned()),
        )];
        let ended = self.ended.as_ref().map(|ended| format!("; {ended}")).unwrap_or_default();
        lines.push(match (self.account.frames, self.no_data_s) {
            (0, Some(seconds)) => format!("  no data for {seconds} s after {}", self.begun_words()),
            (0, None) => format!("  no complete frame, {}{ended}", self.begun_words()),
            _ => match self.readings_per_s {
                Some(rate) => format!("  {}, {rate:.0} readings/s{ended}", self.account),
                None => format!("  {}, all there before{ended}", self.account),
            },
        });
        if let Some(declared) = &self.declared {
            lines.push(format!("  read so, a mean frame {}", declared.explains()));
            lines.extend(declared.warnings.iter().map(|warning| format!("  but {warning}")));
        }
        lines.extend(self.warnings.iter().map(|warning| format!("  {warning}")));
        lines
    }

    fn begun_words(&self) -> String {
        let of = self.patterns * if matches!(self.readings, "pairs" | "halves") { 2 } else { 1 };
        format!("{} of {of} readings", self.begun)
    }
}

impl Inspection {
    /// Inspects a feed: its header, and a few frames. Takes some seconds.
    ///
    /// # Errors
    /// [`InspectError`], one line that names the address and the problem.
    pub fn of_feed(address: &Address) -> Result<Self, InspectError> {
        let began = Instant::now();
        match Feed::open(address, || began.elapsed() < LONGEST) {
            Err(FeedError::Stopped(_)) => {
                let seconds = LONGEST.as_secs();
                Err(InspectError::Quiet { address: address.clone(), seconds })
            }
            opened => Ok(Self::of_open(&address.to_string(), opened?, LONGEST)),
        }
    }

    /// Inspects a feed whose header has come.
    fn of_open(address: &str, mut feed: Feed, longest: Duration) -> Self {
        let mut seen = FeedSeen::new(feed.header());
        let mean = seen.receive(&mut feed, longest);
        let (header, origin) = (feed.header(), Path::new(address));
        let mut found = Self {
            input: origin.to_owned(),
            format: "a feed",
            arrays: Vec::new(),
            recording: None,
            feed: None,
            findings: Vec::new(),
            unexplained: None,
            tried: 0,
            guesses: Vec::new(),
            notes: Vec::new(),
            taken: header.taken(address),
        };
        if seen.account.frames > 0 && header.hadamard().is_ok() {
            found.judge(&mut seen, header, mean.readings());
        } else if seen.account.frames > 0 {
            found.notes.push(
                "the feed does not hold its patterns: serve --matrix PATTERNS shows it, and reconstruct --matrix PATTERNS a \
                 recording of capture"
                    .to_owned(),
            );
        }
        found.feed = Some(seen);
        found
    }

    /// Tries the form and order of the header, and all others.
    fn judge(&mut self, seen: &mut FeedSeen, header: &Header, readings: Vec<f64>) {
        let (Ok((side, rows)), origin) = (header.hadamard(), self.input.clone()) else { return };
        let judge = Judge::new();
        let read = Sweeps::new(&origin, side, rows, header.form, header.simulated)
            .and_then(|sweeps| sweeps.read(readings.clone()));
        match &read {
            Err(error) => seen.warnings.push(error.to_string()),
            Ok(read) => {
                let words = (header.form.name().to_owned(), header.order());
                let verdict = judge.of(&origin, read);
                seen.declared = verdict.map(|verdict| Guess::of(read, verdict, true, words));
            }
        }
        let contents = Contents::of_readings(&origin, readings);
        let mut trials = Trials::new(&origin, &contents, &judge);
        trials.is_feed = true;
        trials.of_contents();
        if !trials.has_fit() && !seen.declared.as_ref().is_some_and(Guess::fits) {
            trials.of_parts();
        }
        (self.tried, self.guesses) = trials.finished();
        self.guesses.truncate(MOST);
        self.guesses.iter_mut().take(PICTURES).for_each(|guess| judge.shown(guess));
        let Some(best) = self.guesses.first().filter(|guess| guess.fits()) else { return };
        let why = match &seen.declared {
            Some(declared) if declared.contradicted => "the header breaks the law of light",
            Some(declared) if declared.by_chance => {
                "what the header declares explains the readings no better than chance"
            }
            Some(_) => return,
            None => "the readings say nothing in the form of the header",
        };
        seen.warnings.push(format!("{why}; they fit {}", best.name()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{self, Read};

    /// A scene's readings in natural order: all patterns, then all complements.
    fn halves() -> Vec<f64> {
        let seen = |row: usize, sign: f64| -> f64 {
            let lit = |p: &usize| if (row & p).count_ones().is_multiple_of(2) { 1.0 } else { -1.0 };
            let scene = |p: usize| match (p / 16, p % 16) {
                (3..=8, 5..12) => 1.0,
                (10..13, 2..7) => 0.5,
                _ => 0.05,
            };
            (0..256).filter(|p| lit(p) == sign).map(scene).sum()
        };
        [1.0, -1.0].iter().flat_map(|&sign| (0..256).map(move |row| seen(row, sign))).collect()
    }

    fn inspected(header: &str, readings: &[f64]) -> Inspection {
        let numbers: String = readings.iter().map(|reading| format!("{reading:.4}\n")).collect();
        let text = format!("{header}\n{}", numbers.repeat(2));
        let feed = Feed::of_reader("feed:test", io::Cursor::new(text), || true).unwrap();
        Inspection::of_open("feed:test", feed, LONGEST)
    }

    #[test]
    fn a_header_that_does_not_fit_its_readings_is_told_what_does() {
        let readings = halves();
        let header =
            |form: &str| format!("{{\"n\":16,\"order\":\"natural\",\"readings\":\"{form}\"}}");
        let right = inspected(&header("halves"), &readings);
        let seen = right.feed.as_ref().unwrap();
        assert!(seen.declared.as_ref().unwrap().fits() && seen.warnings.is_empty(), "{seen:?}");
        assert_eq!((seen.account.frames, seen.begun), (2, 0));
        let wrong = inspected(&header("pairs"), &readings);
        let seen = wrong.feed.as_ref().unwrap();
        assert!(!seen.declared.as_ref().unwrap().fits());
        let warning = "the header breaks the law of light; they fit halves, order natural, 16 x 16";
        assert_eq!(seen.warnings, [warning]);
        let better = r#"{"n": 16, "order": "natural", "readings": "halves"}"#;
        assert_eq!(wrong.guesses[0].commands, [better]);
        better.parse::<Header>().unwrap();
        let words = wrong.words().join("\n");
        for line in ["feed:test: a feed", "readings pairs, numbers text", warning, better] {
            assert!(words.contains(line), "{words}");
        }
    }

    #[test]
    fn own_patterns_of_a_bench_are_not_guessed() {
        let found =
            inspected(r#"{"height":2,"width":3,"patterns":4,"readings":"single"}"#, &[1.0; 4]);
        assert!(found.guesses.is_empty() && found.feed.unwrap().declared.is_none());
        assert!(found.notes[0].contains("--matrix"), "{:?}", found.notes);
    }

    /// Bytes that stop coming without an end.
    struct Stalled(io::Cursor<Vec<u8>>);

    impl Read for Stalled {
        fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
            match self.0.read(bytes)? {
                0 => {
                    std::thread::sleep(Duration::from_millis(20));
                    Err(io::ErrorKind::WouldBlock.into())
                }
                count => Ok(count),
            }
        }
    }

    #[test]
    fn a_feed_without_frames_is_not_waited_for() {
        let text = "{\"n\":2,\"order\":\"natural\",\"readings\":\"pairs\"}\n1 2 3\n";
        let stalled = Stalled(io::Cursor::new(text.as_bytes().to_vec()));
        let feed = Feed::of_reader("feed:test", stalled, || true).unwrap();
        let (began, longest) = (Instant::now(), Duration::from_millis(400));
        let found = Inspection::of_open("feed:test", feed, longest);
        assert!((longest..LONGEST).contains(&began.elapsed()));
        let seen = found.feed.as_ref().unwrap();
        assert_eq!((seen.account.frames, seen.begun), (0, 3));
        assert!(seen.no_data_s.is_some(), "{seen:?}");
        let words = found.words().join("\n");
        assert!(words.contains("s after 3 of 8 readings"), "{words}");
    }
}
