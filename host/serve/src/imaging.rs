//! Imaging of a page: takes the newest frames, reconstructs and enhances their image, and makes the
//! state for pages.

use super::delays::Passed;
use super::line::Line;
use super::look::{Look, Measured};
use super::moving::Moving;
#[cfg(not(target_family = "wasm"))]
use super::own::OwnImages;
use super::picture::{CHOSEN_EVERY, Enhancement, Picture, PictureError, made_of, ms_since};
use super::settings::{Offer, Settings, alternatives};
use super::state::{Light, Offered, Published, Rate, Rates, State};
use super::{Shared, lock};
use nirspi::calibration::FlatField;
use nirspi::causes;
use nirspi::clock::Instant;
use nirspi::imaging::{
    Enhance, ImageContext, KnownReadings, MethodReport, SteadyWhite, Warning, White, enhance_frame,
};
use nirspi_nets::deblur::{self, Model};
use nirspi_nets::{Device, Method as Network, Networks, WeightsError};
use nirspi_recon::reconstruct::{
    Method, MethodSettings, Reconstruct, ReconstructError, Reconstruction, Report, Setting,
    Stacked, Strength,
};
use nirspi_recon::{Measurements, Side};
use std::sync::{Arc, Mutex};
use thiserror::Error;

/// Why methods and networks cannot be prepared.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ImagingError {
    /// A method of reconstruction.
    #[error(transparent)]
    Method(#[from] ReconstructError),
    /// The built-in weights.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// The method makes each image by itself.
    #[error(
        "{method} makes each image by itself; {} can start from the images before",
        alternatives(.methods)
    )]
    WarmStart {
        /// The method.
        method: &'static str,
        /// The methods whose images can start from the images before.
        methods: Vec<&'static str>,
    },
}

/// The methods and networks that make images.
pub struct Imaging {
    settings: MethodSettings,
    methods: Vec<Prepared>,
    device: Device,
    models: Vec<Model>,
    /// Images of patterns of a bench's own, if it shows such.
    #[cfg(not(target_family = "wasm"))]
    own: Option<OwnImages>,
    /// The learned stages with the network of this name.
    enhance: (&'static str, Enhance),
}

/// These settings with the strength that a page chose; without one, it is chosen by held-back
/// measurements.
pub(super) fn with_strength(settings: &MethodSettings, strength: Option<f64>) -> MethodSettings {
    let strength = strength.map_or_else(Strength::default, Strength::Fixed);
    MethodSettings { strength, ..settings.clone() }
}

/// A method of reconstruction that is ready.
struct Prepared {
    name: &'static str,
    method: Box<dyn Reconstruct>,
    /// The method of the library's list, and the strength for which it is prepared, if it has one.
    built_in: Option<(Method, Option<f64>)>,
}

impl Imaging {
    /// Every method of the library's list with these settings, and the built-in networks on this
    /// device. A network that needs many steps for one image is left out.
    ///
    /// # Errors
    /// [`ImagingError`] if a setting is out of range, or the built-in weights are damaged.
    pub fn new(settings: &MethodSettings, device: Device) -> Result<Self, ImagingError> {
        let strength = strength_of(settings);
        let ready = |method: &Method| {
            let name = method.argument();
            let prepared = method.prepare(&settings.taken_by(*method))?;
            let built_in = Some((*method, strength.filter(|_| method.takes(Setting::Strength))));
            let method: Box<dyn Reconstruct> =
                Box::new(Stacked::chosen_every(CHOSEN_EVERY, prepared));
            Ok(Prepared { name, method, built_in })
        };
        let methods = Method::ALL.iter().map(ready).collect::<Result<_, ReconstructError>>()?;
        let mut networks = Networks::built_in(device.clone());
        let mut is_live = |model: &Model| {
            model.default_steps().get() == 1 && networks.weights(model.name()).is_ok()
        };
        let models = Model::ALL.into_iter().filter(|model| is_live(model)).collect();
        let model = Network::default().model();
        let enhance = (model.name(), Enhance::by(model.into(), &device)?);
        Ok(Self {
            settings: settings.clone(),
            methods,
            device,
            models,
            #[cfg(not(target_family = "wasm"))]
            own: None,
            enhance,
        })
    }

    /// The same for a feed of its own patterns, whose page begins with this method: with the methods for such patterns, and
    /// without networks, which know Hadamard patterns only.
    ///
    /// # Errors
    /// [`ImagingError::Method`] if the method needs Hadamard rows.
    #[cfg(not(target_family = "wasm"))]
    pub fn of_own_patterns(mut self, method: Method) -> Result<Self, ImagingError> {
        self.own = Some(OwnImages::new(method, &self.settings)?);
        let is_ours = |method: Method| method.with_matrix().is_some();
        self.methods.retain(|prepared| prepared.built_in.is_some_and(|(of, _)| is_ours(of)));
        self.models.clear();
        Ok(self)
    }

    /// Whether images by this method can start from the images before.
    fn can_remember(&self, prepared: &Prepared) -> bool {
        #[cfg(not(target_family = "wasm"))]
        if self.own.is_some() {
            return false;
        }
        matches!(prepared.method.begin_video(), Ok(Some(_)))
    }

    /// The same with a method of your own. Pages offer the method by this name.
    #[must_use]
    pub fn with_method(mut self, name: &'static str, method: Box<dyn Reconstruct>) -> Self {
        self.methods.push(Prepared { name, method, built_in: None });
        self
    }

    /// What pages can choose.
    pub(super) fn offer(&self) -> Offer {
        let with_strength = |prepared: &&Prepared| {
            prepared.built_in.is_some_and(|(method, _)| method.takes(Setting::Strength))
        };
        let with_warm_start = |prepared: &&Prepared| self.can_remember(prepared);
        let about =
            |prepared: &Prepared| prepared.built_in.map_or("", |(method, _)| method.about());
        Offer {
            methods: self.methods.iter().map(|prepared| prepared.name).collect(),
            about: self.methods.iter().map(about).collect(),
            with_strength: self.methods.iter().filter(with_strength).map(|p| p.name).collect(),
            with_warm_start: self.methods.iter().filter(with_warm_start).map(|p| p.name).collect(),
            models: self.models.iter().map(|model| model.name()).collect(),
            ..Offer::default()
        }
    }

    /// Whether the images of the method of this name can start from the images before. A command
    /// line is refused if they cannot; pages ignore a setting that the method does not use.
    ///
    /// # Errors
    /// [`ImagingError::WarmStart`] if the method makes each image by itself, and
    /// [`ImagingError::Method`] if the method's settings allow no video.
    pub fn check_warm_start(&self, method: &'static str) -> Result<(), ImagingError> {
        let chosen = self.methods.iter().find(|prepared| prepared.name == method);
        chosen.map(|prepared| prepared.method.begin_video()).transpose()?;
        match chosen.is_some_and(|prepared| self.can_remember(prepared)) {
            true => Ok(()),
            false => {
                let methods = self.offer().with_warm_start;
                Err(ImagingError::WarmStart { method, methods })
            }
        }
    }

    /// Whether images start from the images before.
    fn remembers(&self, settings: &Settings) -> bool {
        let mut all = self.methods.iter();
        settings.warm_start
            && all
                .find(|prepared| prepared.name == settings.method)
                .is_some_and(|prepared| self.can_remember(prepared))
    }

    /// The method that these settings choose, prepared for their strength.
    fn method(&mut self, settings: &Settings) -> Result<&dyn Reconstruct, PictureError> {
        let mut all = self.methods.iter_mut();
        let prepared = all
            .find(|prepared| prepared.name == settings.method)
            .ok_or(PictureError::Method(settings.method))?;
        if let Some((method, strength)) = &mut prepared.built_in
            && method.takes(Setting::Strength)
            && *strength != settings.strength
        {
            let with = with_strength(&self.settings, settings.strength);
            prepared.method = method.prepare(&with.taken_by(*method))?;
            *strength = settings.strength;
        }
        Ok(prepared.method.as_ref())
    }

    /// What is known of the readings of an image that this method of the library made: `None` for a
    /// method of your own.
    fn known(
        &self,
        settings: &Settings,
        report: &Report,
        measurements: &Measurements,
    ) -> Option<KnownReadings> {
        let of_library = self.methods.iter().find(|prepared| prepared.name == settings.method);
        let (method, strength) = of_library?.built_in?;
        let report = MethodReport { method, made: report.clone() };
        KnownReadings::new(&report, &with_strength(&self.settings, strength), measurements)
    }

    /// The learned stages with the network that these settings choose.
    fn enhance(&mut self, settings: &Settings) -> Result<&Enhance, PictureError> {
        if self.enhance.0 != settings.model {
            let mut models = self.models.iter();
            if let Some(model) = models.find(|model| model.name() == settings.model) {
                self.enhance = (model.name(), Enhance::by((*model).into(), &self.device)?);
            }
        }
        Ok(&self.enhance.1)
    }
}

/// The strength of these settings; `None` if it is chosen by the measurements.
fn strength_of(settings: &MethodSettings) -> Option<f64> {
    match settings.strength {
        Strength::Fixed(strength) => Some(strength),
        Strength::CrossValidated { .. } => None,
    }
}

/// What pages are told of the images.
pub(super) struct Told {
    picture: Option<Arc<Picture>>,
    problem: Option<String>,
    frames: Rate,
    images: Rate,
    /// Number of states.
    states: u64,
}

/// Makes one image after the other, and the state around it.
///
/// An image may take long. What pages are told of it is behind a lock of its own, so that another
/// thread can make states meanwhile.
pub(super) struct Studio {
    imaging: Imaging,
    white: SteadyWhite,
    moving: Moving,
    told: Arc<Mutex<Told>>,
}

impl Studio {
    /// A studio without images.
    pub(super) fn new(imaging: Imaging) -> Self {
        let started = Instant::now();
        let (frames, images) = (Rate::new(started), Rate::new(started));
        let told = Told { picture: None, problem: None, frames, images, states: 0 };
        let (white, moving) = (SteadyWhite::default(), Moving::default());
        Self { imaging, white, moving, told: Arc::new(Mutex::new(told)) }
    }

    /// What pages are told of the images.
    pub(super) fn told(&self) -> Arc<Mutex<Told>> {
        Arc::clone(&self.told)
    }

    /// Makes the image of a look taken from the slot.
    pub(super) fn make(&mut self, shared: &Shared, look: &Look) {
        let mut settings = lock(&shared.settings).clone();
        settings.enhance &= !shared.shed().enhancement_off;
        if self.moving.awaits(look, &settings) {
            let scene = (&mut self.white, &mut self.moving);
            let made = self.imaging.picture(look, &settings, scene, shared);
            let told = &mut *lock(&self.told);
            match made {
                Ok(made) => (told.picture, told.problem) = (Some(Arc::new(made)), None),
                Err(why) => told.problem = Some(causes::in_one_line(&why)),
            }
            shared.slot.done(told.problem.is_none());
        } else {
            shared.slot.leave();
        }
    }
}

impl Told {
    /// The state of this moment.
    ///
    /// # Errors
    /// Does not occur: every field can be written as JSON.
    pub(super) fn state(&mut self, shared: &Shared) -> serde_json::Result<Published> {
        let now = Instant::now();
        let ledger = shared.slot.ledger();
        let rates = Rates {
            camera_frames_per_s: self.frames.at(now, ledger.frames.received),
            images_per_s: self.images.at(now, ledger.images.shown),
        };
        let settings = lock(&shared.settings).clone();
        // The log is copied, so that the camera's thread can add to the log meanwhile.
        let mut log = lock(&shared.camera).clone();
        log.camera.age(now);
        let (allowed, commands) = shared.light.position();
        self.states += 1;
        let state = State {
            number: self.states,
            program: env!("CARGO_PKG_VERSION"),
            camera: &log.camera,
            light: Light { allowed, commands },
            ledger,
            rates,
            settings: &settings,
            offered: Offered::new(&shared.offer),
            picture: self.picture.as_deref(),
            problem: self.problem.as_deref(),
            scene: shared.stage.state(),
            line: shared.line.as_ref().map(Line::state),
            viewers: shared.viewers(),
            delays: lock(&shared.delays).state(now),
            overload: lock(&shared.overload).state(),
            events: log.events(),
        };
        Published::new(&state, self.picture.as_ref(), shared.stage.drawing().as_deref())
    }
}

impl Imaging {
    /// The images of the newest frames.
    fn picture(
        &mut self,
        look: &Look,
        settings: &Settings,
        (white, moving): (&mut SteadyWhite, &mut Moving),
        shared: &Shared,
    ) -> Result<Picture, PictureError> {
        let started = Instant::now();
        let (measurements, frame_warnings) = match look.measured(self.remembers(settings))? {
            Measured::Hadamard { measurements, warnings } => (measurements, warnings),
            #[cfg(not(target_family = "wasm"))]
            Measured::Own(plain) => {
                let own = self.own.as_mut().ok_or(PictureError::Method(settings.method))?;
                return own.picture(&plain, look, settings, white, shared);
            }
        };
        let method = self.method(settings)?;
        let made = moving.image(method, &measurements, look, settings)?;
        let flat_field = look.flat_field();
        let for_networks = settings
            .enhance
            .then(|| FlatField::corrected(flat_field, made.with_readings(&measurements)));
        let Reconstruction { image, report } = made;
        let known = self.known(settings, &report, &measurements);
        let image = FlatField::corrected(flat_field, image);
        let reconstruct_ms = ms_since(started);
        let side = image.side().pixels();
        if image.pixels().iter().any(|p| !p.is_finite()) {
            return Err(PictureError::NotFinite);
        }
        shared.passed(Passed::Reconstructed, look.arrived);
        let white_counts = white.follow(White::Brightest.level(&image));
        let mut all = frame_warnings.clone();
        let (mut enhanced, mut enhancement, mut short) = (None, None, Vec::new());
        let mut half_width = None;
        // The networks know images of two sizes.
        let is_known = [Side::INSTRUMENT.pixels(), deblur::SIDE].contains(&side);
        if let Some(given) = for_networks.filter(|_| white_counts > 0.0 && is_known) {
            let started = Instant::now();
            let depth = look.depth().map(|depth| &depth.map);
            let (rows, readings) = (Some(measurements.rows()), known);
            let known = ImageContext { rows, readings, depth, ..ImageContext::default() };
            let enhance = self.enhance(settings)?;
            let (made, doubts) = enhance_frame(enhance, &given, white_counts, &known)?;
            short.extend(doubts.iter().map(Warning::short));
            all.extend(doubts.iter().map(Warning::to_string));
            enhancement = Some(Enhancement {
                model: settings.model,
                blur_px: made.blur_px,
                noise: made.noise,
                inconsistency: made.inconsistency,
                depth: look.depth().is_some(),
                enhance_ms: ms_since(started),
            });
            (enhanced, half_width) = (Some(made.pixels), made.half_width);
            shared.passed(Passed::Enhanced, look.arrived);
        }
        Ok(Picture {
            enhanced,
            half_width,
            n: Some(side),
            readings: Some(readings(&measurements)),
            past: report.warm.then(|| report.note.unwrap_or_default()),
            enhancement,
            warnings: all,
            frame_warnings,
            short_warnings: short,
            ..made_of(look, settings, shared, &image, white_counts, reconstruct_ms)
        })
    }
}

/// The measurements by Hadamard row; NaN for a row that was not measured.
fn readings(measurements: &Measurements) -> Vec<f32> {
    let mut readings = vec![f32::NAN; measurements.side().area()];
    for (&row, &value) in measurements.rows().iter().zip(measurements.values()) {
        readings[row as usize] = value as f32;
    }
    readings
}
