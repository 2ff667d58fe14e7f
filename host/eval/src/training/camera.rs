//! The virtual camera as a source of training pairs: some hundred pictures a second instead of a
//! few.
//!
//! A capture is linear in light up to the ADC. The sweeps of an exposure can therefore be summed
//! before the receiver instead of after it: one sweep of the mean light, settled through the
//! receiver's exact response, with the noise of the whole sum drawn at once. The real procedure
//! measures the calibration once on the real virtual camera, and the errors of the calibration stay
//! in every picture. The tests compare pictures with captures by the whole camera
//! (`tests::a_picture_by_the_short_way_differs_from_a_capture_by_noise_alone`).

use nirspi::calibration::{CalibrationError, calibrate};
use nirspi::response::Settling;
use nirspi::session::{IgnorePackets, Session, SessionError};
use nirspi_nets::data::SIDE_PX;
use nirspi_nets::degrade::{Depth, Reading, defocus};
use nirspi_optics::rain::{Drops, PaperRain, RainError, Rainfall, Weather};
use nirspi_optics::water::Water;
use nirspi_optics::{CameraModel, LEDS, Scene, SceneError};
use nirspi_recon::{
    Leak, LeakError, MeasurementError, Measurements, Order, Rows, RowsError, Side, Sweep, fwht,
    reconstruct,
};
use nirspi_virtual::{MemoryLink, VirtualOptics, VirtualOpticsError};
use nirspi_wire::ADC_HZ;
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use thiserror::Error;

// The networks do not depend on the optics, so each has the number of zones.
const _: () = assert!(nirspi_nets::degrade::DEPTH_SIDE == nirspi_optics::DEPTH_SIDE);

/// Farthest target, divided by the focus distance of the lens, which is the nearest: 0.3 to 1.2 m
/// for the paper's camera.
const FARTHEST_OVER_FOCUS: f64 = 4.0;
/// Noise for which an exposure is chosen, in units of a white target.
const NOISE_STD: (f64, f64) = (0.003, 0.08);
/// Sweeps of the shortest and of the longest exposure: 82 us and 10 s.
const SWEEPS: (f64, f64) = (1.0, 122_000.0);
/// The most updates of the drops in one exposure.
const LOOKS: u32 = 128;
/// Share of the pictures taken with all patterns, and the least share of patterns in other
/// pictures.
const FULLY_SAMPLED: f32 = 0.7;
const LEAST_SAMPLING: f32 = 0.25;
/// Share of the depth maps with zones without a reading, and share of pictures without depth.
const NO_DEPTH: f32 = 0.2;

/// The conditions of a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conditions {
    /// Distance from camera to target.
    pub distance_mm: f64,
    /// The rain between camera and target.
    pub rain: Rainfall,
    /// Number of differential sweeps that are summed.
    pub sweeps: u32,
    /// Share of the patterns shown.
    pub sampling: f32,
}

/// A picture and its conditions.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraPicture {
    /// The picture.
    pub reading: Reading,
    /// The conditions.
    pub conditions: Conditions,
}

/// A measurement by the virtual camera, before an image is made of it.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraMeasurement {
    /// The differences of pattern and complement, in ADC counts.
    pub measurements: Measurements,
    /// ADC counts of a pixel that sees a white target.
    pub white_counts: f32,
    /// Noise of a pixel of the plain transform of all patterns, of white: the readings' own noise.
    pub noise: f32,
    /// Defocus, as a standard deviation in pixels of the 64 x 64 grid.
    pub sigma_px: f32,
}

/// Why the camera cannot be made, or gives no picture. `Display` is one line.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TrainingCameraError {
    /// Distance, light or receiver.
    #[error(transparent)]
    Optics(#[from] VirtualOpticsError),
    /// The scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Light that is not linear in the patterns, or that has not seen the target.
    #[error(
        "camera {0}: networks are trained with a camera that is linear in its patterns, expected leds.rise_ns equal \
         to leds.fall_ns, equal turn-on and turn-off delays, and 0 for leds.tile_sag, leds.line_crosstalk_ff and \
         collector.cover_veil"
    )]
    NotLinear(String),
    /// Rain.
    #[error(transparent)]
    Rain(#[from] RainError),
    /// The camera could not be opened.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// The camera could not be calibrated.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// The leak cannot be corrected.
    #[error(transparent)]
    Leak(#[from] LeakError),
    /// The order of patterns is not valid.
    #[error(transparent)]
    Order(#[from] RowsError),
    /// The measurement.
    #[error(transparent)]
    Measurement(#[from] MeasurementError),
}

/// The virtual camera's optics and calibration as one linear map from a picture to readings.
///
/// Without packets, firmware or clocks, the linear camera makes many pictures a second. `tests`
/// compare it with the virtual camera.
#[derive(Debug, Clone)]
pub struct LinearCamera {
    camera: CameraModel,
    /// Light of each LED divided by that of an ideal LED.
    gains: Vec<f32>,
    /// The receiver's true leak between slots, and the leak that the calibration measured.
    leaks: Leak,
    believed: Leak,
    order: Rows,
    light: Weather,
    heavy: Weather,
}

impl LinearCamera {
    /// Opens the virtual camera of this description in front of a white sheet at the lens's focus,
    /// and calibrates it.
    ///
    /// # Errors
    /// [`TrainingCameraError`] if the camera cannot be opened or calibrated.
    pub fn new(camera: &CameraModel, seed: u64) -> Result<Self, TrainingCameraError> {
        let projector = camera.projector();
        let distance_mm = projector.focus_distance_mm;
        let sheet = Scene::new(vec![1.0], 1, projector.field_mm(distance_mm))?;
        let optics = VirtualOptics::of(camera, sheet, distance_mm)?;
        let is_veiled = camera.collector.cover_veil != 0.0;
        if !optics.chain().is_linear() || camera.leds.tile_sag != 0.0 || is_veiled {
            return Err(TrainingCameraError::NotLinear(camera.name.clone()));
        }
        let (clocks, blanked) = timing(camera);
        let mut session = Session::open(Box::new(MemoryLink::new(optics.camera(seed)?)))?;
        let believed = calibrate(&mut session, &mut IgnorePackets)?.leak(clocks, blanked)?;
        let response = |n| optics.chain().settling(n);
        // Two poles of nanoseconds settle to rounding error within this many clocks.
        let exact = Settling {
            adc_latency: 0,
            response: (0..64).map(response).collect(),
            dark_counts: 0.0,
            step_counts: 0.0,
            noise_counts: 0.0,
            tile_sag: 0.0,
        };
        let weather = |drops: Drops| Weather::new(drops, camera.wavelength_nm, Water::Segelstein);
        Ok(Self {
            camera: camera.clone(),
            gains: camera.led_gains(),
            leaks: exact.leak(clocks, blanked)?,
            believed,
            order: Order::CakeCutting.rows(Side::INSTRUMENT)?,
            light: weather(PaperRain::LIGHT.drops()?)?,
            heavy: weather(PaperRain::HEAVY.drops()?)?,
        })
    }

    /// Random conditions: blur uniform between focus and the farthest target, any rain, and an
    /// exposure for the chosen noise, within the limits of light and exposure time.
    pub fn conditions(&self, rng: &mut impl Rng) -> Result<Conditions, TrainingCameraError> {
        // Defocus in pixels grows with the difference of the reciprocal distances.
        let near = self.camera.projector.focus_distance_mm;
        let far = FARTHEST_OVER_FOCUS * near;
        let distance_mm = rng.random_range(1.0 / far..=1.0 / near).recip();
        let rain = [Rainfall::None, Rainfall::Light, Rainfall::Heavy][rng.random_range(0..3_usize)];
        let full = rng.random::<f32>() < FULLY_SAMPLED;
        let sampling = if full { 1.0 } else { rng.random_range(LEAST_SAMPLING..1.0) };
        let wanted = NOISE_STD.0 * (NOISE_STD.1 / NOISE_STD.0).powf(rng.random());
        let optics = VirtualOptics::of(&self.camera, Scene::new(vec![0.5], 1, 1e4)?, distance_mm)?;
        let one = self.noise_std(&optics, optics.footprint().weights(), 1);
        let sweeps = (one / wanted).powi(2).clamp(SWEEPS.0, SWEEPS.1).round() as u32;
        Ok(Conditions { distance_mm, rain, sweeps, sampling })
    }

    /// Takes a picture of `scene`, 64 x 64 in `[0, 1]`, which fills the field of view and continues
    /// mirrored beyond it.
    ///
    /// # Errors
    /// [`TrainingCameraError`] for conditions that are not physical.
    pub fn picture(
        &self,
        scene: &[f32],
        conditions: Conditions,
        rng: &mut Pcg64Mcg,
    ) -> Result<CameraPicture, TrainingCameraError> {
        let Taken { optics, field_mm, seen, measured } =
            self.taken(scene, conditions, &self.order, rng)?;
        let Conditions { sweeps, sampling, .. } = conditions;
        let image = reconstruct::hadamard(&measured);

        let white = white_counts(&optics);
        let diameter_px = (optics.blur_mm() / field_mm) as f32 * SIDE_PX as f32;
        let noise_std = self.noise_std(&optics, &seen, sweeps) * f64::from(sampling).sqrt();
        let reading = Reading {
            image: image.pixels().iter().map(|v| (v / white as f32).clamp(0.0, 1.0)).collect(),
            optical: defocus::disc(scene, diameter_px),
            // A disc's standard deviation along an axis is a quarter of its diameter.
            sigma_px: diameter_px / 4.0,
            noise_std: noise_std as f32,
            sampling,
            depth: depth(&optics, rng)?,
        };
        Ok(CameraPicture { reading, conditions })
    }

    /// Measures `scene`, as [`picture`](Self::picture) does, by the first patterns of `order`.
    ///
    /// # Errors
    /// [`TrainingCameraError`] for conditions that are not physical.
    pub fn measure(
        &self,
        scene: &[f32],
        conditions: Conditions,
        order: &Order,
        rng: &mut Pcg64Mcg,
    ) -> Result<CameraMeasurement, TrainingCameraError> {
        let order = order.rows(Side::INSTRUMENT)?;
        let Taken { optics, field_mm, seen, measured } =
            self.taken(scene, conditions, &order, rng)?;
        Ok(CameraMeasurement {
            measurements: measured,
            white_counts: white_counts(&optics) as f32,
            noise: self.noise_std(&optics, &seen, conditions.sweeps) as f32,
            sigma_px: (optics.blur_mm() / field_mm) as f32 * SIDE_PX as f32 / 4.0,
        })
    }

    /// Number of sweeps for this noise of a pixel of all patterns, of white, at this distance in dry
    /// air: at least 1.
    ///
    /// # Errors
    /// [`TrainingCameraError`] for a distance that the optics refuse.
    pub fn sweeps_for(&self, noise: f64, distance_mm: f64) -> Result<u32, TrainingCameraError> {
        let grey = Scene::new(vec![0.5], 1, 1e4)?;
        let optics = VirtualOptics::of(&self.camera, grey, distance_mm)?;
        let one = self.noise_std(&optics, optics.footprint().weights(), 1);
        Ok((one / noise).powi(2).round().max(1.0) as u32)
    }

    /// Light, receiver and calibrated readings of a scene.
    fn taken(
        &self,
        scene: &[f32],
        conditions: Conditions,
        order: &Rows,
        rng: &mut Pcg64Mcg,
    ) -> Result<Taken, TrainingCameraError> {
        let Conditions { distance_mm, sweeps, sampling, .. } = conditions;
        let field_mm = self.camera.projector().field_mm(distance_mm);
        let wide = Scene::new(mirrored(scene), 2 * SIDE_PX, 2.0 * field_mm)?;
        let mut optics = VirtualOptics::of(&self.camera, wide, distance_mm)?;
        optics = match conditions.rain {
            Rainfall::None => optics,
            Rainfall::Light => optics.in_weather(self.light.clone())?,
            Rainfall::Heavy => optics.in_weather(self.heavy.clone())?,
        };
        let mut seen = exposed(&optics, sweeps, rng.random())?;
        seen.iter_mut().zip(&self.gains).for_each(|(seen, gain)| *seen *= gain);
        let shown = (f64::from(sampling) * LEDS as f64).round().clamp(1.0, LEDS as f64) as usize;
        let rows = order.first(shown);
        let mut differences = self.differences(&optics, &seen, &rows, sweeps, rng);
        self.believed.correct_differential(&mut differences, Sweep::Repeating);
        let measured = Measurements::from_differential(&rows, &differences)?;
        Ok(Taken { optics, field_mm, seen, measured })
    }

    /// Pattern minus complement for each of `rows`, in mean ADC counts of one sample, with leak and
    /// noise.
    fn differences(
        &self,
        optics: &VirtualOptics,
        seen: &[f32],
        rows: &[u32],
        sweeps: u32,
        rng: &mut impl Rng,
    ) -> Vec<f64> {
        let counts = white_counts(optics);
        let mut signed: Vec<f64> = seen.iter().map(|&w| f64::from(w) * counts).collect();
        // The number of LEDs is a power of two, as the transform requires.
        let _ = fwht(&mut signed);
        let all = signed[0];
        let slots: Vec<f64> = rows
            .iter()
            .flat_map(|&row| [1.0, -1.0].map(|sign| (all + sign * signed[row as usize]) / 2.0))
            .collect();
        let read: Vec<f64> = (0..slots.len())
            .map(|slot| {
                let earlier =
                    |tap: usize| slots[(slot + slots.len() * (tap + 1) - tap) % slots.len()];
                let taps = self.leaks.taps().iter().enumerate();
                let light: f64 = taps.map(|(tap, share)| share * earlier(tap)).sum();
                let normal: f64 = rng.sample(StandardNormal);
                light + optics.mean_variance(light, sweeps).sqrt() * normal
            })
            .collect();
        read.as_chunks::<2>().0.iter().map(|[pattern, complement]| pattern - complement).collect()
    }

    /// Noise of a reconstructed pixel with all patterns, in units of a white target.
    fn noise_std(&self, optics: &VirtualOptics, seen: &[f32], sweeps: u32) -> f64 {
        let counts = white_counts(optics);
        // Each pattern lights half of the LEDs.
        let light = seen.iter().map(|&w| f64::from(w)).sum::<f64>() * counts / 2.0;
        let difference = (2.0 * optics.mean_variance(light, sweeps)).sqrt();
        let taps = self.believed.taps();
        // Correcting the leak divides by the share that a difference keeps in its own slot.
        let own = taps[0] - taps.get(1).unwrap_or(&0.0) / 2.0;
        difference / own / (LEDS as f64).sqrt() / counts
    }
}

/// What was measured, and by which optics.
struct Taken {
    optics: VirtualOptics,
    field_mm: f64,
    /// Mean reflectance that each LED illuminated.
    seen: Vec<f32>,
    measured: Measurements,
}

/// ADC counts that one LED on a white target adds to a sample. The time-of-flight sensor gives the
/// distance and thereby the photon budget, which converts counts to reflectances.
fn white_counts(optics: &VirtualOptics) -> f64 {
    optics.budget().electrons_per_led / optics.chain().electrons_per_count
}

/// Clocks of a pattern, and number of clocks at its start whose samples are excluded.
fn timing(camera: &CameraModel) -> (u16, u16) {
    (camera.readout.clocks_per_pattern, camera.readout.blanked)
}

/// Mean pattern of the LEDs' spots during an exposure.
fn exposed(optics: &VirtualOptics, sweeps: u32, seed: u64) -> Result<Vec<f32>, RainError> {
    let Some(mut spots) = optics.spots(seed)? else {
        return Ok(optics.footprint().weights().to_vec());
    };
    let looks = sweeps.min(LOOKS);
    let clocks = timing(optics.camera_model()).0;
    let sweep_s = 2.0 * LEDS as f64 * f64::from(clocks) / f64::from(ADC_HZ);
    let mut mean = vec![0.0; LEDS];
    for _ in 0..looks {
        for (mean, seen) in mean.iter_mut().zip(spots.reflectance()) {
            *mean += seen / looks as f32;
        }
        spots.advance(sweep_s * f64::from(sweeps) / f64::from(looks));
    }
    Ok(mean)
}

/// The depth map of the camera's sensor; sometimes with a hidden corner, sometimes `None`.
fn depth(optics: &VirtualOptics, rng: &mut impl Rng) -> Result<Option<Depth>, TrainingCameraError> {
    if rng.random::<f32>() < NO_DEPTH {
        return Ok(None);
    }
    let reading = optics.depth(rng.random()).map_err(VirtualOpticsError::from)?.reading();
    let hidden = if rng.random() { rng.random::<u64>() & rng.random::<u64>() } else { 0 };
    let mm = |zone: usize| if hidden >> zone & 1 == 1 { 0 } else { reading[zone] };
    Ok(Some(Depth {
        metres: std::array::from_fn(|zone| f32::from(mm(zone)) * 1e-3),
        valid: std::array::from_fn(|zone| mm(zone) > 0),
    }))
}

/// The scene with half of itself mirrored on every side, 128 x 128.
fn mirrored(scene: &[f32]) -> Vec<f32> {
    let half = SIDE_PX / 2;
    let inner = |at: usize| match at {
        at if at < half => half - 1 - at,
        at if at < half + SIDE_PX => at - half,
        at => 2 * SIDE_PX - 1 - (at - half),
    };
    let edge = 2 * SIDE_PX;
    (0..edge * edge).map(|at| scene[inner(at / edge) * SIDE_PX + inner(at % edge)]).collect()
}

#[cfg(test)]
mod tests;
