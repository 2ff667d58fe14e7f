//! The optics of the virtual camera: scene, projector, photon budget, receiver.

use super::{Front, OpticalFpga, SpecularSpot, SpecularSpotError, VirtualCamera};
use nirspi::scene::SceneMap;
use nirspi::setup::MeasurementSetup;
use nirspi_optics::camera::{canonical, fnv1a};
use nirspi_optics::rain::{Air, BeamShadows, RainError, RainySpots, Weather};
use nirspi_optics::{
    Budget, BudgetError, CameraModel, Chain, ChainError, ChainSettings, DepthError, DepthView,
    Footprint, LedArray, Motion, MotionError, MovingTarget, Projector, ProjectorError, Scene,
    SceneError, SimulatedDepth,
};
use nirspi_recon::{Order, RowsError};
use thiserror::Error;

/// The optics at one distance: everything between the LEDs and the ADC.
#[derive(Debug, Clone)]
pub struct VirtualOptics {
    camera: CameraModel,
    scene: Scene,
    distance_mm: f64,
    footprint: Footprint,
    budget: Budget,
    chain: ChainSettings,
    weather: Option<Weather>,
    motion: Motion,
}

/// Why optics cannot be built.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum VirtualOpticsError {
    /// The distance or the lens is out of range.
    #[error(transparent)]
    Projector(#[from] ProjectorError),
    /// The photon budget is out of range.
    #[error(transparent)]
    Budget(#[from] BudgetError),
    /// The receiver is out of range.
    #[error(transparent)]
    Chain(#[from] ChainError),
    /// The depth sensor cannot measure the distance.
    #[error(transparent)]
    Depth(#[from] DepthError),
    /// A reflectance is out of range.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The target's motion is out of range.
    #[error(transparent)]
    Motion(#[from] MotionError),
    /// The weather is out of range.
    #[error(transparent)]
    Rain(#[from] RainError),
    /// The array has no pixel where a specular spot should be.
    #[error(transparent)]
    Specular(#[from] SpecularSpotError),
    /// Gateware and protocol support one wavelength only.
    #[error(
        "wavelength_nm is {0}, expected {expected} for a virtual camera: its protocol knows no other; \
         `nirspi physics range` and `nirspi physics budget` take any",
        expected = nirspi_wire::WAVELENGTH_NM
    )]
    Wavelength(f64),
}

impl VirtualOptics {
    /// The paper's camera in front of `scene`. The gain is set for a white target at this distance.
    ///
    /// # Errors
    /// [`VirtualOpticsError`] for a distance without any light.
    pub fn new(scene: Scene, distance_mm: f64) -> Result<Self, VirtualOpticsError> {
        Self::of(CameraModel::paper(), scene, distance_mm)
    }

    /// This camera in front of `scene`. The gain is set for a white target at this distance. The
    /// weather of the description is ignored; [`Self::in_air`] sets weather.
    ///
    /// # Errors
    /// [`VirtualOpticsError`] for a description that is not physical, or a distance without any
    /// light.
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
        let (weather, motion) = (None, Motion::default());
        Ok(Self { camera, scene, distance_mm, footprint, budget, chain, weather, motion })
    }

    /// This camera in front of a scene by name or file. The target has its own size, or fills the
    /// field.
    ///
    /// # Errors
    /// [`VirtualOpticsError`] for a distance without any light, or one that the depth sensor cannot
    /// measure.
    pub fn before(
        camera: &CameraModel,
        map: &SceneMap,
        distance_mm: f64,
    ) -> Result<Self, VirtualOpticsError> {
        let fills = || camera.projector().field_mm(distance_mm);
        let side_mm = map.side_mm.unwrap_or_else(fills);
        let scene = Scene::new(map.reflectance.clone(), map.size_px, side_mm)?;
        let optics = Self::of(camera, scene, distance_mm)?;
        // The depth sensor has its own range.
        optics.depth(0)?;
        Ok(optics)
    }

    /// The camera's description.
    #[must_use]
    pub fn camera_model(&self) -> &CameraModel {
        &self.camera
    }

    /// A setup for the first patterns of `order`, differential, with this camera's timing.
    ///
    /// # Errors
    /// As [`MeasurementSetup::new`].
    pub fn setup(&self, order: &Order, sampling: f64) -> Result<MeasurementSetup, RowsError> {
        let readout = self.camera.readout;
        let setup = MeasurementSetup::new(order, sampling)?;
        Ok(setup.timed(readout.clocks_per_pattern, readout.blanked))
    }

    /// The same camera in dry air before a white sheet that fills its field, at the lens's focus.
    /// Latency and settling are measured against this sheet.
    ///
    /// # Errors
    /// [`VirtualOpticsError`] for optics without a focus.
    pub fn white_sheet(&self) -> Result<Self, VirtualOpticsError> {
        let distance_mm = self.camera.projector.focus_distance_mm;
        let sheet = Self::of(&self.camera, Scene::white(), distance_mm)?;
        // A receiver without noise stays without noise.
        let ChainSettings { electrons_per_count, ambient_electrons, .. } = sheet.chain;
        let chain = ChainSettings { electrons_per_count, ambient_electrons, ..self.chain };
        Ok(Self { chain, ..sheet })
    }

    /// The same camera before a white sheet in place of the target: at its distance, in its weather.
    ///
    /// # Errors
    /// Does not occur for optics that could be built, because distance and weather are the same.
    pub fn white_sheet_at_target(&self) -> Result<Self, VirtualOpticsError> {
        let sheet = Self::of(&self.camera, Scene::white(), self.distance_mm)?;
        let ChainSettings { electrons_per_count, ambient_electrons, .. } = sheet.chain;
        let chain = ChainSettings { electrons_per_count, ambient_electrons, ..self.chain };
        let sheet = Self { chain, ..sheet };
        match &self.weather {
            Some(weather) => sheet.in_weather(weather.clone()),
            None => Ok(sheet),
        }
    }

    /// Variance of the mean of a slot's samples in `sweeps` sweeps, in counts squared, for this light
    /// in counts: shot noise of the LEDs' light and of daylight, amplifier, ADC, rounding.
    #[must_use]
    pub fn mean_variance(&self, light_counts: f64, sweeps: u32) -> f64 {
        let gain = self.chain.electrons_per_count;
        let electrons = (light_counts * gain).max(0.0) + self.chain.ambient_electrons;
        let readout = self.camera.readout;
        let window = u32::from(readout.clocks_per_pattern.saturating_sub(readout.blanked));
        self.chain.variance_of_mean(electrons, window) / (gain * gain) / f64::from(sweeps)
    }

    /// The serial number of the virtual camera with this seed. Cameras with different instruments
    /// have different serial numbers, so that no camera uses another camera's kept calibration;
    /// scenes do not matter
    /// (`tests::cameras_that_differ_have_different_serials_and_scenes_do_not_matter`). Default
    /// instruments have `virtual-1`; other instruments have `virtual-1-` with a short name of their
    /// settings.
    #[must_use]
    pub fn serial(&self, seed: u64) -> String {
        let instrument = |camera: &CameraModel, chain: &ChainSettings| {
            let paper = CameraModel::paper();
            // Light, weather and name do not belong to the instrument.
            let camera = CameraModel {
                name: paper.name.clone(),
                light: paper.light,
                weather: paper.weather.clone(),
                ..camera.clone()
            };
            // Gain and daylight depend on distance and scene, and change neither latency nor
            // settling.
            let chain =
                ChainSettings { electrons_per_count: 1.0, ambient_electrons: 0.0, ..*chain };
            camera.key_text() + &canonical(&chain)
        };
        let this = instrument(&self.camera, &self.chain);
        if this == instrument(CameraModel::paper(), &ChainSettings::default()) {
            return format!("virtual-{seed}");
        }
        format!("virtual-{seed}-{:08x}", fnv1a(this.as_bytes()))
    }

    /// Puts a specular spot on the target. Daylight comes from one direction, which the spot does not send to the camera: set
    /// weather before.
    ///
    /// # Errors
    /// [`VirtualOpticsError`] for a brightness or a place out of range.
    pub fn with_specular(mut self, spot: SpecularSpot) -> Result<Self, VirtualOpticsError> {
        let spot = spot.of_field(self.field_mm())?;
        self.scene = self.scene.with_specular(spot)?;
        self.footprint = self.camera.projector().footprint(&self.scene, self.distance_mm)?;
        Ok(self)
    }

    /// Sets the target in motion. White sheets stay where they are.
    ///
    /// # Errors
    /// [`VirtualOpticsError`] for a motion out of range.
    pub fn moving(self, motion: Motion) -> Result<Self, VirtualOpticsError> {
        motion.validate()?;
        Ok(Self { motion, ..self })
    }

    /// The target, if it moves.
    ///
    /// # Errors
    /// Does not occur for optics that could be built, because scene and distance are the same.
    pub fn moving_target(&self) -> Result<Option<MovingTarget>, ProjectorError> {
        if self.motion.is_none() {
            return Ok(None);
        }
        let projector = self.camera.projector();
        MovingTarget::new(self.motion, &projector, &self.scene, self.distance_mm).map(Some)
    }

    /// The same camera before its target at rest, where the motion has taken it after `seconds`.
    ///
    /// # Errors
    /// Does not occur for optics that could be built, because the distance is the same.
    pub fn at_time(&self, seconds: f64) -> Result<Self, ProjectorError> {
        let Some(target) = self.moving_target()? else { return Ok(self.clone()) };
        let scene = self.scene.posed(target.pose(seconds), self.field_mm());
        let footprint = self.camera.projector().footprint(&scene, self.distance_mm)?;
        Ok(Self { scene, footprint, motion: Motion::default(), ..self.clone() })
    }

    /// Puts weather between camera and scene. Daylight is dimmed and scattered by the average
    /// effect. The effect of falling drops on the LEDs' light is computed drop by drop.
    ///
    /// # Errors
    /// [`VirtualOpticsError`] if the air is too dense, or there are too many drops to compute.
    pub fn in_air(self, air: &Air) -> Result<Self, VirtualOpticsError> {
        if air.is_clear() {
            return Ok(self);
        }
        let optics = air.weather(self.camera.wavelength_nm)?;
        let optics = self.in_weather(optics)?;
        // An error about too many drops shows here, before the camera is made.
        optics.spots(0)?;
        Ok(optics)
    }

    /// As [`in_air`](Self::in_air), with weather that was computed before.
    ///
    /// # Errors
    /// [`VirtualOpticsError`] if the air is too dense.
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

    /// Extinction between camera and target, multiplied by the distance; 0 in dry air.
    #[must_use]
    pub fn optical_depth(&self) -> f64 {
        let per_m = |weather: &Weather| weather.medium().extinction_per_m;
        self.weather.as_ref().map_or(0.0, per_m) * self.distance_mm * 1e-3
    }

    /// The LEDs' spots in the rain; `None` in dry air.
    ///
    /// # Errors
    /// [`RainError`] if there are too many drops to compute.
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

    /// Replaces the receiver by an exact one without noise, settling, daylight or latency, for
    /// tests that compare bits.
    #[must_use]
    pub fn ideal(mut self) -> Self {
        let electrons_per_count = self.chain.electrons_per_count;
        self.chain = ChainSettings { electrons_per_count, ..ChainSettings::ideal() };
        self
    }

    /// Removes all noise and dark current from the receiver. LEDs and amplifier keep their speed.
    #[must_use]
    pub fn noiseless(mut self) -> Self {
        self.chain = self.chain.noiseless();
        self
    }

    /// Mean reflectance that each LED illuminates, row-major.
    #[must_use]
    pub fn footprint(&self) -> &Footprint {
        &self.footprint
    }

    /// The image of a perfect camera of 32 x 32 pixels: the scene without defocus, as if the lens
    /// were focused at the target.
    ///
    /// # Errors
    /// Does not occur for optics that could be built, because scene and distance are the same.
    pub fn focused_footprint(&self) -> Result<Footprint, ProjectorError> {
        let perfect = Projector {
            aperture_mm: 1e-3,
            emitter_mm: self.camera.projector.led_pitch_mm,
            ..self.camera.projector
        };
        perfect.footprint(&self.scene, self.distance_mm)
    }

    /// The image of a perfect camera of `pixels` x `pixels` in the same field: mean reflectances,
    /// row-major, without blur.
    #[must_use]
    pub fn focused(&self, pixels: usize) -> Vec<f32> {
        let pitch_mm = self.field_mm() / pixels as f64;
        let at_mm = |i: usize| (i as f64 + 0.5 - pixels as f64 / 2.0) * pitch_mm;
        let mean = |i| {
            let (x_mm, y_mm) = (at_mm(i % pixels), at_mm(i / pixels));
            // Differences of running sums may leave the range by the last bit.
            let mean = self.scene.mean_over_square(x_mm, y_mm, pitch_mm);
            mean.clamp(0.0, self.scene.brightest()) as f32
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

    /// Standard deviation of the defocus disc of a target at `distance_mm`, in pixels of an image
    /// of `side` x `side`. A camera that knows its lens and the distance knows this blur. The
    /// standard deviation of a disc is a fourth of its diameter.
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

    /// The LEDs in front of the scene.
    #[must_use]
    pub fn led_array(&self) -> LedArray {
        LedArray::new(&self.footprint, self.budget.electrons_per_led)
            .with_gains(&self.camera.led_gains())
            .with_cover(self.budget.cover_electrons_per_led)
            .with_tile_sag(self.camera.leds.tile_sag)
    }

    /// The FPGA model with gateware and ADC behind the optics.
    ///
    /// # Errors
    /// [`VirtualOpticsError`] for a receiver setting out of range.
    pub fn fpga(&self, seed: u64) -> Result<OpticalFpga, VirtualOpticsError> {
        let fpga = OpticalFpga::new(self.led_array(), Chain::new(self.chain, seed)?);
        let (rain, target) = (self.spots(seed)?, self.moving_target()?);
        if rain.is_none() && target.is_none() {
            return Ok(fpga);
        }
        let electrons_per_led = self.budget.electrons_per_led;
        Ok(fpga.behind(Front { rain, target, electrons_per_led }))
    }

    /// The time-of-flight sensor next to the camera.
    ///
    /// # Errors
    /// [`DepthError`] for a distance that the sensor cannot measure.
    pub fn depth(&self, seed: u64) -> Result<SimulatedDepth, DepthError> {
        SimulatedDepth::new(self.distance_mm, self.camera.tof.noise_mm, 0, seed)
    }

    /// A reading of the time-of-flight sensor in the camera's image.
    ///
    /// # Errors
    /// [`DepthError`] for a distance that the sensor cannot measure.
    pub fn depth_view(&self, seed: u64) -> Result<DepthView, DepthError> {
        let reading = self.depth(seed)?.reading();
        let field = self.camera.projector.field_over_distance();
        Ok(self.camera.depth_geometry().view(&reading, field))
    }

    /// The whole camera.
    ///
    /// # Errors
    /// [`VirtualOpticsError`] for a setting out of range.
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
        let dusk = "name = \"dusk\"\n[light]\nilluminance_klx = 0.1\n[weather]\nair = \"fog:5m\"";
        assert_eq!(near, of(dusk, Scene::white(), 300.0));
        let mut serials = vec![near];
        for toml in [
            "[adc]\nlatency_clocks = 9",
            "[leds]\npower_spread = 0.1",
            "[leds]\nfall_ns = 16",
            "[leds]\ntile_sag = 0.01",
            "[leds]\nline_crosstalk_ff = 1",
            "[collector]\ncover_veil = 0.1",
            "[detector]\ndiameter_mm = 0.3",
            "basis = \"one-metre\"",
        ] {
            let serial = of(toml, Scene::white(), 300.0);
            assert!(serial.starts_with("virtual-3-") && !serials.contains(&serial), "{serial}");
            serials.push(serial);
        }
    }

    /// Kept calibrations on disk bear this serial number.
    #[test]
    fn the_serial_number_of_a_described_camera_is_frozen() {
        let camera = CameraModel::parse("[adc]\nlatency_clocks = 9").unwrap();
        let optics = VirtualOptics::of(&camera, Scene::white(), 300.0).unwrap();
        assert_eq!(optics.serial(1), "virtual-1-ac031031");
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
