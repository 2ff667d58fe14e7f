use super::*;
use crate::testing::{correlation_of, measured, readings, scene, side};
use proptest::prelude::*;

fn natural(n: u64) -> Rows {
    Rows::natural(side(n))
}

fn reversed(n: u64) -> Rows {
    Rows::new(side(n), natural(n).iter().rev().copied()).unwrap()
}

#[test]
fn pairs_singles_and_differences_of_one_scene_agree() {
    let rows = reversed(8);
    let y = readings(side(8), &rows, &scene(side(8), 0));
    let d: Vec<f64> = y.as_chunks::<2>().0.iter().map(|[p, m]| p - m).collect();
    let plus: Vec<f64> = y.iter().step_by(2).copied().collect();
    let from_d = Measurements::from_differential(&rows, &d).unwrap();
    let from_pairs = Measurements::from_pairs(&rows, &y).unwrap();
    let from_single = Measurements::from_single(&rows, &plus).unwrap();
    assert_eq!(
        (from_pairs.dropouts, from_pairs.outliers, from_pairs.doubts),
        (vec![], vec![], vec![])
    );
    assert_eq!(from_pairs.measurements, from_d);
    for (a, b) in from_single.values().iter().zip(&d) {
        assert!((a - b).abs() < 1e-9);
    }
}

#[test]
fn without_the_all_ones_pattern_its_level_is_near_twice_the_mean() {
    let rows = Rows::new(side(16), natural(16)[1..].iter().copied()).unwrap();
    let y = readings(side(16), &rows, &scene(side(16), 0));
    let plus: Vec<f64> = y.iter().step_by(2).copied().collect();
    let d = Measurements::from_single(&rows, &plus).unwrap();
    let exact: Vec<f64> = y.as_chunks::<2>().0.iter().map(|[p, m]| p - m).collect();
    let total = y[0] + y[1];
    assert!(d.values().iter().zip(&exact).all(|(a, b)| (a - b).abs() < 0.01 * total));
}

#[test]
fn each_fault_is_named() {
    use MeasurementError as E;
    let rows = |rows: &[u32]| Rows::new(side(2), rows.iter().copied()).unwrap();
    let d =
        |found: &[u32], d: &[f64]| Measurements::from_differential(&rows(found), d).unwrap_err();
    assert_eq!(d(&[0, 1], &[1.0]), E::Length { field: "d", found: 1, expected: 2 });
    assert!(matches!(d(&[0, 1], &[0.0, f64::NAN]), E::NotFinite { field: "d", index: 1, .. }));
    let pairs = Measurements::from_pairs(&rows(&[0, 1]), &[1.0; 3]).unwrap_err();
    assert_eq!(pairs, E::Length { field: "y", found: 3, expected: 4 });
    let huge = Measurements::from_pairs(&rows(&[0]), &[f64::MAX, -f64::MAX]).unwrap_err();
    assert_eq!(huge, E::NotFinite { field: "d", index: 0, found: f64::INFINITY });
    let single = Measurements::from_single(&rows(&[0]), &[f64::INFINITY]).unwrap_err();
    assert_eq!(single, E::NotFinite { field: "y", index: 0, found: f64::INFINITY });
}

#[test]
fn a_dark_level_under_single_readings_is_found_and_removed() {
    let side = side(32);
    for kind in 0..3 {
        let scene = scene(side, kind);
        let rows = natural(32);
        // Light of the positive patterns: every other reading of the pairs.
        let light: Vec<f64> = readings(side, &rows, &scene).into_iter().step_by(2).collect();
        let clean = Measurements::from_single(&rows, &light).unwrap();
        let dark = 0.7 * light[0];
        let lifted: Vec<f64> = light.iter().map(|y| y + dark).collect();
        let mut found = Measurements::from_single(&rows, &lifted).unwrap();
        let level = found.remove_dark_level().unwrap();
        assert!((level / dark - 1.0).abs() < 0.01, "scene {kind}: {level} for {dark}");
        // Picoamperes and sums of an ADC have the same level.
        for unit in [1e-12, 1e12] {
            let values: Vec<f64> = lifted.iter().map(|y| y * unit).collect();
            let other = Measurements::from_single(&rows, &values).unwrap().remove_dark_level();
            assert!((other.unwrap() / level / unit - 1.0).abs() < 1e-9, "scene {kind}, {unit}");
        }
        let images = [&clean, &found].map(crate::reconstruct::hadamard);
        assert!(correlation_of(&images[0], &images[1]) > 0.999, "scene {kind}");
    }
}

#[test]
fn a_dark_level_counts_from_four_standard_errors_on() {
    let rows = natural(4);
    let spread = |level: f64, by: f64| {
        let mut values = [0.0; 16];
        for (at, position) in order::positions_by_sequency(&rows).into_iter().enumerate() {
            values[position] = level + if at % 2 == 0 { by } else { -by };
        }
        Measurements::from_differential(&rows, &values).unwrap().remove_dark_level()
    };
    // Of eight values that differ by 0.7, the standard error is 0.25.
    assert_eq!(spread(2.0, 0.0), Some(2.0));
    assert!(spread(1.1, 0.7).is_some_and(|level| (level - 1.1).abs() < 1e-12));
    assert_eq!(spread(0.9, 0.7), None);
}

#[test]
fn where_there_is_no_dark_level_nothing_is_changed() {
    let side = side(32);
    for kind in 0..5 {
        let all = measured(side, &scene(side, kind));
        let mut same = all.clone();
        assert_eq!(same.remove_dark_level(), None, "scene {kind}");
        assert_eq!(same, all);
    }
}

#[test]
fn a_share_keeps_the_first_rows_and_says_how_many() {
    let rows = reversed(4);
    let values: Vec<f64> = rows.iter().map(|&r| r.into()).collect();
    let all = Measurements::from_differential(&rows, &values).unwrap();
    assert_eq!(**all.take(None, 0.3).unwrap().rows(), [15, 14, 13, 12, 11]); // round(4.8)
    assert_eq!(all.take(Some(&Order::Natural), 0.25).unwrap().values(), [0.0, 1.0, 2.0, 3.0]);
    assert_eq!(**all.take(None, 1e-9).unwrap().rows(), [15]);
    assert_eq!(all.take(None, 1.0).unwrap(), all);
    assert_eq!(all.take(None, 0.3).unwrap().into_values(), [15.0, 14.0, 13.0, 12.0, 11.0]);
    let odd = all.subset((0..16).filter(|k| k % 2 == 0));
    assert_eq!(**odd.take(Some(&Order::Natural), 0.125).unwrap().rows(), [1, 3]);
    for found in [0.0, -0.1, 1.01, f64::INFINITY] {
        assert_eq!(all.take(None, found), Err(MeasurementError::Fraction { found }));
    }
    assert!(all.take(None, f64::NAN).is_err());
    assert!(matches!(
        all.take(Some(&Order::Table(vec![0])), 0.5),
        Err(MeasurementError::Rows(RowsError::Length { .. }))
    ));
}

proptest! {
    #[test]
    fn the_count_is_exactly_what_was_asked(fraction in 1e-6..=1.0_f64, seed: u64) {
        let all = Measurements::from_differential(&natural(8), &[0.5; 64]).unwrap();
        let expected = ((64.0 * fraction).round() as usize).max(1);
        for order in [None, Some(Order::Random(seed))] {
            prop_assert_eq!(all.take(order.as_ref(), fraction).unwrap().rows().len(), expected);
        }
    }
}

#[test]
fn a_shorter_sweep_takes_measurements_of_its_own_rows_alone() {
    let of = |rows: &Rows| Measurements::from_differential(rows, &[0.5; 16]).unwrap();
    let whole = ShorterSweep::new(&natural(4), None, 1.0).unwrap();
    assert_eq!(whole.shorten(of(&natural(4))), of(&natural(4)));
    let other = std::panic::catch_unwind(|| whole.shorten(of(&reversed(4))));
    assert!(other.is_err());
}
