mod folds;
mod many;
mod same_images;
mod shapes;

use super::*;
use crate::testing::{binary_patterns, correlation_of, measured, normal, scene, side};
use nirspi_recon::Side;
use nirspi_recon::reconstruct::hadamard;

const METHODS: [MatrixMethod; 5] = [
    MatrixMethod::PseudoInverse,
    MatrixMethod::Penalty(Penalty::Tikhonov),
    MatrixMethod::Penalty(Penalty::Sparse),
    MatrixMethod::Penalty(Penalty::TotalVariation),
    MatrixMethod::Omp,
];

/// Patterns of zeros and ones, and their measurements of an image, with some noise.
fn binary(side: Side, patterns: usize, image: &[f64]) -> (OwnMatrix, Vec<f64>) {
    let (weights, y) = binary_patterns(patterns, image, 0.05, 3);
    (OwnMatrix::new(side, &weights).unwrap(), y)
}

#[test]
fn the_pseudo_inverse_is_that_of_the_singular_values() {
    let mut random = Pcg64::seed_from_u64(1);
    let side = side(4);
    for rows in [5, 12, 16, 30] {
        let mut weights: Vec<f64> = (0..rows * 16).map(|_| normal(&mut random)).collect();
        // The same pattern occurs twice, with different measurements.
        weights.copy_within(0..16, 32);
        let own = OwnMatrix::new(side, &weights).unwrap();
        assert_eq!(own.rank(), (rows - 1).min(16));
        for unit in [1e-9, 1e9] {
            let other: Vec<f64> = weights.iter().map(|w| w * unit).collect();
            assert_eq!(OwnMatrix::new(side, &other).unwrap().rank(), own.rank(), "{unit}");
        }
        let y: Vec<f64> = (0..rows).map(|_| normal(&mut random)).collect();
        let settings =
            MatrixSettings { dark: false, ..MatrixSettings::new(MatrixMethod::PseudoInverse) };
        let found = own.reconstruct(&y, &settings).unwrap();
        let inverse = own.patterns.clone().pseudo_inverse(1e-9).unwrap();
        let exact = inverse * DVector::from_column_slice(&y);
        for (a, b) in found.image.pixels().iter().zip(exact.iter()) {
            assert!((f64::from(*a) - b).abs() < 1e-5 * exact.norm(), "{rows} rows: {a} and {b}");
        }
        let faint: Vec<f64> = y.iter().map(|y| y * 1e-12).collect();
        let faint = own.reconstruct(&faint, &settings).unwrap();
        for (a, b) in faint.image.pixels().iter().zip(exact.iter()) {
            assert!((f64::from(*a) * 1e12 - b).abs() < 1e-5 * exact.norm(), "{rows} rows: {a}");
        }
    }
}

#[test]
fn all_hadamard_rows_as_a_matrix_give_the_image_by_every_method() {
    let (side, image) = (side(8), scene(side(8), 1));
    let all = measured(side, &image);
    let sign =
        |k: usize| if ((k / 64) & (k % 64)).count_ones().is_multiple_of(2) { 1.0 } else { -1.0 };
    let own = OwnMatrix::new(side, &(0..64 * 64).map(sign).collect::<Vec<f64>>()).unwrap();
    assert_eq!((own.rank(), own.unseen_pixels()), (64, 0));
    let full = hadamard(&all);
    for method in METHODS {
        let found = own.reconstruct(all.values(), &MatrixSettings::new(method)).unwrap();
        let correlation = correlation_of(&found.image, &full);
        let enough = if method == MatrixMethod::Omp { 0.9 } else { 0.995 };
        assert!(correlation > enough, "{method:?}: {correlation}");
        if method == MatrixMethod::PseudoInverse {
            assert!(found.residual < 1e-6);
        }
    }
}

#[test]
fn orthogonal_patterns_of_any_norms_are_inverted_in_one_step() {
    let side = side(8);
    let mut random = Pcg64::seed_from_u64(5);
    let sign = |r: usize, p: usize| f64::from(1 - 2 * ((r & p).count_ones() as i32 % 2));
    for count in [1, 20, 64] {
        let weights: Vec<f64> = (0..count)
            .flat_map(|r| (0..64).map(move |p| sign(r, p) * (1.0 + r as f64 / 9.0)))
            .collect();
        let own = OwnMatrix::new(side, &weights).unwrap();
        assert!(own.orthogonal.is_some());
        assert_eq!(own.rank(), count);
        for unit in [1e-6, 1e6] {
            let mut other: Vec<f64> = weights.iter().map(|w| w * unit).collect();
            assert!(OwnMatrix::new(side, &other).unwrap().orthogonal.is_some(), "{count}, {unit}");
            other[3] *= 1.0 + 1e-4;
            let orthogonal = OwnMatrix::new(side, &other).unwrap().orthogonal.is_some();
            assert_eq!(orthogonal, count == 1, "{count}, {unit}");
        }
        let y: Vec<f64> = (0..count).map(|_| normal(&mut random)).collect();
        let settings = MatrixSettings::new(MatrixMethod::PseudoInverse);
        let slow = OwnMatrix { orthogonal: None, ..own.clone() };
        let (fast, slow) =
            (own.reconstruct(&y, &settings).unwrap(), slow.reconstruct(&y, &settings).unwrap());
        assert!(fast.residual < 1e-9);
        for (a, b) in fast.image.pixels().iter().zip(slow.image.pixels()) {
            assert!((a - b).abs() < 1e-5, "{count}: {a} and {b}");
        }
    }
}

/// All rows of a Hadamard matrix, in units of `unit`.
fn complete(side: Side, unit: f64) -> OwnMatrix {
    let area = side.area();
    let sign = |k: usize| match ((k / area) & (k % area)).count_ones().is_multiple_of(2) {
        true => unit,
        false => -unit,
    };
    OwnMatrix::new(side, &(0..area * area).map(sign).collect::<Vec<f64>>()).unwrap()
}

#[test]
fn complete_orthogonal_patterns_have_tikhonovs_image_in_one_step() {
    let (side, image) = (side(8), scene(side(8), 1));
    for unit in [1.0, 1e-6, 1e6] {
        let own = complete(side, unit);
        let y = seen(own.patterns.transpose().as_slice(), &image, unit * 0.3);
        for (strength, basis) in [(1e-3, Basis::Dct), (0.1, Basis::Dct), (0.01, Basis::Haar)] {
            let tikhonov = MatrixMethod::Penalty(Penalty::Tikhonov);
            let settings = MatrixSettings {
                dark: false,
                basis,
                strength: Some(strength),
                ..MatrixSettings::new(tikhonov)
            };
            let fast = own.reconstruct(&y, &settings).unwrap();
            let slow = OwnMatrix { orthogonal: None, ..own.clone() };
            let slow = slow.reconstruct(&y, &settings).unwrap();
            for (a, b) in fast.image.pixels().iter().zip(slow.image.pixels()) {
                assert!((a - b).abs() < 2e-3, "{unit}, {strength}, {basis}: {a} and {b}");
            }
        }
    }
}

#[test]
fn the_likeliest_strength_keeps_what_is_clear_and_leaves_out_noise() {
    let side = side(16);
    let own = complete(side, 1.0);
    let weights = own.patterns.transpose();
    for kind in [1, 2] {
        let image = scene(side, kind);
        let apart = |found: &Image<Size>| -> f64 {
            let each = found.pixels().iter().zip(&image).map(|(&a, b)| (f64::from(a) - b).powi(2));
            (each.sum::<f64>() / image.len() as f64).sqrt()
        };
        let of = |noise: f64, method| {
            let y = seen(weights.as_slice(), &image, noise);
            own.reconstruct(&y, &MatrixSettings::new(method)).unwrap()
        };
        let tikhonov = MatrixMethod::Penalty(Penalty::Tikhonov);
        let clear = of(1e-3, tikhonov);
        assert!(apart(&clear.image) < 5e-3, "{kind}: {}", apart(&clear.image));
        // Sixteen times the noise of a pixel of the plain inverse.
        let noisy = of(4.0, tikhonov);
        let inverse = of(4.0, MatrixMethod::PseudoInverse);
        assert!(
            apart(&noisy.image) < 0.75 * apart(&inverse.image),
            "{kind}: {} and {}",
            apart(&noisy.image),
            apart(&inverse.image)
        );
        assert!(noisy.strength > clear.strength);
        // A dark level changes nothing.
        let y: Vec<f64> = seen(weights.as_slice(), &image, 0.1).iter().map(|y| y + 500.0).collect();
        let dark = own.reconstruct(&y, &MatrixSettings::new(tikhonov)).unwrap();
        assert!((dark.dark.value() - 500.0).abs() < 5.0, "{:?}", dark.dark);
        let without = of(0.1, tikhonov);
        for (a, b) in dark.image.pixels().iter().zip(without.image.pixels()) {
            assert!((a - b).abs() < 1e-3, "{a} and {b}");
        }
    }
}

#[test]
fn the_best_method_is_the_one_that_predicts_held_back_measurements() {
    let side = side(16);
    // A letter has edges, and a soft spot has none.
    let edges: Vec<f64> = (0..256)
        .map(|p| f64::from(u8::from((4..12).contains(&(p / 16)) && (5..9).contains(&(p % 16)))))
        .collect();
    let soft: Vec<f64> = (0..256)
        .map(|p| {
            let from = |at: usize| (at as f64 - 7.5) / 4.0;
            (-(from(p / 16).powi(2) + from(p % 16).powi(2))).exp()
        })
        .collect();
    let best = |image: &[f64]| {
        let (own, y) = binary(side, 128, image);
        let of = |method| own.reconstruct(&y, &MatrixSettings::new(method)).unwrap();
        let found = of(MatrixMethod::Best);
        assert_eq!(found, of(found.method));
        found.method
    };
    assert_eq!(best(&edges), MatrixMethod::Penalty(Penalty::TotalVariation));
    assert_eq!(best(&soft), MatrixMethod::Penalty(Penalty::Tikhonov));
    // With a strength, and for complete orthogonal patterns, nothing is held back.
    let own = complete(side, 1.0);
    let y = seen(own.patterns.transpose().as_slice(), &edges, 0.1);
    let found = own.reconstruct(&y, &MatrixSettings::new(MatrixMethod::Best)).unwrap();
    assert_eq!(found.method, MatrixMethod::Penalty(Penalty::Tikhonov));
}

#[test]
fn patterns_that_share_a_little_are_not_taken_for_orthogonal() {
    let side = side(8);
    let mut weights: Vec<f64> = (0..64 * 64).map(|at| f64::from(u8::from(at % 65 == 0))).collect();
    assert!(OwnMatrix::new(side, &weights).unwrap().orthogonal.is_some());
    weights[1] = 1e-6;
    assert!(OwnMatrix::new(side, &weights).unwrap().orthogonal.is_none());
    weights[1] = 0.0;
    // The same pattern twice, a pattern without light, and more patterns than pixels.
    let copied = [&weights[..64], &weights[..64]].concat();
    assert_eq!(OwnMatrix::new(side, &copied).unwrap().rank(), 1);
    let dark = [&weights[..64], &[0.0; 64]].concat();
    assert_eq!(OwnMatrix::new(side, &dark).unwrap().rank(), 1);
    let tall = [&weights[..], &weights[..64]].concat();
    assert!(OwnMatrix::new(side, &tall).unwrap().orthogonal.is_none());
}

#[test]
fn from_half_as_many_random_patterns_as_pixels_every_prior_beats_the_pseudo_inverse() {
    let (side, image) = (side(16), scene(side(16), 2));
    let (own, y) = binary(side, 128, &image);
    let exact = Image::new(side, image.iter().map(|&v| v as f32).collect());
    let error = |method| {
        let found = own.reconstruct(&y, &MatrixSettings::new(method)).unwrap();
        assert!(found.residual < 0.2, "{method:?}: {}", found.residual);
        let pixels = found.image.pixels().iter().zip(exact.pixels());
        pixels.map(|(a, b)| (a - b).powi(2)).sum::<f32>()
    };
    let least = error(MatrixMethod::PseudoInverse);
    for method in &METHODS[1..] {
        let found = error(*method);
        assert!(found < 0.7 * least, "{method:?}: {found} and {least}");
    }
}

#[test]
fn atoms_of_ones_own_and_light_that_is_not_negative_work_with_a_matrix_too() {
    let side = side(8);
    let mut image = vec![0.0; 64];
    (image[10], image[37]) = (2.0, 1.0);
    let (own, y) = binary(side, 20, &image);
    let spikes: Vec<f32> = (0..64 * 64).map(|p| f32::from(u8::from(p % 65 == 0))).collect();
    for atoms in [None, Some(spikes)] {
        let settings = MatrixSettings {
            basis: Basis::Pixel,
            atoms,
            non_negative: true,
            sparsity: Some(2),
            strength: Some(1e-4),
            ..MatrixSettings::new(MatrixMethod::Omp)
        };
        let found = own.reconstruct(&y, &settings).unwrap().image;
        assert!(found.pixels().iter().all(|&p| p >= 0.0));
        let brightest = (0..64).max_by(|&a, &b| found.pixels()[a].total_cmp(&found.pixels()[b]));
        assert_eq!(brightest, Some(10));
        assert!((found.pixels()[10] - 2.0).abs() < 0.2 && (found.pixels()[37] - 1.0).abs() < 0.2);
    }
}

#[test]
fn darkness_and_the_fewest_patterns_have_an_image_by_every_method() {
    let (side, image) = (side(4), scene(side(4), 1));
    for count in 1..=5 {
        let (own, y) = binary(side, count, &image);
        for method in METHODS {
            let settings = MatrixSettings::new(method);
            let found = own.reconstruct(&y, &settings).unwrap();
            assert!(found.image.pixels().iter().all(|p| p.is_finite()), "{count}, {method:?}");
            let dark = own.reconstruct(&vec![0.0; count], &settings).unwrap();
            assert!(dark.image.pixels().iter().all(|&p| p == 0.0), "{count}, {method:?}");
            assert_eq!(dark.residual, 0.0, "{count}, {method:?}");
        }
    }
}

/// Wide spots measure up to 20 times what one of them measures, and a step of a descent that is
/// right for cosines would overshoot further and further.
#[test]
fn atoms_of_ones_own_may_overlap_by_every_method() {
    let (side, image) = (side(8), scene(side(8), 1));
    let (own, y) = binary(side, 40, &image);
    let near = |a: usize, b: usize| 0.7_f32.powi(a.abs_diff(b) as i32);
    let spot = |at: usize, p: usize| near(at / 8, p / 8) * near(at % 8, p % 8);
    let spots: Vec<f32> = (0..64 * 64).map(|at| spot(at / 64, at % 64)).collect();
    let full = hadamard(&measured(side, &image));
    for method in METHODS {
        let settings = MatrixSettings { atoms: Some(spots.clone()), ..MatrixSettings::new(method) };
        let found = own.reconstruct(&y, &settings).unwrap();
        let correlation = correlation_of(&found.image, &full);
        assert!(correlation > 0.7 && found.residual < 0.2, "{method:?}: {correlation}");
    }
}

#[test]
fn units_of_patterns_and_measurements_do_not_matter() {
    let (side, image) = (side(8), scene(side(8), 1));
    let (own, y) = binary(side, 40, &image);
    let larger = OwnMatrix { patterns: &own.patterns * 1e6, ..own.clone() };
    let volts: Vec<f64> = y.iter().map(|y| y * 1e-3).collect();
    for method in METHODS {
        let settings = MatrixSettings::new(method);
        let found = own.reconstruct(&y, &settings).unwrap();
        let other = larger.reconstruct(&volts, &settings).unwrap();
        assert_eq!((found.strength, found.atoms), (other.strength, other.atoms));
        for (a, b) in found.image.pixels().iter().zip(other.image.pixels()) {
            assert!((f64::from(*a) - 1e9 * f64::from(*b)).abs() < 1e-3, "{method:?}: {a} {b}");
        }
    }
}

/// More patterns than pixels, some of them combinations of others, with measurements that no image
/// explains.
#[test]
fn a_condensed_problem_misses_every_image_by_as_much() {
    let mut random = Pcg64::seed_from_u64(12);
    for (count, rank, scale) in [(40, 9, 1e8), (40, 16, 1.0), (19, 16, 1e-8), (18, 1, 1.0)] {
        let mut draw = |rows, columns| DMatrix::from_fn(rows, columns, |_, _| normal(&mut random));
        let a = draw(count, rank) * draw(rank, 16) * scale;
        let y = draw(count, 1).column(0).into_owned();
        let condensed = solvers::Condensed::of(&a).unwrap();
        let (small, values) = (condensed.rows(), condensed.values(&y));
        assert_eq!(small.shape(), (17, 16));
        for x in [0.0, 0.3, 10.0].map(|size| draw(16, 1) * size / scale) {
            let (whole, condensed) = ((&y - &a * &x).norm(), (&values - small.clone() * &x).norm());
            let case = format!("{count} patterns of rank {rank}");
            assert!((whole / condensed - 1.0).abs() < 1e-6, "{case}: {whole} and {condensed}");
        }
    }
    assert!(solvers::Condensed::of(&DMatrix::from_element(17, 16, 1.0)).is_none());
}

/// Patterns of this kind: 0/1, +-1, grey.
fn patterns(kind: u8, count: usize, area: usize, seed: u64) -> Vec<f64> {
    let mut random = Pcg64::seed_from_u64(seed);
    let weight = |v: f64| match kind {
        0 => f64::from(u8::from(v < 0.5)),
        1 => {
            if v < 0.5 {
                1.0
            } else {
                -1.0
            }
        }
        _ => v,
    };
    (0..count * area).map(|_| weight(random.random::<f64>())).collect()
}

fn seen(weights: &[f64], image: &[f64], noise: f64) -> Vec<f64> {
    let mut random = Pcg64::seed_from_u64(9);
    let light = |p: &[f64]| p.iter().zip(image).map(|(w, v)| w * v).sum::<f64>();
    weights.chunks_exact(image.len()).map(|p| light(p) + noise * normal(&mut random)).collect()
}

/// Dark levels up to ten times the signal, with few, with many and with all patterns.
#[test]
fn a_dark_level_changes_no_image() {
    let side = side(8);
    for kind in 0..3 {
        for (count, scene_kind) in [(40, 2), (64, 1), (90, 2)] {
            let image = scene(side, scene_kind);
            let weights = patterns(kind, count, 64, 4 + u64::from(kind));
            let own = OwnMatrix::new(side, &weights).unwrap();
            let y = seen(&weights, &image, 0.01);
            let signal = y.iter().map(|y| y.abs()).sum::<f64>() / y.len() as f64;
            for method in METHODS {
                let settings = MatrixSettings::new(method);
                let clean = own.reconstruct(&y, &settings).unwrap();
                for times in [0.1, 1.0, 10.0, -3.0] {
                    let dark = times * signal;
                    let lifted: Vec<f64> = y.iter().map(|y| y + dark).collect();
                    let found = own.reconstruct(&lifted, &settings).unwrap();
                    let alike = correlation_of(&found.image, &clean.image);
                    let case = format!("kind {kind}, {count} patterns, {method:?}, dark {times}");
                    assert!(alike > 0.999, "{case}: {alike}");
                    let rise = found.dark.value() - clean.dark.value();
                    assert!((rise / dark - 1.0).abs() < 0.01, "{case}: {rise} of {dark}");
                }
            }
        }
    }
}

/// The unknown constant costs next to nothing where there is no dark level, and the level is found where
/// there is one.
#[test]
fn the_constant_costs_little_and_is_the_dark_level() {
    let side = side(16);
    let image = scene(side, 2);
    for kind in 0..3 {
        let weights = patterns(kind, 160, 256, 21);
        let own = OwnMatrix::new(side, &weights).unwrap();
        let y: Vec<f64> = seen(&weights, &image, 0.01).iter().map(|y| y + 30.0).collect();
        let exact = Image::new(side, image.iter().map(|&v| v as f32).collect());
        let settings = MatrixSettings::new(MatrixMethod::Penalty(Penalty::TotalVariation));
        let found = own.reconstruct(&y, &settings).unwrap();
        let alike = correlation_of(&found.image, &exact);
        assert!(alike > 0.99, "kind {kind}: {alike}");
        assert!((found.dark.value() - 30.0).abs() < 1.0, "kind {kind}: {:?}", found.dark);
        let without = own.reconstruct(&y, &MatrixSettings { dark: false, ..settings }).unwrap();
        let worse = correlation_of(&without.image, &exact);
        assert!(worse < alike - 0.02, "kind {kind}: {worse} and {alike}");
        assert_eq!(without.dark, DarkLevel::LeftOut);
    }
}

#[test]
fn a_mean_that_looks_like_a_dark_level_stays_in_the_image() {
    let side = side(8);
    let image = scene(side, 1);
    let mean = image.iter().sum::<f64>() / 64.0;
    let mean_of = |image: &Image<Size>| image.pixels().iter().sum::<f32>() as f64 / 64.0;
    // Half of the pixels of each pattern are lit.
    let mut random = Pcg64::seed_from_u64(2);
    let mut half: Vec<f64> = (0..64).map(|p| f64::from(u8::from(p % 2 == 0))).collect();
    let weights: Vec<f64> = (0..48)
        .flat_map(|_| {
            half.shuffle(&mut random);
            half.clone()
        })
        .collect();
    // Each pixel alone: a raster.
    let raster: Vec<f64> = (0..64 * 64).map(|at| f64::from(u8::from(at % 65 == 0))).collect();
    for (name, weights) in [("half", weights), ("raster", raster)] {
        let own = OwnMatrix::new(side, &weights).unwrap();
        let y = seen(&weights, &image, 0.0);
        for method in METHODS {
            let found = own.reconstruct(&y, &MatrixSettings::new(method)).unwrap();
            assert!((mean_of(&found.image) / mean - 1.0).abs() < 0.02, "{name}, {method:?}");
            assert_eq!(found.dark, DarkLevel::Unknown, "{name}, {method:?}");
        }
    }
    // All rows of a Hadamard matrix, the even one among them.
    let sign = |k: usize| f64::from(1 - 2 * (((k / 64) & (k % 64)).count_ones() as i32 % 2));
    let weights: Vec<f64> = (0..64 * 64).map(sign).collect();
    let own = OwnMatrix::new(side, &weights).unwrap();
    for dark in [0.0, 20.0] {
        let y: Vec<f64> = seen(&weights, &image, 0.0).iter().map(|y| y + dark).collect();
        for method in METHODS {
            let found = own.reconstruct(&y, &MatrixSettings::new(method)).unwrap();
            let case = format!("{method:?}, dark {dark}: {:?}", found.dark);
            assert!((mean_of(&found.image) / mean - 1.0).abs() < 0.05, "{case}");
            assert!((found.dark.value() - dark).abs() < 0.5, "{case}");
        }
    }
}

#[test]
fn what_is_wrong_with_a_matrix_is_named() {
    let side = side(2);
    let refused = |weights: &[f64]| OwnMatrix::new(side, weights).unwrap_err().to_string();
    assert!(refused(&[1.0; 6]).contains("multiple of the 4 pixels of a 2 x 2 image"));
    assert!(refused(&[]).contains("0 numbers"));
    let mut weights = [1.0; 8];
    weights[6] = f64::NAN;
    assert!(refused(&weights).contains("matrix is NaN at [1, 2]"), "{}", refused(&weights));
    assert!(refused(&[0.0; 8]).contains("rank 0"));
    // One weight whose square leaves the range of floating point is a weight all the same.
    for weight in [f64::MAX, 1e160, 1e-160, f64::from_bits(1)] {
        assert_eq!(OwnMatrix::new(side, &[weight, 0.0, 0.0, 0.0]).unwrap().rank(), 1);
    }
    let own = OwnMatrix::new(side, &[1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0]).unwrap();
    assert_eq!((own.rank(), own.unseen_pixels(), own.patterns()), (2, 2, 2));
    let sound = MatrixSettings::new(MatrixMethod::Omp);
    let wrong = own.reconstruct(&[1.0], &sound).unwrap_err().to_string();
    assert!(wrong.contains("1 measurements by 2 patterns"), "{wrong}");
    let wrong = own.reconstruct(&[1.0, f64::INFINITY], &sound).unwrap_err().to_string();
    assert!(wrong.contains("y is inf at [1, 0]"), "{wrong}");
    let atoms = |count| MatrixSettings { atoms: Some(vec![1.0; count]), ..sound.clone() };
    for count in [0, 6] {
        let wrong = own.reconstruct(&[1.0, 1.0], &atoms(count)).unwrap_err();
        assert_eq!(wrong, MatrixError::Shape { found: count, size: side.into() });
    }
    for found in [0.0, -1.0, 1.1e6] {
        let settings = MatrixSettings { strength: Some(found), ..sound.clone() };
        let wrong = own.reconstruct(&[1.0, 1.0], &settings).unwrap_err().to_string();
        assert!(wrong.ends_with("expected more than 0, at most 1e6"), "{wrong}");
    }
    let settings = MatrixSettings { non_negative: true, ..sound };
    let wrong = own.reconstruct(&[1.0, 1.0], &settings).unwrap_err();
    assert_eq!(wrong, MatrixError::Signed { basis: Basis::Dct });
}
