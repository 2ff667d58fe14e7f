//! The quality of enhanced images, on characters outside the training data and on other scenes.
//!
//! Sharp 64 x 64 images are blurred (Gaussian, sigma in pixels of 64), sampled to 32 x 32 by means
//! of 2 x 2, given noise, and enhanced by every method. The methods are Lanczos, three classical
//! methods that know blur and noise, and the networks, which do not.
//!
//! # Invariant
//! Every method gets the same readings, and its figures come with their number of images
//! (`every_row_is_measured_on_the_same_unseen_images` in the tests of `nirspi-cli`).

mod characters;
mod charts;
mod condition;
mod contenders;
mod measure;
mod others;

pub use characters::{Character, Characters, Origin};
pub use condition::Condition;
pub use contenders::{Contender, Method, Version};
pub use measure::Figures;
pub use others::Case;

pub(crate) use characters::groups;
pub(crate) use condition::halved;

use crate::error::Result;
use measure::Judges;
use nirspi::picture::Figure;
use nirspi_nets::{Device, Networks};
use serde::Serialize;
use std::path::PathBuf;

/// Settings of the measurement.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Settings {
    /// Characters: `.npz` stacks or Chars74K's folder.
    pub data: PathBuf,
    /// Held-out groups of each stack, as JSON; `None` means those of the embedded weights.
    pub held_out: Option<PathBuf>,
    /// Folder of PNG pictures. Parts of the pictures are scenes other than letters.
    pub scenes: Option<PathBuf>,
    /// Folder of real measurements (`.npz`).
    pub spi: Option<PathBuf>,
    /// Folder of other weights, `<network>.safetensors`.
    pub weights: Option<PathBuf>,
    /// Number of images of each stack.
    pub count: usize,
    /// Number of images of each stack for the curve over steps.
    pub sampler_count: usize,
    /// The most steps of that curve.
    pub most_steps: u32,
    /// Seed of the choice of images and of the noise.
    pub seed: u64,
}

/// Blur of the curves over noise and steps, and noise of the curves over blur and steps: strong,
/// but a character stays readable.
const MIDDLE: Condition = Condition { sigma_px: 2.0, noise: 0.03 };

/// Blurs, in pixels of 64.
const SIGMAS_PX: [f32; 6] = [0.3, 0.7, 1.0, 2.0, 3.0, 4.0];

/// Standard deviations of noise.
const NOISES: [f32; 5] = [0.0, 0.01, 0.03, 0.05, 0.08];

/// A condition without degradation except the sampling.
const UNTOUCHED: Condition = Condition { sigma_px: 0.0, noise: 0.0 };

/// Numbers of steps of the curves over steps.
const STEPS: [u32; 6] = [1, 2, 4, 10, 50, 500];

/// The quality of every method, and the results for scenes other than characters.
#[derive(Debug, Serialize)]
pub struct Report {
    /// Always true.
    pub simulated: bool,
    /// Seed of the choice of images and of the noise.
    pub seed: u64,
    /// The stacks, and their numbers of images.
    pub images: Vec<Origin>,
    /// The networks' versions.
    pub weights: Vec<Version>,
    /// Each method at each condition.
    pub conditions: Vec<Figures>,
    /// Each method with each number of steps at the middle condition.
    pub steps: Vec<Figures>,
    /// Results for scenes other than characters.
    pub others: Vec<Case>,
    /// Notes about stacks with fewer images than requested.
    pub notes: Vec<String>,
}

/// All data of the measurement, read and checked.
pub struct Study {
    settings: Settings,
    contenders: Vec<Contender>,
    /// The characters for the curves over steps.
    stepped: Vec<Contender>,
    /// The contender for scenes other than characters.
    bridge: Contender,
    weights: Vec<Version>,
    judges: Judges,
    characters: Characters,
    few: Characters,
    scenes: Vec<others::Scene>,
}

/// The report, and its figures by name.
pub struct Measured {
    /// The report.
    pub report: Report,
    /// Charts, and scenes other than characters.
    pub pictures: Vec<(&'static str, Figure)>,
}

impl Study {
    /// Reads images, weights and scenes.
    ///
    /// # Errors
    /// `EvalError` for a file that cannot be read, or if there is no held-out image.
    pub fn new(settings: Settings) -> Result<Self> {
        let mut networks = Networks::built_in(Device::cpu());
        if let Some(folder) = &settings.weights {
            networks = networks.with_folder(folder);
        }
        let judges = Judges::new(&mut networks)?;
        let held_out = settings.held_out.as_deref();
        let characters = Characters::read(&settings.data, held_out, settings.count, settings.seed)?;
        let few = characters.first(settings.sampler_count);
        let (pictures, spi) = (settings.scenes.as_deref(), settings.spi.as_deref());
        let scenes = others::cases(pictures, spi, settings.seed)?;
        let mut ready = |methods: &[Method]| -> Result<Vec<Contender>> {
            methods.iter().map(|method| Contender::new(*method, &mut networks)).collect()
        };
        let (contenders, stepped) = (ready(&Method::ALL)?, ready(&stepped(settings.most_steps))?);
        let bridge = Contender::new(Method::Diffusion(1), &mut networks)?;
        let weights = Version::all(&mut networks)?;
        Ok(Self { settings, contenders, stepped, bridge, weights, judges, characters, few, scenes })
    }

    /// Number of images to enhance.
    #[must_use]
    pub fn images(&self) -> usize {
        self.contenders.len() * conditions().len() * self.characters.len()
            + self.stepped.len() * self.few.len()
    }

    /// Measures. `done` is called with the number of images just enhanced.
    ///
    /// # Errors
    /// `EvalError` for images that a method or a judge refuses.
    pub fn run(&self, done: &dyn Fn(usize)) -> Result<Measured> {
        let Self { settings, contenders, judges, characters, few, .. } = self;
        let seed = settings.seed;
        let measured = over(contenders, &conditions(), characters, judges, seed, done)?;
        let steps = over(&self.stepped, &[MIDDLE], few, judges, seed, done)?;
        let shown = others::enhance(&self.scenes, &self.bridge)?;
        let mut pictures = charts::all(&measured, &steps, characters, few);
        pictures.push(("others", shown.picture.into()));
        let report = Report {
            simulated: true,
            seed,
            images: characters.origins().to_vec(),
            weights: self.weights.clone(),
            conditions: measured,
            steps,
            others: shown.cases,
            notes: characters.notes().to_vec(),
        };
        Ok(Measured { report, pictures })
    }
}

/// All conditions, each once.
fn conditions() -> Vec<Condition> {
    let mut all = vec![UNTOUCHED];
    all.extend(SIGMAS_PX.map(|sigma_px| Condition { sigma_px, ..MIDDLE }));
    all.extend(
        NOISES.map(|noise| Condition { noise, ..MIDDLE }).into_iter().filter(|c| *c != MIDDLE),
    );
    all
}

/// The methods with a choice of steps, and the methods for comparison.
fn stepped(most: u32) -> Vec<Method> {
    let mut all = vec![
        Method::Lanczos,
        Method::Classical(charts::BEST_CLASSICAL),
        Method::Gan,
        Method::Regression,
    ];
    for steps in STEPS.into_iter().filter(|&steps| steps <= most) {
        if steps <= charts::MOST_BRIDGE_STEPS {
            all.push(Method::Diffusion(steps));
        }
        all.push(Method::Ancestral(steps));
    }
    all
}

fn over(
    contenders: &[Contender],
    conditions: &[Condition],
    characters: &Characters,
    judges: &Judges,
    seed: u64,
    done: &dyn Fn(usize),
) -> Result<Vec<Figures>> {
    let sharp = judges.judge(&characters.values())?;
    let mut all = Vec::new();
    for &condition in conditions {
        let readings = condition.readings(characters, seed);
        let mut made = Vec::new();
        for contender in contenders {
            let images = contender.enhance(&readings, condition, done)?;
            let each = Judges::each(condition, characters, &readings, &images)?;
            made.push((contender.method(), judges.judge(&images)?, each));
        }
        let gan = made.iter().find(|(method, ..)| *method == Method::Gan);
        let gan = gan.map(|(.., each)| each.as_slice());
        for (method, judged, each) in &made {
            let figures =
                judges.figures((*method, condition), characters, (&sharp, judged), each, gan)?;
            all.extend(figures);
        }
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_condition_is_there_once_and_the_middle_is_among_them() {
        let all = conditions();
        assert_eq!(all.len(), 1 + SIGMAS_PX.len() + NOISES.len() - 1);
        assert_eq!(all.iter().filter(|c| **c == MIDDLE).count(), 1);
        for (at, condition) in all.iter().enumerate() {
            assert!(!all[..at].contains(condition), "{condition:?}");
        }
    }

    #[test]
    fn steps_go_no_further_than_asked_and_the_bridge_no_further_than_it_settles() {
        let of = |most| stepped(most).into_iter().filter_map(Method::steps).collect::<Vec<u32>>();
        assert_eq!(of(1), [1, 1]);
        assert_eq!(of(10), [1, 1, 2, 2, 4, 4, 10, 10]);
        assert_eq!(of(500).iter().filter(|&&steps| steps == 500).count(), 1);
    }
}
