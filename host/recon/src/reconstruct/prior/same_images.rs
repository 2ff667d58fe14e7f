//! The learned prior, with networks that need no training.

use super::*;
use crate::fwht as walsh;
use crate::reconstruct::same_images::{Table, parts};
use crate::testing::{scene, side};

/// A network that knows a part of the scene, the rest being Tikhonov's start, and gets measured
/// values a little wrong.
struct Half {
    truth: Vec<f64>,
    known: f32,
}

impl Network for Half {
    fn name(&self) -> &str {
        "half"
    }

    fn takes(&self, side: Side) -> bool {
        side.pixels() == 16
    }

    fn complete(&self, seen: &Seen) -> Result<Vec<f32>, String> {
        let mut d = self.truth.clone();
        walsh(&mut d).map_err(|error| error.to_string())?;
        let mixed = seen.start().iter().zip(&d).map(|(start, &d)| {
            let truth = seen.in_units(d);
            start + self.known * (truth - start) + 0.05
        });
        Ok(mixed.collect())
    }
}

#[test]
fn a_networks_images_are_those_that_it_made() {
    let mut table = Table::default();
    for (name, part) in parts() {
        let kind = if name == "blobs" || name == "in noise" { 1 } else { 2 };
        for known in [0.3, 0.9, 3.0, -2.0] {
            let network = Half { truth: scene(side(16), kind), known };
            let without = part.clone().with_noise(0.0).unwrap();
            for (noise, part) in [("estimated", &part), ("no", &without)] {
                let made = with_network(part, &network, "half").unwrap();
                table.made(&format!("{known} known, {noise} noise, {name}"), &made);
            }
        }
    }
    table.is_the_same_as("prior.txt");
}

#[test]
fn a_network_is_given_what_it_was_given() {
    let mut table = Table::default();
    for (name, part) in parts() {
        let seen = Seen::new(&part).unwrap();
        table.image(&format!("values, {name}"), seen.values().iter().copied());
        table.image(&format!("mask, {name}"), seen.mask().iter().copied());
        table.image(&format!("start, {name}"), seen.start().iter().copied());
        table.image(&format!("fineness, {name}"), seen.fineness().iter().copied());
        table.image(&format!("image, {name}"), seen.image(seen.values()));
        let told: Vec<f64> = seen.conditions().iter().map(|&told| told.into()).collect();
        table.line(&format!("conditions, {name}"), &told);
        let units = [seen.noise().into(), seen.unit(), seen.mean()];
        table.line(&format!("units, {name}"), &units);
        let half: Vec<f32> = seen.values().iter().map(|v| 0.5 * v).collect();
        table.line(&format!("residual, {name}"), &[seen.residual(&half)]);
    }
    table.is_the_same_as("seen.txt");
}

#[test]
fn a_shared_network_is_itself_and_no_other() {
    let network = || SharedNetwork::new(Half { truth: vec![0.0; 256], known: 0.0 });
    let one = network();
    assert_eq!(one, one.clone());
    assert_ne!(one, network());
    assert_eq!(format!("{one:?}"), "SharedNetwork(half)");
}
