//! One measurement of a scene by the virtual camera, from the white sheets before it to the picture.
//!
//! ```no_run
//! let picture = nirspi_virtual::Look::paper().at("letter:R")?.capture()?.picture()?;
//! std::fs::write("letter.png", picture.png())?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Invariant
//! Every image is in shares of a white sheet at the target's place, which the same camera has
//! measured; none is fitted to the scene (`tests::the_first_picture_shows_the_letter`).

use super::{
    Shot, ShotError, Stages, StagesError, VirtualOptics, VirtualOpticsError,
    calibrate_against_white, enhance_stages, flat_field_against_white, shoot,
    white_level_at_target,
};
use crate::panels::SCENE_PX;
use nirspi::calibration::FlatField;
use nirspi::capture::{Capture, Progress, StopCause};
use nirspi::exposure::{Exposure, Length, Light, LightError};
use nirspi::imaging::{KnownReadings, MethodReport, share_of_white};
use nirspi::moving::followed;
use nirspi::picture::{Figure, FigureStyle, Panel, Unit};
use nirspi::provenance::{Made, Provenance, Taken};
use nirspi::response::Settling;
use nirspi::scene::{SceneError, SceneSource};
use nirspi::setup::MeasurementSetup;
use nirspi::stage_times::StageTimes;
use nirspi_nets::deblur;
use nirspi_optics::CameraModel;
use nirspi_recon::reconstruct::{self, Method, MethodSettings, ReconstructError};
use nirspi_recon::{Image, Measurements, Order, RowsError};
use std::ops::ControlFlow;
use thiserror::Error;

/// How a virtual camera is to look at a scene. [`Look::paper`] has the paper's camera and the values
/// of `nirspi demo`.
#[derive(Debug, Clone)]
pub struct Look {
    /// The camera.
    pub model: CameraModel,
    /// Distance of the scene, in mm.
    pub distance_mm: f64,
    /// The order of the patterns.
    pub order: Order,
    /// Share of the patterns that is shown, from 0 to 1.
    pub sampling: f64,
    /// Light of the measurement; `None` for what the camera description says.
    pub light: Option<Light>,
    /// Seed of all noise.
    pub seed: u64,
}

/// Why there is no picture of a scene.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LookError {
    /// The scene cannot be drawn or read.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The distance is not positive.
    #[error("distance is {found_mm} mm, expected a positive number")]
    Distance {
        /// The distance.
        found_mm: f64,
    },
    /// The camera cannot see at this distance.
    #[error(transparent)]
    Optics(#[from] VirtualOpticsError),
    /// The patterns cannot be chosen.
    #[error(transparent)]
    Rows(#[from] RowsError),
    /// There is no measurement with this light.
    #[error(transparent)]
    Light(#[from] LightError),
    /// The measurement failed.
    #[error(transparent)]
    Shot(#[from] ShotError),
    /// The measurement gives no image.
    #[error(transparent)]
    Method(#[from] ReconstructError),
    /// The networks give no image.
    #[error(transparent)]
    Stages(#[from] StagesError),
}

impl Look {
    /// The paper's camera: a scene in its focus, half of the patterns in cake-cutting order, 20 ms of
    /// light.
    #[must_use]
    pub fn paper() -> Self {
        let model = CameraModel::paper().clone();
        let distance_mm = model.projector().focus_distance_mm;
        let (order, sampling) = (Order::CakeCutting, 0.5);
        Self { model, distance_mm, order, sampling, light: None, seed: 1 }
    }

    /// The camera before this scene: `letter:R`, `word:STOP`, `white`, `black`, or the path of a
    /// picture.
    ///
    /// # Errors
    /// [`LookError`] names what is not possible.
    pub fn at(&self, scene: &str) -> Result<Bench, LookError> {
        let found_mm = self.distance_mm;
        if !(found_mm.is_finite() && found_mm > 0.0) {
            return Err(LookError::Distance { found_mm });
        }
        let map = scene.parse::<SceneSource>()?.load(SCENE_PX)?;
        let optics = VirtualOptics::before(&self.model, &map, self.distance_mm)?;
        let setup = optics.setup(&self.order, self.sampling)?;
        let readout = self.model.readout;
        let light = match self.light {
            Some(light) => light,
            None => Light::of_full_sweeps(readout.sweeps_per_picture, readout.clocks_per_pattern)?,
        };
        let Exposure { frames, sweeps } = Exposure::of(Length::Light(light, None), &setup)?;
        let setup = MeasurementSetup { sweeps, ..setup };
        Ok(Bench { optics, setup, frames, seed: self.seed })
    }
}

/// A virtual camera before its scene, and the measurement that it is to make.
pub struct Bench {
    /// Camera and scene.
    pub optics: VirtualOptics,
    /// The setup of the measurement.
    pub setup: MeasurementSetup,
    /// Number of frames.
    pub frames: u32,
    /// Seed of all noise.
    pub seed: u64,
}

impl Bench {
    /// Calibrates the camera and measures the scene.
    ///
    /// # Errors
    /// [`ShotError`] unless all frames were made and received.
    pub fn capture(self) -> Result<Seen, ShotError> {
        let times = &mut StageTimes::default();
        self.calibrated(times)?.capture(times, &mut |_| ControlFlow::Continue(()))
    }

    /// Measures what belongs to the camera and not to the scene, as a user would: latency and
    /// settling, the flat field if the LEDs differ, and a white sheet in the scene's place.
    ///
    /// # Errors
    /// [`ShotError`] if the camera sees no light from a sheet.
    pub fn calibrated(self, times: &mut StageTimes) -> Result<Calibrated, ShotError> {
        let (optics, seed) = (&self.optics, self.seed);
        let settling = times.time("calibrate", || calibrate_against_white(optics, seed))?;
        let flat_field =
            times.time("flat_field", || flat_field_against_white(optics, &settling, seed))?;
        let white = times.time("white_sheet", || {
            white_level_at_target(optics, &settling, flat_field.as_ref(), seed)
        })?;
        Ok(Calibrated { bench: self, settling, flat_field, white })
    }
}

/// A virtual camera before its scene, calibrated.
pub struct Calibrated {
    bench: Bench,
    settling: Settling,
    flat_field: Option<FlatField>,
    white: f32,
}

impl Calibrated {
    /// Measures the scene. `watch` is called while frames arrive and may break to stop.
    ///
    /// # Errors
    /// [`ShotError`] unless all frames were made and received.
    pub fn capture(
        self,
        times: &mut StageTimes,
        watch: &mut dyn FnMut(&Progress) -> ControlFlow<StopCause>,
    ) -> Result<Seen, ShotError> {
        let Self { bench: Bench { optics, setup, frames, seed }, settling, flat_field, white } =
            self;
        let frame_ns = setup.frame_ns();
        let mut newest_s = 0.0;
        let mut watch = |progress: &Progress| {
            // Frames come one after the other without a pause, and the last of them may come after the last call.
            let to_come = u64::from(frames).saturating_sub(progress.counters.received) as f64;
            newest_s = progress.device_time_us as f64 * 1e-6 + (to_come + 0.5) * frame_ns * 1e-9;
            watch(progress)
        };
        let shot = times.time("capture", || {
            shoot(&optics, setup.clone(), &settling, frames, seed, &mut watch)
        })?;
        let Capture { integrated, setup: taken, settling, .. } = &shot.capture;
        let (measurements, notes) = followed(integrated, taken, settling.as_ref(), false)?;
        let optics = optics.at_time(newest_s).map_err(VirtualOpticsError::from)?;
        let bench = Bench { optics, setup, frames, seed };
        Ok(Seen { bench, shot, measurements, notes, flat_field, white })
    }
}

/// A scene as the virtual camera has measured it.
pub struct Seen {
    /// Camera, scene and measurement. A target that moves is where the newest frame has seen it.
    pub bench: Bench,
    /// The frames and their account.
    pub shot: Shot,
    /// The measurements of their sum, or of the newest frames along the way of a target that moves.
    pub measurements: Measurements,
    /// What is to be said of the frames.
    pub notes: Vec<String>,
    /// The camera's flat field; `None` if its LEDs are alike.
    pub flat_field: Option<FlatField>,
    /// ADC counts of a pixel that sees the white sheet.
    pub white: f32,
}

/// An image of 32 x 32 in shares of the white sheet.
pub struct SeenImage {
    /// The image.
    pub image: Image,
    /// The same with the readings as they are, for networks.
    pub for_networks: Image,
    /// How its readings were taken, if their noise is known.
    pub readings: Option<KnownReadings>,
    /// The method's report.
    pub report: MethodReport,
}

impl Seen {
    /// An image of the measurements in shares of the white sheet, corrected for unequal LEDs.
    fn in_shares_of_white(&self, image: Image) -> Image {
        match &self.flat_field {
            Some(flat) => share_of_white(&flat.correct(&image), self.white),
            None => share_of_white(&image, self.white),
        }
    }

    /// The plain inverse transform, in shares of the white sheet.
    #[must_use]
    pub fn plain_transform(&self) -> Image {
        self.in_shares_of_white(reconstruct::hadamard(&self.measurements))
    }

    /// The image by a method of reconstruction.
    ///
    /// # Errors
    /// [`ReconstructError`] if a setting is out of range, or belongs to another method.
    pub fn reconstruct(
        &self,
        method: Method,
        settings: &MethodSettings,
    ) -> Result<SeenImage, ReconstructError> {
        let measurements = &self.measurements;
        let made = method.prepare(settings)?.reconstruct(measurements)?;
        let for_networks = self.in_shares_of_white(made.with_readings(measurements));
        let report = MethodReport { method, made: made.report };
        let readings = KnownReadings::new(&report, settings, measurements);
        let readings = readings.map(|readings| readings.in_shares_of(self.white));
        let image = self.in_shares_of_white(made.image);
        Ok(SeenImage { image, for_networks, readings, report })
    }

    /// The learned stages on an image.
    ///
    /// # Errors
    /// [`StagesError`] if a stage failed.
    pub fn enhance(&self, seen: &SeenImage, times: &mut StageTimes) -> Result<Stages, StagesError> {
        let (rows, Bench { optics, seed, .. }) = (self.measurements.rows(), &self.bench);
        enhance_stages(&seen.for_networks, rows, seen.readings, optics, *seed, times)
    }

    /// The enhanced image by the method that held-back readings choose.
    ///
    /// # Errors
    /// [`LookError`] if there is no image.
    pub fn picture(&self) -> Result<SeenPicture, LookError> {
        let image = self.reconstruct(Method::default(), &nirspi_nets::prior::settings())?;
        let Stages { deblurred, report, .. } = self.enhance(&image, &mut StageTimes::default())?;
        let made = Made::now("nirspi-virtual", None, std::env::args());
        let provenance = Taken::by(self.shot.session.identity()).made(&made);
        Ok(SeenPicture { pixels: deblurred, warnings: report.warnings, provenance })
    }
}

/// An enhanced image.
pub struct SeenPicture {
    /// 64 x 64 pixels, row by row, in shares of the white sheet.
    pub pixels: Vec<f32>,
    /// Reasons not to trust it.
    pub warnings: Vec<String>,
    /// By whom and when it was made.
    pub provenance: Provenance,
}

impl SeenPicture {
    /// The image as a PNG file with a title, its scale and its provenance.
    #[must_use]
    pub fn png(&self) -> Vec<u8> {
        let panel =
            Panel::square("enhanced (simulated)", deblur::SIDE, &self.pixels, Unit::OfWhite);
        Figure::Images(panel.into()).png(&FigureStyle::Paper.look(), &self.provenance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi::imaging::score;
    use nirspi_optics::Motion;
    use nirspi_recon::Side;

    #[test]
    fn the_first_picture_shows_the_letter() {
        let seen = Look::paper().at("letter:R").unwrap().capture().unwrap();
        let picture = seen.picture().unwrap();
        let truth = seen.bench.optics.focused(deblur::SIDE);
        let image = Image::new(Side::new(deblur::SIDE as u64).unwrap(), picture.pixels.clone());
        let quality = score(&image, &truth).unwrap();
        assert!(quality.psnr_db.is_some_and(|psnr| psnr > 24.0), "{quality}");
        // Without a fit to the scene, the letter reads about as the white sheet does.
        let brightest = picture.pixels.iter().fold(0.0_f32, |most, &pixel| most.max(pixel));
        assert!((0.8..=1.0).contains(&brightest), "{brightest}");
        assert_eq!(picture.warnings, [""; 0]);
        assert!(picture.png().starts_with(b"\x89PNG"));
    }

    #[test]
    fn a_letter_that_moves_is_scored_where_its_newest_frame_has_seen_it() {
        let mut bench = Look::paper().at("letter:R").unwrap();
        let motion = Motion { speed_m_per_s: 0.5, direction_deg: 90.0, ..Motion::default() };
        bench.optics = bench.optics.moving(motion).unwrap();
        let seen = bench.capture().unwrap();
        assert!(
            seen.notes.iter().any(|note| note.contains("added along its way")),
            "{:?}",
            seen.notes
        );
        let image = seen.reconstruct(Method::PRIOR, &nirspi_nets::prior::settings()).unwrap().image;
        let truth = seen.bench.optics.focused_footprint().unwrap();
        let quality = score(&image, truth.weights()).unwrap();
        assert!(quality.psnr_db.is_some_and(|psnr| psnr > 24.0), "{quality}");
    }

    #[test]
    fn what_is_not_possible_is_one_line() {
        let refused = |look: Look, scene| look.at(scene).err().unwrap().to_string();
        assert!(refused(Look::paper(), "letter:").contains("letter"));
        let near = Look { distance_mm: -1.0, ..Look::paper() };
        assert!(refused(near, "white").contains("distance is -1 mm"));
        let light = Some(Light::from_ms(1e-3).unwrap());
        assert!(refused(Look { light, ..Look::paper() }, "white").contains("one sweep"));
    }
}
