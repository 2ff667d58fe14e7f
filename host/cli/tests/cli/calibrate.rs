//! `nirspi calibrate`, and what captures make of a scene too dim to show the ADC latency.

use crate::bench::Bench;

/// A letter at 1 m: one burst says nothing of the latency.
const DIM: [&str; 6] = ["--scene", "letter:R", "--distance-m", "1", "--frames", "2"];

#[test]
fn a_dim_scene_needs_a_calibration_and_then_uses_it() {
    let bench = Bench::new();
    let capture = |more: &[&str]| {
        bench.run(&[&["capture", "--overwrite", "--out", "r.mcap"][..], &DIM, more].concat())
    };
    capture(&[]).failed(1, &["too dim", "white sheet", "nirspi calibrate", "--adc-latency"]);
    assert!(!bench.path("r.mcap").exists(), "nothing half-made stays");

    let said = bench.run(&["calibrate"]).succeeded().stdout;
    assert!(said.contains("ADC latency 6 clocks") && said.contains("kept in"), "{said}");
    let report = capture(&["--json"]).succeeded().json();
    assert_eq!((&report["calibrated"], &report["adc_latency_clocks"]), (&true.into(), &6.into()));
    assert!(report["calibration"]["measured"].is_string(), "{report}");
    // Measured afresh, the burst is too dim, and the kept one is used with a word about it.
    let report = capture(&["--calibrate", "--json"]).succeeded().json();
    assert_eq!(report["adc_latency_clocks"], 6, "{report}");
    assert!(report["calibration"]["measured"].is_string(), "{report}");
    assert!(report["calibration_problem"].as_str().unwrap().contains("too dim"), "{report}");
    // Another camera has another serial number, and no calibration.
    capture(&["--seed", "2"]).failed(1, &["too dim"]);
}

#[test]
fn a_calibration_goes_where_it_is_asked_to_go() {
    let bench = Bench::new();
    let report =
        bench.run(&["calibrate", "--calibration", "mine.json", "--json"]).succeeded().json();
    assert_eq!(report["settling"]["adc_latency"], 6, "{report}");
    assert_eq!(bench.names(), ["mine.json"]);
    let used = ["capture", "--calibration", "mine.json", "--out", "r.mcap", "--json"];
    let report = bench.run(&[&used[..], &DIM].concat()).succeeded().json();
    assert!(report["calibration"]["file"].as_str().unwrap().ends_with("mine.json"), "{report}");
}

#[test]
fn no_calibration_needs_a_latency() {
    let bench = Bench::new();
    let plain = bench.run(&["capture", "--no-calibration", "--out", "r.mcap"]);
    plain.failed(2, &["--adc-latency"]);
    assert!(bench.names().is_empty());
}
