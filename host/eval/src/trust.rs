//! How far enhanced images and read characters can be trusted: makes the calibration of intervals
//! and readings, and judges both on images that the calibration has not used.
//!
//! The groups outside the training data (font families, writers, photographs, natural scenes) are
//! halved: the calibration uses one half, the judging the other. The virtual camera measures the
//! scenes, every method of reconstruction makes images of the readings, and the networks enhance
//! them, as the commands do.
//!
//! # Invariant
//! No group is in both halves (`tests::no_group_is_in_both_halves_and_none_is_lost`). Natural scenes
//! that the learned method of reconstruction has seen in its training neither calibrate nor judge it.

mod charts;
mod coverage;
mod learn;
mod letters;
mod others;
mod shots;

pub use coverage::Covered;
pub use learn::calibrate;
pub use letters::Letters;

use crate::error::{EvalError, Result};
use crate::quality::{Characters, Origin};
use nirspi::picture::Figure;
use nirspi_nets::data::Stack;
use nirspi_nets::interval::{Intervals, NETWORKS};
use nirspi_nets::metrics::CharacterJudge;
use nirspi_nets::{Device, Enhancer, HELD_OUT, Method, Networks};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Mcg;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Number of pixels of an enhanced image.
const AREA: usize = nirspi_nets::deblur::SIDE * nirspi_nets::deblur::SIDE;

/// The stack of natural scenes, by its name in the list of held-out groups.
pub const NATURAL: &str = "natural";
/// The list of natural scenes that the learned method of reconstruction has not seen.
const NATURAL_OF_PRIOR: &str = "natural_of_prior";

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
    /// The most images of each stack of characters. Of natural scenes all are taken.
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

    /// The natural scenes that the learned method of reconstruction has not seen.
    fn unseen_by_prior(&self) -> Result<Vec<u32>> {
        Ok(crate::quality::groups(HELD_OUT)?.remove(NATURAL_OF_PRIOR).unwrap_or_default())
    }

    /// Characters of groups that training has seen, `count` of each stack.
    fn training_images(&self, count: usize) -> Result<Characters> {
        let held_out = crate::quality::groups(HELD_OUT)?;
        let of = |stack: &Stack| {
            let hidden = held_out.get(stack.name()).map_or(&[][..], Vec::as_slice);
            let seen = stack.groups().iter().copied().filter(|group| !hidden.contains(group));
            let labelled = stack.label(0).is_some() && held_out.contains_key(stack.name());
            (stack.name().to_owned(), if labelled { seen.collect() } else { Vec::new() })
        };
        let groups = self.stacks.iter().map(of).collect();
        let images = Characters::of(&self.stacks, &groups, count, self.seed);
        match images.is_empty() {
            true => Err(EvalError::Content("no characters of training".to_owned())),
            false => Ok(images),
        }
    }

    /// The images of one half.
    fn images(&self, half: Half) -> Result<Characters> {
        // Natural scenes are the harder half of what a camera sees: all that there are.
        let count = |stack: &str| if stack == NATURAL { usize::MAX } else { self.count };
        let images = Characters::of_each(&self.stacks, &self.groups(half)?, &count, self.seed);
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
    let all = NETWORKS.into_iter().chain(["prior", "classifier"]);
    all.map(|network| Ok((network.to_owned(), networks.weights(network)?.fingerprint()))).collect()
}

/// Half of the share of images that may be wrong and called sure.
const HALF_OF_TARGET: f64 = 0.01;

/// The result of the judging.
#[derive(Debug, Serialize)]
pub struct Report {
    /// Always true.
    pub simulated: bool,
    /// Seed of the choice of images and of the noise.
    pub seed: u64,
    /// The stacks of the judging half.
    pub images: Vec<Origin>,
    /// Coverage by method, kind of image and condition.
    pub coverage: Vec<Covered>,
    /// Readings by kind of image.
    pub letters: Vec<Letters>,
}

/// The report, and its figures by name.
pub struct Judged {
    /// The report.
    pub report: Report,
    /// The coverage curve, and cases with failures among them.
    pub pictures: Vec<(&'static str, Figure)>,
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
    let studio = shots::Studio::new(enhancer(&mut networks)?, settings.seed)?;
    let images = settings.images(Half::Judging)?;
    let mut rng = Pcg64Mcg::seed_from_u64(settings.seed.wrapping_add(JUDGING_SEED));
    let shots = learn::taken(settings, &studio, &images, &mut rng, done)?;
    let ones = coverage::each(intervals, &studio, &images, &shots)?;
    let coverage = coverage::covered(&studio, &ones);
    let judge = CharacterJudge::new(&networks.weights("classifier")?)?;
    let cases = letters::cases(settings, Half::Judging, &judge, &studio, &images, &shots, done)?;
    let read = letters::judged(&intervals.calibration().characters, &cases);
    let shown = charts::cases(intervals, &studio, &shots)?;
    let pictures =
        vec![("coverage", charts::curve(&coverage)), ("intervals", charts::picture(shown))];
    let images = images.origins().to_vec();
    let report = Report { simulated: true, seed: settings.seed, images, coverage, letters: read };
    Ok(Judged { report, pictures })
}

/// Added to the seed for the conditions of the judging.
const JUDGING_SEED: u64 = 1000;

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
