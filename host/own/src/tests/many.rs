//! Many measurements by the same patterns.

use super::super::{
    BATCH, LiveMatrix, MatrixError, MatrixMethod, MatrixSettings, OwnMatrix, Penalty,
};
use super::{METHODS, patterns, scene, seen, side};
use nirspi_recon::Basis;

/// Measurements that differ in scene, noise and size, and one of no light.
fn measurements(weights: &[f64]) -> Vec<Vec<f64>> {
    let mut all: Vec<Vec<f64>> = [(0, 0.02, 1.0), (1, 0.5, 1e-3), (2, 0.1, 40.0)]
        .map(|(number, noise, unit)| {
            let y = seen(weights, &scene(side(8), number), noise);
            y.iter().map(|y| unit * y + 3.0).collect()
        })
        .to_vec();
    all.push(vec![7.0; weights.len() / 64]);
    all
}

/// Fewer patterns than pixels, more, and orthogonal ones.
#[test]
fn images_are_those_of_each_alone() {
    for (kind, count) in [(0, 40), (0, 90), (1, 64)] {
        let weights = patterns(kind, count, 64, 4);
        let own = OwnMatrix::new(side(8), &weights).unwrap();
        let measured = measurements(&weights);
        let all: Vec<&[f64]> = measured.iter().map(Vec::as_slice).collect();
        for method in METHODS.into_iter().chain([MatrixMethod::Best]) {
            for (basis, dark) in [(Basis::Dct, true), (Basis::Pixel, false)] {
                let settings = MatrixSettings { basis, dark, ..MatrixSettings::new(method) };
                let together = own.reconstruct_all(&all, &settings).unwrap();
                let alone: Vec<_> =
                    all.iter().map(|y| own.reconstruct(y, &settings).unwrap()).collect();
                assert!(together == alone, "kind {kind}, {count} patterns, {method:?}, {basis}");
            }
        }
    }
}

#[test]
fn any_number_of_measurements_is_taken() {
    let weights = patterns(0, 40, 64, 4);
    let own = OwnMatrix::new(side(8), &weights).unwrap();
    let y = measurements(&weights).remove(0);
    let settings = MatrixSettings::new(MatrixMethod::Penalty(Penalty::Tikhonov));
    let many = own.reconstruct_all(&vec![&y[..]; BATCH + 1], &settings).unwrap();
    assert_eq!((many.len(), &many[BATCH]), (BATCH + 1, &many[0]));
    assert_eq!(own.reconstruct_all(&[], &settings), Ok(Vec::new()));
    let short = own.reconstruct_all(&[&y, &y[1..]], &settings);
    assert_eq!(short, Err(MatrixError::Length { found: 39, expected: 40 }));
}

/// Fewer patterns than pixels, and orthogonal ones.
#[test]
fn a_live_view_chooses_once_for_many_images() {
    for (kind, count) in [(0, 40), (1, 64)] {
        let weights = patterns(kind, count, 64, 4);
        let own = OwnMatrix::new(side(8), &weights).unwrap();
        let measured = measurements(&weights);
        for method in METHODS.into_iter().chain([MatrixMethod::Best]) {
            let settings = MatrixSettings::new(method);
            let mut live = LiveMatrix::new(own.clone(), settings.clone(), 3);
            let alone = |y: &[f64]| own.reconstruct(y, &settings).unwrap();
            let first = live.image(&measured[0]).unwrap();
            assert_eq!(first, alone(&measured[0]), "kind {kind}, {method:?}");
            // What was chosen for the first serves two more, of which the noisy one would choose something else.
            let kept = MatrixSettings {
                method: first.method,
                strength: first.strength,
                sparsity: first.atoms.map(|(atoms, _)| atoms),
                judge: false,
                ..settings.clone()
            };
            for y in [&measured[1], &measured[2]] {
                let made = live.image(y).unwrap();
                assert_eq!(made, own.reconstruct(y, &kept).unwrap(), "kind {kind}, {method:?}");
            }
            assert_eq!(live.image(&measured[1]).unwrap(), alone(&measured[1]), "chosen anew");
            assert!(live.image(&measured[1][1..]).is_err());
            assert_eq!(live.image(&measured[2]).unwrap(), alone(&measured[2]), "after an error");
        }
    }
}
