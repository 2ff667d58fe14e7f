//! A build without the feature `baselines`: `cargo test -p nirspi-nets` builds one.
#![cfg(not(feature = "baselines"))]

use nirspi_nets::{Weights, embedded::ShippedWeights};

#[test]
fn a_baseline_that_was_left_out_names_the_feature_that_brings_it() {
    for model in ["gan", "ancestral", "regression"] {
        let error = Weights::embedded(model).map(drop).map_err(|error| error.to_string());
        let said = error.err().is_some_and(|error| error.contains("feature `baselines`"));
        assert!(said, "{model}");
    }
    let models: Vec<_> = ShippedWeights::all().into_iter().flatten().map(|w| w.model).collect();
    assert_eq!(models, nirspi_weights::FILES.map(|(model, _)| model));
}
