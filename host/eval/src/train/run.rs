//! Trains one network in a folder.

use super::data::{Data, Found};
use super::folder::RunFolder;
use crate::error::{EvalError, On, Result};
use nirspi::provenance::{Made, Origin, Provenance, Taken};
use nirspi::training::{LinearCamera, Mixed};
use nirspi_nets::Weights;
use nirspi_nets::degrade::{AnalyticCamera, Limits};
use nirspi_nets::device::{Backend, Device};
use nirspi_nets::train::checkpoint::Checkpoint;
use nirspi_nets::train::{
    Enlarge, Entry, Examples, Fused, Keeper, Lanczos, Model, Outcome, Settings, check, train,
};
use nirspi_optics::CameraModel;
use serde::Serialize;
use std::path::PathBuf;

/// A training run: the network, its data and its folder.
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    /// The network and how it learns.
    pub settings: Settings,
    /// The characters.
    pub data: Data,
    /// The virtual camera.
    pub camera: CameraModel,
    /// Share of the examples that the virtual camera takes. Formulas make the others.
    pub camera_share: f32,
    /// Weights of the FSRCNN before the deblurrer; `None` means the embedded weights.
    pub fsrcnn: Option<PathBuf>,
    /// Folder for checkpoint, weights, log and plot.
    pub out: PathBuf,
    /// Whether to resume from the folder's checkpoint.
    pub resume: bool,
    /// The backend.
    pub backend: Backend,
    /// The program, for the provenance of the plot.
    pub made: Made,
}

/// Observes a run.
pub trait Watch {
    /// Training begins after `step` steps of an earlier run, or after 0 steps.
    fn starts(&mut self, settings: &Settings, step: u64);
    /// A line of the log, with the last held-out score.
    fn entry(&mut self, entry: &Entry, held_out: Option<f64>);
    /// A step was done. `false` writes a checkpoint and ends the run.
    fn stepped(&mut self, step: u64) -> bool;
}

/// The result of a run.
#[derive(Debug, Serialize)]
pub struct Report {
    /// The network.
    pub model: Model,
    /// The settings of the training.
    pub settings: Settings,
    /// The data of the training.
    pub data: Found,
    /// Share of the examples that the virtual camera took.
    pub camera_share: f32,
    /// The outcome of the training.
    #[serde(flatten)]
    pub outcome: Outcome,
    /// The best weights.
    pub weights: PathBuf,
}

/// Share of examples whose degraded image is 64 x 64 from the start.
const FINE_SHARE: f32 = 0.25;
/// Blur and noise of classified characters, which are small because the characters have been
/// restored.
const NEARLY_SHARP: (f32, f32) = (1.0, 0.03);

/// The share of a network's examples whose degraded image is 64 x 64 from the start.
fn fine_share(model: Model) -> f32 {
    match model {
        Model::Fsrcnn => 0.0,
        Model::Classifier => 1.0,
        Model::Estimator => 0.5,
        Model::Diffusion | Model::Ancestral | Model::Gan => FINE_SHARE,
    }
}

/// The degradation of a network's examples.
fn degradation(request: &Request) -> Result<Mixed> {
    // The classifier sees characters that have been restored.
    if request.settings.model == Model::Classifier {
        let (sigma_px, noise_std) = NEARLY_SHARP;
        let limits =
            Limits { sigma_px: 0.0..=sigma_px, noise_std: 0.0..=noise_std, ..Limits::default() };
        return Ok(Mixed { analytic: AnalyticCamera::new(limits)?, camera: None });
    }
    let camera = match request.camera_share > 0.0 {
        true => {
            Some((LinearCamera::new(&request.camera, request.settings.seed)?, request.camera_share))
        }
        false => None,
    };
    Ok(Mixed { analytic: AnalyticCamera::new(Limits::default())?, camera })
}

/// Trains a network until its last step, until held-out examples no longer improve, or until
/// `watch` ends the run.
///
/// # Errors
/// [`EvalError::Setting`] for a share out of range; other errors for data, weights or a folder that
/// cannot be used, or a step that fails.
pub fn run(request: &Request, watch: &mut dyn Watch) -> Result<Report> {
    let Request { settings, camera_share, out, .. } = request;
    if !(0.0..=1.0).contains(camera_share) {
        return Err(EvalError::setting("camera_share", camera_share, "0 to 1"));
    }
    let (model, seed) = (settings.model, settings.seed);
    let mut characters = request.data.clone();
    if model == Model::Classifier {
        characters.shapes = 0.0;
    }
    let (scenes, data) = characters.scenes(seed)?;
    let device = Device::open(request.backend)?;
    let degrade = degradation(request)?;
    let enlarge = request.enlarge()?;
    let fine = fine_share(model);
    let examples =
        Examples { scenes: &scenes, degrade: &degrade, enlarge: enlarge.as_ref(), fine, seed };

    check(settings, &examples)?;
    let (mut folder, resumed) = match request.resume {
        true => RunFolder::resume(out).map(|(folder, checkpoint)| (folder, Some(checkpoint)))?,
        false => (RunFolder::start(out)?, None),
    };
    folder.write_data(&data)?;
    watch.starts(settings, resumed.as_ref().map_or(0, |checkpoint| checkpoint.progress.step));
    let provenance = Taken::without_camera(Origin::Computed).made(&request.made);
    let mut keeper = Kept { folder: &mut folder, watch, held_out: None, provenance };
    let trained_on = request.trained_on(&data);
    let outcome = train(settings, &examples, &trained_on, resumed, &device, &mut keeper);
    Ok(Report {
        model,
        settings: settings.clone(),
        data,
        camera_share: *camera_share,
        outcome: outcome.on_file(out)?,
        weights: out.join(RunFolder::WEIGHTS),
    })
}

impl Request {
    /// The network before the deblurrer. Other networks get readings, or images of 64 x 64.
    fn enlarge(&self) -> Result<Box<dyn Enlarge>> {
        if !deblurs(self.settings.model) {
            return Ok(Box::new(Lanczos));
        }
        let weights = match &self.fsrcnn {
            Some(file) => Weights::read(file)?,
            None => Weights::embedded("fsrcnn")?,
        };
        Ok(Box::new(Fused::new(&weights)?))
    }

    /// A description of the training data in one line. A different line means a different run.
    fn trained_on(&self, data: &Found) -> String {
        let stacks: Vec<String> = data
            .stacks
            .iter()
            .map(|stack| {
                let (held_out, groups) = (stack.held_out.len(), stack.groups);
                format!(
                    "{} ({} images, {held_out} of {groups} groups held out)",
                    stack.stack, stack.images
                )
            })
            .collect();
        let stacks =
            if stacks.is_empty() { "procedural scenes".to_owned() } else { stacks.join(", ") };
        let fsrcnn = if self.fsrcnn.is_some() { ", an FSRCNN of the user's" } else { "" };
        let (shapes, share) = (self.data.shapes, self.camera_share);
        let camera = match self.camera == *CameraModel::paper() {
            true => String::new(),
            false => format!(" {} ({:08x})", self.camera.name, self.camera.digest()),
        };
        format!("{stacks}; {shapes} shapes, {share} by the virtual camera{camera}{fsrcnn}")
    }
}

fn deblurs(model: Model) -> bool {
    matches!(model, Model::Diffusion | Model::Ancestral | Model::Gan)
}

/// Writes a run to its folder, and lets a [`Watch`] observe the run.
struct Kept<'k> {
    folder: &'k mut RunFolder,
    watch: &'k mut dyn Watch,
    held_out: Option<f64>,
    provenance: Provenance,
}

type Boxed = Box<dyn std::error::Error + Send + Sync>;

impl Keeper for Kept<'_> {
    fn entry(&mut self, entry: &Entry) -> Result<(), Boxed> {
        self.held_out = entry.held_out.or(self.held_out);
        self.watch.entry(entry, self.held_out);
        Ok(self.folder.entry(entry)?)
    }

    fn checkpoint(&mut self, checkpoint: &Checkpoint) -> Result<(), Boxed> {
        let bytes = checkpoint.to_bytes()?;
        Ok(self.folder.checkpoint(&bytes, &checkpoint.progress.log, &self.provenance)?)
    }

    fn best(&mut self, weights: &Weights) -> Result<(), Boxed> {
        let bytes = weights.to_bytes(nirspi_nets::weights::Precision::Single)?;
        Ok(self.folder.best(&bytes)?)
    }

    fn stepped(&mut self, step: u64, _loss: f64) -> bool {
        self.watch.stepped(step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counts the steps, and ends the run after some steps.
    struct Counted {
        began_at: u64,
        entries: u64,
        last: u64,
    }

    impl Watch for Counted {
        fn starts(&mut self, _: &Settings, step: u64) {
            self.began_at = step;
        }
        fn entry(&mut self, _: &Entry, _: Option<f64>) {
            self.entries += 1;
        }
        fn stepped(&mut self, step: u64) -> bool {
            step < self.last
        }
    }

    fn request(model: Model, out: PathBuf) -> Request {
        let settings = Settings {
            width: vec![4, 2],
            steps: 4,
            batch: 2,
            judge_every: 2,
            log_every: 2,
            ..Settings::new(model)
        };
        let data = Data { stacks: Vec::new(), fonts: Vec::new(), held_out: 0.1, shapes: 0.15 };
        let (camera_share, fsrcnn, resume, backend) = (0.0, None, false, Backend::Cpu);
        let camera = CameraModel::default();
        let made = Made::by("test", None, ["test"], 0);
        Request { settings, data, camera, camera_share, fsrcnn, out, resume, backend, made }
    }

    #[test]
    fn a_run_that_was_ended_goes_on_from_its_checkpoint() {
        let folder = tempfile::tempdir().unwrap();
        let mut request = request(Model::Fsrcnn, folder.path().join("run"));
        let mut watch = Counted { began_at: 9, entries: 0, last: 2 };
        let report = run(&request, &mut watch).unwrap();
        assert_eq!((watch.began_at, report.outcome.step), (0, 2));
        request.resume = true;
        watch.last = 100;
        let report = run(&request, &mut watch).unwrap();
        assert_eq!((watch.began_at, watch.entries, report.outcome.step), (2, 2, 4));
        assert!(report.weights.exists());
    }

    #[test]
    fn another_description_of_the_data_is_another_run() {
        let one = request(Model::Fsrcnn, "run".into());
        let found = Found {
            stacks: Vec::new(),
            training_images: 0,
            held_out_images: 0,
            skipped_fonts: Vec::new(),
        };
        let told = one.trained_on(&found);
        assert_eq!(told, "procedural scenes; 0.15 shapes, 0 by the virtual camera");
        let other = Request { fsrcnn: Some("mine".into()), camera_share: 0.5, ..one };
        let told = other.trained_on(&found);
        assert_eq!(
            told,
            "procedural scenes; 0.15 shapes, 0.5 by the virtual camera, an FSRCNN of the user's"
        );
    }

    #[test]
    fn the_classifier_learns_from_nearly_sharp_characters_without_the_camera() {
        let share = |model| {
            let request = Request { camera_share: 0.5, ..request(model, "run".into()) };
            degradation(&request).unwrap().camera.map(|(_, share)| share)
        };
        assert_eq!((share(Model::Classifier), share(Model::Estimator)), (None, Some(0.5)));
        let wrong = Request { camera_share: 1.5, ..request(Model::Gan, "run".into()) };
        let watch = &mut Counted { began_at: 0, entries: 0, last: 0 };
        let told = run(&wrong, watch).unwrap_err().to_string();
        assert_eq!(told, "camera_share is 1.5, expected 0 to 1");
    }
}
