//! Reads the character in an enhanced image: the alternatives with their probabilities, or that the
//! image is not legible.
//!
//! The probabilities are those of the project's own classifier at a temperature (Guo et al., *On
//! calibration of modern neural networks*, ICML 2017), which was chosen on images that neither
//! training nor judging used. Characters whose shapes are the same at any size (`V` and `v`, `0`
//! and `O`) are one alternative: the image does not tell them apart. The reader knows 62
//! characters: an image of something else gets one of these characters, or is not legible.
//!
//! # Invariant
//! The probabilities of all alternatives add up to 1, and every character belongs to exactly one
//! alternative (`tests::every_character_belongs_to_one_alternative`).

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::data::CHARACTERS;
use crate::images::Images;
use crate::metrics::CharacterJudge;
use crate::weights::{Weights, WeightsError};

/// Alternatives with a smaller probability are not listed.
const LEAST_LISTED: f32 = 0.05;
/// The most alternatives in a list.
const MOST_LISTED: usize = 4;

/// From this probability on, a reading counts as sure.
pub const SURE: f32 = 0.9;

/// The likeliest characters are legible if their probability is at least this: they are likelier
/// than everything else together.
const LEGIBLE: f32 = 0.5;

/// Characters that have the same shape. The first is their name.
const ALIKE: [&str; 12] =
    ["0Oo", "1Il", "Cc", "Kk", "Pp", "Ss", "Uu", "Vv", "Ww", "Xx", "Yy", "Zz"];

/// The calibration of readings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ReadingScale {
    /// Divisor of the classifier's logits.
    pub temperature: f32,
}

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

/// What the reader sees in an image. `Display` gives `R 0.70, A 0.20`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reading {
    /// Whether the likeliest character is likely enough.
    pub legible: bool,
    /// The likeliest characters, likeliest first.
    pub alternatives: Vec<Alternative>,
}

impl fmt::Display for Reading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let one = |a: &Alternative| format!("{} {:.2}", a.characters, a.probability);
        let all: Vec<String> = self.alternatives.iter().map(one).collect();
        let all = all.join(", ");
        match self.legible {
            true => f.write_str(&all),
            false => write!(f, "not legible ({all})"),
        }
    }
}

/// The reader of characters.
#[derive(Debug)]
pub struct Reader {
    judge: CharacterJudge,
    scale: ReadingScale,
}

impl Reader {
    /// The reader with these weights (model `classifier`).
    ///
    /// # Errors
    /// [`WeightsError`] if the weights belong to another network.
    pub fn new(weights: &Weights, scale: ReadingScale) -> Result<Self, WeightsError> {
        Ok(Self { judge: CharacterJudge::new(weights)?, scale })
    }

    /// Every alternative for each image, likeliest first.
    #[must_use]
    pub fn alternatives(&self, images: Images<'_, 64>) -> Vec<Vec<Alternative>> {
        let logits = self.judge.logits(images);
        logits.iter().map(|logits| alternatives(logits, self.scale.temperature)).collect()
    }

    /// Reads each image.
    #[must_use]
    pub fn read(&self, images: Images<'_, 64>) -> Vec<Reading> {
        self.alternatives(images).into_iter().map(Reading::of).collect()
    }
}

impl Reading {
    /// The likely ones among all alternatives, which are sorted.
    fn of(mut alternatives: Vec<Alternative>) -> Self {
        let legible = alternatives.first().is_some_and(|first| first.probability >= LEGIBLE);
        let likely = alternatives.iter().take_while(|a| a.probability >= LEAST_LISTED).count();
        alternatives.truncate(likely.clamp(1, MOST_LISTED));
        Self { legible, alternatives }
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
        let scale = ReadingScale { temperature: 1.0 };
        Reader::new(&Weights::embedded("classifier").unwrap(), scale).unwrap()
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
        let of = |likely: &[(&str, f32)]| {
            let one = |&(characters, probability): &(&str, f32)| Alternative {
                characters: characters.to_owned(),
                probability,
            };
            Reading::of(likely.iter().map(one).collect())
        };
        assert_eq!(of(&[("R", 0.7), ("A", 0.2), ("B", 0.04)]).to_string(), "R 0.70, A 0.20");
        let unclear = of(&[("R", 0.49), ("A", 0.4)]);
        assert!(!unclear.legible);
        assert_eq!(unclear.to_string(), "not legible (R 0.49, A 0.40)");
        assert_eq!(of(&[("Vv", 0.03), ("R", 0.02)]).to_string(), "not legible (Vv 0.03)");
    }

    #[test]
    fn a_bar_is_read_as_a_bar() {
        let lit = |at: usize| (29..35).contains(&(at % 64)) && (8..56).contains(&(at / 64));
        let bar: Vec<f32> = (0..4096).map(|at| f32::from(u8::from(lit(at)))).collect();
        let found = reader().read(Images::new(&bar).unwrap()).remove(0);
        assert_eq!(found.alternatives[0].characters, "1Il", "{found}");
        assert!(found.legible, "{found}");
    }
}
