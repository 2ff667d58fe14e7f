//! The live page without threads and without a server: camera, imaging and pages take turns. For
//! programs that have neither, such as WebAssembly in a browser.
//!
//! The parts are those of [`serve`](super::serve): the same commands, the same messages, the same
//! images.
//!
//! # Invariant
//! A turn is a number of frames and not a time, so the same commands between the same turns give
//! the same images on every machine (`host/web/tests/check.py` compares WebAssembly with native
//! code).

use super::camera::{End, Live, Next, darken, is_dark, reconnect, why_dark};
use super::camera_log::{CameraLog, Phase};
use super::imaging::Studio;
use super::light::Leds;
use super::line::{Line, LineError};
use super::settings::{Offer, Settings};
use super::stage::Stage;
use super::state::Published;
use super::{CameraSource, Connected, ForeignError, Imaging, Shared, commands, lock};
use nirspi::capture::Run;
use nirspi::causes;
use nirspi::clock::Instant;
use nirspi::session::{IgnorePackets, SessionError};
use serde::Serialize;
use std::fmt::Display;
use std::mem;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// Frames of one turn: eight sweeps of half the patterns are 0.3 ms of light.
const FRAMES: u64 = 8;
/// A turn with fewer frames ends after this time.
const TURN: Duration = Duration::from_secs(1);
/// Time between two attempts to reconnect, and between two questions to a dark camera.
const PAUSE: Duration = Duration::from_secs(1);
/// The longest wait for packets of a dark camera.
const DARK: Duration = Duration::from_millis(50);

/// What the camera does until the next turn.
enum Doing {
    /// No session: it begins after this moment.
    Away { after: Instant, person_said: bool },
    /// A session without a run.
    Dark { connected: Connected, asked: Option<Instant> },
    /// A run.
    Measuring { connected: Connected, run: Box<Run> },
    /// Waits for a person to allow light, and asks the camera meanwhile whether it is dark, as long as it
    /// answers.
    Waiting { connected: Option<Connected>, asked: Option<Instant> },
}

/// A camera and its page, in turns.
pub struct Turns {
    shared: Arc<Shared>,
    source: CameraSource,
    live: Live,
    studio: Studio,
    doing: Doing,
    published: Published,
}

impl Turns {
    /// Connects to the camera of this source. The page can damage the bytes of `line`.
    ///
    /// # Errors
    /// If the camera does not answer.
    pub fn new(
        mut source: CameraSource,
        imaging: Imaging,
        settings: Settings,
        line: Option<Line>,
    ) -> Result<Self, ForeignError> {
        let scene = source.scene.take();
        let mut connected = (source.connect)(scene.as_ref())?;
        let log = CameraLog::new(&source.address, connected.session.identity());
        let offer = Offer {
            records: source.record_to.is_some(),
            base: Some(source.setup.clone()),
            ..imaging.offer()
        };
        let mut shared = Shared::new(log, offer, settings, Stage::of(scene));
        shared.line = line;
        // The page that takes these turns.
        shared.viewers.store(1, Ordering::Relaxed);
        let shared = Arc::new(shared);
        let mut live = Live::new(Arc::clone(&shared), &mut source);
        live.greeted(&mut connected);
        let doing = Doing::Dark { connected, asked: None };
        let studio = Studio::new(imaging);
        Ok(Self { shared, source, live, studio, doing, published: Published::default() })
    }

    /// Takes one turn: the camera measures a few frames, and their image is made. Returns the
    /// message to the page, the JSON of an event of `GET /events`.
    pub fn turn(&mut self) -> &str {
        self.camera();
        let look = self.shared.slot.take_now();
        if let Some(look) = look {
            self.studio.make(&self.shared, &look);
        }
        let state = lock(&self.studio.told()).state(&self.shared);
        if let Ok(published) = state {
            self.published = published;
        }
        &self.published.message
    }

    /// Executes a command of a page: `path` and `body` are those of a `POST` to the server, or
    /// `/api/line` with the share of bytes to damage. Returns the answer's JSON.
    ///
    /// # Errors
    /// Why the command is refused, in one line.
    pub fn command(&mut self, path: &str, body: &[u8]) -> Result<String, String> {
        let shared = &self.shared;
        match path {
            "/api/settings" => answer(commands::settings(shared, body)),
            "/api/scene" => answer(commands::scene(shared, body)),
            "/api/stop" => answer(Ok::<_, LineError>(commands::switch(shared, false))),
            "/api/start" => answer(Ok::<_, LineError>(commands::switch(shared, true))),
            "/api/line" => {
                let line = shared.line.as_ref().ok_or(LineError::Real);
                answer(line.and_then(|line| line.change(body)))
            }
            _ => Err(format!(
                "there is no command {path}, expected /api/settings, /api/scene, /api/line, /api/stop or /api/start"
            )),
        }
    }

    /// The camera's part of a turn.
    fn camera(&mut self) {
        let now = Instant::now();
        let away = Doing::Away { after: now, person_said: false };
        self.doing = match mem::replace(&mut self.doing, away) {
            Doing::Away { after, person_said } if after > now => Doing::Away { after, person_said },
            Doing::Away { person_said, .. } => self.connect(now, person_said),
            Doing::Waiting { .. } if self.shared.light.is_on() => {
                Doing::Away { after: now, person_said: true }
            }
            Doing::Waiting { connected, asked } => self.await_person(connected, asked),
            Doing::Dark { connected, .. } if self.shared.stage.has_changed() => {
                drop(connected);
                self.ended(End::Scene, None)
            }
            Doing::Dark { connected, .. } if self.shared.light.is_on() => self.begin(connected),
            Doing::Dark { connected, asked } => self.wait(connected, asked),
            Doing::Measuring { connected, run } => self.measure(connected, run),
        };
    }

    fn connect(&mut self, now: Instant, person_said: bool) -> Doing {
        match reconnect(&self.shared, &mut self.source.connect) {
            Ok(mut connected) => {
                let dark = if person_said { None } else { why_dark(&mut connected.session) };
                if let Some(why) = dark {
                    return self.ended(End::Dark(why), Some(connected));
                }
                self.live.greeted(&mut connected);
                Doing::Dark { connected, asked: None }
            }
            // The scene before is shown next.
            Err(None) => Doing::Away { after: now, person_said },
            Err(Some(problem)) => {
                let line = format!("{problem}; trying again");
                self.shared.enter(Phase::Lost, Leds::Unknown, line);
                Doing::Away { after: now + PAUSE, person_said: false }
            }
        }
    }

    fn begin(&mut self, mut connected: Connected) -> Doing {
        let options = self.live.prepare(&connected);
        match Run::begin(&mut connected.session, &options, &mut self.live) {
            Ok(run) => self.measure(connected, Box::new(run)),
            Err(error) => match self.live.captured(&connected, Err(error)) {
                Ok(None) => Doing::Dark { connected, asked: None },
                Ok(Some(end)) => self.ended(end, Some(connected)),
                Err(error) => self.ended(End::Gone(causes::in_one_line(&error)), None),
            },
        }
    }

    fn measure(&mut self, mut connected: Connected, mut run: Box<Run>) -> Doing {
        let session = &mut connected.session;
        let goes_on = self.live.goes_on();
        if !goes_on {
            run.stop(session, &mut self.live);
        }
        let (began, before) = (Instant::now(), self.live.offered());
        while run.turn(session, &mut self.live) {
            let is_enough = self.live.offered() - before >= FRAMES || began.elapsed() > TURN;
            if goes_on && is_enough {
                return Doing::Measuring { connected, run };
            }
        }
        let captured = run.end(session, &mut self.live);
        match self.live.captured(&connected, captured) {
            Ok(None) => Doing::Dark { connected, asked: None },
            Ok(Some(end)) => self.ended(end, Some(connected)),
            Err(error) => self.ended(End::Gone(causes::in_one_line(&error)), None),
        }
    }

    /// A turn of a camera that waits for a person.
    fn await_person(&self, mut connected: Option<Connected>, asked: Option<Instant>) -> Doing {
        let is_due = asked.is_none_or(|asked| asked.elapsed() > PAUSE);
        let Some(camera) = connected.as_mut().filter(|_| is_due) else {
            return Doing::Waiting { connected, asked };
        };
        if is_dark(&self.shared, &mut camera.session).is_err() {
            connected = None;
        }
        Doing::Waiting { connected, asked: Some(Instant::now()) }
    }

    /// A turn of a camera whose LEDs a person switched off.
    fn wait(&mut self, mut connected: Connected, mut asked: Option<Instant>) -> Doing {
        let session = &mut connected.session;
        let mut ask = || {
            // A simulated camera computes while the host listens.
            if asked.is_none_or(|asked| asked.elapsed() > PAUSE) {
                asked = darken(&self.shared, session)?.then(Instant::now);
                session.listen(DARK, &mut IgnorePackets)?;
            }
            Ok::<_, SessionError>(())
        };
        match ask() {
            Ok(()) => Doing::Dark { connected, asked },
            Err(error) => self.ended(End::Gone(causes::in_one_line(&error)), None),
        }
    }

    fn ended(&mut self, end: End, connected: Option<Connected>) -> Doing {
        let now = Instant::now();
        match self.live.ended(end) {
            Next::Connect { person_said } => Doing::Away { after: now, person_said },
            Next::Retry => Doing::Away { after: now + PAUSE, person_said: false },
            Next::Person => Doing::Waiting { connected, asked: None },
        }
    }
}

/// The answer to a command: what the command has set, or why the command is refused.
fn answer<E: Display>(done: Result<impl Serialize, E>) -> Result<String, String> {
    let value = done.map_err(|refused| refused.to_string())?;
    serde_json::to_string(&value).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests;
