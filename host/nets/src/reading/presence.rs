//! Whether an image shows a single character: a small network on what the classifier sees, and on a
//! few numbers about the image.
//!
//! The classifier knows 62 characters and shares its certainty among them, whatever it is shown. This
//! network has seen what is no character: sheets, noise, strokes, words, scenes, other alphabets.
//!
//! # Invariant
//! Training follows from its seed alone (`tests::training_separates_two_kinds_and_follows_its_seed`).

use serde::{Deserialize, Serialize};

use crate::grid::{AREA, FINE as SIDE};
use crate::random::Noise;
use crate::rounding::rounded;

/// Number of hidden units.
const HIDDEN: usize = 24;
/// Numbers about the image besides the classifier's features.
const NUMBERS: usize = 10;
/// Inputs are limited to so many standard deviations.
const FARTHEST: f32 = 5.0;
/// Passes over the examples, examples a step, rate and decay of AdamW.
const EPOCHS: usize = 60;
const BATCH: usize = 32;
const RATE: f32 = 2e-3;
const DECAY: f32 = 0.02;
/// Standard deviation of noise added to inputs in training, so that single examples are not learnt by
/// heart.
const JITTER: f32 = 0.25;

/// The network, in the file of the calibration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Presence {
    /// Mean of each input.
    mean: Vec<f32>,
    /// Standard deviation of each input.
    deviation: Vec<f32>,
    /// Weights of the hidden units, (24, inputs), row-major.
    hidden: Vec<f32>,
    /// Biases of the hidden units, then weights of the output, then its bias.
    output: Vec<f32>,
}

/// An example: the inputs, and whether the image shows a character.
#[derive(Debug, Clone)]
pub struct Example {
    /// From [`inputs`].
    pub inputs: Vec<f32>,
    /// Whether it is a character.
    pub character: bool,
    /// Its weight.
    pub weight: f32,
}

/// The inputs of the network for an image of 64 x 64: the classifier's features and logits, and
/// numbers about the image.
#[must_use]
pub fn inputs(features: &[f32], logits: &[f32], image: &[f32]) -> Vec<f32> {
    let mut all = features.to_vec();
    all.extend(numbers(logits, image));
    all
}

/// The first number about an image: its standard deviation, on the scale of the network.
pub(super) fn of_deviation(deviation: f32) -> f32 {
    (deviation + 0.01).ln()
}

fn numbers(logits: &[f32], image: &[f32]) -> [f32; NUMBERS] {
    let mean = |values: &mut dyn Iterator<Item = f32>| {
        let (sum, count) = values.fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
        sum / (count.max(1)) as f32
    };
    let level = mean(&mut image.iter().copied());
    let deviation = mean(&mut image.iter().map(|value| (value - level).powi(2))).sqrt();
    let rim = || {
        let outer = |at: usize| !(5..SIDE - 5).contains(&at);
        image.iter().enumerate().filter(move |(at, _)| outer(at / SIDE) || outer(at % SIDE))
    };
    let rim_level = mean(&mut rim().map(|(_, &value)| value));
    let rim_deviation = mean(&mut rim().map(|(_, &value)| (value - rim_level).powi(2))).sqrt();
    let most = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let energy = most + logits.iter().map(|logit| (logit - most).exp()).sum::<f32>().ln();
    let second = logits.iter().copied().filter(|&l| l < most).fold(f32::NEG_INFINITY, f32::max);
    let steps = mean(&mut (0..AREA - SIDE).map(|at| (image[at + SIDE] - image[at]).abs()));
    let (ink, pieces) = ink(image, rim_level);
    [
        of_deviation(deviation),
        level,
        (rim_deviation + 0.01).ln(),
        rim_level,
        energy,
        if second.is_finite() { most - second } else { 0.0 },
        (steps + 0.002).ln() - (deviation + 0.01).ln(),
        ink,
        pieces.min(12) as f32,
        (mean(&mut image.iter().map(|v| 4.0 * v * (1.0 - v))) + 0.02).ln(),
    ]
}

/// The share of the pixels that are unlike the rim by more than half of the largest difference, and
/// the number of pieces that they form.
fn ink(image: &[f32], rim_level: f32) -> (f32, usize) {
    let largest = image.iter().map(|value| (value - rim_level).abs()).fold(0.0, f32::max);
    let is_ink = |at: usize| (image[at] - rim_level).abs() > 0.5 * largest.max(0.02);
    let mut seen = vec![false; AREA];
    let (mut count, mut pieces) = (0, 0);
    for start in 0..AREA {
        if seen[start] || !is_ink(start) {
            continue;
        }
        let (mut open, mut size) = (vec![start], 0);
        seen[start] = true;
        while let Some(at) = open.pop() {
            size += 1;
            let (row, column) = (at / SIDE, at % SIDE);
            let beside = [
                (row > 0).then(|| at - SIDE),
                (row + 1 < SIDE).then_some(at + SIDE),
                (column > 0).then(|| at - 1),
                (column + 1 < SIDE).then_some(at + 1),
            ];
            for next in beside.into_iter().flatten() {
                if !seen[next] && is_ink(next) {
                    seen[next] = true;
                    open.push(next);
                }
            }
        }
        count += size;
        pieces += usize::from(size >= 6);
    }
    (count as f32 / AREA as f32, pieces)
}

impl Presence {
    /// Trains the network. `None` without examples of both kinds.
    #[must_use]
    pub fn learn(examples: &[Example], seed: u64) -> Option<Self> {
        let count = examples.first()?.inputs.len();
        let of = |character: bool| examples.iter().any(|example| example.character == character);
        if !of(true) || !of(false) {
            return None;
        }
        let all = examples.len() as f32;
        let mean: Vec<f32> =
            (0..count).map(|k| examples.iter().map(|e| e.inputs[k]).sum::<f32>() / all).collect();
        let deviation: Vec<f32> = (0..count)
            .map(|k| {
                let square = |e: &Example| (e.inputs[k] - mean[k]).powi(2);
                (examples.iter().map(square).sum::<f32>() / all).sqrt().max(1e-3)
            })
            .collect();
        let mut noise = Noise::of(seed, 0);
        let spread = (1.0 / count as f32).sqrt();
        let mut network = Self {
            mean,
            deviation,
            hidden: (0..HIDDEN * count).map(|_| spread * noise.draw()).collect(),
            output: (0..2 * HIDDEN + 1)
                .map(|k| if k < HIDDEN || k == 2 * HIDDEN { 0.0 } else { 0.2 * noise.draw() })
                .collect(),
        };
        let inputs: Vec<Vec<f32>> =
            examples.iter().map(|example| network.normalised(&example.inputs)).collect();
        network.descend(examples, &inputs, &mut noise);
        for list in
            [&mut network.mean, &mut network.deviation, &mut network.hidden, &mut network.output]
        {
            list.iter_mut().for_each(|value| *value = rounded(*value));
        }
        Some(network)
    }

    /// AdamW with a rate that falls along a cosine.
    fn descend(&mut self, examples: &[Example], inputs: &[Vec<f32>], noise: &mut Noise) {
        let count = self.mean.len();
        let size = self.hidden.len() + self.output.len();
        let (mut first, mut second) = (vec![0.0_f32; size], vec![0.0_f32; size]);
        let steps = EPOCHS * examples.len().div_ceil(BATCH);
        for step in 0..steps {
            let mut gradient = vec![0.0_f32; size];
            for _ in 0..BATCH {
                let at = (noise.uniform() * examples.len() as f32) as usize;
                let at = at.min(examples.len() - 1);
                let seen: Vec<f32> =
                    inputs[at].iter().map(|value| value + JITTER * noise.draw()).collect();
                let (hidden, logit) = self.forward(&seen);
                let target = f32::from(u8::from(examples[at].character));
                let slope = examples[at].weight * (sigmoid(logit) - target) / BATCH as f32;
                let (of_hidden, of_output) = gradient.split_at_mut(self.hidden.len());
                for (unit, &value) in hidden.iter().enumerate() {
                    let back = slope * self.output[HIDDEN + unit] * (1.0 - value * value);
                    of_output[unit] += back;
                    of_output[HIDDEN + unit] += slope * value;
                    for (g, s) in of_hidden[unit * count..][..count].iter_mut().zip(&seen) {
                        *g += back * s;
                    }
                }
                of_output[2 * HIDDEN] += slope;
            }
            let along = step as f32 / steps as f32;
            let rate = RATE * 0.5 * (1.0 + (std::f32::consts::PI * along).cos());
            let time = (step + 1) as i32;
            let weights = self.hidden.iter_mut().chain(&mut self.output);
            let moments = first.iter_mut().zip(&mut second);
            for ((weight, (m, v)), g) in weights.zip(moments).zip(gradient) {
                *m = 0.9 * *m + 0.1 * g;
                *v = 0.999 * *v + 0.001 * g * g;
                let (m, v) = (*m / (1.0 - 0.9_f32.powi(time)), *v / (1.0 - 0.999_f32.powi(time)));
                *weight -= rate * (m / (v.sqrt() + 1e-8) + DECAY * *weight);
            }
        }
    }

    fn normalised(&self, inputs: &[f32]) -> Vec<f32> {
        let scale = self.mean.iter().zip(&self.deviation);
        let each = inputs.iter().zip(scale);
        each.map(|(value, (mean, deviation))| {
            ((value - mean) / deviation).clamp(-FARTHEST, FARTHEST)
        })
        .collect()
    }

    /// Hidden units and the output for normalised inputs.
    fn forward(&self, inputs: &[f32]) -> (Vec<f32>, f32) {
        let hidden: Vec<f32> = self
            .hidden
            .chunks_exact(self.mean.len())
            .zip(&self.output)
            .map(|(row, bias)| {
                let sum: f32 = row.iter().zip(inputs).map(|(a, b)| a * b).sum();
                (sum + bias).tanh()
            })
            .collect();
        let weights = &self.output[HIDDEN..2 * HIDDEN];
        let sum: f32 = hidden.iter().zip(weights).map(|(a, b)| a * b).sum();
        let logit = sum + self.output[2 * HIDDEN];
        (hidden, logit)
    }

    /// How likely the image is a character, as a logit: above 0 it is likelier than not.
    #[must_use]
    pub fn logit(&self, inputs: &[f32]) -> f32 {
        self.forward(&self.normalised(inputs)).1
    }

    /// Whether lookups cannot fail, for this number of features of the classifier.
    pub(super) fn is_whole(&self, features: usize) -> bool {
        let inputs = features + NUMBERS;
        self.mean.len() == inputs
            && self.deviation.len() == inputs
            && self.hidden.len() == HIDDEN * inputs
            && self.output.len() == 2 * HIDDEN + 1
    }
}

/// The logistic function.
pub(super) fn sigmoid(value: f32) -> f32 {
    1.0 / (1.0 + (-value).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two kinds of inputs that no straight line separates: inside and outside of a ring.
    fn examples(seed: u64) -> Vec<Example> {
        let mut noise = Noise::of(seed, 1);
        (0..600)
            .map(|_| {
                let inputs = vec![noise.draw(), noise.draw()];
                let character = inputs[0].hypot(inputs[1]) < 1.1;
                Example { inputs, character, weight: 1.0 }
            })
            .collect()
    }

    #[test]
    fn training_separates_two_kinds_and_follows_its_seed() {
        let learnt = Presence::learn(&examples(1), 3).unwrap();
        let right = |example: &Example| (learnt.logit(&example.inputs) > 0.0) == example.character;
        let others = examples(2);
        let share = others.iter().filter(|e| right(e)).count() as f32 / others.len() as f32;
        assert!(share > 0.85, "{share}");
        assert_eq!(Presence::learn(&examples(1), 3).unwrap(), learnt);
        assert_ne!(Presence::learn(&examples(1), 4).unwrap(), learnt);
        let one_kind: Vec<Example> = examples(1).into_iter().filter(|e| e.character).collect();
        assert_eq!(Presence::learn(&one_kind, 3), None);
    }

    #[test]
    fn ink_is_counted_in_pieces_bright_on_dark_and_dark_on_bright() {
        let bars =
            |at: usize| [10, 11, 30, 31].contains(&(at % SIDE)) && (10..50).contains(&(at / SIDE));
        let bright: Vec<f32> = (0..AREA).map(|at| if bars(at) { 0.8 } else { 0.1 }).collect();
        let dark: Vec<f32> = bright.iter().map(|value| 1.0 - value).collect();
        for image in [bright, dark] {
            let (share, pieces) = ink(&image, image[0]);
            assert_eq!(pieces, 2);
            assert!((share - 160.0 / AREA as f32).abs() < 1e-6);
        }
        assert_eq!(ink(&vec![0.5; AREA], 0.5), (0.0, 0));
    }
}
