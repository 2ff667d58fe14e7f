//! What stands in front of the virtual camera: scene, projector, photon budget, receiver.

use super::{OpticalFpga, VirtualCamera};
use crate::scene::SceneMap;
use nirspi_optics::pixel::Instrument;
use nirspi_optics::rain::{BeamShadows, Drops, RainError, RainySpots, Weather};
use nirspi_optics::water::Water;
use nirspi_optics::{
    Budget, BudgetError, BudgetSettings, Chain, ChainError, ChainSettings, DepthError, Footprint,
    LedArray, Projector, ProjectorError, Scene, SceneError, SimulatedDepth,
};
use thiserror::Error;

/// Noise of the simulated time-of-flight sensor: a few millimetres, as such sensors state indoors.
const DEPTH_NOISE_MM: f64 = 4.0;

/// Everything that light meets on its way, at one distance.
#[derive(Debug, Clone)]
pub struct VirtualOptics {
    scene: Scene,
    projector: Projector,
    distance_mm: f64,
    footprint: Footprint,
    budget_settings: BudgetSettings,
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
}

impl VirtualOptics {
    /// The default camera in front of `scene`, its gain set for a white target at that distance.
    ///
    /// # Errors
    /// A distance that no light covers.
    pub fn new(scene: Scene, distance_mm: f64) -> Result<Self, VirtualOpticsError> {
        Self::with_settings(
            scene,
            distance_mm,
            Projector::default(),
            &BudgetSettings::default(),
            ChainSettings::default(),
        )
    }

    /// The default camera in front of a scene by name or file: a target of its own size, or one that fills the field.
    ///
    /// # Errors
    /// A distance that no light covers, or that the depth sensor cannot read.
    pub fn before(map: &SceneMap, distance_mm: f64) -> Result<Self, VirtualOpticsError> {
        let fills = || Projector::default().field_mm(distance_mm);
        let side_mm = map.side_mm.unwrap_or_else(fills);
        let scene = Scene::new(map.reflectance.clone(), map.size_px, side_mm)?;
        let optics = Self::new(scene, distance_mm)?;
        // The depth sensor has a range of its own.
        optics.depth(0)?;
        Ok(optics)
    }

    /// As [`new`](Self::new), with everything given. The gain and the daylight in `chain` are replaced by
    /// those that follow from the budget.
    ///
    /// # Errors
    /// A setting that is not physical.
    pub fn with_settings(
        scene: Scene,
        distance_mm: f64,
        projector: Projector,
        budget: &BudgetSettings,
        mut chain: ChainSettings,
    ) -> Result<Self, VirtualOpticsError> {
        let footprint = projector.footprint(&scene, distance_mm)?;
        let budget_settings = *budget;
        let budget = Budget::new(budget, &projector, distance_mm)?;
        chain.electrons_per_count = chain.auto_gain(&budget)?;
        chain.ambient_electrons = budget.ambient_electrons(footprint.mean());
        let weather = None;
        Ok(Self {
            scene,
            projector,
            distance_mm,
            footprint,
            budget_settings,
            budget,
            chain,
            weather,
        })
    }

    /// The same camera in dry air before a white sheet that fills its field, where its lens is focused: what latency and
    /// settling are measured against.
    ///
    /// # Errors
    /// Optics that have no focus.
    pub fn white_sheet(&self) -> Result<Self, VirtualOpticsError> {
        let Self { projector, budget_settings, chain, .. } = self;
        let distance_mm = projector.focus_distance_mm;
        Self::with_settings(Scene::white(), distance_mm, *projector, budget_settings, *chain)
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
        // Gain and daylight follow distance and scene, and change neither latency nor settling.
        let chain =
            ChainSettings { electrons_per_count: 1.0, ambient_electrons: 0.0, ..self.chain };
        let instrument = format!("{:?} {:?} {chain:?}", self.projector, self.budget_settings);
        let default = {
            let chain = ChainSettings {
                electrons_per_count: 1.0,
                ambient_electrons: 0.0,
                ..ChainSettings::default()
            };
            format!("{:?} {:?} {chain:?}", Projector::default(), BudgetSettings::default())
        };
        if instrument == default {
            return format!("virtual-{seed}");
        }
        format!("virtual-{seed}-{:08x}", fnv1a(instrument.as_bytes()))
    }

    /// Lets these drops fall between camera and scene. Daylight is dimmed and scattered as they do on average; what
    /// they do to the LEDs' light is followed drop by drop.
    ///
    /// # Errors
    /// Air too dense, or too many drops to be followed.
    pub fn in_rain(self, drops: Drops) -> Result<Self, VirtualOpticsError> {
        let weather = Weather::new(drops, self.budget_settings.wavelength_nm, Water::Segelstein)?;
        let optics = self.in_weather(weather)?;
        // Whether the drops can be followed shows now rather than when the camera is made.
        optics.spots(0)?;
        Ok(optics)
    }

    /// As [`in_rain`](Self::in_rain), in weather that was worked out before.
    ///
    /// # Errors
    /// Air too dense.
    pub fn in_weather(mut self, weather: Weather) -> Result<Self, VirtualOpticsError> {
        let baseline_mm = Instrument::default().baseline_mm;
        let veil = weather.veil(&self.projector, self.distance_mm, baseline_mm)?;
        let returned = weather.blur(self.distance_mm)?.returned(self.field_mm() / self.distance_mm);
        self.chain.ambient_electrons = self.budget.ambient_electrons(self.footprint.mean())
            * returned
            + self.budget.ambient_electrons_white * veil.airlight;
        self.weather = Some(weather);
        Ok(self)
    }

    /// What the LEDs' spots show in the rain; none in dry air.
    ///
    /// # Errors
    /// Too many drops to be followed.
    pub fn spots(&self, seed: u64) -> Result<Option<RainySpots>, RainError> {
        let Some(weather) = &self.weather else { return Ok(None) };
        let beams = BeamShadows {
            projector: self.projector,
            distance_mm: self.distance_mm,
            baseline_mm: Instrument::default().baseline_mm,
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
            emitter_mm: self.projector.led_pitch_mm,
            ..self.projector
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
        self.projector.field_mm(self.distance_mm)
    }

    /// Diameter of the defocus disc on the target.
    #[must_use]
    pub fn blur_mm(&self) -> f64 {
        self.projector.blur_mm(self.distance_mm)
    }

    /// Standard deviation of the defocus disc of a target at `distance_mm`, in pixels of an image of `side` x `side`: what a
    /// camera knows of its blur that knows its lens and the distance. A disc's is a fourth of its diameter.
    #[must_use]
    pub fn defocus_px(&self, distance_mm: f64, side: usize) -> f64 {
        let pixel_mm = self.projector.field_mm(distance_mm) / side as f64;
        self.projector.blur_mm(distance_mm) / 4.0 / pixel_mm
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
        let array = LedArray::new(&self.footprint, electrons_per_led);
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
        SimulatedDepth::new(self.distance_mm, DEPTH_NOISE_MM, 0, seed)
    }

    /// The whole camera.
    ///
    /// # Errors
    /// A setting out of range.
    pub fn camera(&self, seed: u64) -> Result<VirtualCamera<OpticalFpga>, VirtualOpticsError> {
        Ok(VirtualCamera::new(self.fpga(seed)?, self.depth(seed)?, &self.serial(seed)))
    }
}

/// FNV-1a, 32 bit: a short name for settings, not a checksum (Fowler, Noll and Vo).
fn fnv1a(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0x811c_9dc5, |hash, &byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_that_differ_have_different_serials_and_scenes_do_not_matter() {
        let projector = Projector::default();
        let of = |scene: Scene, distance_mm, chain| {
            let budget = BudgetSettings::default();
            VirtualOptics::with_settings(scene, distance_mm, projector, &budget, chain)
                .unwrap()
                .serial(3)
        };
        let chain = ChainSettings::default();
        let near = of(Scene::white(), 300.0, chain);
        assert_eq!(near, of(Scene::new(vec![0.1], 1, 10.0).unwrap(), 700.0, chain));
        let slower = ChainSettings { adc_latency_clocks: 9, ..chain };
        assert_ne!(near, of(Scene::white(), 300.0, slower));
        assert_eq!(near, "virtual-3");
        assert!(of(Scene::white(), 300.0, slower).starts_with("virtual-3-"));
    }

    #[test]
    fn a_camera_before_a_white_sheet_is_still_the_same_camera() {
        let letter = VirtualOptics::new(Scene::new(vec![0.2], 1, 10.0).unwrap(), 900.0).unwrap();
        let sheet = letter.white_sheet().unwrap();
        assert_eq!(letter.serial(1), sheet.serial(1));
        assert!((sheet.footprint().mean() - 1.0).abs() < 1e-9);
    }
}
