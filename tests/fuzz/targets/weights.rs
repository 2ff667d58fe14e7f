//! Any file that claims to be weights: each network runs with it and gives numbers, or refuses it in one line.
#![no_main]

use libfuzzer_sys::fuzz_target;
use nirspi_nets::cpu::{Classifier, Estimator, Fsrcnn, UNet};
use nirspi_nets::{Weights, WeightsError};

const IMAGE: [f32; 3 * 64 * 64] = [0.5; 3 * 64 * 64];

fn run(weights: &Weights) -> [Result<(), WeightsError>; 4] {
    let (one, side) = (&IMAGE[..64 * 64], (64, 64));
    [
        UNet::new(weights).map(|unet| drop(unet.forward(one, one, side, &[0.5; 6]))),
        Fsrcnn::new(weights).map(|fsrcnn| drop(fsrcnn.forward(&IMAGE, side))),
        Estimator::new(weights).map(|estimator| drop(estimator.forward(one, side))),
        Classifier::new(weights).map(|classifier| drop(classifier.features(one, side))),
    ]
}

fuzz_target!(|bytes: &[u8]| {
    let refused = match Weights::parse("fuzz", bytes) {
        Ok(weights) => run(&weights).into_iter().filter_map(Result::err).collect(),
        Err(error) => vec![error],
    };
    assert!(refused.iter().all(|error| error.to_string().lines().count() == 1));
});
