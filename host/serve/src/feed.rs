//! The feed of a page: receives every frame of a bench that is no camera of nirspi, and puts the newest into the slot.

use super::camera_log::Phase;
use super::delays::Passed;
use super::light::Leds;
use super::look::{Bench, BenchError, Look, Seen};
use super::rest::{RETRY, rest};
use super::settings::{Measuring, Settings};
use super::{Shared, lock};
use nirspi::account::LossCounters;
use nirspi::causes;
use nirspi::clock::Instant;
use nirspi::events::Level;
use nirspi::feed::{Account, Address, Feed, Header, Next, Recorded, Recorder};
use nirspi::files::FileError;
use nirspi::provenance::Made;
use nirspi_recon::reconstruct::Method;
use nirspi_recon::words::count;
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// Time between two looks at what pages want.
const TICK: Duration = Duration::from_millis(100);
/// A feed that sends nothing for so long is called silent.
const SILENT: Duration = Duration::from_secs(2);
/// The most bytes of readings that are kept for a sum of frames.
const MOST_KEPT: usize = 256 << 20;

/// A feed whose header has come.
pub struct FeedSource {
    /// Where the readings come from, in words.
    pub(super) name: String,
    feed: Feed,
    bench: Arc<Bench>,
    /// The address at which the feed is opened again after its end; `None` for a feed that has no other.
    again: Option<Address>,
    /// The patterns of a feed that shows its own.
    matrix: Option<PathBuf>,
    /// The folder for recordings; `None` if pages cannot record.
    pub(super) record_to: Option<PathBuf>,
}

impl FeedSource {
    /// The feed of this name. After its end, it is opened `again`, unless it has no address. `matrix` is the file of the
    /// patterns of a feed that shows its own; pages record to the folder `record_to`, if there is one.
    ///
    /// # Errors
    /// [`BenchError`] if the patterns are not those of the feed.
    pub fn new(
        name: String,
        feed: Feed,
        again: Option<Address>,
        matrix: Option<PathBuf>,
        record_to: Option<PathBuf>,
    ) -> Result<Self, BenchError> {
        let bench = Arc::new(Bench::new(&name, feed.header(), matrix.as_deref())?);
        Ok(Self { name, feed, bench, again, matrix, record_to })
    }

    /// The header of the feed.
    #[must_use]
    pub fn header(&self) -> &Header {
        &self.bench.header
    }

    /// The settings with which a page of this feed begins.
    #[must_use]
    pub fn settings(&self, method: Method, frames: u32) -> Settings {
        let header = self.header();
        let sampling = (header.patterns() as f64 / header.size().area() as f64).min(1.0);
        let measuring = Measuring { order: header.order(), sampling, sweeps: 1 };
        Settings::measuring(method, frames, measuring)
    }

    /// Receives until the server stops. A feed that has ended is opened again, if there is another.
    pub(super) fn receive(self, shared: &Arc<Shared>, made: &Made) {
        let Self { name, feed, bench, again, matrix, record_to } = self;
        let mut receiver = Receiver {
            shared,
            name: &name,
            made,
            record_to,
            earlier: LossCounters::default(),
            offered: 0,
            recorder: None,
        };
        let mut why = receiver.one(feed, Ok(bench));
        while !shared.is_over() {
            let Some(address) = &again else {
                shared.enter(Phase::Lost, Leds::None, why);
                while !shared.is_over() {
                    rest(shared, RETRY);
                }
                return;
            };
            shared.enter(Phase::Lost, Leds::None, format!("{why}; trying again"));
            rest(shared, RETRY);
            why = match Feed::open(address, || !shared.is_over()) {
                Ok(feed) => {
                    let bench = Bench::new(&name, feed.header(), matrix.as_deref());
                    receiver.one(feed, bench.map(Arc::new))
                }
                Err(error) => causes::in_one_line(&error),
            };
        }
    }
}

/// Receives one feed after the other from an address.
struct Receiver<'r> {
    shared: &'r Shared,
    name: &'r str,
    made: &'r Made,
    record_to: Option<PathBuf>,
    /// The account of all earlier feeds.
    earlier: LossCounters,
    /// Frames put into the slot.
    offered: u64,
    recorder: Option<Recorder>,
}

impl Receiver<'_> {
    /// Receives a feed to its end. Returns why it ended, in one line.
    fn one(&mut self, mut feed: Feed, bench: Result<Arc<Bench>, BenchError>) -> String {
        let why = match bench {
            Ok(bench) => self.frames(&mut feed, &bench),
            Err(error) => causes::in_one_line(&error),
        };
        self.end_recording();
        let run = counters(feed.account(), true);
        self.tell(feed.account(), run);
        self.earlier = self.earlier + run;
        lock(&self.shared.camera).event(Level::Warning, why.clone());
        why
    }

    fn frames(&mut self, feed: &mut Feed, bench: &Arc<Bench>) -> String {
        let header = &bench.header;
        lock(&self.shared.camera).fed(header, header.taken(self.name));
        let mut kept: VecDeque<Arc<[f64]>> = VecDeque::new();
        let most = (MOST_KEPT / (8 * header.readings())).max(1);
        let mut told = Instant::now();
        let mut silent = None;
        while !self.shared.is_over() {
            match feed.next(TICK) {
                Next::Frame(readings) => {
                    if let Some(recorder) = &mut self.recorder {
                        let pushed = recorder.push(readings);
                        self.unless_failed(pushed);
                    }
                    let sum = lock(&self.shared.settings).frames as usize;
                    kept.push_back(readings.into());
                    while kept.len() > sum.min(most) {
                        kept.pop_front();
                    }
                    self.offer(&kept, bench, feed.account());
                    if self.offered == 1 || silent.take().is_some() {
                        self.shared.enter(Phase::Measuring, Leds::None, "measuring".to_owned());
                    }
                }
                Next::Quiet(quiet) if quiet >= SILENT => {
                    let seconds = quiet.as_secs();
                    if silent.replace(seconds) != Some(seconds) {
                        let line = format!("no data for {seconds} s");
                        self.shared.enter(Phase::Silent, Leds::None, line);
                    }
                }
                Next::Quiet(_) => {
                    if silent.take().is_some() {
                        self.shared.enter(Phase::Measuring, Leds::None, "measuring".to_owned());
                    }
                }
                Next::End(end) => return end.to_string(),
            }
            if told.elapsed() >= TICK {
                told = Instant::now();
                self.tell(feed.account(), counters(feed.account(), false));
                self.record(header);
            }
        }
        "the server stops".to_owned()
    }

    fn offer(&mut self, kept: &VecDeque<Arc<[f64]>>, bench: &Arc<Bench>, account: &Account) {
        let arrived = Instant::now();
        let counters = counters(account, false);
        self.offered += 1;
        let seen = Seen::Feed { frames: kept.iter().cloned().collect(), bench: Arc::clone(bench) };
        self.shared.passed(Passed::Counted, arrived);
        let look = Look { seen, arrived, counters, newest: self.offered };
        self.shared.slot.offer(look, self.earlier, counters);
    }

    /// Tells pages the account. The first number that is refused is an event.
    fn tell(&self, account: &Account, run: LossCounters) {
        self.shared.slot.account(self.earlier, run);
        let mut log = lock(&self.shared.camera);
        let Some(feed) = &mut log.camera.feed else { return };
        let is_first = feed.account.refused == 0 && account.refused > 0;
        feed.account.clone_from(account);
        if is_first {
            let first = account.first_refused.clone().unwrap_or_default();
            let line = format!("a number was refused: {first}; the next are only counted");
            log.event(Level::Warning, line);
        }
    }

    /// Begins or ends a recording, as pages want.
    fn record(&mut self, header: &Header) {
        let wanted = lock(&self.shared.settings).record;
        match (&self.record_to, wanted, self.recorder.is_some()) {
            (Some(folder), true, false) => {
                let provenance = header.taken(self.name).made(self.made);
                let path = Recorder::first_free(folder);
                match Recorder::begin(&path, false, header, &provenance) {
                    Ok(recorder) => self.recorder = Some(recorder),
                    Err(error) => self.unless_failed(Err(error)),
                }
            }
            (_, false, true) => self.end_recording(),
            _ => {}
        }
    }

    /// Ends a recording, if there is one. A person must begin another one.
    fn end_recording(&mut self) {
        let Some(recorder) = self.recorder.take() else { return };
        lock(&self.shared.settings).record = false;
        match recorder.finish() {
            Ok(Recorded { files, frames }) => {
                let name = |file: &PathBuf| {
                    let name = file.file_name().unwrap_or(file.as_os_str());
                    Path::new(name).display().to_string()
                };
                let names: Vec<String> = files.iter().map(name).collect();
                let names = if names.is_empty() { "no file".to_owned() } else { names.join(", ") };
                let line = format!("recorded {} in {names}", count(frames, "frame"));
                lock(&self.shared.camera).event(Level::Info, line);
            }
            Err(error) => self.unless_failed(Err(error)),
        }
    }

    /// A recording that fails is an event, and ends.
    fn unless_failed(&mut self, done: Result<(), FileError>) {
        if let Err(error) = done {
            self.recorder = None;
            lock(&self.shared.settings).record = false;
            lock(&self.shared.camera).event(Level::Error, causes::in_one_line(&error));
        }
    }
}

/// The account of frames. A frame without any reading counts as corrupt, and at the end of a feed so does one that is cut.
fn counters(account: &Account, is_end: bool) -> LossCounters {
    let cut = u64::from(is_end && account.cut > 0);
    LossCounters {
        received: account.frames,
        corrupt: account.empty_frames + cut,
        ..LossCounters::default()
    }
}
