use crate::law::Reading;
use crate::testing::{Noise, array, correlation_of, readings, real_data, scene, side};
use crate::{Measurements, Rows, reconstruct};
use proptest::prelude::*;

/// Raw readings of a scene with a dark level, a drifting lamp and noise.
fn recorded(n: u64, kind: u8, dark: f64, noise: Noise) -> (Rows, Vec<f64>) {
    let rows = Rows::natural(side(n));
    let mut y = readings(side(n), &rows, &scene(side(n), kind));
    let total = y[0];
    let count = y.len() as f64;
    for (i, y) in y.iter_mut().enumerate() {
        let lamp = 1.0 - 0.2 * (i as f64 / count);
        *y = noise.of(*y * lamp / total, i as u64) + dark;
    }
    (rows, y)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn nothing_is_called_a_dropout_in_a_whole_recording(
        kind in 0_u8..5, dark in 0.0..0.5, seed: u64, sigma in 0.0..0.3
    ) {
        let (rows, y) = recorded(32, kind, dark, Noise::Normal { sigma, seed });
        let Reading { measurements: measured, dropouts, .. } = Measurements::from_pairs(&rows, &y).unwrap();
        prop_assert_eq!(dropouts, vec![]);
        prop_assert_eq!(measured.rows().len(), rows.len());
    }

    #[test]
    fn photons_arriving_one_by_one_are_no_dropouts(
        kind in 0_u8..5, photons in 0.2..200.0, seed: u64
    ) {
        let (rows, y) = recorded(32, kind, 0.0, Noise::Poisson { photons, seed });
        let Reading { dropouts, .. } = Measurements::from_pairs(&rows, &y).unwrap();
        prop_assert_eq!(dropouts, vec![]);
    }

    #[test]
    fn a_run_is_found_where_it_is_and_the_image_survives(
        kind in 0_u8..3,
        dark in 0.0..0.3,
        length in prop_oneof![1_usize..6, 6_usize..=200],
        place in prop_oneof![Just(0.0), Just(1.0), 0.0..1.0],
        to_zero: bool,
        partial in 0.05..0.95,
        seed: u64,
    ) {
        let (rows, whole) = recorded(32, kind, dark, Noise::Normal { sigma: 1e-4, seed });
        // The first pair is the all-ones pattern: a lost reading of its dark complement cannot be
        // found.
        let start = 2 + (place * (whole.len() - 2 - length) as f64) as usize;
        let mut y = whole.clone();
        let floor = if to_zero { 0.0 } else { dark };
        y[start..start + length].fill(floor);
        // The readings next to the run are down by part of their integration time.
        let (mut first, mut end) = (start, start + length);
        if start > 2 {
            first -= 1;
            y[first] = floor + (whole[first] - floor) * partial;
        }
        if end < y.len() {
            y[end] = floor + (whole[end] - floor) * partial;
            end += 1;
        }
        let Reading { measurements: measured, dropouts, .. } = Measurements::from_pairs(&rows, &y).unwrap();
        prop_assert_eq!(dropouts.len(), 1);
        let found = &dropouts[0];
        prop_assert!(found.start <= start && found.start + found.length >= start + length, "{:?}", found);
        prop_assert!(found.start + 2 >= first && found.start + found.length <= end + 2, "{:?}", found);
        for row in &found.rows {
            prop_assert!(!measured.rows().contains(row));
        }
        let Reading { measurements: full, .. } = Measurements::from_pairs(&rows, &whole).unwrap();
        let kept = Measurements::from_differential(
            measured.rows(),
            &measured.rows().iter().map(|&r| full.values()[r as usize]).collect::<Vec<_>>(),
        ).unwrap();
        // The remaining measurements are as without the drop-out, except for readings into which a
        // fraction of the run leaked.
        let worst = measured.values().iter().zip(kept.values()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        prop_assert!(worst < 0.02, "{}", worst);
        let (a, b) = (reconstruct::hadamard(&measured), reconstruct::hadamard(&kept));
        prop_assert!(correlation_of(&a, &b) > 0.99);
    }
}

#[test]
fn short_runs_hardly_change_the_image() {
    let (rows, whole) = recorded(32, 1, 0.1, Noise::Normal { sigma: 1e-4, seed: 1 });
    let Reading { measurements: full, .. } = Measurements::from_pairs(&rows, &whole).unwrap();
    for start in [301, 700, 1501, 2020] {
        let mut y = whole.clone();
        y[start..start + 20].fill(0.0);
        let Reading { measurements: measured, dropouts, .. } =
            Measurements::from_pairs(&rows, &y).unwrap();
        assert_eq!((dropouts[0].start, dropouts[0].length), (start, 20));
        let (a, b) = (reconstruct::hadamard(&measured), reconstruct::hadamard(&full));
        assert!(correlation_of(&a, &b) > 0.99, "run at {start}: {}", correlation_of(&a, &b));
        // The same run, if left in, stripes the image where it cuts a pair in two; a whole lost
        // pair becomes a zero.
        let d: Vec<f64> = y.as_chunks::<2>().0.iter().map(|[p, m]| p - m).collect();
        let striped = Measurements::from_differential(&rows, &d).unwrap();
        let striped = correlation_of(&reconstruct::hadamard(&striped), &b);
        assert!(
            start % 2 == 0 || striped < correlation_of(&a, &b) - 0.01,
            "run at {start}: {striped}"
        );
    }
}

#[test]
fn two_runs_are_two_and_a_dimming_lamp_is_none() {
    let (rows, mut y) = recorded(16, 0, 0.0, Noise::Normal { sigma: 1e-3, seed: 5 });
    y[100..120].iter_mut().for_each(|y| *y *= 0.7);
    let Reading { dropouts: none, .. } = Measurements::from_pairs(&rows, &y).unwrap();
    assert_eq!(none, vec![]);
    // A converter may write a word of its own for no reading.
    for value in [0.0, -999.0] {
        y[31..36].fill(value);
        y[400] = value;
        let Reading { dropouts: two, .. } = Measurements::from_pairs(&rows, &y).unwrap();
        let found: Vec<_> = two.iter().map(|d| (d.start, d.length, d.rows.clone())).collect();
        assert_eq!(found, [(31, 5, vec![15, 16, 17]), (400, 1, vec![200])], "{value}");
    }
}

#[test]
fn a_detector_of_negative_polarity_is_the_same_upside_down() {
    let (rows, mut y) = recorded(16, 0, 0.0, Noise::Normal { sigma: 1e-3, seed: 5 });
    y[60..70].fill(0.0);
    y.iter_mut().for_each(|y| *y = -*y);
    let Reading { dropouts, .. } = Measurements::from_pairs(&rows, &y).unwrap();
    assert_eq!((dropouts[0].start, dropouts[0].length), (60, 10));
}

/// Start and length of each drop-out.
fn runs(rows: &Rows, y: &[f64]) -> Vec<(usize, usize)> {
    let Reading { dropouts, .. } = Measurements::from_pairs(rows, y).unwrap();
    dropouts.iter().map(|found| (found.start, found.length)).collect()
}

#[test]
fn a_run_is_found_in_any_unit_and_under_any_ambient_light() {
    for dark in [0.0, 30.0] {
        let (all, whole) = recorded(32, 0, dark, Noise::Normal { sigma: 1e-4, seed: 2 });
        let mut y = whole.clone();
        y[600..800].fill(dark);
        let mut dimmed = whole;
        dimmed[600..620].iter_mut().for_each(|y| *y = dark + 0.7 * (*y - dark));
        // The second recording lacks the all-ones pattern, whose complement shows the dark level.
        for (unit, first) in [(1e-4, 0), (1.0, 0), (1e5, 0), (1e-4, 1), (1e5, 1)] {
            let rows = Rows::new(side(32), all[first..].iter().copied()).unwrap();
            let counted =
                |y: &[f64]| -> Vec<f64> { y[2 * first..].iter().map(|y| y * unit).collect() };
            let case = format!("dark {dark}, unit {unit}, from pair {first}");
            assert_eq!(runs(&rows, &counted(&y)), [(600 - 2 * first, 200)], "{case}");
            assert!(first == 1 || runs(&rows, &counted(&dimmed)).is_empty(), "{case}");
        }
    }
}

#[test]
fn a_run_may_begin_with_the_first_reading_and_end_with_the_last() {
    let (rows, whole) = recorded(16, 0, 0.0, Noise::Normal { sigma: 1e-3, seed: 5 });
    let mut y = whole.clone();
    y[..20].fill(0.0);
    y[500..].fill(0.0);
    assert_eq!(runs(&rows, &y), [(0, 20), (500, 12)]);
}

#[test]
fn a_lamp_that_changes_makes_no_run_longer() {
    let sinks_at_the_end = |k: f64| 1.0 - 0.3 * (k - 1648.0).max(0.0) / 400.0;
    let grows_and_sinks = |k: f64| 0.4 + 0.6 * (std::f64::consts::PI * k / 2048.0).sin();
    for lamp in [sinks_at_the_end, grows_and_sinks] {
        let (rows, mut y) = recorded(32, 0, 0.0, Noise::Normal { sigma: 1e-5, seed: 3 });
        y.iter_mut().enumerate().for_each(|(k, reading)| *reading *= lamp(k as f64));
        y[1900..1910].fill(0.0);
        assert_eq!(runs(&rows, &y), [(1900, 10)]);
    }
}

#[test]
fn a_run_is_found_under_noise_and_at_a_level_below_zero() {
    let (rows, mut y) = recorded(32, 0, 0.0, Noise::Normal { sigma: 0.05, seed: 4 });
    y[700..720].fill(-0.1);
    let found = runs(&rows, &y);
    assert!(matches!(found[..], [(699..=701, 19..=22)]), "{found:?}");
}

#[test]
fn runs_cut_into_the_real_recording_are_found() {
    let Some(mut file) = real_data("opar_ala1.npz") else { return };
    let rows = Rows::new(side(64), array::<i32>(&mut file, "h_row")).unwrap();
    let whole: Vec<f64> = array::<f32>(&mut file, "y").into_iter().map(f64::from).collect();
    let Reading { measurements: full, dropouts: none, .. } =
        Measurements::from_pairs(&rows, &whole).unwrap();
    assert_eq!(none, vec![]);
    for length in [1, 2, 3, 7, 20, 101, 200] {
        for start in [2, 5, 900, 3333, 7000, whole.len() - length] {
            let mut y = whole.clone();
            y[start..start + length].fill(0.0);
            let Reading { measurements: measured, dropouts, .. } =
                Measurements::from_pairs(&rows, &y).unwrap();
            let found: Vec<_> = dropouts.iter().map(|d| (d.start, d.length)).collect();
            assert_eq!(found, [(start, length)]);
            let alike =
                correlation_of(&reconstruct::hadamard(&measured), &reconstruct::hadamard(&full));
            // Lost measurements stay lost: this order shows the coarsest patterns first, and a
            // hundred of the next patterns have more than a hundredth of the energy.
            let least = if length > 101 { 0.98 } else { 0.99 };
            assert!(alike > least || start < 200, "{length} from {start}: {alike}");
        }
    }
}
