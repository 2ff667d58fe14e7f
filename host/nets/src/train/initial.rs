//! Initial weights that depend on the seed alone and are the same on every backend
//! (`train::tests::the_same_seed_gives_the_same_weights_and_another_seed_others`).
//!
//! A tensor that a network initialises to one value (a slope, a layer that starts switched off)
//! keeps that value. Every other tensor is drawn as in PyTorch: uniform within 1 / sqrt(fan-in),
//! times the gain of its layer. The backends' own generators are not used, because a whole process
//! shares them, so one test's numbers would depend on other tests.

use crate::data::{Purpose, stream};
use crate::model::{fill, weights_of};
use crate::weights::{Array, Weights, WeightsError};
use burn::module::Module;
use burn::tensor::backend::Backend;
use rand::RngExt;

/// Gains of the layers whose path ends with this name; other layers have gain 1.
pub(super) type Gains = [(&'static str, f32)];

/// `network` with its initial weights for `seed`.
pub(super) fn seeded<B: Backend, M: Module<B>>(
    network: M,
    gains: &Gains,
    seed: u64,
) -> Result<M, WeightsError> {
    let drawn = weights_of("first weights", &network);
    let mut seeded = Weights::new("first weights");
    let names: Vec<String> = drawn.names().map(str::to_owned).collect();
    for (number, name) in (0..).zip(&names) {
        let array = drawn.get(name)?;
        let constant = array.values.len() > 1 && array.values.iter().all(|v| *v == array.values[0]);
        let values = if constant {
            array.values.clone()
        } else {
            let layer = name.rsplit_once('.').map_or(name.as_str(), |(layer, _)| layer);
            let gain =
                gains.iter().find(|(end, _)| layer.ends_with(end)).map_or(1.0, |(_, gain)| *gain);
            // A bias has the fan-in of its layer's weights.
            let shape = drawn.get(&format!("{layer}.weight")).map_or(&array.shape, |w| &w.shape);
            let fan_in: usize = shape[1..].iter().product();
            let bound = gain / (fan_in.max(1) as f32).sqrt();
            let mut rng = stream(seed, Purpose::Weights, number);
            array.values.iter().map(|_| rng.random_range(-bound..=bound)).collect()
        };
        seeded.insert(name.clone(), Array { shape: array.shape.clone(), values });
    }
    fill(network, &seeded)
}
