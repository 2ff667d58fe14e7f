//! Readings of characters: the temperature, what counts as a character, and how often something that
//! is no character is called sure.

use super::others::{Other, others};
use super::shots::{At, Condition, Shot, Studio};
use super::{HALF_OF_TARGET, Half, Settings};
use crate::error::{EvalError, Result};
use crate::quality::Characters;
use nirspi_nets::metrics::CharacterJudge;
use nirspi_nets::reading::presence::{Example, Presence};
use nirspi_nets::reading::{
    Alternative, Answer, Evidence, ReadingScale, SURE, alternatives, evidence, same_shape,
};
use nirspi_nets::{Images, Networks};
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::Serialize;

/// The temperatures that are tried, smallest first.
fn temperatures() -> impl Iterator<Item = f32> {
    (10..=80).map(|k| k as f32 / 20.0)
}

/// The most noise of the readings of these shots: beyond what has intervals, because the networks
/// draw strokes of noise.
const MOST_NOISE: f32 = 0.5;
/// Shots that are taken together, under one condition.
const TOGETHER: usize = 6;
/// Every so many examples of what is no character, one is kept back from the training of
/// [`Presence`], to choose its bounds.
const KEPT_BACK: usize = 3;
/// Characters of each stack from which [`Presence`] learns. They are of groups that training has seen;
/// its bounds are chosen on groups that training has not seen.
const LEARNT: usize = 160;
/// The share of the legible characters of each stack that may be lost to the rule.
const LOST: f64 = 0.008;
/// Added to the bound of what is sure, because other scenes are unlike those of the calibration.
const MARGIN: f32 = 0.5;

/// An enhanced image to be read.
pub(super) struct Case {
    /// A stack's name, or the kind of what is no character.
    pub kind: String,
    pub label: Option<u8>,
    pub evidence: Evidence,
    pub inconsistency: f32,
}

/// The readings of one kind of images.
#[derive(Debug, Clone, Serialize)]
pub struct Letters {
    /// The stack, or the kind of what is no character.
    pub kind: String,
    /// Number of images.
    pub images: usize,
    /// Share of the images whose likeliest alternative is right; `null` for images that are no
    /// characters, where every alternative is wrong.
    pub right: Option<f64>,
    /// Share of the images that are legible.
    pub legible: f64,
    /// Share of the images that were legible without the answer `no character`.
    pub legible_before: f64,
    /// Share of the images that are called sure.
    pub sure: f64,
    /// Share of the images that were called sure without the answer `no character`.
    pub sure_before: f64,
    /// Share of the images that are called sure and are wrong.
    pub wrong_and_sure: f64,
    /// Share of the images with the answer `no character`.
    pub no_character: f64,
    /// Share of the legible images whose likeliest alternative is right.
    pub right_if_legible: Option<f64>,
}

/// Whether a list of alternatives is wrong: its first does not have the class.
fn wrong(alternatives: &[Alternative], label: Option<u8>) -> bool {
    let first = alternatives.first().map(|a| a.characters.as_str());
    label.is_none_or(|label| first != Some(same_shape(label.into()).as_str()))
}

/// The most likely alternative's probability without the question whether there is a character.
fn likeliest(case: &Case, temperature: f32) -> (Vec<Alternative>, f32) {
    let found = alternatives(&case.evidence.logits, temperature);
    let most = found.first().map_or(0.0, |first| first.probability);
    (found, most)
}

/// Cases of one half: the images by the shots that were taken, more characters, and what is no
/// character.
pub(super) fn cases(
    settings: &Settings,
    half: Half,
    judge: &CharacterJudge,
    studio: &Studio,
    images: &Characters,
    shots: &[(At, Shot)],
    done: &dyn Fn(usize),
) -> Result<Vec<Case>> {
    let mut cases = Vec::new();
    let labelled: Vec<_> = images.iter().collect();
    for ((stack, number), shot) in shots {
        let kind = images.origins()[*stack].stack.clone();
        cases.push(case(judge, kind, labelled[*number].label, shot)?);
    }
    let seed = settings.seed ^ if half == Half::Judging { 0x5eed } else { 0 };
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut scenes: Vec<(String, Option<u8>, Vec<f32>)> = others(half, settings.count, seed)
        .into_iter()
        .map(|Other { kind, sharp }| (kind.to_owned(), None, sharp))
        .collect();
    // Letters of other alphabets are what is most like a character.
    let again: Vec<_> = scenes.iter().filter(|(kind, ..)| kind == "alphabets").cloned().collect();
    scenes.extend(again);
    match half {
        Half::Calibration => {
            let learnt = settings.training_images(LEARNT)?;
            scenes.extend(learnt.iter().map(|image| {
                (LEARNT_FROM[image.stack % 3].to_owned(), image.label, image.sharp.clone())
            }));
        }
        Half::Judging => {
            let characters: Vec<_> =
                labelled.iter().filter(|image| image.label.is_some()).collect();
            for _ in 0..scenes.len() / 2 {
                if let Some(image) = characters.choose(&mut rng) {
                    let kind = images.origins()[image.stack].stack.clone();
                    scenes.push((kind, image.label, image.sharp.clone()));
                }
            }
        }
    }
    let methods: Vec<usize> = (0..studio.methods.len()).collect();
    for together in scenes.chunks(TOGETHER) {
        let mut condition = Condition::drawn(&mut rng, MOST_NOISE);
        // Sheets and letters as they come are the usual case.
        if rng.random::<f32>() < 0.7 {
            condition.contrast = 1.0;
        }
        let chosen: Vec<[usize; 1]> =
            together.iter().map(|_| [methods.choose(&mut rng).copied().unwrap_or(0)]).collect();
        let jobs: Vec<(&[f32], &[usize])> =
            together.iter().zip(&chosen).map(|((.., sharp), m)| (&sharp[..], &m[..])).collect();
        let made = studio.shoot(&jobs, condition, &mut rng)?;
        done(made.len());
        for ((kind, label, _), shot) in together.iter().zip(&made) {
            cases.push(case(judge, kind.clone(), *label, shot)?);
        }
    }
    Ok(cases)
}

fn case(judge: &CharacterJudge, kind: String, label: Option<u8>, shot: &Shot) -> Result<Case> {
    let seen = evidence(judge, Images::new(&shot.made.images)?);
    let evidence = seen.into_iter().next();
    let evidence = evidence.ok_or_else(|| EvalError::Content("no image to read".to_owned()))?;
    let inconsistency = shot.made.inconsistency.first().copied().unwrap_or(f32::NAN);
    Ok(Case { kind, label, evidence, inconsistency })
}

/// The calibration of the reader, from the calibration half.
pub(super) fn calibrated(
    settings: &Settings,
    networks: &mut Networks,
    studio: &Studio,
    images: &Characters,
    shots: &[(At, Shot)],
    done: &dyn Fn(usize),
) -> Result<ReadingScale> {
    let judge = CharacterJudge::new(&networks.weights("classifier")?)?;
    let cases = cases(settings, Half::Calibration, &judge, studio, images, shots, done)?;
    let unseen = |case: &&Case| !LEARNT_FROM.contains(&case.kind.as_str());
    let temperature = temperature(&cases.iter().filter(unseen).collect::<Vec<_>>());
    // A character that nobody can read says nothing about characters.
    let usable = |case: &&Case| {
        case.label.is_none() || {
            let (found, most) = likeliest(case, temperature);
            most >= 0.5 && !wrong(&found, case.label)
        }
    };
    let cases: Vec<&Case> = cases.iter().filter(usable).collect();
    let learnt_from = |case: &Case| LEARNT_FROM.contains(&case.kind.as_str());
    let count = |kind: &str| cases.iter().filter(|case| case.kind == kind).count() as f32;
    let (mut learn, mut kept) = (Vec::new(), Vec::new());
    for (number, case) in cases.iter().enumerate() {
        let character = case.label.is_some();
        let learnt = if character { learnt_from(case) } else { number % KEPT_BACK != 0 };
        if learnt {
            let weight = 1.0 / count(&case.kind) / if character { 3.0 } else { 5.0 };
            learn.push(Example { inputs: case.evidence.inputs.clone(), character, weight });
        } else {
            kept.push(*case);
        }
    }
    let mean = learn.iter().map(|example| example.weight).sum::<f32>() / learn.len().max(1) as f32;
    learn.iter_mut().for_each(|example| example.weight /= mean);
    let presence = Presence::learn(&learn, settings.seed).ok_or_else(|| {
        EvalError::Content("no characters, or nothing else, to learn the reader from".to_owned())
    })?;
    // The bound of each stack of characters that lets all but a few of them through.
    let mut least_presence = f32::INFINITY;
    for origin in images.origins() {
        let of_stack = kept.iter().filter(|case| case.label.is_some() && case.kind == origin.stack);
        let mut logits: Vec<f32> =
            of_stack.map(|case| presence.logit(&case.evidence.inputs)).collect();
        logits.sort_unstable_by(f32::total_cmp);
        if let Some(&logit) = logits.get((LOST * logits.len() as f64) as usize) {
            least_presence = least_presence.min(logit);
        }
    }
    // Above this bound none of what is no character is sure.
    let sure_presence = kept
        .iter()
        .filter(|case| case.label.is_none() && likeliest(case, temperature).1 > SURE)
        .map(|case| presence.logit(&case.evidence.inputs) + MARGIN)
        .fold(least_presence, f32::max);
    Ok(ReadingScale { temperature, presence, least_presence, sure_presence })
}

/// The kinds of the characters from which [`Presence`] learns.
const LEARNT_FROM: [&str; 3] = ["learnt fonts", "learnt handwriting", "learnt photographs"];

/// The temperature of the largest likelihood, or the next above at which in no stack more than
/// half of the target's share of the images is wrong and called sure.
fn temperature(cases: &[&Case]) -> f32 {
    let mut kinds: Vec<&str> =
        cases.iter().filter(|case| case.label.is_some()).map(|case| case.kind.as_str()).collect();
    kinds.sort_unstable();
    kinds.dedup();
    let mut best = (f64::NEG_INFINITY, f32::NAN);
    let mut safe = Vec::new();
    for temperature in temperatures() {
        let (mut likelihood, mut bad, mut all) =
            (0.0, vec![0_usize; kinds.len()], vec![0_usize; kinds.len()]);
        for case in cases {
            let Some(label) = case.label else { continue };
            let (found, most) = likeliest(case, temperature);
            let own = same_shape(label.into());
            let of_truth =
                found.iter().find(|a| a.characters == own).map_or(0.0, |a| a.probability);
            likelihood += f64::from(of_truth.max(1e-6)).ln();
            let kind = kinds.iter().position(|kind| *kind == case.kind).unwrap_or(0);
            all[kind] += 1;
            bad[kind] += usize::from(most > SURE && wrong(&found, case.label));
        }
        if likelihood > best.0 {
            best = (likelihood, temperature);
        }
        let within = |(bad, all): (&usize, &usize)| *bad as f64 <= HALF_OF_TARGET * *all as f64;
        if bad.iter().zip(&all).all(within) {
            safe.push(temperature);
        }
    }
    let above = safe.into_iter().find(|&temperature| temperature >= best.1);
    // The last temperature calls nothing sure.
    above.or(temperatures().last()).unwrap_or(1.0)
}

/// How well each kind is read.
pub(super) fn judged(scale: &ReadingScale, cases: &[Case]) -> Vec<Letters> {
    let mut kinds: Vec<&str> = cases.iter().map(|case| case.kind.as_str()).collect();
    kinds.sort_unstable();
    kinds.dedup();
    let of_kind = |kind: &str| {
        let taken: Vec<(&Case, _)> = cases
            .iter()
            .filter(|case| case.kind == kind)
            .map(|case| (case, scale.reading(&case.evidence, case.inconsistency)))
            .collect();
        let share = |of: &dyn Fn(&Case, &nirspi_nets::reading::Reading) -> bool| {
            let found = taken.iter().filter(|(case, reading)| of(case, reading)).count();
            found as f64 / taken.len().max(1) as f64
        };
        let before = |case: &Case| likeliest(case, scale.temperature).1;
        let right = |case: &Case| !wrong(&likeliest(case, scale.temperature).0, case.label);
        let legible = share(&|_, reading| reading.legible);
        let both = share(&|case, reading| reading.legible && right(case));
        let labelled = taken.iter().any(|(case, _)| case.label.is_some());
        Letters {
            kind: kind.to_owned(),
            images: taken.len(),
            right: labelled.then(|| share(&|case, _| right(case))),
            legible,
            legible_before: share(&|case, _| before(case) >= 0.5),
            sure: share(&|_, reading| reading.sure),
            sure_before: share(&|case, _| before(case) > SURE),
            wrong_and_sure: share(&|case, reading| reading.sure && !right(case)),
            no_character: share(&|_, reading| reading.answer == Answer::NoCharacter),
            right_if_legible: (labelled && legible > 0.0).then(|| both / legible),
        }
    };
    kinds.into_iter().map(of_kind).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reading_is_wrong_if_its_first_has_not_the_class() {
        let of = |characters: &str| {
            [Alternative { characters: characters.to_owned(), probability: 0.95 }]
        };
        // Class 57 is `v`, class 31 is `V`.
        assert!(!wrong(&of("Vv"), Some(57)) && !wrong(&of("Vv"), Some(31)));
        assert!(wrong(&of("Vv"), Some(10)) && wrong(&of("Vv"), None) && wrong(&[], Some(57)));
    }
}
