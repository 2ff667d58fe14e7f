//! Reads the character in an enhanced image: the alternatives with their probabilities, or that the
//! image shows no single character, or that the character is not legible.
//!
//! The probabilities are those of the project's own classifier at a temperature (Guo et al., *On
//! calibration of modern neural networks*, ICML 2017), times the probability that the image shows a
//! single character at all ([`presence`]). Both were chosen on images that neither training nor
//! judging used. Characters whose shapes are the same at any size (`V` and `v`, `0` and `O`) are one
//! alternative: the image does not tell them apart.
//!
//! # Invariant
//! The probabilities of all alternatives add up to 1, and every character belongs to exactly one
//! alternative (`tests::every_character_belongs_to_one_alternative`). An image that its readings
//! contradict is never legible (`tests::an_image_that_its_readings_contradict_is_not_legible`).

pub mod presence;

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::consistency::is_contradicted;
use crate::data::CHARACTERS;
use crate::images::Images;
use crate::metrics::CharacterJudge;
use crate::weights::{Weights, WeightsError};

use presence::{Presence, inputs, sigmoid};

/// Alternatives with a smaller probability are not listed.
const LEAST_LISTED: f32 = 0.05;
/// The most alternatives in a list.
const MOST_LISTED: usize = 4;

/// From this probability on, a reading counts as sure.
pub const SURE: f32 = 0.9;

/// The likeliest characters are legible if their probability among the characters is at least this:
/// they are likelier than all other characters together.
const LEGIBLE: f32 = 0.5;

/// Characters that have the same shape. The first is their name.
const ALIKE: [&str; 12] =
    ["0Oo", "1Il", "Cc", "Kk", "Pp", "Ss", "Uu", "Vv", "Ww", "Xx", "Yy", "Zz"];

/// The calibration of readings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReadingScale {
    /// Divisor of the classifier's logits.
    pub temperature: f32,
    /// Whether an image shows a character.
    pub presence: Presence,
    /// The least logit of [`Presence`] with which an image counts as a character.
    pub least_presence: f32,
    /// The least logit of [`Presence`] with which a character may be sure.
    pub sure_presence: f32,
}

impl ReadingScale {
    /// Checks that the network fits the classifier's features.
    pub(crate) fn checked(&self) -> Result<(), ()> {
        let whole = self.temperature > 0.0 && self.presence.is_whole(FEATURES);
        if whole { Ok(()) } else { Err(()) }
    }
}

/// The least standard deviation of an image that shows a character; white is 1. A letter of a tenth
/// of the contrast has 0.03.
const LEAST_DEVIATION: f32 = 0.02;

/// Number of features of the shipped classifier.
const FEATURES: usize = 128;

/// The characters that look like this class, the class's own among them.
#[must_use]
pub fn same_shape(class: usize) -> String {
    let own = CHARACTERS.chars().nth(class);
    let alike = ALIKE.iter().find(|alike| own.is_some_and(|own| alike.contains(own)));
    alike.map_or_else(|| own.into_iter().collect(), |alike| (*alike).to_owned())
}

/// What the image may show: a character, or one of several with the same shape.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Alternative {
    /// The character, or all characters of this shape.
    pub characters: String,
    /// Their probability.
    pub probability: f32,
}

/// What the reader says about an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Answer {
    /// The image shows the first alternative.
    Character,
    /// The image may show a character, but which one is open, or its readings contradict it.
    NotLegible,
    /// The image shows no single character.
    NoCharacter,
}

/// What the reader sees in an image. `Display` gives `R 0.70, A 0.20`, `not legible (R 0.45)` or
/// `no character`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reading {
    /// The answer.
    pub answer: Answer,
    /// Whether the answer is a character.
    pub legible: bool,
    /// Whether the answer is a character whose probability is above [`SURE`].
    pub sure: bool,
    /// Probability that the image shows a single character.
    pub character: f32,
    /// The likeliest characters, likeliest first. Their probabilities include
    /// [`character`](Self::character).
    pub alternatives: Vec<Alternative>,
}

impl fmt::Display for Reading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let one = |a: &Alternative| format!("{} {:.2}", a.characters, a.probability);
        let all: Vec<String> = self.alternatives.iter().map(one).collect();
        let all = all.join(", ");
        match self.answer {
            Answer::Character => f.write_str(&all),
            Answer::NotLegible if all.is_empty() => f.write_str("not legible"),
            Answer::NotLegible => write!(f, "not legible ({all})"),
            Answer::NoCharacter => f.write_str("no character"),
        }
    }
}

/// The reader of characters.
#[derive(Debug)]
pub struct Reader {
    judge: CharacterJudge,
    scale: ReadingScale,
}

/// What the networks say of an image, before the rules.
#[derive(Debug, Clone, PartialEq)]
pub struct Evidence {
    /// Logits of the 62 classes.
    pub logits: Vec<f32>,
    /// The inputs of [`Presence`].
    pub inputs: Vec<f32>,
}

/// What the classifier sees in each image.
#[must_use]
pub fn evidence(judge: &CharacterJudge, images: Images<'_, 64>) -> Vec<Evidence> {
    let seen = judge.evidence(images).into_iter().zip(images.values().chunks_exact(64 * 64));
    seen.map(|((features, logits), image)| Evidence {
        inputs: inputs(&features, &logits, image),
        logits,
    })
    .collect()
}

impl Reader {
    /// The reader with these weights (model `classifier`).
    ///
    /// # Errors
    /// [`WeightsError`] if the weights belong to another network.
    pub fn new(weights: &Weights, scale: ReadingScale) -> Result<Self, WeightsError> {
        Ok(Self { judge: CharacterJudge::new(weights)?, scale })
    }

    /// Reads each image. `inconsistency` is that of the enhanced images
    /// ([`Enhanced::inconsistency`](crate::Enhanced)), one an image.
    ///
    /// # Panics
    /// If there is not one inconsistency for each image.
    #[must_use]
    pub fn read(&self, images: Images<'_, 64>, inconsistency: &[f32]) -> Vec<Reading> {
        assert_eq!(images.count(), inconsistency.len(), "one inconsistency an image");
        let seen = evidence(&self.judge, images).into_iter().zip(inconsistency);
        seen.map(|(evidence, &inconsistency)| self.scale.reading(&evidence, inconsistency))
            .collect()
    }
}

impl ReadingScale {
    /// The reading of one image.
    #[must_use]
    pub fn reading(&self, evidence: &Evidence, inconsistency: f32) -> Reading {
        let presence = self.presence.logit(&evidence.inputs);
        let all = alternatives(&evidence.logits, self.temperature);
        let legible = all.first().is_some_and(|first| first.probability >= LEGIBLE);
        let flat = evidence.inputs[FEATURES] < presence::of_deviation(LEAST_DEVIATION);
        let answer = if flat || presence < self.least_presence {
            Answer::NoCharacter
        } else if legible && !is_contradicted(inconsistency) {
            Answer::Character
        } else {
            Answer::NotLegible
        };
        let may_be_sure = answer == Answer::Character && presence >= self.sure_presence;
        // Half way at the bound: below it, no character is likelier.
        Reading::of(answer, may_be_sure, sigmoid(presence - self.least_presence), all)
    }
}

impl Reading {
    /// The likely ones among all alternatives, which are sorted. `character` is the probability that
    /// there is a character.
    fn of(
        answer: Answer,
        may_be_sure: bool,
        character: f32,
        mut alternatives: Vec<Alternative>,
    ) -> Self {
        // A character that may not be sure is not shown as if it were.
        let most = if may_be_sure { 1.0 } else { SURE };
        for alternative in &mut alternatives {
            alternative.probability = (character * alternative.probability).min(most);
        }
        let likely = alternatives.iter().take_while(|a| a.probability >= LEAST_LISTED).count();
        let least = usize::from(answer != Answer::NoCharacter);
        alternatives.truncate(likely.clamp(least, MOST_LISTED));
        let first = alternatives.first().map_or(0.0, |first| first.probability);
        let legible = answer == Answer::Character;
        Self { answer, legible, sure: may_be_sure && first > SURE, character, alternatives }
    }
}

/// Every alternative of the classifier's logits, likeliest first.
#[must_use]
pub fn alternatives(logits: &[f32], temperature: f32) -> Vec<Alternative> {
    let mut all: Vec<Alternative> = Vec::new();
    for (class, probability) in softmax(logits, temperature).into_iter().enumerate() {
        let characters = same_shape(class);
        match all.iter_mut().find(|a| a.characters == characters) {
            Some(found) => found.probability += probability,
            None => all.push(Alternative { characters, probability }),
        }
    }
    all.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    all
}

/// Probabilities of logits at a temperature.
fn softmax(logits: &[f32], temperature: f32) -> Vec<f32> {
    let most = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let powers: Vec<f32> = logits.iter().map(|l| ((l - most) / temperature).exp()).collect();
    let sum: f32 = powers.iter().sum();
    powers.into_iter().map(|power| power / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reader() -> Reader {
        let scale = crate::Intervals::shipped().unwrap().calibration().characters.clone();
        Reader::new(&Weights::embedded("classifier").unwrap(), scale).unwrap()
    }

    fn read(image: &[f32], inconsistency: f32) -> Reading {
        reader().read(Images::new(image).unwrap(), &[inconsistency]).remove(0)
    }

    fn bar() -> Vec<f32> {
        let lit = |at: usize| (29..35).contains(&(at % 64)) && (8..56).contains(&(at / 64));
        (0..4096).map(|at| f32::from(u8::from(lit(at)))).collect()
    }

    #[test]
    fn every_character_belongs_to_one_alternative() {
        let logits: Vec<f32> = (0..62).map(|k| (k * k % 17) as f32 / 3.0).collect();
        for temperature in [0.5, 1.0, 4.0] {
            let all = alternatives(&logits, temperature);
            let sum: f32 = all.iter().map(|a| a.probability).sum();
            assert!((sum - 1.0).abs() < 1e-5, "{sum}");
            assert!(all.is_sorted_by(|a, b| a.probability >= b.probability));
            let mut found: Vec<char> = all.iter().flat_map(|a| a.characters.chars()).collect();
            let mut expected: Vec<char> = CHARACTERS.chars().collect();
            found.sort_unstable();
            expected.sort_unstable();
            assert_eq!(found, expected);
        }
        let most = |temperature| alternatives(&logits, temperature)[0].probability;
        assert!(most(0.5) > most(1.0) && most(1.0) > most(4.0));
    }

    #[test]
    fn a_reading_lists_likely_characters_and_says_if_there_is_none() {
        let of = |answer, sure, likely: &[(&str, f32)]| {
            let one = |&(characters, probability): &(&str, f32)| Alternative {
                characters: characters.to_owned(),
                probability,
            };
            Reading::of(answer, sure, 1.0, likely.iter().map(one).collect())
        };
        let (character, unclear) = (Answer::Character, Answer::NotLegible);
        let clear = of(character, true, &[("R", 0.7), ("A", 0.2), ("B", 0.04)]);
        assert_eq!((clear.to_string().as_str(), clear.legible), ("R 0.70, A 0.20", true));
        assert!(!clear.sure && of(character, true, &[("R", 0.97)]).sure);
        let capped = of(character, false, &[("R", 0.97)]);
        assert_eq!((capped.to_string().as_str(), capped.sure), ("R 0.90", false));
        let unclear = of(unclear, false, &[("R", 0.49), ("A", 0.4)]);
        assert_eq!(
            (unclear.to_string().as_str(), unclear.legible),
            ("not legible (R 0.49, A 0.40)", false)
        );
        let none = of(Answer::NoCharacter, false, &[("R", 0.03)]);
        assert_eq!((none.to_string().as_str(), none.legible), ("no character", false));
        assert!(none.alternatives.is_empty());
    }

    #[test]
    fn a_bar_is_read_as_a_bar() {
        let found = read(&bar(), 1.0);
        assert_eq!(found.alternatives[0].characters, "1Il", "{found}");
        assert!(found.legible, "{found}");
    }

    #[test]
    fn an_image_that_its_readings_contradict_is_not_legible() {
        for inconsistency in [1.3, f32::NAN] {
            let found = read(&bar(), inconsistency);
            assert_eq!(
                (found.answer, found.legible, found.sure),
                (Answer::NotLegible, false, false)
            );
        }
    }

    #[test]
    fn a_sheet_is_no_character() {
        for image in [vec![0.0; 4096], vec![0.3; 4096], vec![1.0; 4096]] {
            let found = read(&image, 1.0);
            assert!(!found.legible && !found.sure, "{found}");
        }
        assert_eq!(read(&[0.9; 4096], 1.0).answer, Answer::NoCharacter);
    }
}
