use super::*;
use crate::testing::{array, correlation_of, measured, normal, real_data, scene, side};
use crate::{Order, Rows, reconstruct};
use rand::SeedableRng;
use rand_pcg::Pcg64;

const ALL: [Penalty; 3] = [Penalty::Tikhonov, Penalty::Sparse, Penalty::TotalVariation];

fn correlation(part: &Measurements, full: &Image, penalty: Penalty) -> f64 {
    let found = regularised(part, &RegularisedSettings::new(penalty)).unwrap();
    correlation_of(&found.image, full)
}

#[test]
fn every_penalty_beats_zero_filling_on_a_phantom() {
    let side = side(32);
    let all = measured(side, &scene(side, 1));
    let full = reconstruct::hadamard(&all);
    for share in [0.1, 0.3] {
        let part = all.take(Some(&Order::ZigZag), share).unwrap();
        let zero = correlation_of(&reconstruct::hadamard(&part), &full);
        for penalty in ALL {
            let found = correlation(&part, &full, penalty);
            assert!(found > zero, "{penalty:?} at {share}: {found}, zero filling {zero}");
        }
    }
}

#[test]
fn flat_regions_come_back_whole_by_total_variation() {
    let side = side(32);
    let all = measured(side, &scene(side, 2));
    let part = all.take(Some(&Order::Random(2)), 0.4).unwrap();
    let settings = RegularisedSettings {
        strength: Strength::Fixed(1e-3),
        iterations: 2000,
        ..RegularisedSettings::new(Penalty::TotalVariation)
    };
    let found = regularised(&part, &settings).unwrap();
    let full = reconstruct::hadamard(&all);
    let worst = found.image.pixels().iter().zip(full.pixels()).map(|(a, b)| (a - b).abs());
    assert!(worst.fold(0.0, f32::max) < 0.02);
}

#[test]
fn each_minimum_is_one() {
    // No step away from the result reduces its sum. This is the definition of a minimum, whatever
    // the algorithm.
    let side = side(8);
    let part = measured(side, &scene(side, 1)).take(Some(&Order::ZigZag), 0.5).unwrap();
    let mut random = Pcg64::seed_from_u64(3);
    for penalty in ALL {
        let problem = Problem::of(&part, Basis::Dct, Some(1.0), NoiseLevel::Known(0.5));
        let every: Vec<usize> = (0..part.rows().len()).collect();
        let predict = match penalty {
            Penalty::Tikhonov => tikhonov::predict,
            Penalty::Sparse => fista::predict,
            Penalty::TotalVariation => total_variation::predict,
        };
        let mut found = predict(&problem, &every, &[1.0], 5000).remove(0);
        let cost = |rows: &[f32]| {
            let misfit = problem.residual_of(rows).powi(2) * dot(&problem.values, &problem.values);
            misfit / 2.0 + penalty_of(&problem, penalty, rows)
        };
        let least = cost(&found);
        for row in 0..64 {
            for change in [1e-2, -1e-2, 1e-3, -1e-3] {
                let by = change * normal(&mut random).abs() as f32;
                found[row] += by;
                assert!(cost(&found) >= least * (1.0 - 1e-4), "{penalty:?}, row {row} by {by}");
                found[row] -= by;
            }
        }
    }
}

fn penalty_of(problem: &Problem<'_>, penalty: Penalty, rows: &[f32]) -> f64 {
    let noise = f64::from(problem.prior.noise);
    let mut x = rows.to_vec();
    walsh(8, &mut x);
    if penalty == Penalty::TotalVariation {
        let at = |r: usize, c: usize| f64::from(x[r.min(7) * 8 + c.min(7)]);
        let gradient = |p: usize| {
            let (r, c) = (p / 8, p % 8);
            (at(r + 1, c) - at(r, c)).hypot(at(r, c + 1) - at(r, c))
        };
        return noise * (0..64).map(gradient).sum::<f64>();
    }
    problem.transform.analyse(&mut x);
    let relative = x.iter().zip(&problem.prior.scale).map(|(c, s)| f64::from(c / s).abs());
    match penalty {
        Penalty::Tikhonov => noise.powi(2) / 2.0 * relative.map(|z| z * z).sum::<f64>(),
        _ => noise.powi(2) * 2.0_f64.sqrt() * relative.skip(1).sum::<f64>(),
    }
}

#[test]
fn measured_rows_are_kept_and_darkness_stays_dark() {
    for penalty in ALL {
        let settings = RegularisedSettings::new(penalty);
        for n in [2, 16] {
            let all = measured(side(n), &scene(side(n), 2));
            for share in [0.05, 0.4, 1.0] {
                let part = all.take(Some(&Order::ZigZag), share).unwrap();
                let found = regularised(&part, &settings).unwrap();
                let mut back: Vec<f64> = found.image.pixels().iter().map(|&p| p.into()).collect();
                fwht(&mut back).unwrap();
                for (&row, value) in part.rows().iter().zip(part.values()) {
                    assert!((back[row as usize] - value).abs() < 1e-3 * n as f64);
                }
            }
        }
        let dark = measured(side(8), &[0.0; 64]).take(None, 0.5).unwrap();
        let found = regularised(&dark, &settings).unwrap();
        assert!(found.image.pixels().iter().all(|&p| p == 0.0), "{penalty:?}");
    }
}

#[test]
fn darkness_and_the_mean_alone_have_an_image_by_every_penalty() {
    let dark = measured(side(8), &[0.0; 64]).take(None, 0.5).unwrap();
    let mean = measured(side(8), &scene(side(8), 1)).take(Some(&Order::Natural), 1e-9).unwrap();
    for penalty in ALL {
        for (part, level) in [(&dark, 0.0), (&mean, mean.values()[0] / 64.0)] {
            let found = regularised(part, &RegularisedSettings::new(penalty)).unwrap();
            let even = |&pixel: &f32| (f64::from(pixel) - level).abs() < 1e-6;
            assert!(found.image.pixels().iter().all(even), "{penalty:?}: {:?}", found.image);
        }
    }
}

#[test]
fn settings_that_make_no_sense_are_named() {
    let part = measured(side(8), &scene(side(8), 0));
    let sound = RegularisedSettings::new(Penalty::Tikhonov);
    let refused = |settings| regularised(&part, &settings).unwrap_err().to_string();
    let strength = |s| RegularisedSettings { strength: Strength::Fixed(s), ..sound };
    assert!(refused(strength(0.0)).starts_with("strength is 0, expected more than 0"));
    assert!(refused(strength(f64::NAN)).starts_with("strength is NaN"));
    let none = RegularisedSettings { iterations: 0, ..sound };
    assert!(refused(none).starts_with("iterations is 0"));
    let folds = Strength::CrossValidated { folds: 1 };
    assert!(refused(RegularisedSettings { strength: folds, ..sound }).starts_with("folds is 1"));
    for strength in [Strength::CrossValidated { folds: 2 }, Strength::Fixed(1e6)] {
        assert_eq!(RegularisedSettings { strength, ..sound }.check(), Ok(()));
    }
    let falloff = RegularisedSettings { falloff: Some(-1.0), ..sound };
    assert!(refused(falloff).starts_with("falloff is -1"));
}

#[test]
fn tikhonov_beats_zero_filling_on_real_measurements_at_every_share() {
    for (name, size, field) in [("opar_ala1.npz", 64, "y"), ("scheidt_car.npz", 32, "d")] {
        let Some(mut file) = real_data(name) else { return };
        let rows = Rows::new(side(size), array::<i32>(&mut file, "h_row")).unwrap();
        let all = if field == "y" {
            let y: Vec<f64> = array::<f32>(&mut file, "y").into_iter().map(f64::from).collect();
            Measurements::from_pairs(&rows, &y).unwrap().measurements
        } else {
            let d: Vec<f64> = array::<i32>(&mut file, "d").into_iter().map(f64::from).collect();
            Measurements::from_differential(&rows, &d[..rows.len()]).unwrap()
        };
        let full = reconstruct::hadamard(&all);
        for share in [0.1, 0.2, 0.3, 0.5] {
            let part = all.take(Some(&Order::ZigZag), share).unwrap();
            let zero = correlation_of(&reconstruct::hadamard(&part), &full);
            let found = correlation(&part, &full, Penalty::Tikhonov);
            assert!(found > zero, "{name} at {share}: {found}, zero filling {zero}");
        }
    }
}
