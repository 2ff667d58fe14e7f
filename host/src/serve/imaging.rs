//! Frames -> images: takes the newest look, reconstructs it, enhances it, and publishes the moment.
//!
//! The one law: it works on the newest frames there are and never makes the camera's thread wait.

use super::settings::Settings;
use super::slot::Look;
use super::state::{Offered, Published, Rate, Rates, State};
use super::{Shared, lock};
use crate::causes;
use crate::imaging::{
    Enhance, EnhanceError, ImageContext, SteadyWhite, Warning, White, brightest, warnings,
};
use crate::integrate::IntegrateError;
use nirspi_recon::Side;
use nirspi_recon::reconstruct::{Reconstruct, ReconstructError};
use serde::Serialize;
use std::sync::Arc;
use std::time::{Duration, Instant};
use thiserror::Error;
use tokio::sync::watch;

/// Least time from image to image: more than this no screen shows.
const PACE: Duration = Duration::from_millis(33);
/// How often pages hear of a camera that sends nothing.
const HEARTBEAT: Duration = Duration::from_millis(500);

/// Why a look gave no picture.
#[derive(Debug, Error)]
enum PictureError {
    /// The settings name a method that there is not.
    #[error("there is no method {0}")]
    Method(&'static str),
    /// The frames give no measurements.
    #[error(transparent)]
    Measurements(#[from] IntegrateError),
    /// The method gives no image.
    #[error(transparent)]
    Reconstruct(#[from] ReconstructError),
    /// The image is not of the instrument's size, or not finite.
    #[error("the frames gave no image of finite numbers")]
    NotFinite,
    /// The networks do not take the image.
    #[error(transparent)]
    Enhance(#[from] EnhanceError),
}

/// All that makes images.
pub struct Imaging {
    /// Methods of reconstruction, each by its word; the settings name one of them.
    pub methods: Vec<(&'static str, Box<dyn Reconstruct>)>,
    /// Fusion and deblurring.
    pub enhance: Enhance,
}

/// The images of one moment, and what is known of them.
#[derive(Debug, Serialize)]
pub struct Picture {
    /// (32, 32) in [0, 1], 1 being white.
    #[serde(skip)]
    pub image: Vec<f32>,
    /// (64, 64) in [0, 1].
    #[serde(skip)]
    pub enhanced: Option<Vec<f32>>,
    method: &'static str,
    /// Frames summed.
    frames: u64,
    /// ADC counts of one pixel that were taken for white.
    white_counts: f32,
    reconstruct_ms: f64,
    /// `null` where it is switched off.
    enhancement: Option<Enhancement>,
    /// Reasons not to trust the images: the frames' flags, and what the learned stages found.
    warnings: Vec<String>,
    /// The same in a few words, for the image itself.
    short_warnings: Vec<&'static str>,
}

/// What the learned stages found.
#[derive(Debug, Clone, Copy, Serialize)]
struct Enhancement {
    /// Blur in pixels of the 64 x 64 grid, as estimated.
    blur_px: f32,
    /// Noise of a pixel, white being 1, as estimated.
    noise: f32,
    /// Distance of the image from that of the result, over its noise: near 1 or below, the readings bear it out.
    inconsistency: f32,
    /// Whether a depth map was there to be fused.
    depth: bool,
    enhance_ms: f64,
}

/// Makes images and publishes them until told to stop.
pub fn run(shared: &Shared, imaging: &Imaging, publish: &watch::Sender<Arc<Published>>) {
    let mut white = SteadyWhite::default();
    let (mut picture, mut problem) = (None, None);
    let started = Instant::now();
    let (mut frames, mut images) = (Rate::new(started), Rate::new(started));
    while !shared.is_over() {
        let turn = Instant::now();
        if let Some(look) = shared.slot.take(HEARTBEAT) {
            let settings = *lock(&shared.settings);
            match imaging.picture(&look, settings, &mut white) {
                Ok(made) => (picture, problem) = (Some(Arc::new(made)), None),
                Err(why) => problem = Some(causes::in_one_line(&why)),
            }
            shared.slot.done(problem.is_none());
        }
        let now = Instant::now();
        let ledger = shared.slot.ledger();
        let rates = Rates {
            camera_frames_per_s: frames.at(now, ledger.frames.received),
            images_per_s: images.at(now, ledger.images.shown),
        };
        let settings = *lock(&shared.settings);
        // A copy: the camera's thread may have something to add meanwhile.
        let log = lock(&shared.camera).clone();
        let state = State {
            program: env!("CARGO_PKG_VERSION"),
            camera: &log.camera,
            ledger,
            rates,
            settings,
            offered: Offered::new(&shared.methods),
            picture: picture.as_deref(),
            problem: problem.as_deref(),
            viewers: shared.viewers(),
            events: log.events(),
        };
        let published = Published::new(&state, picture.as_ref());
        if let Ok(published) = published {
            publish.send_replace(Arc::new(published));
        }
        std::thread::sleep(PACE.saturating_sub(turn.elapsed()));
    }
}

impl Imaging {
    /// The images of one look.
    fn picture(
        &self,
        look: &Look,
        settings: Settings,
        white: &mut SteadyWhite,
    ) -> Result<Picture, PictureError> {
        let started = Instant::now();
        let (_, method) = self
            .methods
            .iter()
            .find(|(name, _)| *name == settings.method)
            .ok_or(PictureError::Method(settings.method))?;
        let measurements =
            look.sum.measurements(&look.run.setup, look.run.settling.as_ref(), false)?;
        let image = method.reconstruct(&measurements)?.image;
        let image = match &look.run.flat_field {
            Some(flat) => flat.correct(&image),
            None => image,
        };
        let reconstruct_ms = ms_since(started);
        let side = image.side().pixels();
        if side != Side::INSTRUMENT.pixels() || image.pixels().iter().any(|p| !p.is_finite()) {
            return Err(PictureError::NotFinite);
        }
        let white_counts = white.follow(brightest(image.pixels(), side));
        let mut all: Vec<String> = look.sum.warnings().into_iter().map(str::to_owned).collect();
        let (mut enhanced, mut enhancement, mut short) = (None, None, Vec::new());
        if settings.enhance && white_counts > 0.0 {
            let started = Instant::now();
            let known = ImageContext {
                rows: Some(measurements.rows()),
                depth: look.depth.as_deref(),
                ..ImageContext::default()
            };
            let made = self.enhance.enhance(&image, White::Known(white_counts), &known)?;
            let doubts = warnings(&made);
            short.extend(doubts.iter().map(Warning::short));
            all.extend(doubts.iter().map(Warning::to_string));
            enhancement = Some(Enhancement {
                blur_px: made.blur_px,
                noise: made.noise,
                inconsistency: made.inconsistency,
                depth: look.depth.is_some(),
                enhance_ms: ms_since(started),
            });
            enhanced = Some(made.pixels);
        }
        let scale = if white_counts > 0.0 { 1.0 / white_counts } else { 0.0 };
        Ok(Picture {
            image: image.pixels().iter().map(|v| (v * scale).clamp(0.0, 1.0)).collect(),
            enhanced,
            method: settings.method,
            frames: look.sum.frames(),
            white_counts,
            reconstruct_ms,
            enhancement,
            warnings: all,
            short_warnings: short,
        })
    }
}

fn ms_since(started: Instant) -> f64 {
    started.elapsed().as_secs_f64() * 1e3
}
