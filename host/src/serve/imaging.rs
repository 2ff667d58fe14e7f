//! The imaging thread: takes the newest frames, reconstructs and enhances their image, and
//! publishes the state.
//!
//! The imaging thread always takes the newest frames, and the camera's thread never waits for the
//! imaging thread.

use super::settings::Settings;
use super::slot::Look;
use super::state::{Light, Offered, Published, Rate, Rates, State};
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

/// Least time from image to image. Screens show no more images a second.
const PACE: Duration = Duration::from_millis(33);
/// Time between two states that pages receive while the camera sends nothing.
const HEARTBEAT: Duration = Duration::from_millis(500);

/// Why the newest frames gave no picture.
#[derive(Debug, Error)]
enum PictureError {
    /// The settings name a method that does not exist.
    #[error("there is no method {0}")]
    Method(&'static str),
    /// The frames give no measurements.
    #[error(transparent)]
    Measurements(#[from] IntegrateError),
    /// The method gives no image.
    #[error(transparent)]
    Reconstruct(#[from] ReconstructError),
    /// The image does not have the instrument's size, or has a pixel that is not finite.
    #[error("the frames gave no image of finite numbers")]
    NotFinite,
    /// The networks refuse the image.
    #[error(transparent)]
    Enhance(#[from] EnhanceError),
}

/// The methods and networks that make images.
pub struct Imaging {
    /// Methods of reconstruction by name. The settings name one of the methods.
    pub methods: Vec<(&'static str, Box<dyn Reconstruct>)>,
    /// Fusion and deblurring.
    pub enhance: Enhance,
}

/// The images of one state, and their properties.
#[derive(Debug, Serialize)]
pub struct Picture {
    /// The reconstructed image, (32, 32) in [0, 1], with white at 1.
    #[serde(skip)]
    pub image: Vec<f32>,
    /// The enhanced image, (64, 64) in [0, 1].
    #[serde(skip)]
    pub enhanced: Option<Vec<f32>>,
    method: &'static str,
    /// Number of summed frames.
    frames: u64,
    /// ADC counts of one pixel that were used as white.
    white_counts: f32,
    reconstruct_ms: f64,
    /// The results of the learned stages; `null` if they are switched off.
    enhancement: Option<Enhancement>,
    /// Reasons not to trust the images: the frames' flags, and the results of the learned stages.
    warnings: Vec<String>,
    /// Short forms of the warnings, for the image itself.
    short_warnings: Vec<&'static str>,
}

/// The results of the learned stages.
#[derive(Debug, Clone, Copy, Serialize)]
struct Enhancement {
    /// Estimated blur in pixels of the 64 x 64 grid.
    blur_px: f32,
    /// Estimated noise of a pixel; white is 1.
    noise: f32,
    /// Distance of the image from that of the result, divided by its noise. A value near 1 or below
    /// means that the readings support the result.
    inconsistency: f32,
    /// Whether a depth map was fused.
    depth: bool,
    enhance_ms: f64,
}

/// Makes images and publishes them until the server stops.
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
        // The log is copied, so that the camera's thread can add to the log meanwhile.
        let log = lock(&shared.camera).clone();
        let state = State {
            program: env!("CARGO_PKG_VERSION"),
            camera: &log.camera,
            light: Light { allowed: shared.light.is_on(), commands: shared.light.commands() },
            ledger,
            rates,
            settings,
            offered: Offered::new(&shared.methods, &shared.about),
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
    /// The images of the newest frames.
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
