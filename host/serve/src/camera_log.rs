//! The state of the camera and its events, in words.

use super::light::Leds;
use nirspi::account::FailedChecks;
use nirspi::boards;
use nirspi::clock::{self, Instant};
use nirspi::events::Level;
#[cfg(not(target_family = "wasm"))]
use nirspi::feed::{Account, Header};
use nirspi::identity::CameraIdentity;
#[cfg(not(target_family = "wasm"))]
use nirspi::provenance::{Origin, Taken};
use nirspi::setup::MeasurementSetup;
use nirspi::versions::{self, Part};
use nirspi_wire::Status;
use serde::Serialize;
use std::collections::VecDeque;
use std::time::Duration;

/// How long the camera's word that its LEDs are off holds. A dark camera is asked every second.
const CONFIRMED: Duration = Duration::from_secs(2);

/// Number of events kept for pages that connect later.
const EVENTS: usize = 100;

/// The phase of the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Phase {
    /// The camera has answered. Latency and settling are being measured, or the setup is being
    /// sent.
    Preparing,
    /// Frames arrive.
    Measuring,
    /// A person switched the LEDs off. A person must switch them on again.
    Stopped,
    /// The camera switched its LEDs off and waits for a person to allow them again.
    Fault,
    /// The camera's latency could not be measured and no calibration is kept, so every picture
    /// would be wrong. A person must ask for another attempt.
    Uncalibrated,
    /// The link is gone; the thread tries to reconnect.
    Lost,
    /// A feed sends nothing.
    #[cfg(not(target_family = "wasm"))]
    Silent,
}

/// The state of the camera.
#[derive(Debug, Clone, Serialize)]
pub struct CameraState {
    /// The camera's address as on the command line.
    address: String,
    /// Whether any part of the camera is simulated.
    simulated: bool,
    /// The phase.
    pub phase: Phase,
    /// The phase in words.
    line: String,
    /// What is known of the LEDs.
    pub leds: Leds,
    /// How long ago the LEDs were last known to be on or off, in milliseconds.
    leds_age_ms: u64,
    /// When the LEDs were last known to be on or off.
    #[serde(skip)]
    leds_known: Instant,
    /// The camera; `null` for a feed.
    identity: Option<CameraIdentity>,
    /// The feed, if readings come from one.
    #[cfg(not(target_family = "wasm"))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) feed: Option<FeedState>,
    versions: Vec<Part>,
    #[serde(skip_serializing_if = "Option::is_none")]
    measurement: Option<Measurement>,
    /// What the camera last said of itself.
    pub said: Said,
}

impl CameraState {
    /// Where the readings come from.
    #[cfg(not(target_family = "wasm"))]
    pub fn taken(&self) -> Taken {
        match (&self.identity, &self.feed) {
            (Some(identity), _) => Taken::by(identity),
            (None, Some(feed)) => feed.taken.clone(),
            (None, None) => Taken::without_camera(Origin::Unknown),
        }
    }

    /// Records what is known of the LEDs now.
    pub fn leds_are(&mut self, leds: Leds) {
        self.leds_were(leds, Instant::now());
    }

    /// Records what was true of the LEDs at a moment. An answer of the camera may be as old as its question.
    pub fn leds_were(&mut self, leds: Leds, at: Instant) {
        self.leds = leds;
        if leds != Leds::Unknown {
            self.leds_known = at;
        }
    }

    /// Makes this the state at a later moment: LEDs that were off too long ago may be on again. LEDs that
    /// were switched on count as on until the camera has confirmed that they are off.
    pub fn age(&mut self, now: Instant) {
        let age = now.saturating_duration_since(self.leds_known);
        self.leds_age_ms = age.as_millis() as u64;
        if self.leds == Leds::Off && age > CONFIRMED {
            self.leds = Leds::Unknown;
        }
    }
}

/// A feed, by its header, and what became of its numbers.
#[cfg(not(target_family = "wasm"))]
#[derive(Debug, Clone, Serialize)]
pub struct FeedState {
    name: Option<String>,
    unit: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    n: Option<usize>,
    height: usize,
    width: usize,
    order: String,
    patterns: usize,
    readings: &'static str,
    /// What became of its numbers.
    pub account: Account,
    #[serde(skip)]
    taken: Taken,
}

/// What a camera last said of itself beside its frames.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct Said {
    /// The camera's time of the newest frame of the run.
    pub device_time_us: u64,
    /// How many packets of all runs failed each check.
    pub failed_checks: FailedChecks,
    /// The last status; `null` before the first.
    pub status: Option<Status>,
}

/// A short description of the measurement.
#[derive(Debug, Clone, Serialize)]
struct Measurement {
    patterns: usize,
    order: String,
    differential: bool,
    sweeps: u32,
    /// Time of light in one frame.
    frame_us: f64,
    calibrated: bool,
}

/// One event.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EventLine {
    /// Time of the event, in milliseconds since 1970.
    pub unix_ms: u64,
    /// How serious the event is.
    pub level: Level,
    /// The event in one line.
    pub text: String,
}

/// The state and the events that the camera's thread reports.
#[derive(Debug, Clone)]
pub struct CameraLog {
    /// The state of the camera.
    pub camera: CameraState,
    /// The newest events, oldest first.
    events: VecDeque<EventLine>,
}

impl CameraLog {
    /// The log of a camera that has answered.
    pub fn new(address: &str, identity: &CameraIdentity) -> Self {
        let camera = CameraState {
            address: address.to_owned(),
            simulated: false,
            phase: Phase::Preparing,
            line: String::new(),
            leds: Leds::Off,
            leds_age_ms: 0,
            leds_known: Instant::now(),
            identity: Some(identity.clone()),
            #[cfg(not(target_family = "wasm"))]
            feed: None,
            versions: Vec::new(),
            measurement: None,
            said: Said::default(),
        };
        let mut log = Self { camera, events: VecDeque::new() };
        log.greeted(identity);
        log
    }

    /// The log of a feed.
    #[cfg(not(target_family = "wasm"))]
    pub fn of_feed(address: &str) -> Self {
        let camera = CameraState {
            address: address.to_owned(),
            simulated: false,
            phase: Phase::Preparing,
            line: String::new(),
            leds: Leds::None,
            leds_age_ms: 0,
            leds_known: Instant::now(),
            identity: None,
            feed: None,
            versions: Vec::new(),
            measurement: None,
            said: Said::default(),
        };
        Self { camera, events: VecDeque::new() }
    }

    /// Records that the header of a feed has come.
    #[cfg(not(target_family = "wasm"))]
    pub fn fed(&mut self, header: &Header, taken: Taken) {
        self.camera.simulated = header.simulated == Some(true);
        let line = format!("{}, order {}", header.size(), header.order());
        self.camera.feed = Some(FeedState {
            name: header.name.clone(),
            unit: header.unit.clone(),
            n: header.hadamard().ok().map(|(side, _)| side.pixels()),
            height: header.size().height(),
            width: header.size().width(),
            order: header.order(),
            patterns: header.patterns(),
            readings: header.form.name(),
            account: Account::default(),
            taken,
        });
        self.event(Level::Info, format!("a feed has begun: {line}"));
        self.enter(Phase::Measuring, "receiving the first frame".to_owned());
    }

    /// Records that a camera has answered; the camera may be another one than before.
    pub fn greeted(&mut self, identity: &CameraIdentity) {
        self.camera.identity = Some(identity.clone());
        self.camera.simulated = boards::is_simulated(&identity.board);
        self.camera.versions = versions::compare(identity, None);
        self.camera.measurement = None;
        // A greeting ends the session before, and light with it.
        self.camera.leds_are(Leds::Off);
        self.enter(Phase::Preparing, "preparing: latency and settling are measured".to_owned());
        self.camera.said.status = None;
        self.event(Level::Info, format!("connected to {} {}", identity.board, identity.serial));
    }

    /// Records that frames arrive from now on.
    pub fn measuring(&mut self, setup: &MeasurementSetup, calibrated: bool) {
        self.camera.measurement = Some(Measurement {
            patterns: setup.rows.len(),
            order: setup.order.clone(),
            differential: setup.differential,
            sweeps: setup.sweeps,
            frame_us: setup.frame_ns() * 1e-3,
            calibrated,
        });
        self.enter(Phase::Measuring, "measuring".to_owned());
    }

    /// Records a new phase.
    pub fn enter(&mut self, phase: Phase, line: String) {
        self.camera.phase = phase;
        self.camera.line = line;
    }

    /// Records what the host has counted so far. The first packet that fails a check is an event.
    pub fn counted(&mut self, device_time_us: u64, failed_checks: FailedChecks) {
        let before = self.camera.said.failed_checks;
        for check in failed_checks.first_after(before) {
            let wrong = check.in_words();
            let line = format!(
                "a packet arrived damaged: {wrong}; the next such packets are only counted"
            );
            self.event(Level::Warning, line);
        }
        let said = &mut self.camera.said;
        (said.device_time_us, said.failed_checks) = (device_time_us, failed_checks);
    }

    /// Records an event.
    pub fn event(&mut self, level: Level, text: String) {
        let unix_ms = clock::since_1970().as_millis() as u64;
        self.events.push_back(EventLine { unix_ms, level, text });
        if self.events.len() > EVENTS {
            self.events.pop_front();
        }
    }

    /// The newest events, oldest first.
    pub fn events(&self) -> &VecDeque<EventLine> {
        &self.events
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn identity() -> CameraIdentity {
        CameraIdentity::current("test", "T")
    }

    #[test]
    fn the_word_that_leds_are_off_does_not_last() {
        let mut camera = CameraLog::new("test", &identity()).camera;
        let seen = |camera: &CameraState, ms| {
            let mut later = camera.clone();
            later.age(camera.leds_known + Duration::from_millis(ms));
            (later.leds, later.leds_age_ms)
        };
        camera.leds_are(Leds::Off);
        assert_eq!(seen(&camera, 1900), (Leds::Off, 1900));
        assert_eq!(seen(&camera, 2100), (Leds::Unknown, 2100));
        camera.leds_are(Leds::On);
        assert_eq!(seen(&camera, 9000), (Leds::On, 9000));
        // What is not known is as old as what was known before.
        let known = camera.leds_known;
        camera.leds_are(Leds::Unknown);
        assert_eq!(camera.leds_known, known);
    }

    #[test]
    fn the_first_packet_that_fails_a_check_is_an_event_and_further_ones_are_counted() {
        let mut log = CameraLog::new("test", &identity());
        let before = log.events().len();
        for (crc, cobs) in [(0, 0), (1, 0), (2, 0), (2, 1), (9, 9)] {
            log.counted(0, FailedChecks { crc, cobs, ..FailedChecks::default() });
        }
        let texts: Vec<&str> =
            log.events().iter().skip(before).map(|event| event.text.as_str()).collect();
        assert_eq!(texts.len(), 2, "{texts:?}");
        assert!(texts[0].starts_with("a packet arrived damaged: wrong CRC-32; the next"));
        assert!(texts[1].starts_with("a packet arrived damaged: broken COBS code; "));
        assert_eq!(log.camera.said.failed_checks.packets(), 18);
    }

    #[test]
    fn the_newest_events_are_kept_and_no_more() {
        let mut log = CameraLog::new("test", &identity());
        for number in 1..=3 * EVENTS {
            log.event(Level::Info, number.to_string());
        }
        let texts: Vec<&str> = log.events().iter().map(|event| event.text.as_str()).collect();
        let expected: Vec<String> = (2 * EVENTS + 1..=3 * EVENTS).map(|n| n.to_string()).collect();
        assert_eq!(texts, expected);
    }
}
