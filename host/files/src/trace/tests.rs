use super::*;
use crate::testing::{Zip, file, line, npy_f64, zip};
use proptest::prelude::*;

/// A trace with some samples of each level, behind a few samples of no pattern, and its trigger.
#[derive(Clone)]
struct Made {
    samples: Vec<f64>,
    trigger: Vec<f64>,
}

impl Made {
    fn new(levels: &[f64], samples: usize, before: usize) -> Self {
        let each = |of: &dyn Fn(usize, usize) -> f64| {
            let pattern = (0..levels.len()).flat_map(|k| (0..samples).map(move |at| (k, at)));
            std::iter::repeat_n(0.0, before).chain(pattern.map(|(k, at)| of(k, at))).collect()
        };
        Self {
            samples: each(&|k, _| levels[k]),
            trigger: each(&|_, at| if at < 2 { 5.0 } else { 0.1 }),
        }
    }

    fn without_first(mut self, count: usize) -> Self {
        self.samples.drain(..count);
        self.trigger.drain(..count);
        self
    }

    fn first(mut self, count: usize) -> Self {
        self.samples.truncate(count);
        self.trigger.truncate(count);
        self
    }

    fn read(&self, cut: &Cut) -> Result<Found, FileError> {
        let array = |values: &[f64]| npy_f64(&format!("({},)", values.len()), values);
        let members = [("y.npy", array(&self.samples)), ("T.npy", array(&self.trigger))];
        let (_guard, path) = file("trace.npz", &zip(Zip::Stored, &members));
        read(&path, &Cut { field: Some("y".to_owned()), ..cut.clone() })
    }

    fn told(&self, cut: &Cut) -> String {
        line(&self.read(cut).unwrap_err(), "trace.npz")
    }
}

fn by_trigger() -> Cut {
    Cut { trigger: Some("T".to_owned()), ..Cut::default() }
}

fn every(samples: usize, skip: usize) -> Cut {
    Cut { samples: Some(samples), skip, ..Cut::default() }
}

fn close(readings: &[f64], levels: &[f64]) -> bool {
    readings.len() == levels.len() && readings.iter().zip(levels).all(|(a, b)| (a - b).abs() < 1e-9)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn readings_are_the_levels_by_the_trigger_and_by_their_number(
        levels in proptest::collection::vec(-9.0..9.0_f64, 3..20),
        samples in 4_usize..4000,
        before in 1_usize..20_000,
        settle in 0_usize..3,
    ) {
        let made = Made::new(&levels, samples, before);
        let cuts = [Cut { settle, ..by_trigger() }, Cut { settle, ..every(samples, before) }];
        for cut in cuts {
            let found = made.read(&cut).unwrap();
            prop_assert_eq!(found.samples, samples);
            prop_assert!(close(&found.readings, &levels), "{:?}", found.readings);
            prop_assert_eq!((found.outside, found.cut_off), ((before, 0), None));
            prop_assert!(found.lost.is_empty() && found.extra.is_empty());
            prop_assert_eq!(found.first.windows.len(), levels.len().min(8));
            prop_assert!(found.first.windows.iter().all(|w| w.len() == samples - settle));
            let of_trace = |&(at, value): &(usize, f64)| made.samples[at].to_bits() == value.to_bits();
            prop_assert!(found.first.samples.iter().all(of_trace));
            let steps = found.first.samples.windows(2).map(|two| two[1].0 - two[0].0);
            let mut steps: Vec<usize> = steps.collect();
            steps.dedup();
            prop_assert_eq!(steps.len(), 1, "samples of a picture are evenly chosen");
            prop_assert!(found.first.samples.len() <= 4000);
            prop_assert!(found.first.samples.len() >= samples.min(2000));
        }
    }
}

#[test]
fn lost_and_extra_edges_are_named_and_move_no_other_reading() {
    let levels: Vec<f64> = (0..16).map(f64::from).collect();
    let made = Made::new(&levels, 20, 7);
    let mut spoilt = made.clone();
    // The edge of pattern 4, and one in the first half of pattern 8.
    spoilt.trigger[7 + 4 * 20..][..2].fill(0.0);
    spoilt.trigger[7 + 8 * 20 + 6] = 5.0;
    let found = spoilt.read(&by_trigger()).unwrap();
    assert_eq!(found.readings.len(), 16);
    for (k, reading) in found.readings.iter().enumerate() {
        assert!(if k == 4 { reading.is_nan() } else { (reading - k as f64).abs() < 1e-9 }, "{k}");
    }
    assert_eq!((&*found.lost, &*found.extra), (&[4][..], &[173][..]));
    let warnings = found.warnings();
    assert!(warnings[0].starts_with("1 reading is not there, because the trigger has no edge"));
    assert!(warnings[0].ends_with(": 4") && warnings[1].ends_with(": at 173"), "{warnings:?}");
    // A sample is missing.
    let mut jitter = made.clone();
    jitter.samples.remove(50);
    jitter.trigger.remove(50);
    let found = jitter.read(&Cut { settle: 2, ..by_trigger() }).unwrap();
    assert!(close(&found.readings, &levels), "{:?}", found.readings);
}

#[test]
fn a_trigger_may_fall_or_change_with_each_pattern() {
    let levels: Vec<f64> = (0..16).map(f64::from).collect();
    let with = |trigger: &str| Cut { trigger: Some(trigger.to_owned()), ..Cut::default() };
    let made = Made::new(&levels, 20, 7);
    let mut low = made.clone();
    low.trigger.iter_mut().for_each(|level| *level = 5.0 - *level);
    assert!(close(&low.read(&with("T:fall")).unwrap().readings, &levels));
    // Half of each pattern is that of the next one, where the wrong edge is taken.
    let mut half = made.clone();
    half.trigger.iter_mut().enumerate().for_each(|(at, level)| {
        *level = f64::from(u8::from(at >= 7 && (at - 7) % 20 < 10));
    });
    let found = half.read(&with("T:fall")).unwrap();
    assert!((found.readings[0] - 0.5).abs() < 1e-9, "{:?}", found.readings);
    let mut toggles = made.clone();
    toggles.trigger.iter_mut().enumerate().for_each(|(at, level)| {
        *level = f64::from(u8::from(at >= 7 && (at - 7) / 20 % 2 == 0));
    });
    assert!(close(&toggles.read(&with("T:both")).unwrap().readings, &levels));
    toggles.trigger.fill(1.0);
    assert!(toggles.told(&with("T:fall")).contains("`T` falls nowhere, expected two edges"));
    assert!(toggles.told(&with("T:up")).contains("`T:up` is not in the file"));
}

#[test]
fn the_first_and_the_last_pattern_count_if_they_are_whole() {
    let levels: Vec<f64> = (0..16).map(f64::from).collect();
    let made = Made::new(&levels, 20, 7);
    let read = |made: Made| made.read(&by_trigger()).unwrap();
    let short = read(made.clone().first(7 + 15 * 20 + 9));
    assert!(close(&short.readings, &levels[..15]));
    assert_eq!((short.cut_off, short.outside), (Some(9), (7, 9)));
    assert!(short.warnings()[0].starts_with("the trace ends 9 samples after the last edge"));
    let almost = read(made.clone().first(7 + 15 * 20 + 19));
    assert!(close(&almost.readings, &levels) && almost.cut_off.is_none());
    // The trace begins where the trigger is high: with the first pattern, or in the midst of it.
    let exact = read(made.clone().without_first(7));
    assert!(close(&exact.readings, &levels) && exact.outside == (0, 0));
    let mut wide = made.clone();
    (0..16).for_each(|k| wide.trigger[7 + k * 20..][..12].fill(5.0));
    let within = read(wide.without_first(7 + 8));
    assert!(close(&within.readings, &levels[1..]), "{:?}", within.readings);
    // The trigger does not end with the patterns.
    let counted = made.read(&Cut { count: Some(4), ..by_trigger() }).unwrap();
    assert!(close(&counted.readings, &levels[..4]) && counted.outside == (7, 12 * 20));
    assert!(counted.warnings().is_empty() && counted.words()[1] == "a full sweep: 2 x 2 patterns");
}

#[test]
fn noise_on_a_slow_edge_is_one_edge() {
    let levels = [1.0, 2.0, 3.0, 4.0];
    let mut made = Made::new(&levels, 20, 7);
    for k in 0..4 {
        made.trigger[7 + k * 20..][..6].copy_from_slice(&[3.2, 2.4, 2.7, 2.45, 5.0, 5.0]);
    }
    let found = made.read(&by_trigger()).unwrap();
    assert!(found.extra.is_empty() && found.samples == 20, "{found:?}");
    assert!(close(&found.readings, &levels), "{:?}", found.readings);
}

#[test]
fn an_array_of_readings_by_samples_is_a_trace() {
    let numbers: Vec<f64> = (0..24).map(f64::from).collect();
    let (_guard, path) = file("rows.npy", &npy_f64("(4, 6)", &numbers));
    let found = read(&path, &Cut { settle: 2, ..every(6, 0) }).unwrap();
    assert_eq!(found.readings, [3.5, 9.5, 15.5, 21.5]);
    for wrong in [every(4, 0), every(6, 1), every(24, 0)] {
        let told = line(&read(&path, &wrong).unwrap_err(), "rows.npy");
        assert!(told.contains("has shape (4, 6), expected (N,) samples"), "{told}");
    }
}

#[test]
fn what_cannot_be_cut_is_refused_in_one_line() {
    let made = Made::new(&[1.0, 2.0, 3.0], 20, 5);
    let told = made.told(&Cut { samples: Some(25), ..by_trigger() });
    assert!(told.contains("`T` rises every 20 samples, expected 25"), "{told}");
    for cut in [Cut::default(), every(0, 0)] {
        assert!(made.told(&cut).contains("expected a trigger, or 1 sample or more"));
    }
    assert!(made.told(&every(20, 1000)).contains("`y` has 0 samples after the 1000 skipped"));
    let told = made.told(&Cut { settle: 20, ..every(20, 5) });
    assert!(told.contains("has 20 samples of a pattern, expected more than the 20"), "{told}");
    let told = made.told(&Cut { count: Some(4), ..every(20, 5) });
    assert!(told.contains("has 3 readings, expected 4"), "{told}");
    let flat = |level: f64| Made { trigger: vec![level; 65], ..made.clone() };
    assert!(flat(1.0).told(&by_trigger()).contains("`T` rises nowhere, expected two edges"));
    assert!(flat(f64::NAN).told(&by_trigger()).contains("`T` is NaN at [0], expected finite"));
    let shorter = Made { trigger: vec![1.0; 64], ..made.clone() };
    assert!(shorter.told(&by_trigger()).contains("`T` has 64 samples, expected 65"));
    let missing = Cut { trigger: Some("U".to_owned()), ..Cut::default() };
    assert!(made.told(&missing).contains("`U` is not in the file, expected one of T, y"));
}

#[test]
fn samples_that_are_no_numbers_are_refused_and_overload_is_left_out() {
    let with = |at: usize, value: f64| {
        let mut made = Made::new(&[1.0, 2.0, 3.0, 4.0], 20, 5);
        made.samples[at] = value;
        made
    };
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let told = with(31, value).told(&every(20, 5));
        assert!(told.contains(&format!("`y` is {value} at [31], expected finite")), "{told}");
        // Before the first pattern, and while the light settles, no reading has the sample.
        assert!(with(3, value).read(&every(20, 5)).is_ok());
        assert!(with(26, value).read(&Cut { settle: 2, ..every(20, 5) }).is_ok());
    }
    let found = with(31, 9.9e37).read(&every(20, 5)).unwrap();
    assert!(found.readings[1].is_nan() && found.overloads == [1], "{found:?}");
    assert_eq!(found.warnings(), ["overload: 1 reading is not there: 1"]);
}

#[test]
fn the_number_of_readings_is_held_against_full_sweeps() {
    let told = |count: usize| {
        let made = Made::new(&vec![1.0; count], 1, 0);
        let found = made.read(&every(1, 0)).unwrap();
        (found.words().get(1).cloned(), found.warnings())
    };
    let (words, warnings) = told(128);
    assert_eq!(words.unwrap(), "a full sweep: 8 x 8 patterns and their complements");
    assert!(warnings.is_empty());
    assert_eq!(told(1024).0.unwrap(), "a full sweep: 32 x 32 patterns");
    let start = "131 readings are no full sweep: 3 more than the 128 of 8 x 8 patterns and their complements; ";
    assert_eq!(told(131).1, [format!("{start}--count 128 keeps the first of them")]);
    assert!(told(250).1[0].contains("6 fewer than the 256 of 16 x 16 patterns; only part"));
    assert!(told(640).1[0].contains("may be 5 sweeps of 8 x 8 patterns and their complements"));
}

#[test]
fn fields_are_chosen_by_name_or_by_being_the_only_one() {
    let rows = (0..9).map(|at| format!("{at},{},{}\n", at * 2, at % 3)).collect::<String>();
    let (_guard, path) = file("scope.csv", format!("time,CH1,TRIG\n{rows}").as_bytes());
    let of = |field: Option<&str>, trigger: Option<&str>| Cut {
        field: field.map(str::to_owned),
        trigger: trigger.map(str::to_owned),
        samples: Some(3),
        ..Cut::default()
    };
    assert_eq!(read(&path, &of(Some("CH1"), Some("TRIG"))).unwrap().readings, [6.0, 12.0]);
    assert_eq!(read(&path, &of(Some("CH1"), None)).unwrap().readings, [2.0, 8.0, 14.0]);
    let told = |cut| line(&read(&path, &cut).unwrap_err(), "scope.csv");
    assert!(told(of(None, Some("TRIG"))).contains("expected --field with one of time, CH1, TRIG"));
    assert!(told(of(Some("CH1"), Some("T"))).contains("`T` is not in the file, expected one of"));
    let (_guard, path) =
        file("two.csv", format!("CH1,TRIG\n{}", "1,0\n2,5\n".repeat(3)).as_bytes());
    assert_eq!(
        read(&path, &Cut { trigger: Some("TRIG".into()), ..Cut::default() }).unwrap().samples,
        2
    );
    let (_guard, path) = file("one.npy", &npy_f64("(4, 1)", &[1.0, 2.0, 3.0, 4.0]));
    assert_eq!(read(&path, &every(2, 0)).unwrap().readings, [1.5, 3.5]);
    let told = line(&read(&path, &of(Some("y"), None)).unwrap_err(), "one.npy");
    assert!(told.contains("no names of fields"), "{told}");
}
