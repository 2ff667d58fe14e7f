//! How far enhanced images and read characters can be trusted: makes the calibration of intervals
//! and readings, and judges both on images that the calibration has not used.
//!
//! The groups outside the training data (font families, writers, photographs) are halved: the
//! calibration uses one half, the judging the other.
//!
//! # Invariant
//! No group is in both halves (`tests::no_group_is_in_both_halves_and_none_is_lost`).

mod charts;
mod coverage;
mod learn;
mod letters;

pub use coverage::Covered;
pub use learn::calibrate;
pub use letters::Letters;

use crate::error::{EvalError, Result};
use crate::quality::{Characters, Condition, Origin};
use image::RgbImage;
use nirspi_nets::data::Stack;
use nirspi_nets::interval::{Intervals, NETWORKS};
use nirspi_nets::{Device, Enhanced, Enhancer, HELD_OUT, Images, Method, Networks, Options};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Mcg;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Number of pixels of an enhanced image.
const AREA: usize = nirspi_nets::deblur::SIDE * nirspi_nets::deblur::SIDE;

/// Seed of the halves. The halves belong to the shipped calibration and do not follow the seed of
/// the images.
const HALVES_SEED: u64 = 1;

/// One half of the groups that training has not seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Half {
    /// For the calibration.
    Calibration,
    /// For the judging.
    Judging,
}

/// Settings of calibration and judging.
#[derive(Debug, Clone)]
pub struct Settings {
    /// The images. Stacks that are no characters have no labels.
    pub stacks: Vec<Stack>,
    /// Folder of other weights, `<network>.safetensors`.
    pub weights: Option<PathBuf>,
    /// The most images of each stack.
    pub count: usize,
    /// Seed of the choice of images, of their blur and of the noise.
    pub seed: u64,
}

impl Settings {
    /// The chosen networks.
    fn networks(&self) -> Networks {
        let networks = Networks::built_in(Device::cpu());
        match &self.weights {
            Some(folder) => networks.with_folder(folder),
            None => networks,
        }
    }

    /// The groups of each stack in one half.
    fn groups(&self, half: Half) -> Result<BTreeMap<String, Vec<u32>>> {
        let mut held_out = crate::quality::groups(HELD_OUT)?;
        let found = self.stacks.iter().map(|stack| {
            // Training has not seen a stack that is not named.
            let all = || stack.groups().iter().copied().collect::<std::collections::BTreeSet<_>>();
            let groups =
                held_out.remove(stack.name()).unwrap_or_else(|| all().into_iter().collect());
            (stack.name().to_owned(), halved(groups, half))
        });
        Ok(found.collect())
    }

    /// The images of one half.
    fn images(&self, half: Half) -> Result<Characters> {
        let images = Characters::of(&self.stacks, &self.groups(half)?, self.count, self.seed);
        match images.is_empty() {
            true => Err(EvalError::Content("no image that training has not seen".to_owned())),
            false => Ok(images),
        }
    }
}

/// One half of the groups. Of an odd number, the judging gets one more.
fn halved(mut groups: Vec<u32>, half: Half) -> Vec<u32> {
    groups.sort_unstable();
    groups.dedup();
    groups.shuffle(&mut Pcg64Mcg::seed_from_u64(HALVES_SEED));
    let judging = groups.split_off(groups.len() / 2);
    match half {
        Half::Calibration => groups,
        Half::Judging => judging,
    }
}

/// The networks that are calibrated.
fn enhancer(networks: &mut Networks) -> Result<Enhancer> {
    Ok(networks.enhancer(Method::default())?)
}

/// Fingerprint of each network that decides about the intervals and readings.
fn fingerprints(networks: &mut Networks) -> Result<BTreeMap<String, String>> {
    let all = NETWORKS.into_iter().chain(["classifier"]);
    all.map(|network| Ok((network.to_owned(), networks.weights(network)?.fingerprint()))).collect()
}

/// Enhances the readings of images, each under its own condition, with the defaults of every
/// command.
fn enhanced(
    enhancer: &Enhancer,
    images: &Characters,
    conditions: &[Condition],
    seed: u64,
    done: &dyn Fn(usize),
) -> Result<Enhanced> {
    let each = images.iter().zip(conditions).enumerate();
    let readings: Vec<f32> = each
        .flat_map(|(k, (image, condition))| condition.read(&image.sharp, seed, k as u64))
        .collect();
    let mut told = 0;
    let mut progress = |all: usize| {
        done(all.saturating_sub(told));
        told = all.max(told);
    };
    Ok(enhancer.enhance(Images::new(&readings)?, None, &Options::default(), &mut progress)?)
}

/// The conditions of the judging: the targets first, at blur 1 to 3 px and noise 3 %.
const CONDITIONS: [Condition; 9] = [
    Condition { sigma_px: 1.0, noise: 0.03 },
    Condition { sigma_px: 2.0, noise: 0.03 },
    Condition { sigma_px: 3.0, noise: 0.03 },
    Condition { sigma_px: 0.3, noise: 0.03 },
    Condition { sigma_px: 4.0, noise: 0.03 },
    Condition { sigma_px: 2.0, noise: 0.0 },
    Condition { sigma_px: 2.0, noise: 0.01 },
    Condition { sigma_px: 2.0, noise: 0.06 },
    Condition { sigma_px: 2.0, noise: 0.1 },
];

/// Half of the share of images that may be wrong and called sure.
const HALF_OF_TARGET: f64 = 0.01;

/// The conditions for which the targets are set.
const TARGETS: usize = 3;

/// The result of the judging.
#[derive(Debug, Serialize)]
pub struct Report {
    /// Always true.
    pub simulated: bool,
    /// Seed of the choice of images and of the noise.
    pub seed: u64,
    /// The stacks of the judging half.
    pub images: Vec<Origin>,
    /// Coverage by condition and stack.
    pub coverage: Vec<Covered>,
    /// Readings of characters by condition and stack.
    pub letters: Vec<Letters>,
}

/// The report, and its pictures by file name.
pub struct Judged {
    /// The report.
    pub report: Report,
    /// The coverage curve, and cases with failures among them.
    pub pictures: Vec<(&'static str, RgbImage)>,
}

/// Judges intervals and readings on the images that the calibration has not used. `done` is called
/// with the number of images just enhanced.
///
/// # Errors
/// `EvalError` for weights that are not those of the calibration, or files that cannot be read.
pub fn judge(settings: &Settings, intervals: &Intervals, done: &dyn Fn(usize)) -> Result<Judged> {
    let mut networks = settings.networks();
    for network in NETWORKS.into_iter().chain(["classifier"]) {
        intervals.expect(network, &networks.weights(network)?)?;
    }
    let enhancer = enhancer(&mut networks)?;
    let reader = letters::reader(&mut networks, intervals.calibration().characters)?;
    let images = settings.images(Half::Judging)?;
    let (mut coverage, mut read, mut shown) = (Vec::new(), Vec::new(), Vec::new());
    for (at, condition) in CONDITIONS.into_iter().enumerate() {
        let conditions = vec![condition; images.len()];
        let made = enhanced(&enhancer, &images, &conditions, settings.seed, done)?;
        coverage.extend(coverage::covered(intervals, &images, &made, condition)?);
        read.extend(letters::judged(&reader, &images, &made, condition)?);
        if at == charts::SHOWN {
            shown = charts::cases(intervals, &reader, &images, &made)?;
        }
    }
    let pictures = vec![
        ("coverage.png", charts::curve(&coverage)),
        ("intervals.png", charts::picture(shown, CONDITIONS[charts::SHOWN])),
    ];
    let images = images.origins().to_vec();
    let report = Report { simulated: true, seed: settings.seed, images, coverage, letters: read };
    Ok(Judged { report, pictures })
}

/// Number of images that [`judge`] enhances.
///
/// # Errors
/// As [`judge`].
pub fn images_to_judge(settings: &Settings) -> Result<usize> {
    Ok(CONDITIONS.len() * settings.images(Half::Judging)?.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_group_is_in_both_halves_and_none_is_lost() {
        let all: Vec<u32> = (0..41).map(|k| 7 * k).collect();
        let [calibration, judging] =
            [Half::Calibration, Half::Judging].map(|half| halved(all.clone(), half));
        assert_eq!((calibration.len(), judging.len()), (20, 21));
        let mut both = [calibration.clone(), judging].concat();
        both.sort_unstable();
        assert_eq!(both, all);
        let mut turned = all;
        turned.reverse();
        assert_eq!(halved(turned, Half::Calibration), calibration, "the order does not matter");
    }
}
