//! What stands in front of the virtual camera: scene, projector, photon budget, receiver.

use super::{OpticalFpga, VirtualCamera};
use crate::scene::SceneMap;
use crate::setup::MeasurementSetup;
use nirspi_optics::camera::fnv1a;
use nirspi_optics::rain::{Air, BeamShadows, RainError, RainySpots, Weather};
use nirspi_optics::{
    Budget, BudgetError, CameraModel, Chain, ChainError, ChainSettings, DepthError, DepthView,
    Footprint, LedArray, Projector, ProjectorError, Scene, SceneError, SimulatedDepth,
};
use nirspi_recon::{Order, RowsError};
use thiserror::Error;

/// Everything that light meets on its way, at one distance.
#[derive(Debug, Clone)]
pub struct VirtualOptics {
    camera: CameraModel,
    scene: Scene,
    distance_mm: f64,
    footprint: Footprint,
    budget: Budget,
    chain: ChainSettings,
    weather: Option<Weather>,
}

/// Optics that cannot be.
#[derive(Debug, Error)]
pub enum VirtualOpticsError {
    /// Distance or lens.
    #[error(transparent)]
    Projector(#[from] ProjectorError),
    /// Light.
    #[error(transparent)]
    Budget(#[from] BudgetError),
    /// Receiver.
    #[error(transparent)]
    Chain(#[from] ChainError),
    /// Distance.
    #[error(transparent)]
    Depth(#[from] DepthError),
    /// Reflectances.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Weather.
    #[error(transparent)]
    Rain(#[from] RainError),
    /// Gateware and protocol are of one wavelength.
    #[error(
        "wavelength_nm is {0}, expected {expected} for a virtual camera: its protocol knows no other; \
         `nirspi range` and `nirspi rain --budget` take any",
        expected = nirspi_wire::WAVELENGTH_NM
    )]
    Wavelength(f64),
}

impl VirtualOptics {
    /// The paper's camera in front of `scene`, its gain set for a white target at that distance.
    ///
    /// # Errors
    /// A distance that no light covers.
    pub fn new(scene: Scene, distance_mm: f64) -> Result<Self, VirtualOpticsError> {
        Self::of(CameraModel::paper(), scene, distance_mm)
    }

    /// This camera in front of `scene`, its gain set for a white target at that distance. The weather of the description
    /// is not taken from it: see [`Self::in_air`].
    ///
    /// # Errors
    /// A description that is not physical, or a distance that no light covers.
    pub fn of(
        camera: &CameraModel,
        scene: Scene,
        distance_mm: f64,
    ) -> Result<Self, VirtualOpticsError> {
        if camera.wavelength_nm != f64::from(nirspi_wire::WAVELENGTH_NM) {
            return Err(VirtualOpticsError::Wavelength(camera.wavelength_nm));
        }
        let projector = camera.projector();
        let footprint = projector.footprint(&scene, distance_mm)?;
        let budget = Budget::new(&camera.budget_settings(), &projector, distance_mm)?;
        let mut chain = camera.chain_settings();
        chain.electrons_per_count = chain.auto_gain(&budget)?;
        chain.ambient_electrons = budget.ambient_electrons(footprint.mean());
        let camera = camera.clone();
        Ok(Self { camera, scene, distance_mm, footprint, budget, chain, weather: None })
    }

    /// This camera in front of a scene by name or file: a target of its own size, or one that fills the field.
    ///
    /// # Errors
    /// A distance that no light covers, or that the depth sensor cannot read.
    pub fn before(
        camera: &CameraModel,
        map: &SceneMap,
        distance_mm: f64,
    ) -> Result<Self, VirtualOpticsError> {
        let fills = || camera.projector().field_mm(distance_mm);
        let side_mm = map.side_mm.unwrap_or_else(fills);
        let scene = Scene::new(map.reflectance.clone(), map.size_px, side_mm)?;
        let optics = Self::of(camera, scene, distance_mm)?;
        // The depth sensor has a range of its own.
        optics.depth(0)?;
        Ok(optics)
    }

    /// The camera.
    #[must_use]
    pub fn camera_model(&self) -> &CameraModel {
        &self.camera
    }

    /// The first patterns of `order`, differential, with the timing of this camera.
    ///
    /// # Errors
    /// As [`MeasurementSetup::new`].
    pub fn setup(&self, order: &Order, sampling: f64) -> Result<MeasurementSetup, RowsError> {
        let readout = self.camera.readout;
        // Ranges are checked when a description is read.
        let (clocks, blanked) = (readout.clocks_per_pattern as u16, readout.blanked as u16);
        Ok(MeasurementSetup::new(order, sampling)?.timed(clocks, blanked))
    }

    /// The same camera in dry air before a white sheet that fills its field, where its lens is focused: what latency and
    /// settling are measured against.
    ///
    /// # Errors
    /// Optics that have no focus.
    pub fn white_sheet(&self) -> Result<Self, VirtualOpticsError> {
        let distance_mm = self.camera.projector.focus_distance_mm;
        let sheet = Self::of(&self.camera, Scene::white(), distance_mm)?;
        // A receiver without noise stays one.
        let ChainSettings { electrons_per_count, ambient_electrons, .. } = sheet.chain;
        let chain = ChainSettings { electrons_per_count, ambient_electrons, ..self.chain };
        Ok(Self { chain, ..sheet })
    }

    /// ADC counts that a white target gives one pixel, as the photon budget has it.
    #[must_use]
    pub fn white_counts(&self) -> f64 {
        self.budget.electrons_per_led / self.chain.electrons_per_count
    }

    /// The serial number of the virtual camera with this seed. Cameras that differ in anything that is the instrument's,
    /// not the scene's, have different ones, so that none uses the kept calibration of another: `virtual-1`, and for
    /// other than default instruments `virtual-1-` with a short name of their settings.
    #[must_use]
    pub fn serial(&self, seed: u64) -> String {
        let instrument = |camera: &CameraModel, chain: &ChainSettings| {
            let paper = CameraModel::paper();
            // Light, weather and name are not the instrument's.
            let camera = CameraModel {
                name: paper.name.clone(),
                light: paper.light,
                weather: paper.weather,
                ..camera.clone()
            };
            // Gain and daylight follow distance and scene, and change neither latency nor settling.
            let chain =
                ChainSettings { electrons_per_count: 1.0, ambient_electrons: 0.0, ..*chain };
            format!("{camera:?} {chain:?}")
        };
        let this = instrument(&self.camera, &self.chain);
        if this == instrument(CameraModel::paper(), &ChainSettings::default()) {
            return format!("virtual-{seed}");
        }
        format!("virtual-{seed}-{:08x}", fnv1a(this.as_bytes()))
    }

    /// Puts this weather between camera and scene. Daylight is dimmed and scattered as they do on average; what
    /// falling drops do to the LEDs' light is followed drop by drop.
    ///
    /// # Errors
    /// Air too dense, or too many drops to be followed.
    pub fn in_air(self, air: &Air) -> Result<Self, VirtualOpticsError> {
        if air.is_clear() {
            return Ok(self);
        }
        let optics = air.weather(self.camera.wavelength_nm)?;
        let optics = self.in_weather(optics)?;
        // Whether the drops can be followed shows now rather than when the camera is made.
        optics.spots(0)?;
        Ok(optics)
    }

    /// As [`in_air`](Self::in_air), in weather that was worked out before.
    ///
    /// # Errors
    /// Air too dense.
    pub fn in_weather(mut self, weather: Weather) -> Result<Self, VirtualOpticsError> {
        let baseline_mm = self.camera.collector.baseline_mm;
        let veil = weather.veil(&self.camera.projector, self.distance_mm, baseline_mm)?;
        let returned = weather.blur(self.distance_mm)?.returned(self.field_mm() / self.distance_mm);
        self.chain.ambient_electrons =
            self.budget.ambient_electrons(self.footprint.mean()) * returned * weather.clear()
                + self.budget.ambient_electrons_white * veil.airlight;
        self.weather = Some(weather);
        Ok(self)
    }

    /// Extinction between camera and target, times the distance; 0 in dry air.
    #[must_use]
    pub fn optical_depth(&self) -> f64 {
        let per_m = |weather: &Weather| weather.medium().extinction_per_m;
        self.weather.as_ref().map_or(0.0, per_m) * self.distance_mm * 1e-3
    }

    /// What the LEDs' spots show in the rain; none in dry air.
    ///
    /// # Errors
    /// Too many drops to be followed.
    pub fn spots(&self, seed: u64) -> Result<Option<RainySpots>, RainError> {
        let Some(weather) = &self.weather else { return Ok(None) };
        let beams = BeamShadows {
            projector: self.camera.projector,
            distance_mm: self.distance_mm,
            baseline_mm: self.camera.collector.baseline_mm,
            collector_mm: self.budget.effective_collector_mm,
        };
        RainySpots::new(weather, &self.footprint, beams, seed).map(Some)
    }

    /// Replaces the receiver by an exact one: no noise, no settling, no daylight, no latency. For tests
    /// that compare bits.
    #[must_use]
    pub fn ideal(mut self) -> Self {
        let electrons_per_count = self.chain.electrons_per_count;
        self.chain = ChainSettings { electrons_per_count, ..ChainSettings::ideal() };
        self
    }

    /// Takes all noise and dark current from the receiver; LEDs and amplifier stay as slow as they are.
    #[must_use]
    pub fn noiseless(mut self) -> Self {
        self.chain = self.chain.noiseless();
        self
    }

    /// Mean reflectance that each LED sees, row-major.
    #[must_use]
    pub fn footprint(&self) -> &Footprint {
        &self.footprint
    }

    /// What a perfect camera of 32 x 32 pixels would see: the scene without blur by defocus, as if the
    /// lens were focused at the target.
    ///
    /// # Errors
    /// Never for optics that could be made: the same scene at the same distance.
    pub fn focused_footprint(&self) -> Result<Footprint, ProjectorError> {
        let perfect = Projector {
            aperture_mm: 1e-3,
            emitter_mm: self.camera.projector.led_pitch_mm,
            ..self.camera.projector
        };
        perfect.footprint(&self.scene, self.distance_mm)
    }

    /// What a perfect camera of `pixels` x `pixels` would see in the same field: mean reflectances, row-major, free of
    /// blur.
    #[must_use]
    pub fn focused(&self, pixels: usize) -> Vec<f32> {
        let pitch_mm = self.field_mm() / pixels as f64;
        let at_mm = |i: usize| (i as f64 + 0.5 - pixels as f64 / 2.0) * pitch_mm;
        let mean = |i| {
            let (x_mm, y_mm) = (at_mm(i % pixels), at_mm(i / pixels));
            // Differences of running sums leave the last bit on either side of the range.
            self.scene.mean_over_square(x_mm, y_mm, pitch_mm).clamp(0.0, 1.0) as f32
        };
        (0..pixels * pixels).map(mean).collect()
    }

    /// Distance of the target.
    #[must_use]
    pub fn distance_mm(&self) -> f64 {
        self.distance_mm
    }

    /// Side of the field that the LEDs light, on the target.
    #[must_use]
    pub fn field_mm(&self) -> f64 {
        self.camera.projector.field_mm(self.distance_mm)
    }

    /// Diameter of the defocus disc on the target.
    #[must_use]
    pub fn blur_mm(&self) -> f64 {
        self.camera.projector.blur_mm(self.distance_mm)
    }

    /// Standard deviation of the defocus disc of a target at `distance_mm`, in pixels of an image of `side` x `side`: what a
    /// camera knows of its blur that knows its lens and the distance. A disc's is a fourth of its diameter.
    #[must_use]
    pub fn defocus_px(&self, distance_mm: f64, side: usize) -> f64 {
        let pixel_mm = self.camera.projector.field_mm(distance_mm) / side as f64;
        self.camera.projector.blur_mm(distance_mm) / 4.0 / pixel_mm
    }

    /// Electrons per ADC sample.
    #[must_use]
    pub fn budget(&self) -> &Budget {
        &self.budget
    }

    /// The receiver.
    #[must_use]
    pub fn chain(&self) -> &ChainSettings {
        &self.chain
    }

    /// Puts gateware and ADC behind the optics.
    ///
    /// # Errors
    /// A receiver setting out of range.
    pub fn fpga(&self, seed: u64) -> Result<OpticalFpga, VirtualOpticsError> {
        let electrons_per_led = self.budget.electrons_per_led;
        let gains = self.camera.led_gains();
        let array = LedArray::new(&self.footprint, electrons_per_led).with_gains(&gains);
        let fpga = OpticalFpga::new(array, Chain::new(self.chain, seed)?);
        Ok(match self.spots(seed)? {
            Some(spots) => fpga.in_rain(spots, electrons_per_led),
            None => fpga,
        })
    }

    /// The time-of-flight sensor beside the camera.
    ///
    /// # Errors
    /// A distance that it cannot read.
    pub fn depth(&self, seed: u64) -> Result<SimulatedDepth, DepthError> {
        SimulatedDepth::new(self.distance_mm, self.camera.tof.noise_mm, 0, seed)
    }

    /// A reading of that sensor in the camera's image.
    ///
    /// # Errors
    /// A distance that it cannot read.
    pub fn depth_view(&self, seed: u64) -> Result<DepthView, DepthError> {
        let reading = self.depth(seed)?.reading();
        let field = self.camera.projector.field_over_distance();
        Ok(self.camera.depth_geometry().view(&reading, field))
    }

    /// The whole camera.
    ///
    /// # Errors
    /// A setting out of range.
    pub fn camera(&self, seed: u64) -> Result<VirtualCamera<OpticalFpga>, VirtualOpticsError> {
        Ok(VirtualCamera::new(self.fpga(seed)?, self.depth(seed)?, &self.serial(seed)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_that_differ_have_different_serials_and_scenes_do_not_matter() {
        let of = |toml: &str, scene: Scene, distance_mm| {
            let camera = CameraModel::parse(toml).unwrap();
            VirtualOptics::of(&camera, scene, distance_mm).unwrap().serial(3)
        };
        let near = of("", Scene::white(), 300.0);
        assert_eq!(near, "virtual-3");
        assert_eq!(near, of("", Scene::new(vec![0.1], 1, 10.0).unwrap(), 700.0));
        let dusk = "name = \"dusk\"\n[light]\nilluminance_klx = 0.1\n[weather]\nrain = \"heavy\"";
        assert_eq!(near, of(dusk, Scene::white(), 300.0));
        let mut serials = vec![near];
        for toml in [
            "[adc]\nlatency_clocks = 9",
            "[leds]\npower_spread = 0.1",
            "[detector]\ndiameter_mm = 0.3",
            "basis = \"one-metre\"",
        ] {
            let serial = of(toml, Scene::white(), 300.0);
            assert!(serial.starts_with("virtual-3-") && !serials.contains(&serial), "{serial}");
            serials.push(serial);
        }
    }

    #[test]
    fn a_camera_of_another_wavelength_is_refused() {
        let camera = CameraModel { wavelength_nm: 1450.0, ..CameraModel::default() };
        let error = VirtualOptics::of(&camera, Scene::white(), 300.0).unwrap_err().to_string();
        assert!(error.contains("wavelength_nm is 1450, expected 1550"), "{error}");
    }

    #[test]
    fn a_camera_before_a_white_sheet_is_still_the_same_camera() {
        let letter = VirtualOptics::new(Scene::new(vec![0.2], 1, 10.0).unwrap(), 900.0).unwrap();
        let sheet = letter.white_sheet().unwrap();
        assert_eq!(letter.serial(1), sheet.serial(1));
        assert!((sheet.footprint().mean() - 1.0).abs() < 1e-9);
    }
}
