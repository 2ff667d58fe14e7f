//! What is known of the camera, and what has happened to it, in words.

use crate::boards;
use crate::session::CameraIdentity;
use crate::setup::MeasurementSetup;
use crate::versions::{self, Part};
use serde::Serialize;
use std::collections::VecDeque;
use std::time::{SystemTime, UNIX_EPOCH};

/// Events that are kept for who comes later.
const EVENTS: usize = 100;

/// Where the camera is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Phase {
    /// Greeted; latency and settling are measured, or the setup sent.
    Preparing,
    /// Frames come.
    Measuring,
    /// It switched its LEDs off, and waits for somebody to say that they may go on again.
    Fault,
    /// Its latency could not be measured and none is kept, so no picture would be right. A person must say to try again.
    Uncalibrated,
    /// It has gone; it is looked for again.
    Lost,
}

/// What is known of the camera.
#[derive(Debug, Clone, Serialize)]
pub struct CameraState {
    /// As the command line names it.
    address: String,
    /// Whether anything in it is simulated.
    simulated: bool,
    /// Where it is.
    pub phase: Phase,
    /// The phase in words.
    line: String,
    identity: CameraIdentity,
    versions: Vec<Part>,
    #[serde(skip_serializing_if = "Option::is_none")]
    measurement: Option<Measurement>,
}

/// What is being measured, in short.
#[derive(Debug, Clone, Serialize)]
struct Measurement {
    patterns: usize,
    order: String,
    differential: bool,
    sweeps: u32,
    /// Light in one frame.
    frame_us: f64,
    calibrated: bool,
}

/// Something that happened.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EventLine {
    /// When, in milliseconds since 1970.
    unix_ms: u64,
    /// What, in one line.
    pub text: String,
}

/// What the camera's thread knows.
#[derive(Debug, Clone)]
pub struct CameraLog {
    /// The camera.
    pub camera: CameraState,
    /// The newest events, oldest first.
    events: VecDeque<EventLine>,
}

impl CameraLog {
    /// Of a camera that has answered.
    pub fn new(address: &str, identity: &CameraIdentity) -> Self {
        let camera = CameraState {
            address: address.to_owned(),
            simulated: false,
            phase: Phase::Preparing,
            line: String::new(),
            identity: identity.clone(),
            versions: Vec::new(),
            measurement: None,
        };
        let mut log = Self { camera, events: VecDeque::new() };
        log.greeted(identity);
        log
    }

    /// A camera has answered, perhaps another one.
    pub fn greeted(&mut self, identity: &CameraIdentity) {
        self.camera.identity = identity.clone();
        self.camera.simulated = boards::is_simulated(&identity.board);
        self.camera.versions = versions::compare(identity, None);
        self.camera.measurement = None;
        self.enter(Phase::Preparing, "preparing: latency and settling are measured".to_owned());
        self.event(format!("connected to {} {}", identity.board, identity.serial));
    }

    /// Frames come from now on.
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

    /// Something else is the case now.
    pub fn enter(&mut self, phase: Phase, line: String) {
        self.camera.phase = phase;
        self.camera.line = line;
    }

    /// Something has happened.
    pub fn event(&mut self, text: String) {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        self.events.push_back(EventLine { unix_ms: now.as_millis() as u64, text });
        if self.events.len() > EVENTS {
            self.events.pop_front();
        }
    }

    /// The newest events, oldest first.
    pub fn events(&self) -> &VecDeque<EventLine> {
        &self.events
    }
}
