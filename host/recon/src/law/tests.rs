use super::*;
use crate::law::repeats::averaged;
use crate::testing::{Noise, array, correlation_of, numbers, readings, real_data, scene, side};
use crate::{Order, reconstruct};
use proptest::prelude::*;

/// Raw readings of a scene: a lamp that drifts, a dark level, noise; in units of the all-on reading.
fn recorded(rows: &Rows, kind: u8, drift: f64, dark: f64, noise: Noise) -> Vec<f64> {
    let mut y = readings(rows.side(), rows, &scene(rows.side(), kind));
    let total = scene(rows.side(), kind).iter().sum::<f64>();
    let count = y.len() as f64;
    for (i, y) in y.iter_mut().enumerate() {
        let lamp = 1.0 + drift * (i as f64 / count);
        *y = noise.of(*y * lamp / total, i as u64) + dark;
    }
    y
}

const QUIET: Noise = Noise::Normal { sigma: 1e-4, seed: 3 };

fn quiet(rows: &Rows, kind: u8) -> Vec<f64> {
    recorded(rows, kind, -0.1, 0.01, QUIET)
}

fn shown(order: &Order, n: u64) -> Rows {
    order.rows(side(n)).unwrap()
}

fn claim(form: Form) -> Claim {
    Claim { side_guessed: true, ..form.into() }
}

/// The readings in each form that they can have.
fn in_every_form(y: &[f64]) -> [(Form, Vec<f64>); 4] {
    let (plus, minus): (Vec<f64>, Vec<f64>) =
        y.as_chunks::<2>().0.iter().map(|p| (p[0], p[1])).unzip();
    let differences = plus.iter().zip(&minus).map(|(p, m)| p - m).collect();
    [
        (Form::Pairs, y.to_vec()),
        // The reader has put each pattern beside its complement.
        (Form::Halves, y.to_vec()),
        (Form::Single, plus),
        (Form::Differences, differences),
    ]
}

/// All that may be said about right readings is that they have a dark level.
fn is_silent(rows: &Rows, y: &[f64], claim: Claim) -> Result<(), String> {
    let found = read(rows, y, claim).unwrap();
    match (&found.outliers[..], &found.doubts[..], &found.dropouts[..]) {
        ([], [], []) if found.measurements.rows().len() == rows.len() => Ok(()),
        _ => Err(format!("{:?} {:?} {:?}", found.outliers, found.doubts, found.dropouts)),
    }
}

mod right {
    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, max_shrink_iters: 50, ..ProptestConfig::default() })]

        #[test]
        fn readings_of_every_form_order_and_share_are_not_doubted(
            kind in 0_u8..5,
            order in prop::sample::select(vec![
                Order::Natural, Order::ZigZag, Order::Random(4), Order::Sequency, Order::Walsh2d,
            ]),
            share in prop_oneof![Just(1.0), 0.05..1.0],
            drift in -0.3..0.3,
            dark in prop_oneof![Just(0.0), 0.0..2.0],
            noise in prop_oneof![
                (Just(0.0), any::<u64>()).prop_map(|(sigma, seed)| Noise::Normal { sigma, seed }),
                (1e-4..0.3, any::<u64>()).prop_map(|(sigma, seed)| Noise::Normal { sigma, seed }),
                (0.2..300.0, any::<u64>()).prop_map(|(photons, seed)| Noise::Poisson { photons, seed }),
            ],
        ) {
            let rows = shown(&order, 32);
            let rows = rows.first(((share * 1024.0) as usize).max(1));
            // Noise of single photons has its own unit: the dark level is a part of the all-on reading.
            let unit = match noise { Noise::Poisson { photons, .. } => photons, Noise::Normal { .. } => 1.0 };
            let y = recorded(&rows, kind, drift, dark * unit, noise);
            for (form, y) in in_every_form(&y) {
                let claim = Claim { side_guessed: share == 1.0, ..form.into() };
                let said = is_silent(&rows, &y, claim);
                prop_assert!(said.is_ok(), "{form:?}: {said:?}");
            }
        }

        #[test]
        fn a_sweep_without_the_all_on_pattern_is_not_doubted(
            kind in 0_u8..5, first in 1_usize..40, sigma in prop_oneof![Just(0.0), 0.0..0.3], seed: u64
        ) {
            let all = shown(&Order::ZigZag, 32);
            let rows = Rows::new(side(32), all[first..].iter().copied()).unwrap();
            let y = recorded(&rows, kind, 0.2, 0.1, Noise::Normal { sigma, seed });
            for (form, y) in in_every_form(&y) {
                let said = is_silent(&rows, &y, form.into());
                prop_assert!(said.is_ok(), "{form:?}: {said:?}");
            }
        }
    }

    /// An even scene without noise has differences that differ by rounding alone.
    #[test]
    fn rounding_is_not_taken_for_several_samples() {
        let rows = shown(&Order::Natural, 32);
        for step in 0..1500 {
            let drift = f64::from(step) * 4e-4 - 0.3;
            let y = recorded(&rows, 4, drift, 0.0, Noise::Normal { sigma: 0.0, seed: 1 });
            let [_, _, _, (form, d)] = in_every_form(&y);
            assert_eq!(form, Form::Differences);
            let said = is_silent(&rows, &d, claim(form));
            assert!(said.is_ok(), "{drift}: {said:?}");
        }
    }

    #[test]
    fn light_that_flickers_or_steps_is_not_doubted() {
        let rows = shown(&Order::Natural, 32);
        type Change = (&'static str, fn(f64) -> f64);
        let changes: [Change; 5] = [
            ("5 % at 100 Hz", |k| 1.0 + 0.05 * (k * 0.31).sin()),
            ("10 % mains", |k| 1.0 + 0.1 * (k * 0.013).sin()),
            ("step up", |k| if k < 700.0 { 1.0 } else { 1.3 }),
            ("step down", |k| if k < 701.0 { 1.0 } else { 0.7 }),
            ("warming up", |k| 1.0 - 0.05 * (-k / 300.0).exp()),
        ];
        for kind in 0..5 {
            for (name, lamp) in changes {
                // Half of the readings of a point are dark, and a step of the lamp beside them looks like a
                // drop-out.
                if kind == 3 && name.starts_with("step") {
                    continue;
                }
                let mut y = recorded(&rows, kind, 0.0, 0.02, QUIET);
                y.iter_mut().enumerate().for_each(|(k, y)| *y *= lamp(k as f64));
                for (form, y) in in_every_form(&y) {
                    if form == Form::Single {
                        // A single reading does not know the lamp.
                        continue;
                    }
                    let said = is_silent(&rows, &y, form.into());
                    assert!(said.is_ok(), "{name}, scene {kind}, {form:?}: {said:?}");
                }
            }
        }
    }

    /// Photon counts of a mirror array that collects twice the light of coarse patterns, the differences of
    /// a car, and the wing.
    #[test]
    fn real_recordings_are_not_doubted() {
        for name in ["photon_40ms.npy", "photon_80ms.npy"] {
            let Some(y) = photons(name) else { return };
            let rows = shown(&Order::Natural, 32);
            for (form, y) in in_every_form(&y) {
                // The two exposures have a lamp that changes: only pairs know that.
                let said = is_silent(&rows, &y, claim(form));
                assert!(said.is_ok(), "{name}, {form:?}: {said:?}");
            }
        }
        let Some(mut car) = real_data("scheidt_car.npz") else { return };
        let rows = Rows::new(side(32), array::<i32>(&mut car, "h_row")).unwrap();
        let d: Vec<f64> = array::<i32>(&mut car, "d").into_iter().map(f64::from).collect();
        for (detector, d) in d.chunks_exact(1024).enumerate() {
            let said = is_silent(&rows, d, claim(Form::Differences));
            assert!(said.is_ok(), "detector {detector}: {said:?}");
        }
        let Some(mut wing) = real_data("opar_ala1.npz") else { return };
        let rows = Rows::new(side(64), array::<i32>(&mut wing, "h_row")).unwrap();
        let y: Vec<f64> = array::<f32>(&mut wing, "y").into_iter().map(f64::from).collect();
        for (form, y) in in_every_form(&y) {
            let said = is_silent(&rows, &y, claim(form));
            assert!(said.is_ok(), "wing, {form:?}: {said:?}");
        }
    }
}

/// Differences of a scene under a lamp that changes, by their sums or as they are, and how far they are from those of a
/// steady lamp: root of the mean square, without the all-on pattern.
fn under_a_lamp(lamp: fn(f64) -> f64, ambient: f64, sigma: f64) -> (Lamp, f64, f64) {
    let rows = shown(&Order::ZigZag, 32);
    let steady = recorded(&rows, 1, 0.0, 0.0, Noise::Normal { sigma: 0.0, seed: 1 });
    let noisy = recorded(&rows, 1, 0.0, 0.0, Noise::Normal { sigma, seed: 1 });
    let y: Vec<f64> = (0..noisy.len())
        .map(|k| steady[k] * lamp((k / 2) as f64) + ambient + noisy[k] - steady[k])
        .collect();
    let of = |divide_by_lamp| {
        let read = read(&rows, &y, Claim { divide_by_lamp, ..Form::Pairs.into() }).unwrap();
        // The unit of divided differences is the lamp's median.
        let truth = Measurements::from_pairs(&rows, &steady).unwrap().measurements;
        let (found, truth) = (&read.measurements.values()[1..], &truth.values()[1..]);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let scale = dot(found, truth) / dot(truth, truth);
        let off: f64 = found.iter().zip(truth).map(|(f, t)| (f - scale * t).powi(2)).sum();
        (read.lamp.unwrap(), (off / truth.len() as f64).sqrt())
    };
    let ((lamp, as_it_is), (same, divided)) = (of(false), of(true));
    assert_eq!(lamp, same, "of the readings as they came");
    (lamp, as_it_is, divided)
}

#[test]
fn a_lamp_that_drifts_is_told_where_it_limits_and_sums_correct_it() {
    let steady = |_| 1.0;
    let (lamp, as_it_is, divided) = under_a_lamp(steady, 0.0, 1e-3);
    assert!(!lamp.limits && lamp.drift < 0.01 && lamp.spread > 0.0, "{lamp:?}");
    assert!(divided < 1.1 * as_it_is, "{divided} {as_it_is}");
    let drifts = |k: f64| 1.0 + 0.3 * k / 1023.0;
    let (lamp, as_it_is, divided) = under_a_lamp(drifts, 0.0, 1e-4);
    assert!(lamp.limits && (lamp.drift - 0.3 / 1.15).abs() < 0.02, "{lamp:?}");
    assert!(divided < 0.2 * as_it_is, "{divided} {as_it_is}");
    // Steps are a drift, and no noise.
    let steps = |k: f64| if ((k / 150.0) as u32).is_multiple_of(2) { 1.0 } else { 0.7 };
    let (lamp, as_it_is, divided) = under_a_lamp(steps, 0.0, 1e-4);
    assert!(lamp.limits && lamp.drift > 0.3 && lamp.spread < 0.001, "{lamp:?}");
    assert!(divided < 0.2 * as_it_is, "{divided} {as_it_is}");
    // Flicker from pair to pair is no drift, and the sums correct it, too.
    let flickers = |k: f64| 1.0 + 0.05 * (k * 2.1).sin();
    let (lamp, as_it_is, divided) = under_a_lamp(flickers, 0.0, 1e-4);
    assert!(!lamp.limits && (lamp.spread - 0.05 / 2_f64.sqrt()).abs() < 0.01, "{lamp:?}");
    assert!(divided < 0.2 * as_it_is, "{divided} {as_it_is}");
    // Ambient light is in each sum, and leaves a part of the drift.
    let (_, as_it_is, divided) = under_a_lamp(drifts, 3.0, 1e-4);
    assert!(divided > 0.2 * as_it_is, "{divided} {as_it_is}");
    // Noise hides the drift.
    let (lamp, _, _) = under_a_lamp(drifts, 0.0, 0.02);
    assert!(!lamp.limits, "{lamp:?}");
}

/// Real photon counts, pattern and complement, natural order, 32 x 32.
fn photons(name: &str) -> Option<Vec<f64>> {
    let folder = std::env::var_os("NIRSPI_DATA").map(std::path::PathBuf::from)?;
    let bytes = std::fs::read(folder.join("spi").join(name)).ok()?;
    Some(numbers(&bytes))
}

/// Recordings of which the all-on pattern comes first, with their names.
fn recordings() -> Vec<(String, Rows, Vec<f64>)> {
    let mut all = Vec::new();
    for (order, n) in
        [(Order::Natural, 16), (Order::ZigZag, 32), (Order::Random(1), 32), (Order::Walsh2d, 16)]
    {
        for kind in 0..3 {
            let rows = shown(&order, n);
            let y = quiet(&rows, kind);
            all.push((format!("{order}, {n} px, scene {kind}"), rows, y));
            let rows = shown(&order, n);
            let noise = Noise::Normal { sigma: 0.005, seed: 8 };
            let y = recorded(&rows, kind, 0.1, 0.0, noise);
            all.push((format!("{order}, {n} px, scene {kind}, noise"), rows, y));
        }
    }
    for name in ["photon_40ms.npy", "photon_80ms.npy"] {
        all.extend(photons(name).map(|y| (name.to_owned(), shown(&Order::Natural, 32), y)));
    }
    if let Some(mut wing) = real_data("opar_ala1.npz") {
        let rows = Rows::new(side(64), array::<i32>(&mut wing, "h_row")).unwrap();
        let y = array::<f32>(&mut wing, "y").into_iter().map(f64::from).collect();
        all.push(("wing".to_owned(), rows, y));
    }
    all
}

fn explanation(rows: &Rows, y: &[f64], claim: Claim) -> Option<Explanation> {
    let found = read(rows, y, claim).unwrap();
    // What is wrong with all readings is no reason to leave some out.
    let of = |doubt: &Doubt| match *doubt {
        Doubt::Form { explanation, .. } | Doubt::Repeated { explanation, .. } => Some(explanation),
        _ => None,
    };
    let explanation = found.doubts.iter().find_map(of);
    if explanation.is_some() {
        assert_eq!((found.outliers, found.dropouts), (vec![], vec![]));
    }
    explanation
}

#[test]
fn readings_of_another_form_are_named_by_it() {
    for (name, rows, y) in recordings() {
        let count = rows.len();
        let said = |y: &[f64], form: Form, expected: Explanation| {
            let found = explanation(&rows, y, form.into());
            assert_eq!(found, Some(expected), "{name}");
        };
        let half = |reading: usize| y.iter().skip(reading).step_by(2).copied();
        let halves: Vec<f64> = half(0).chain(half(1)).collect();
        said(&halves, Form::Pairs, Explanation::Form(Form::Halves));
        // The reader has taken the first half of the pairs for patterns.
        let split: Vec<f64> = (0..count).flat_map(|k| [y[k], y[count + k]]).collect();
        said(&split, Form::Halves, Explanation::Form(Form::Pairs));
        let swapped: Vec<f64> = y.as_chunks::<2>().0.iter().flat_map(|[p, m]| [*m, *p]).collect();
        said(&swapped, Form::Pairs, Explanation::ComplementsFirst(Form::Pairs));
        let inverted: Vec<f64> = y.iter().map(|y| 0.002 - y).collect();
        let found = explanation(&rows, &inverted, Form::Pairs.into());
        let sign = [Explanation::Inverted, Explanation::ComplementsFirst(Form::Pairs)];
        assert!(found.is_some_and(|found| sign.contains(&found)), "{name}: {found:?}");
        let early: Vec<f64> = y[1..].iter().chain(&y[..1]).copied().collect();
        said(&early, Form::Pairs, Explanation::OneEarly);
        let late: Vec<f64> = y[..1].iter().chain(&y[..y.len() - 1]).copied().collect();
        said(&late, Form::Pairs, Explanation::OneLate);
    }
}

/// A pattern that was not read leaves a gap in its recording, and the form of the other readings is seen all the same.
#[test]
fn patterns_that_were_not_read_hide_no_form() {
    for (name, rows, y) in recordings() {
        let count = rows.len();
        let half = |reading: usize| y.iter().skip(reading).step_by(2).copied();
        let halves: Vec<f64> = half(0).chain(half(1)).collect();
        let split: Vec<f64> = (0..count).flat_map(|k| [y[k], y[count + k]]).collect();
        let early: Vec<f64> = y[1..].iter().chain(&y[..1]).copied().collect();
        let patterns: Vec<f64> = half(0).collect();
        let samples = |y: &[f64]| y.iter().flat_map(|&y| [y; 4]).collect::<Vec<f64>>();
        let named = |form| Explanation::Form(form);
        let larger = Rows::natural(side(2 * rows.side().pixels() as u64));
        let mut cases = vec![
            (&rows, Form::Pairs, halves, named(Form::Halves), false),
            (&rows, Form::Halves, split, named(Form::Pairs), false),
            (&rows, Form::Pairs, early, Explanation::OneEarly, false),
        ];
        if rows.side().pixels() == 16 && !name.contains("scene 2") && !name.contains("noise") {
            let (each, count) = (4, 4);
            cases.extend([
                (&larger, Form::Pairs, samples(&y), Explanation::Samples { each }, true),
                (&larger, Form::Pairs, y.repeat(4), Explanation::Sweeps { count }, true),
                (&larger, Form::Single, samples(&patterns), Explanation::Samples { each }, true),
                (&larger, Form::Single, patterns.repeat(4), Explanation::Sweeps { count }, true),
            ]);
        }
        for (rows, form, y, expected, side_guessed) in cases {
            for gap in [rows.len() / 3, rows.len() - 1, 101] {
                let is_read = |k: &usize| *k == 0 || !k.is_multiple_of(gap);
                let read: Vec<usize> = (0..rows.len()).filter(is_read).collect();
                let some: Vec<u32> = read.iter().map(|&k| rows[k]).collect();
                let some = Rows::new(rows.side(), some).unwrap();
                let each = form.readings();
                let y: Vec<f64> =
                    read.iter().flat_map(|k| &y[k * each..(k + 1) * each]).copied().collect();
                let places = Places { read: &read, patterns: rows.len() };
                let claim = Claim { side_guessed, ..form.into() };
                let found = read_at(&some, &y, claim, Some(places)).unwrap();
                let explanation = found.doubts.iter().find_map(|doubt| match *doubt {
                    Doubt::Form { explanation, .. } | Doubt::Repeated { explanation, .. } => {
                        Some(explanation)
                    }
                    _ => None,
                });
                assert_eq!(explanation, Some(expected), "{name}, {form:?}, each {gap}th lost");
            }
        }
    }
}

#[test]
fn readings_of_another_sign_are_named_in_every_form() {
    for (name, rows, y) in recordings() {
        for (form, y) in in_every_form(&y) {
            let inverted: Vec<f64> = y.iter().map(|y| -y).collect();
            let found = explanation(&rows, &inverted, form.into());
            let sign = [Explanation::Inverted, Explanation::ComplementsFirst(form)];
            assert!(
                found.is_some_and(|found| sign.contains(&found)),
                "{name}, {form:?}: {found:?}"
            );
        }
    }
}

#[test]
fn several_samples_and_several_sweeps_are_counted() {
    // The Walsh functions of a letter repeat each other, as samples do.
    let small = |(name, rows, _): &(String, Rows, Vec<f64>)| {
        rows.side().pixels() == 16 && !name.contains("scene 2")
    };
    for (name, _, y) in recordings().into_iter().filter(small) {
        for times in [4_usize, 16] {
            let larger = Rows::natural(side(16 * times.isqrt() as u64));
            for (form, y) in in_every_form(&y) {
                if form == Form::Halves {
                    continue;
                }
                let wobble = |k: usize| 1.0 + 1e-4 * (k as f64 * 1.7).sin();
                let samples: Vec<f64> =
                    (0..times * y.len()).map(|k| y[k / times] * wobble(k)).collect();
                let found = explanation(&larger, &samples, claim(form));
                assert_eq!(found, Some(Explanation::Samples { each: times }), "{name}, {form:?}");
                let sweeps: Vec<f64> =
                    (0..times * y.len()).map(|k| y[k % y.len()] * wobble(k)).collect();
                let found = explanation(&larger, &sweeps, claim(form));
                assert_eq!(found, Some(Explanation::Sweeps { count: times }), "{name}, {form:?}");
                if form == Form::Pairs {
                    let shown = |k: usize| y[2 * (k / 2 / times) + k % 2] * wobble(k);
                    let pairs: Vec<f64> = (0..times * y.len()).map(shown).collect();
                    for form in [Form::Pairs, Form::Halves] {
                        let found = explanation(&larger, &pairs, claim(form));
                        let each = Some(Explanation::Repeats { each: times });
                        assert_eq!(found, each, "{name}, {form:?}");
                        let found = explanation(&larger, &pairs, form.into());
                        assert!(!matches!(found, Some(Explanation::Repeats { .. })), "{name}");
                    }
                }
                // Who says the side has one sweep.
                let found = explanation(&larger, &sweeps, form.into());
                assert!(!matches!(found, Some(Explanation::Sweeps { .. })), "{name}: {found:?}");
            }
        }
    }
    assert_eq!(averaged(&[1.0, 3.0, 5.0, 5.0], 2), [2.0, 5.0]);
}

#[test]
fn patterns_of_another_order_are_named_by_their_all_on_pattern() {
    let rows = Rows::natural(side(16));
    let mut moved: Vec<u32> = rows.to_vec();
    moved.swap(0, 37);
    let y = quiet(&Rows::new(side(16), moved).unwrap(), 1);
    for (form, y) in in_every_form(&y) {
        if form != Form::Single {
            let found = explanation(&rows, &y, form.into());
            assert_eq!(found, Some(Explanation::Order { all_on: 37 }), "{form:?}");
        }
    }
    // The recording starts in the middle of a sweep, with a complement.
    let y = quiet(&rows, 1);
    let rotated = [&y[101..], &y[..101]].concat();
    let found = explanation(&rows, &rotated, Form::Pairs.into());
    assert_eq!(found, Some(Explanation::Unknown));
}

/// Images with and without the pattern of a wild reading are alike, and the reading is named.
#[test]
fn one_wild_reading_costs_one_pattern() {
    for (name, rows, y) in recordings() {
        let whole = Measurements::from_pairs(&rows, &y).unwrap().measurements;
        let floor = 0.05 * y[0];
        for factor in [3.0, 8.0, 1e3, 1e30] {
            for at in (0..y.len()).step_by(1 + y.len() / 7).chain([0, 1, y.len() - 1]) {
                let mut wild = y.clone();
                wild[at] *= factor;
                let found = Measurements::from_pairs(&rows, &wild).unwrap();
                let case = format!(
                    "{name}, reading {at} times {factor}: {:?} {:?}",
                    found.outliers, found.doubts
                );
                let without = whole.subset((0..rows.len()).filter(|k| *k != at / 2));
                assert!(found.measurements.values().iter().all(|v| v.abs() < 1e9), "{case}");
                let images = [&found.measurements, &without].map(reconstruct::hadamard);
                let alike = correlation_of(&images[0], &images[1]);
                assert!(alike > 0.99, "{case}: {alike}");
                assert_eq!(found.doubts, vec![], "{case}");
                // A dark reading times three may still be a dark reading.
                if wild[at] - y[at] > floor {
                    let places: Vec<usize> = found.outliers.iter().map(|o| o.reading / 2).collect();
                    assert_eq!(places, [at / 2], "{case}");
                    assert_eq!(found.measurements.rows().len(), rows.len() - 1, "{case}");
                }
            }
        }
    }
}

#[test]
fn a_wild_single_reading_or_difference_is_left_out_where_light_cannot_give_it() {
    for (name, rows, y) in recordings() {
        for (form, y) in in_every_form(&y).into_iter().skip(2) {
            for at in (1..y.len()).step_by(1 + y.len() / 7) {
                let mut wild = y.clone();
                wild[at] = 4.0 * y[0];
                let found = read(&rows, &wild, form.into()).unwrap();
                let places: Vec<usize> = found.outliers.iter().map(|o| o.reading).collect();
                assert_eq!(places, [at], "{name}, {form:?}: {:?}", found.doubts);
                assert_eq!(found.outliers[0].row, rows[at]);
                assert_eq!(found.outliers[0].value, wild[at]);
            }
        }
    }
}

#[test]
fn saturation_is_named_for_what_it_is() {
    let rows = Rows::natural(side(16));
    let y = quiet(&rows, 1);
    let image = reconstruct::hadamard(&Measurements::from_pairs(&rows, &y).unwrap().measurements);
    // The converter's end is between the all-on reading and all others.
    let others = y[1..].iter().copied().fold(0.0, f64::max);
    let end = 0.5 * (others + y[0]).min(1.9 * others);
    let cut: Vec<f64> = y.iter().map(|y| y.min(end)).collect();
    let found = Measurements::from_pairs(&rows, &cut).unwrap();
    assert_eq!((found.dropouts.len(), found.outliers.len()), (0, 0));
    let [Doubt::Saturated { found: told, expected }] = found.doubts[..] else {
        panic!("{:?}", found.doubts)
    };
    assert!(told == end && (expected / y[0] - 1.0).abs() < 0.01, "{:?}", found.doubts);
    let repaired = reconstruct::hadamard(&found.measurements);
    let mean = |image: &crate::Image| image.pixels().iter().sum::<f32>();
    assert!((mean(&repaired) / mean(&image) - 1.0).abs() < 0.01);
    // Nearly all readings are clipped, and no drop-out is among them.
    for share in [0.3, 0.45, 0.6] {
        let end = share * y[0];
        let clipped: Vec<f64> = y.iter().map(|y| y.min(end)).collect();
        let equal = clipped.iter().filter(|y| **y == end).count();
        let found = Measurements::from_pairs(&rows, &clipped).unwrap();
        if equal < 6 {
            continue;
        }
        assert!(found.dropouts.is_empty(), "{share}: {:?}", found.dropouts);
        let expected =
            Doubt::Clipped { readings: 512, equal, value: end, extreme: Extreme::Greatest };
        assert_eq!(found.doubts, [expected], "{share}");
    }
    // An offset that takes dark readings below the converter's range.
    let cut: Vec<f64> = y.iter().map(|v| (v - 0.45 * y[0]).max(0.0)).collect();
    let equal = cut.iter().filter(|y| **y == 0.0).count();
    let found = Measurements::from_pairs(&rows, &cut).unwrap();
    let expected = Doubt::Clipped { readings: 512, equal, value: 0.0, extreme: Extreme::Least };
    assert_eq!((found.dropouts.len(), &found.doubts[..]), (0, &[expected][..]), "{equal}");
}

#[test]
fn all_readings_alike_are_no_picture() {
    let rows = Rows::natural(side(4));
    for value in [4095.0, 0.0] {
        for (form, y) in in_every_form(&[value; 32]) {
            let found = read(&rows, &y, form.into()).unwrap();
            match form {
                // Pairs without a difference are a dark scene.
                Form::Differences => assert_eq!(found.doubts, []),
                _ => assert_eq!(found.doubts, [Doubt::AllEqual { readings: y.len(), value }]),
            }
            assert_eq!(found.measurements.rows().len(), 16);
        }
    }
}

/// Readings of 0/1 patterns that light the -1: the least one is 0, and what the values have in common is
/// no dark level.
#[test]
fn what_is_no_dark_level_is_not_removed() {
    let rows = Rows::natural(side(16));
    for kind in 0..3 {
        let y = recorded(&rows, kind, 0.0, 0.0, QUIET);
        let dark: Vec<f64> = y.iter().skip(1).step_by(2).copied().collect();
        let found = read(&rows, &dark, Form::Single.into()).unwrap();
        assert_eq!(found.dark_level, None);
        let broken = Broken { readings: 256, above: 255, below: 0 };
        let explanation = Explanation::Inverted;
        assert_eq!(found.doubts, [Doubt::Form { claimed: Form::Single, broken, explanation }]);
        // With the other sign they are a measurement.
        let turned: Vec<f64> = dark.iter().map(|y| -y).collect();
        let turned = read(&rows, &turned, Form::Single.into()).unwrap();
        assert_eq!(turned.doubts, []);
        let exact = Measurements::from_pairs(&rows, &y).unwrap().measurements;
        let images = [&turned.measurements, &exact].map(reconstruct::hadamard);
        assert!(correlation_of(&images[0], &images[1]) > 0.99, "scene {kind}");
    }
}

#[test]
fn doubts_say_numbers_and_what_to_do() {
    let broken = Broken { readings: 512, above: 0, below: 429 };
    let explanation = Explanation::Form(Form::Halves);
    let doubt = Doubt::Form { claimed: Form::Pairs, broken, explanation };
    assert_eq!(
        doubt.to_string(),
        "512 readings: 429 are below the all-off reading; the readings fit the form `halves`: try --readings halves"
    );
    for (claimed, explanation, words) in [
        (Form::Pairs, Explanation::OneEarly, "pairs that are one reading early"),
        (Form::Pairs, Explanation::OneLate, "pairs that are one reading late"),
        (Form::Pairs, Explanation::Inverted, "inverting amplifier"),
        (Form::Single, Explanation::Inverted, "patterns that light the -1 instead of the +1"),
        (Form::Pairs, Explanation::Samples { each: 4 }, "4 samples of each reading"),
        (Form::Pairs, Explanation::ComplementsFirst(Form::Pairs), "complement first"),
    ] {
        let line = Doubt::Form { claimed, broken, explanation }.to_string();
        assert!(line.contains(words), "{words}: {line}");
    }
    let why = Impossible::AboveAllOn { all_on: 83.770_024_6 };
    let outlier = Outlier { reading: 77, value: 32767.0, row: 38, why };
    assert_eq!(outlier.to_string(), "32767 is above the all-on reading 83.77");
    for (value, text) in [
        (0.0, "0"),
        (-0.010_833_5, "-0.0108"),
        (1e30, "1.0000e30"),
        (4095.0, "4095"),
        (100.0, "100"),
    ] {
        assert_eq!(doubt::Short(value).to_string(), text);
    }
}

/// A lamp that drifts and mirrors that collect more light of coarse patterns change sums, and are no
/// noise of differences.
#[test]
fn sums_of_pairs_say_what_the_noise_is_at_most() {
    let rows = shown(&Order::ZigZag, 32);
    for kind in [1, 2] {
        for (sigma, drift) in [(2e-3, 0.0), (2e-3, -0.2), (2e-2, 0.1)] {
            let y = recorded(&rows, kind, drift, 0.3, Noise::Normal { sigma, seed: 5 });
            let found = Measurements::from_pairs(&rows, &y).unwrap().measurements;
            let ratio = found.most_noise().unwrap() / (2.0_f64.sqrt() * sigma);
            assert!((0.85..1.25).contains(&ratio), "kind {kind}, {sigma}, {drift}: {ratio}");
        }
    }
    // The second reading was computed from the first: the sums know nothing of the noise.
    let one = readings(side(32), &rows, &scene(side(32), 1));
    let total = one[0] + one[1];
    let computed: Vec<f64> =
        one.as_chunks::<2>().0.iter().flat_map(|y| [y[0], total - y[0]]).collect();
    assert_eq!(most_noise_of(&rows, &computed), None);
    // A few pairs say nothing.
    assert_eq!(most_noise_of(&rows.first(40), &quiet(&rows, 1)[..80]), None);
}

fn most_noise_of(rows: &Rows, y: &[f64]) -> Option<f64> {
    Measurements::from_pairs(rows, y).unwrap().measurements.most_noise()
}
