//! Methods by name, and penalties with their settings.

use super::*;

#[test]
fn every_method_makes_the_images_that_it_made() {
    let mut table = Table::default();
    for (name, part) in parts() {
        for method in Method::ALL.iter().filter(|method| !method.needs_network()) {
            let ready = method.prepare(&MethodSettings::default()).unwrap();
            table.made(&format!("{method}, {name}"), &ready.reconstruct(&part).unwrap());
        }
    }
    table.is_the_same_as("methods.txt");
}

#[test]
fn every_penalty_makes_the_images_that_it_made() {
    let mut table = Table::default();
    for (at, (name, part)) in parts().into_iter().enumerate() {
        for penalty in [Penalty::Tikhonov, Penalty::Sparse, Penalty::TotalVariation] {
            let base = RegularisedSettings::new(penalty);
            for (what, settings) in [
                ("strength 0.5", RegularisedSettings { strength: Strength::Fixed(0.5), ..base }),
                ("Haar", RegularisedSettings { basis: Basis::Haar, ..base }),
                (
                    "pixels, steep",
                    RegularisedSettings {
                        basis: Basis::Pixel,
                        falloff: Some(1.7),
                        noise: NoiseLevel::Known(0.8),
                        ..base
                    },
                ),
                (
                    "flat, 3 parts, 9 iterations",
                    RegularisedSettings {
                        falloff: Some(0.0),
                        strength: Strength::CrossValidated { folds: 3 },
                        iterations: 9,
                        ..base
                    },
                ),
            ]
            .into_iter()
            .skip(at % 2)
            {
                let found = regularised(&part, &settings).unwrap();
                let name = format!("{penalty:?}, {what}, {name}");
                table.image(&name, found.image.pixels().iter().copied());
                let Regularised { strength, trust, residual, noise, .. } = found;
                table.line(&format!("report, {name}"), &[strength, trust, residual, noise]);
            }
        }
    }
    table.is_the_same_as("penalties.txt");
}
