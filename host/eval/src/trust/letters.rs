//! Readings of characters: the temperature, and how often a wrong character is called sure.

use super::HALF_OF_TARGET;
use crate::error::Result;
use crate::quality::{Characters, Condition};
use nirspi_nets::metrics::CharacterJudge;
use nirspi_nets::reading::{
    Alternative, Reader, Reading, ReadingScale, SURE, alternatives, same_shape,
};
use nirspi_nets::{Enhanced, Images, Networks};
use serde::Serialize;

/// The temperatures that are tried, smallest first.
fn temperatures() -> impl Iterator<Item = f32> {
    (10..=80).map(|k| k as f32 / 20.0)
}

/// The readings of one stack under one condition.
#[derive(Debug, Clone, Serialize)]
pub struct Letters {
    /// The degradation.
    #[serde(flatten)]
    pub condition: Condition,
    /// The stack.
    pub stack: String,
    /// Number of images.
    pub images: usize,
    /// Share of the images whose likeliest alternative is right; `null` for images that are no
    /// characters, where every alternative is wrong.
    pub right: Option<f64>,
    /// Share of the images that are called sure: more than 0.9.
    pub sure: f64,
    /// Share of the images that are called sure and are wrong.
    pub wrong_and_sure: f64,
    /// Share of the images that are called not legible.
    pub not_legible: f64,
    /// Share of the legible images whose likeliest alternative is right.
    pub right_if_legible: Option<f64>,
}

/// Whether a list of alternatives is wrong: its first does not have the class.
fn wrong(alternatives: &[Alternative], label: Option<u8>) -> bool {
    let first = alternatives.first().map(|a| a.characters.as_str());
    label.is_none_or(|label| first != Some(same_shape(label.into()).as_str()))
}

fn sure(alternatives: &[Alternative]) -> bool {
    alternatives.first().is_some_and(|a| a.probability > SURE)
}

/// The temperature of the largest likelihood, or the next above at which in no stack more than
/// half of the target's share of the images is wrong and called sure. All images are of the
/// calibration half.
pub(super) fn calibrated(
    networks: &mut Networks,
    images: &Characters,
    rounds: &[Enhanced],
) -> Result<ReadingScale> {
    let judge = CharacterJudge::new(&networks.weights("classifier")?)?;
    let mut cases: Vec<(usize, u8, Vec<f32>)> = Vec::new();
    for made in rounds {
        let logits = judge.logits(Images::new(&made.images)?);
        let labelled = images
            .iter()
            .zip(logits)
            .filter_map(|(image, logits)| Some((image.stack, image.label?, logits)));
        cases.extend(labelled);
    }
    let stacks = images.origins().len();
    let mut best = (f64::NEG_INFINITY, f32::NAN);
    let mut safe = Vec::new();
    for temperature in temperatures() {
        let (mut likelihood, mut bad, mut all) =
            (0.0, vec![0_usize; stacks], vec![0_usize; stacks]);
        for (stack, label, logits) in &cases {
            let found = alternatives(logits, temperature);
            let own = same_shape((*label).into());
            let of_truth =
                found.iter().find(|a| a.characters == own).map_or(0.0, |a| a.probability);
            likelihood += f64::from(of_truth.max(1e-6)).ln();
            all[*stack] += 1;
            bad[*stack] += usize::from(sure(&found) && wrong(&found, Some(*label)));
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
    let last = temperatures().last().unwrap_or(1.0);
    Ok(ReadingScale { temperature: above.unwrap_or(last) })
}

/// The reader of a calibration.
pub(super) fn reader(networks: &mut Networks, scale: ReadingScale) -> Result<Reader> {
    Ok(Reader::new(&networks.weights("classifier")?, scale)?)
}

/// How well each stack is read.
pub(super) fn judged(
    reader: &Reader,
    images: &Characters,
    made: &Enhanced,
    condition: Condition,
) -> Result<Vec<Letters>> {
    let read = reader.read(Images::new(&made.images)?);
    let of_stack = |(at, origin): (usize, &crate::quality::Origin)| {
        let taken: Vec<(&Reading, Option<u8>)> = images
            .iter()
            .zip(&read)
            .filter(|(image, _)| image.stack == at)
            .map(|(image, reading)| (reading, image.label))
            .collect();
        let share = |of: &dyn Fn(&Reading, Option<u8>) -> bool| {
            let found = taken.iter().filter(|(reading, label)| of(reading, *label)).count();
            found as f64 / taken.len().max(1) as f64
        };
        let right = |reading: &Reading, label| !wrong(&reading.alternatives, label);
        let legible = share(&|reading, _| reading.legible);
        let both = share(&|reading, label| reading.legible && right(reading, label));
        let labelled = taken.iter().any(|(_, label)| label.is_some());
        Letters {
            condition,
            stack: origin.stack.clone(),
            images: taken.len(),
            right: labelled.then(|| share(&right)),
            sure: share(&|reading, _| sure(&reading.alternatives)),
            wrong_and_sure: share(&|reading, label| {
                sure(&reading.alternatives) && !right(reading, label)
            }),
            not_legible: 1.0 - legible,
            right_if_legible: (labelled && legible > 0.0).then(|| both / legible),
        }
    };
    Ok(images.origins().iter().enumerate().map(of_stack).collect())
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
        assert!(sure(&of("A")) && !sure(&[]));
    }
}
