//! Short runs of tiny networks on procedural scenes: they learn, repeat, continue and stop.

use super::checkpoint::Checkpoint;
use super::*;
use crate::data::{AREA_PX, Kind, Scenes, Stack};
use crate::degrade::{AnalyticCamera, Degrade, Limits, Reading};
use crate::device::Device;
use crate::model::{ClassifierConfig, EstimatorConfig, FsrcnnConfig, UNetConfig};
use crate::weights::{Precision, Weights};
use rand_pcg::Pcg64Mcg;

type Kept = Result<(), Box<dyn std::error::Error + Send + Sync>>;

/// A keeper that stores everything in memory, and can stop the run after a step.
#[derive(Default)]
struct Memory {
    entries: Vec<Entry>,
    checkpoint: Option<Checkpoint>,
    best: Option<Weights>,
    last_step: Option<u64>,
}

impl Keeper for Memory {
    fn entry(&mut self, entry: &Entry) -> Kept {
        self.entries.push(*entry);
        Ok(())
    }

    fn checkpoint(&mut self, checkpoint: &Checkpoint) -> Kept {
        // The checkpoint passes through its bytes, as through a file.
        self.checkpoint = Some(Checkpoint::from_bytes(&checkpoint.to_bytes()?)?);
        Ok(())
    }

    fn best(&mut self, weights: &Weights) -> Kept {
        self.best = Some(weights.clone());
        Ok(())
    }

    fn stepped(&mut self, step: u64, _loss: f64) -> bool {
        self.last_step != Some(step)
    }
}

fn tiny(model: Model) -> Settings {
    let (width, steps) = match model {
        Model::Fsrcnn => (vec![8, 4], 40),
        Model::Diffusion | Model::Gan => (vec![8, 8], 40),
        Model::Ancestral => (vec![8, 8], 60),
        Model::Estimator => (vec![4, 6, 8, 8], 60),
        Model::Classifier => (vec![6, 8, 12], 60),
    };
    Settings {
        width,
        steps,
        batch: 4,
        rate: 4e-3,
        average: 0.9,
        log_every: 10,
        judge_every: 20,
        held_out: 4,
        ..Settings::new(model)
    }
}

fn camera() -> AnalyticCamera {
    AnalyticCamera::new(Limits::default()).unwrap()
}

fn run(
    settings: &Settings,
    scenes: &Scenes,
    camera: &dyn Degrade,
    resumed: Option<Checkpoint>,
    keeper: &mut Memory,
) -> Result<Outcome, TrainError> {
    let examples =
        Examples { scenes, degrade: camera, enlarge: &Lanczos, fine: 0.25, seed: settings.seed };
    train(settings, &examples, "procedural", resumed, &Device::cpu(), keeper)
}

/// Ten pages with a small square or a large one: two classes that are easy to distinguish. No page is there
/// twice, because families that share one would be one family.
fn squares() -> Scenes {
    let page = |number: usize| -> Vec<u8> {
        let half = if number.is_multiple_of(2) { 4 } else { 20 } + number / 2;
        let lit = |at: usize| (at / 64).abs_diff(32).max((at % 64).abs_diff(32)) < half;
        (0..AREA_PX).map(|at| if lit(at) { 255 } else { 0 }).collect()
    };
    let levels = (0..10).flat_map(page).collect();
    let labels = Some((0..10).map(|number| (number % 2) as u8).collect());
    let stack =
        Stack::new("squares", Kind::Drawn, levels, labels, (0..10).map(|n| n / 2).collect());
    Scenes::new(vec![stack.unwrap()], 0.2, 0.0, 1).unwrap()
}

#[test]
fn every_network_learns_in_a_short_run() {
    for model in [Model::Fsrcnn, Model::Diffusion, Model::Ancestral, Model::Gan, Model::Estimator] {
        let mut kept = Memory::default();
        let settings = tiny(model);
        let outcome = run(&settings, &Scenes::procedural(), &camera(), None, &mut kept).unwrap();
        assert_eq!((outcome.ended, outcome.step), (Ended::Complete, settings.steps));
        let losses: Vec<f64> = kept.entries.iter().map(|entry| entry.loss).collect();
        let (first, last) = (losses[0], losses[losses.len() - 1]);
        assert!(last < 0.9 * first, "{model}: {losses:?}");
        assert_eq!(
            kept.entries.iter().filter(|e| e.held_out.is_some()).count() as u64,
            settings.steps / 20
        );
        // The stored weights are a file with metadata.
        let bytes = kept.best.unwrap().to_bytes(Precision::Half).unwrap();
        let weights = Weights::parse("best", &bytes).unwrap();
        weights.expect_model(&model.to_string()).unwrap();
    }
}

#[test]
fn a_classifier_learns_classes_and_refuses_scenes_without() {
    let sharp = Limits { sigma_px: 0.0..=0.5, noise_std: 0.0..=0.02, ..Limits::default() };
    let camera = AnalyticCamera::new(sharp).unwrap();
    let mut kept = Memory::default();
    let outcome = run(&tiny(Model::Classifier), &squares(), &camera, None, &mut kept).unwrap();
    assert_eq!(outcome.best.unwrap().0, 100.0, "{:?}", kept.entries);
    let procedural = Scenes::procedural();
    let error = run(&tiny(Model::Classifier), &procedural, &camera, None, &mut kept).unwrap_err();
    assert!(error.to_string().contains("images without labels"), "{error}");
}

#[test]
fn a_run_that_was_stopped_goes_on_to_the_very_same_weights() {
    for model in [Model::Diffusion, Model::Gan] {
        let settings = Settings { steps: 24, judge_every: 10, log_every: 4, ..tiny(model) };
        let scenes = Scenes::procedural();
        let mut whole = Memory::default();
        run(&settings, &scenes, &camera(), None, &mut whole).unwrap();
        let mut parts = Memory { last_step: Some(13), ..Memory::default() };
        let outcome = run(&settings, &scenes, &camera(), None, &mut parts).unwrap();
        assert_eq!((outcome.ended, outcome.step), (Ended::Stopped, 13));
        let halfway = parts.checkpoint.take();
        parts.last_step = None;
        run(&settings, &scenes, &camera(), halfway, &mut parts).unwrap();

        let told = |entries: &[Entry]| -> Vec<(u64, f64, Option<f64>)> {
            entries.iter().map(|e| (e.step, e.loss, e.held_out)).collect()
        };
        assert_eq!(told(&whole.entries), told(&parts.entries), "{model}");
        assert_eq!(whole.best, parts.best, "{model}");
        let (whole, parts) =
            (whole.checkpoint.unwrap().progress, parts.checkpoint.unwrap().progress);
        assert_eq!(told(&whole.log), told(&parts.log));
        assert_eq!(whole.best, parts.best);
    }
}

#[test]
fn the_same_seed_gives_the_same_weights_and_another_seed_others() {
    let weights = |seed| {
        let settings = Settings { steps: 12, judge_every: 12, seed, ..tiny(Model::Fsrcnn) };
        let mut kept = Memory::default();
        run(&settings, &Scenes::procedural(), &camera(), None, &mut kept).unwrap();
        kept.best.unwrap()
    };
    assert_eq!(weights(1), weights(1));
    assert_ne!(weights(1), weights(2));
}

/// A camera that breaks after some pictures, and then gives NaN.
struct Breaking(std::sync::atomic::AtomicUsize);

impl Degrade for Breaking {
    fn degrade(&self, scene: &[f32], rng: &mut Pcg64Mcg) -> Result<Reading, DegradeError> {
        let mut reading = camera().degrade(scene, rng)?;
        if self.0.fetch_add(1, std::sync::atomic::Ordering::Relaxed) > 60 {
            reading.optical.fill(f32::NAN);
        }
        Ok(reading)
    }
}

#[test]
fn a_loss_that_is_no_number_ends_the_run_and_the_last_checkpoint_is_good() {
    let settings = Settings { judge_every: 5, ..tiny(Model::Fsrcnn) };
    let broken = Breaking(Default::default());
    let mut kept = Memory::default();
    let error = run(&settings, &Scenes::procedural(), &broken, None, &mut kept).unwrap_err();
    let line = error.to_string();
    assert!(line.starts_with("the loss is NaN at step 1") && line.contains("--resume"), "{line}");
    let checkpoint = kept.checkpoint.unwrap();
    assert!(checkpoint.progress.step > 0);
    let mut again = Memory::default();
    let scenes = Scenes::procedural();
    let outcome = run(&settings, &scenes, &camera(), Some(checkpoint), &mut again).unwrap();
    assert_eq!(outcome.ended, Ended::Complete);
}

#[test]
fn training_ends_when_held_out_examples_get_no_better() {
    let settings = Settings {
        rate: 1e-12,
        average: 0.0,
        judge_every: 2,
        patience: Some(3),
        ..tiny(Model::Estimator)
    };
    let mut kept = Memory::default();
    let outcome = run(&settings, &Scenes::procedural(), &camera(), None, &mut kept).unwrap();
    assert_eq!(outcome.ended, Ended::NoLongerBetter);
    assert!(outcome.step < settings.steps);
}

#[test]
fn settings_that_cannot_be_are_named() {
    let refused = |settings: Settings| {
        let mut kept = Memory::default();
        run(&settings, &Scenes::procedural(), &camera(), None, &mut kept).unwrap_err().to_string()
    };
    assert_eq!(
        refused(Settings { batch: 0, ..tiny(Model::Gan) }),
        "batch is 0, expected at least 1"
    );
    assert!(refused(Settings { rate: f64::NAN, ..tiny(Model::Gan) }).contains("rate is NaN"));
    let width = Settings { width: vec![1, 2, 3], ..tiny(Model::Fsrcnn) };
    assert!(refused(width).contains("width is [1, 2, 3], expected 2 numbers"));
}

#[test]
fn networks_are_trained_at_the_size_of_the_shipped_ones() {
    let shipped = |model: Model| Weights::embedded(&model.to_string()).unwrap();
    for model in [Model::Diffusion, Model::Gan, Model::Ancestral] {
        let standard = Settings::new(model);
        assert!(standard.width.is_empty());
        assert_eq!(tasks::unet(&standard), UNetConfig::of(&shipped(model)).unwrap(), "{model}");
    }
    assert_eq!(FsrcnnConfig::default(), FsrcnnConfig::of(&shipped(Model::Fsrcnn)).unwrap());
    assert_eq!(
        EstimatorConfig::default(),
        EstimatorConfig::of(&shipped(Model::Estimator)).unwrap()
    );
    let classifier = ClassifierConfig::of(&shipped(Model::Classifier)).unwrap();
    assert_eq!(ClassifierConfig::default(), classifier);
}
