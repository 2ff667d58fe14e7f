//! Camera, imaging and HTTP, each on a thread of its own.
//!
//! # Invariant
//! The camera's thread waits for the camera only: never for the imaging thread
//! (`images_that_are_given_up_are_counted_and_frames_are_not_waited_for`), and never for a browser
//! (`a_browser_that_does_not_read_delays_no_other_and_then_sees_the_newest`), both in
//! `host/serve/src/tests.rs`.

use super::camera::{End, EventLog, Live, Next, darken, is_dark, reconnect, why_dark};
use super::camera_log::{CameraLog, Phase};
use super::delays::DelayState;
use super::feed::FeedSource;
use super::imaging::{Studio, Told};
use super::light::Leds;
use super::overload::Shed;
use super::rest::{RETRY, TICK, rest};
use super::settings::{Offer, Settings};
use super::stage::Stage;
use super::state::Published;
use super::{CameraSource, Connected, Imaging, Ledger, Server, Shared, http, lock};
use nirspi::capture::{CaptureError, observe};
use nirspi::causes;
use nirspi::provenance::Made;
use nirspi::session::{Session, SessionError};
use std::fmt;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use thiserror::Error;
use tokio::sync::watch;

/// Time between two questions to a camera whose LEDs a person switched off.
const ASK: Duration = Duration::from_secs(1);

/// Least time from image to image. Screens show no more images a second.
const PACE: Duration = Duration::from_millis(33);
/// Time between two states that pages receive while the camera sends nothing.
const HEARTBEAT: Duration = Duration::from_millis(500);

/// Why serving ended without a request of the user.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ServeError {
    /// The camera could not measure.
    #[error(transparent)]
    Camera(#[from] CaptureError),
    /// The network failed.
    #[error("the web server failed")]
    Network(#[from] io::Error),
    /// A thread panicked because of a bug in this program.
    #[error("the {0} thread died")]
    Thread(&'static str),
}

/// What was served.
#[derive(Debug, Clone, Copy)]
pub struct Served {
    /// The account of all frames.
    pub ledger: Ledger,
    /// The delays of the last seconds.
    delays: DelayState,
}

impl fmt::Display for Served {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { ledger: Ledger { frames, images, .. }, delays } = self;
        write!(f, "{frames}; {} shown{delays}", images.shown)
    }
}

/// Serves `camera` to the browsers that connect to `server`, until `stop` is set. Returns the
/// account of all frames and their delays.
///
/// # Errors
/// [`ServeError`], after the camera is stopped.
pub fn serve(
    server: Server,
    mut camera: CameraSource,
    connected: Connected,
    imaging: Imaging,
    settings: Settings,
    stop: &AtomicBool,
) -> Result<Served, ServeError> {
    let log = CameraLog::new(&camera.address, connected.session.identity());
    let records = camera.record_to.is_some();
    let offer = Offer { records, base: Some(camera.setup.clone()), ..imaging.offer() };
    let stage = Stage::of(camera.scene.take());
    let shared = Arc::new(Shared::new(log, offer, settings, stage));
    let made = server.made.clone();
    let measure = move |shared: &Arc<Shared>| measure(shared, camera, connected, made);
    run(server, shared, imaging, stop, measure)
}

/// Serves `feed` to the browsers that connect to `server`, until `stop` is set. Returns the account of all frames and
/// their delays.
///
/// # Errors
/// [`ServeError`].
pub fn serve_feed(
    server: Server,
    feed: FeedSource,
    imaging: Imaging,
    settings: Settings,
    stop: &AtomicBool,
) -> Result<Served, ServeError> {
    let log = CameraLog::of_feed(&feed.name);
    let records = feed.record_to.is_some();
    let offer = Offer { records, fixed: true, ..imaging.offer() };
    let shared = Arc::new(Shared::new(log, offer, settings, Stage::of(None)));
    let made = server.made.clone();
    let receive = move |shared: &Arc<Shared>| {
        feed.receive(shared, &made);
        Ok(())
    };
    run(server, shared, imaging, stop, receive)
}

/// Camera or feed, imaging and HTTP, until `stop` is set.
fn run(
    server: Server,
    shared: Arc<Shared>,
    imaging: Imaging,
    stop: &AtomicBool,
    measure: impl FnOnce(&Arc<Shared>) -> Result<(), CaptureError> + Send + 'static,
) -> Result<Served, ServeError> {
    let (publish, published) = watch::channel(Arc::new(Published::default()));
    let measuring = {
        let shared = Arc::clone(&shared);
        spawn("camera", move || measure(&shared))?
    };
    let making = {
        let shared = Arc::clone(&shared);
        spawn("imaging", move || images(&shared, imaging, &publish))?
    };
    let is_over =
        || stop.load(Ordering::Relaxed) || measuring.is_finished() || making.is_finished();
    let served = http::run(server, Arc::clone(&shared), published, is_over);
    shared.over.store(true, Ordering::Relaxed);
    // The camera is stopped even if the other threads failed.
    let measured = measuring.join().map_err(|_| ServeError::Thread("camera"))?;
    making.join().map_err(|_| ServeError::Thread("imaging"))?;
    measured?;
    served?;
    let delays = lock(&shared.delays).state(Instant::now());
    Ok(Served { ledger: shared.slot.ledger(), delays })
}

fn spawn<T: Send + 'static>(
    name: &str,
    work: impl FnOnce() -> T + Send + 'static,
) -> io::Result<JoinHandle<T>> {
    std::thread::Builder::new().name(name.to_owned()).spawn(work)
}

/// Measures until the server stops.
///
/// # Errors
/// [`CaptureError`] if the first run cannot begin.
pub(super) fn measure(
    shared: &Arc<Shared>,
    mut source: CameraSource,
    first: Connected,
    made: Made,
) -> Result<(), CaptureError> {
    let mut live = Live::new(Arc::clone(shared), &mut source).on_its_thread(made);
    let mut next = Some(first);
    // A person who starts this program can see the camera.
    let mut person_said = true;
    while !shared.is_over() {
        let mut connected = match next.take() {
            Some(connected) => connected,
            None => match reconnect(shared, &mut source.connect) {
                Ok(connected) => connected,
                Err(None) => continue,
                Err(Some(problem)) => {
                    shared.enter(Phase::Lost, Leds::Unknown, format!("{problem}; trying again"));
                    rest(shared, RETRY);
                    continue;
                }
            },
        };
        let dark = if person_said { None } else { why_dark(&mut connected.session) };
        person_said = false;
        let end = match dark {
            Some(why) => End::Dark(why),
            None => session(&mut live, shared, &mut connected)?,
        };
        match live.ended(end) {
            Next::Connect { person_said: said } => person_said = said,
            Next::Retry => {
                // The old link is closed before reconnecting.
                drop(connected);
                rest(shared, RETRY);
            }
            Next::Person => {
                await_person(shared, &mut connected.session);
                person_said = true;
            }
        }
    }
    Ok(())
}

/// One session: runs, and pauses without light between the runs. Fails only if the first run of
/// all cannot begin.
fn session(
    live: &mut Live,
    shared: &Shared,
    connected: &mut Connected,
) -> Result<End, CaptureError> {
    live.greeted(connected);
    while !shared.is_over() {
        let end = if shared.stage.has_changed() {
            Some(End::Scene)
        } else if shared.light.is_on() {
            one_run(live, connected)?
        } else {
            let stopped = stopped(shared, &mut connected.session);
            stopped.err().map(|error| End::Gone(causes::in_one_line(&error)))
        };
        if let Some(end) = end {
            return Ok(end);
        }
    }
    Ok(End::Told)
}

/// One run. `None` if the run was stopped from here. Fails only if the run is the first of all
/// and cannot begin.
fn one_run(live: &mut Live, connected: &mut Connected) -> Result<Option<End>, CaptureError> {
    let options = live.prepare(connected);
    let captured = observe(&mut connected.session, &options, live);
    live.captured(connected, captured)
}

/// Keeps a camera whose LEDs a person switched off, until a person switches them on again.
///
/// # Errors
/// If the link ends.
fn stopped(shared: &Shared, session: &mut Session) -> Result<(), SessionError> {
    let mut asked: Option<Instant> = None;
    while !shared.is_over() && !shared.light.is_on() && !shared.stage.has_changed() {
        if asked.is_none_or(|asked| asked.elapsed() > ASK) {
            asked = darken(shared, session)?.then(Instant::now);
        }
        session.listen(TICK, &mut EventLog(shared))?;
        // The link in memory does not wait.
        std::thread::sleep(TICK);
    }
    Ok(())
}

/// Asks a camera that has switched its LEDs off, or must not measure, whether they are off, until a
/// person allows light. When the link ends, what is known of the LEDs ends too.
fn await_person(shared: &Shared, session: &mut Session) {
    let mut asked: Option<Instant> = None;
    let mut is_linked = true;
    while !shared.is_over() && !shared.light.is_on() {
        if is_linked && asked.is_none_or(|asked| asked.elapsed() > ASK) {
            is_linked = is_dark(shared, session).is_ok();
            asked = Some(Instant::now());
        }
        std::thread::sleep(TICK);
    }
}

/// Makes images and publishes them until the server stops. While images are left out to save work, the thread
/// rests after each image for the time of those left out, and pages get only what else is new. States come twice
/// a second at least, however long an image takes.
pub(super) fn images(shared: &Shared, imaging: Imaging, publish: &watch::Sender<Arc<Published>>) {
    let mut studio = Studio::new(imaging);
    let told = studio.told();
    let mut next_image = Instant::now();
    let ended = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            while !shared.is_over() && !ended.load(Ordering::Relaxed) {
                tell(shared, &told, publish, Some(HEARTBEAT));
                std::thread::sleep(TICK);
            }
        });
        // The other thread ends even if this one panics.
        let _ended = SetOnDrop(&ended);
        while !shared.is_over() {
            let turn = Instant::now();
            let look = match next_image.checked_duration_since(turn) {
                None | Some(Duration::ZERO) => shared.slot.take(HEARTBEAT),
                Some(rest) => {
                    shared.slot.await_news(rest.min(HEARTBEAT));
                    None
                }
            };
            let began = Instant::now();
            if let Some(look) = &look {
                studio.make(shared, look);
                next_image = Instant::now() + given_up(shared.shed(), began.elapsed());
            }
            tell(shared, &told, publish, None);
            std::thread::sleep(PACE.saturating_sub(turn.elapsed()));
        }
    });
}

/// Publishes the state of this moment, unless the last one is younger than `than`. The lock is held, so that no
/// state takes the place of a later one.
fn tell(
    shared: &Shared,
    told: &Mutex<Told>,
    publish: &watch::Sender<Arc<Published>>,
    than: Option<Duration>,
) {
    let mut told = lock(told);
    let age = publish.borrow().made.map(|made| made.elapsed());
    if than.is_some_and(|than| age.is_some_and(|age| age < than)) {
        return;
    }
    if let Ok(published) = told.state(shared) {
        publish.send_replace(Arc::new(published));
    }
}

/// Sets a flag when dropped.
struct SetOnDrop<'f>(&'f AtomicBool);

impl Drop for SetOnDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// The time of the images that are left out after an image that took so long.
fn given_up(shed: Shed, took: Duration) -> Duration {
    (shed.show_every - 1) * took.max(PACE)
}
