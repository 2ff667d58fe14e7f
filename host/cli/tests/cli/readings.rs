//! Readings that are not what they are said to be, and readings that light cannot have given.

use crate::bench::{Bench, Measured, correlation, npz};
use nirspi::files::npy;

/// The readings of the phantom, 16 x 16, natural order, as an array alone.
fn phantom(bench: &Bench, change: impl Fn(Vec<f32>) -> Vec<f32>) -> Measured {
    let measured = Measured::new(16);
    let y = change(measured.natural());
    bench.write("in.npy", &npy::encode(&[y.len()], &y));
    measured
}

/// The lines and the report of a reconstruction, whose exit code is 0.
fn said(bench: &Bench, more: &[&str]) -> (String, serde_json::Value) {
    let all = [&["reconstruct", "in.npy", "--shown", "natural"], more].concat();
    let outcome = bench.run(&all);
    assert_eq!(outcome.code, Some(0), "{outcome:?}");
    (outcome.stdout + &outcome.stderr, bench.json("out/report.json"))
}

#[test]
fn right_readings_get_no_warning() {
    let bench = Bench::new();
    let measured = phantom(&bench, |y| y);
    let (lines, report) = said(&bench, &[]);
    assert!(!lines.contains("warning") && !lines.contains("outlier"), "{lines}");
    assert_eq!(
        (&report["warnings"], &report["outliers"]),
        (&vec![(); 0].into(), &vec![(); 0].into())
    );
    assert!(correlation(&bench.pixels("out/image.npy"), &measured.image) > 0.999);
}

#[test]
fn readings_without_the_first_one_are_shifted_by_an_option() {
    let bench = Bench::new();
    let measured = phantom(&bench, |y| y.iter().skip(2).step_by(2).copied().collect());
    let single = ["--readings", "single", "--side", "16"];
    let (lines, _) = said(&bench, &[&single[..], &["--shift", "1"]].concat());
    assert!(lines.contains("not read: 1 pattern left out, at [0]"), "{lines}");
    let alike = correlation(&bench.pixels("out/image.npy"), &measured.image);
    assert!(alike > 0.99, "{alike}");
}

/// Pairs that come several times in a row keep the law of light, and look like those of a larger image.
#[test]
#[ignore = "long: .ci/run demo"]
fn patterns_that_were_shown_several_times_in_a_row_are_told_and_need_their_rows() {
    let bench = Bench::new();
    let four = |y: &[f32]| -> Vec<f32> {
        y.as_chunks::<2>().0.iter().flat_map(|pair| [*pair; 4]).flatten().collect()
    };
    let measured = phantom(&bench, |y| four(&y));
    let (lines, _) = said(&bench, &[]);
    let words = "each pattern and its complement 4 times in a row: save them with `h_row`, each row 4 times";
    assert!(lines.contains(words), "{lines}");
    // Who says the side has readings of one larger image.
    let (lines, _) = said(&bench, &["--side", "32"]);
    assert!(!lines.contains("warning"), "{lines}");
    let inspected = bench.run(&["inspect", "in.npy"]).succeeded().stdout;
    assert!(
        inspected.contains("none fits") && inspected.contains("4 times in a row"),
        "{inspected}"
    );
    let rows: Vec<f32> = (0..1024).map(|at| (at / 4) as f32).collect();
    let y = four(&measured.natural());
    bench.write(
        "rows.npz",
        &npz(&[("n", &[], &[16.0]), ("h_row", &[1024], &rows), ("y", &[2048], &y)]),
    );
    let lines = bench.run(&["reconstruct", "rows.npz", "--out", "rows"]).succeeded().stdout;
    assert!(lines.contains("each pattern was shown 4 times: the mean of its readings is used"));
    let alike = correlation(&bench.pixels("rows/image.npy"), &measured.image);
    assert!(alike > 0.99, "{alike}");
}

#[test]
#[ignore = "long: .ci/run demo"]
fn what_a_warning_names_is_an_option_that_gives_the_image() {
    let bench = Bench::new();
    type Change = fn(Vec<f32>) -> Vec<f32>;
    let cases: [(&[&str], Change); 7] = [
        (&["--readings", "halves"], |y| {
            y.iter().step_by(2).chain(y.iter().skip(1).step_by(2)).copied().collect()
        }),
        (&["--complements-first"], |y| {
            y.as_chunks::<2>().0.iter().flat_map(|p| [p[1], p[0]]).collect()
        }),
        (&["--inverted"], |y| y.iter().map(|y| -y).collect()),
        (&["--shift", "1"], |y| [&y[1..], &y[..1]].concat()),
        (&["--shift", "-1"], |y| [&y[..1], &y[..511]].concat()),
        (&["--sweeps", "4"], |y| y.repeat(4)),
        (&["--readings", "halves", "--complements-first"], |y| {
            y.iter().skip(1).step_by(2).chain(y.iter().step_by(2)).copied().collect()
        }),
    ];
    for (options, change) in cases {
        let measured = phantom(&bench, change);
        let (lines, report) = said(&bench, &[]);
        let warning = report["warnings"][0].as_str().unwrap_or_default();
        assert!(warning.contains(&options.join(" ")), "{options:?}: {lines}");
        let (lines, _) = said(&bench, options);
        assert!(!lines.contains("warning"), "{options:?}: {lines}");
        let alike = correlation(&bench.pixels("out/image.npy"), &measured.image);
        assert!(alike > 0.99, "{options:?}: {alike}");
    }
    let spoilt = |options: &[&str]| {
        bench.run(&[&["reconstruct", "in.npy", "--shown", "natural"], options].concat())
    };
    spoilt(&["--sweeps", "3"]).failed(1, &["in.npy", "3 sweeps", "--sweeps"]);
    let single = ["--readings", "single", "--complements-first"];
    spoilt(&[&single[..], &["--side", "32"]].concat()).failed(1, &["holds no complements"]);
    bench.write(
        "rows.npz",
        &npz(&[("n", &[], &[2.0]), ("h_row", &[1], &[0.0]), ("y", &[2], &[1.0, 2.0])]),
    );
    bench.run(&["reconstruct", "rows.npz", "--sweeps", "2"]).failed(1, &["no --sweeps"]);
}

#[test]
fn one_impossible_reading_is_left_out_and_stands_in_the_report() {
    let bench = Bench::new();
    for (at, factor) in [(77, 3.0), (300, 8.0), (301, 1e3), (0, 1e30), (511, 1e30)] {
        let measured = phantom(&bench, |mut y| {
            y[at] *= factor;
            y
        });
        let (lines, report) = said(&bench, &[]);
        assert_eq!(report["outliers"][0]["reading"], at, "{lines}");
        assert!(lines.contains(&format!("outlier: reading [{at}]")), "{lines}");
        assert_eq!(
            (&report["measurements"], &report["outliers"][1]),
            (&255.into(), &().into()),
            "{lines}"
        );
        let alike = correlation(&bench.pixels("out/image.npy"), &measured.image);
        assert!(alike > 0.99, "{at}: {alike}");
    }
    // Readings that the user shifts keep their numbers in the file.
    phantom(&bench, |mut y| {
        y[77] *= 8.0;
        y.rotate_left(1);
        y
    });
    let (lines, report) = said(&bench, &["--shift", "1"]);
    assert_eq!(report["outliers"][0]["reading"], 76, "{lines}");
}

#[test]
fn an_instruments_word_for_overload_is_no_reading() {
    let bench = Bench::new();
    let measured = phantom(&bench, |mut y| {
        (y[40], y[300]) = (9.9e37, 9.91e37);
        y
    });
    let (lines, report) = said(&bench, &[]);
    assert_eq!(report["not_read"], serde_json::json!([20, 150]), "{lines}");
    assert!(
        report["warnings"][0].as_str().unwrap().starts_with(
            "overload: 2 readings say that the detector was overloaded (9.9e37, OL or ∞), from y[40] on"
        ),
        "{lines}"
    );
    assert!(correlation(&bench.pixels("out/image.npy"), &measured.image) > 0.99);
}
