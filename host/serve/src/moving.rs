//! The recursive estimate of a page: each image starts from the images before.
//!
//! The sums of a page overlap from image to image. An estimate takes each frame once, so an image
//! waits until all its frames are newer than those of the image before. A lost frame, or a frame
//! that was passed over, makes the time between two images longer: the estimate then finds a longer
//! motion of the scene. Another run, method, strength or number of frames, and an image that fails,
//! begin a new estimate.
//!
//! # Invariant
//! The images are those of [`Reconstruct::reconstruct_video`] for the same sums of frames
//! (`turns::tests::images_that_start_from_those_before_are_those_of_a_recorded_video`).

use super::look::{Look, Run};
use super::settings::Settings;
use nirspi_recon::Measurements;
use nirspi_recon::reconstruct::{Reconstruct, ReconstructError, Reconstruction, Recursive};

/// What the images of one run have shown; `None` if the next image is made alone or begins an
/// estimate.
#[derive(Debug, Default)]
pub struct Moving(Option<Scene>);

/// An estimate, and what the estimate holds for.
#[derive(Debug)]
struct Scene {
    past: Recursive,
    run: Run,
    method: &'static str,
    strength: Option<f64>,
    frames: u32,
    /// Number of the newest frame that the estimate has.
    newest: u64,
}

impl Scene {
    /// An estimate without images; `None` if the method, with its settings, makes each image by
    /// itself.
    fn begin(method: &dyn Reconstruct, look: &Look, settings: &Settings) -> Option<Self> {
        Some(Self {
            past: method.begin_video().ok().flatten()?,
            run: look.run(),
            method: settings.method,
            strength: settings.strength,
            frames: settings.frames,
            newest: 0,
        })
    }

    fn holds_for(&self, look: &Look, settings: &Settings) -> bool {
        self.run.is_of(look)
            && self.method == settings.method
            && self.strength == settings.strength
            && self.frames == settings.frames
    }
}

impl Moving {
    /// Whether a look makes an image: not if the estimate has some of the look's frames already.
    pub fn awaits(&self, look: &Look, settings: &Settings) -> bool {
        match &self.0 {
            Some(scene) if settings.warm_start && scene.holds_for(look, settings) => {
                look.newest.saturating_sub(scene.newest) >= look.frames()
            }
            _ => true,
        }
    }

    /// The image of a look. The first sums of a run have fewer frames and thus another noise:
    /// their images are made alone.
    ///
    /// # Errors
    /// The errors of the method. The next image then begins a new estimate.
    pub fn image(
        &mut self,
        method: &dyn Reconstruct,
        measurements: &Measurements,
        look: &Look,
        settings: &Settings,
    ) -> Result<Reconstruction, ReconstructError> {
        let before = self.0.take().filter(|scene| scene.holds_for(look, settings));
        let is_whole = look.frames() == u64::from(settings.frames);
        let scene = match settings.warm_start && is_whole {
            true => before.or_else(|| Scene::begin(method, look, settings)),
            false => None,
        };
        let Some(mut scene) = scene else { return method.reconstruct(measurements) };
        let made = method.next_frame(&mut scene.past, measurements)?;
        // A number that is not finite would stay in all later images.
        if made.image.pixels().iter().all(|pixel| pixel.is_finite()) {
            scene.newest = look.newest;
            self.0 = Some(scene);
        }
        Ok(made)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::look::{RunSetup, Seen};
    use crate::settings::tests::settings;
    use nirspi::account::LossCounters;
    use nirspi::clock::Instant;
    use nirspi::integrate::{Integrated, Newest};
    use nirspi::scene::{SceneMap, SceneSource};
    use nirspi::setup::MeasurementSetup;
    use nirspi_optics::CameraModel;
    use nirspi_recon::reconstruct::{Method, MethodSettings, hadamard};
    use nirspi_recon::{Image, Order, metrics};
    use nirspi_virtual::{Shot, VirtualOptics, calibrate_against_white, shoot};
    use std::ops::ControlFlow;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU32, Ordering};

    /// Distance of the scene from the camera, in millimetres.
    const DISTANCE_MM: f64 = 300.0;
    /// Motion of the scene from frame to frame, in pixels of the camera.
    const STEP_PX: f64 = 0.5;
    /// Frames that an image sums.
    const FRAMES: u32 = 16;

    /// The scene, this many pixels of the camera further to the right.
    fn moved(map: &SceneMap, pixels: f64) -> SceneMap {
        let model = CameraModel::paper();
        let field_mm = model.projector().field_mm(DISTANCE_MM);
        let side_mm = map.side_mm.unwrap_or(field_mm);
        let by = (pixels * field_mm / 32.0 / side_mm * map.size_px as f64).round() as usize;
        let at = |p: usize| match p % map.size_px {
            column if column < by => map.reflectance[0],
            _ => map.reflectance[p - by],
        };
        let reflectance = (0..map.reflectance.len()).map(at).collect();
        SceneMap { reflectance, ..map.clone() }
    }

    fn psnr_db(image: &Image, truth: &Image) -> f64 {
        let white = truth.pixels().iter().copied().fold(0.0, f32::max);
        let side = truth.side().pixels();
        metrics::psnr(truth.pixels(), image.pixels(), side, side, white.into()).unwrap()
    }

    #[test]
    fn a_moving_scene_is_better_than_frame_by_frame_at_equal_light() {
        let map = "letter:R".parse::<SceneSource>().unwrap().load(256).unwrap();
        let before = |k: u64| {
            let map = moved(&map, STEP_PX * k as f64);
            VirtualOptics::before(CameraModel::paper(), &map, DISTANCE_MM).unwrap()
        };
        let settling = calibrate_against_white(&before(0), 1).unwrap();
        let method = Method::TIKHONOV.prepare(&MethodSettings::default()).unwrap();
        let settings = Settings { warm_start: true, frames: FRAMES, ..settings() };
        let (mut moving, mut run) = (Moving::default(), None);
        let (mut recursive, mut alone) = (Vec::new(), Vec::new());
        for k in 0..10 {
            let shot = |optics: &VirtualOptics| -> Shot {
                let setup = optics.setup(&Order::ZigZag, 1.0).unwrap();
                let mut go_on = |_: &_| ControlFlow::Continue(());
                shoot(optics, setup, &settling, FRAMES, k + 1, &mut go_on).unwrap()
            };
            let truth = hadamard(&shot(&before(k).noiseless()).measurements().unwrap());
            let made = shot(&before(k));
            let measurements = made.measurements().unwrap();
            let run = run.get_or_insert_with(|| {
                let (setup, settling) = (made.capture.setup.clone(), Some(settling.clone()));
                Arc::new(RunSetup { setup, settling, flat_field: None })
            });
            let look = Look {
                seen: Seen::Camera {
                    frames: Box::new(Newest::of_sum(made.capture.integrated)),
                    run: Arc::clone(run),
                    depth: None,
                },
                arrived: Instant::now(),
                counters: LossCounters::default(),
                newest: u64::from(FRAMES) * (k + 1),
            };
            assert!(moving.awaits(&look, &settings));
            let image = moving.image(method.as_ref(), &measurements, &look, &settings).unwrap();
            assert_eq!(image.report.warm, k > 0, "{}", image.report);
            assert!(!moving.awaits(&look, &settings), "the same frame twice");
            recursive.push(psnr_db(&image.image, &truth));
            alone.push(psnr_db(&method.reconstruct(&measurements).unwrap().image, &truth));
        }
        let mean = |all: &[f64]| all[4..].iter().sum::<f64>() / (all.len() - 4) as f64;
        let (recursive, alone) = (mean(&recursive), mean(&alone));
        println!("recursive {recursive:.2} dB, frame by frame {alone:.2} dB (simulated)");
        assert!(recursive > alone + 2.0, "{recursive:.2} dB against {alone:.2} dB");
    }

    /// Tikhonov's recursive estimate, whose second image is not finite and whose fifth fails.
    struct Faulty(Box<dyn Reconstruct>, AtomicU32);

    impl Reconstruct for Faulty {
        fn name(&self) -> &str {
            "faulty"
        }

        fn reconstruct(&self, frame: &Measurements) -> Result<Reconstruction, ReconstructError> {
            self.0.reconstruct(frame)
        }

        fn begin_video(&self) -> Result<Option<Recursive>, ReconstructError> {
            self.0.begin_video()
        }

        fn next_frame(
            &self,
            past: &mut Recursive,
            frame: &Measurements,
        ) -> Result<Reconstruction, ReconstructError> {
            let mut made = self.0.next_frame(past, frame)?;
            match self.1.fetch_add(1, Ordering::Relaxed) {
                1 => made.image = Image::new(made.image.side(), vec![f32::NAN; 1024]),
                4 => return Err(ReconstructError::Failed("five".to_owned())),
                _ => {}
            }
            Ok(made)
        }
    }

    #[test]
    fn after_an_image_that_failed_a_new_estimate_begins() {
        let method = Method::TIKHONOV.prepare(&MethodSettings::default()).unwrap();
        let faulty = Faulty(method, AtomicU32::new(0));
        let settings = Settings { warm_start: true, frames: 1, ..settings() };
        let setup = MeasurementSetup::new(&Order::ZigZag, 0.3).unwrap();
        let patterns = setup.rows.len();
        let run = Arc::new(RunSetup { setup, settling: None, flat_field: None });
        let mut moving = Moving::default();
        let warm = |newest: u64| {
            let (mut sum, arrived) = (Integrated::new(&run.setup), Instant::now());
            sum.add_sums((0..patterns).map(|k| 1000 / (k as i64 + 1)), 1);
            let measurements = sum.measurements(&run.setup, None, false).unwrap();
            let counters = LossCounters::default();
            let seen = Seen::Camera {
                frames: Box::new(Newest::of_sum(sum)),
                run: Arc::clone(&run),
                depth: None,
            };
            let look = Look { seen, arrived, counters, newest };
            let made = moving.image(&faulty, &measurements, &look, &settings);
            made.ok().map(|made| made.report.warm)
        };
        let made: Vec<Option<bool>> = (1..=7).map(warm).collect();
        let (first, warm, failed) = (Some(false), Some(true), None);
        assert_eq!(made, [first, warm, first, warm, failed, first, warm]);
    }
}
