//! `nirspi camera calibrate`, and what captures make of a scene too dim to show the ADC latency.

use crate::bench::Bench;

/// A letter at 1 m: one burst says nothing of the latency.
const DIM: [&str; 6] = ["--scene", "letter:R", "--distance-m", "1", "--frames", "2"];

#[test]
fn a_dim_scene_needs_a_calibration_and_then_uses_it() {
    let bench = Bench::new();
    let capture = |more: &[&str]| {
        bench.run(&[&["capture", "--overwrite", "--out", "r.mcap"][..], &DIM, more].concat())
    };
    capture(&[]).failed(1, &["too dim", "white sheet", "nirspi camera calibrate", "--adc-latency"]);
    assert!(!bench.path("r.mcap").exists(), "nothing half-made stays");

    let said = bench.run(&["camera", "calibrate"]).succeeded().stdout;
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
    let report = bench
        .run(&["camera", "calibrate", "--calibration", "mine.json", "--json"])
        .succeeded()
        .json();
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

/// Bright LEDs that differ by a tenth, one of them dead.
const UNEQUAL: &[u8] = b"[leds]\npower_mw = 40\npower_spread = 0.1\ndead = [[3, 7]]\n";

#[test]
fn a_flat_field_is_kept_for_its_camera_and_applied_to_its_pictures() {
    let bench = Bench::new();
    bench.write("lab.toml", UNEQUAL);
    let lab = ["--camera-model", "lab.toml"];
    bench
        .run(&[&["camera", "calibrate", "--dark"][..], &lab].concat())
        .failed(1, &["no flat field", "nirspi camera calibrate --white"]);
    let white = ["camera", "calibrate", "--white", "--sweeps", "400"];
    let report = bench.run(&[&white[..], &lab, &["--json"]].concat()).succeeded().json();
    let flat = &report["flat_field"];
    assert_eq!(flat["dead_leds"], serde_json::json!([[3, 7]]), "{report}");
    let pattern = |when: &str| flat[when].as_f64().unwrap();
    assert!(pattern("pattern_after") < pattern("pattern_before") / 10.0, "{report}");
    let dark = ["camera", "calibrate", "--dark", "--sweeps", "40", "--json"];
    let report = bench.run(&[&dark[..], &lab].concat()).succeeded().json();
    // Four standard deviations of 1024 pixels.
    assert!(report["dark_pixels"].as_u64().unwrap() <= 2, "{report}");

    let capture = ["capture", "--frames", "40", "--scene", "white", "--out", "r.mcap"];
    let picture = |more: &[&str], out: &str| {
        let more = [more, &["--overwrite", "--picture", out]].concat();
        bench.run(&[&capture[..], &more].concat()).succeeded();
        bench.json(&format!("{out}/report.json"))["notes"].to_string()
    };
    let notes = picture(&lab, "seen");
    assert!(notes.contains("1 dead LED (row 3 column 7)"), "{notes}");
    let reconstruct = |more: &[&str], out: &str| {
        bench.run(&[&["reconstruct", "r.mcap", "--out", out][..], more].concat()).succeeded();
        bench.json(&format!("{out}/report.json"))["notes"].to_string()
    };
    let again = reconstruct(&[], "again");
    assert!(again.contains("flat field of"), "{again}");
    assert!(!reconstruct(&["--no-flat-field"], "as-it-is").contains("flat field"));
    let pixels = |out: &str| std::fs::read(bench.path(&format!("{out}/image.npy"))).unwrap();
    assert_eq!(pixels("seen"), pixels("again"));
    assert_ne!(pixels("again"), pixels("as-it-is"));
    // Another camera has another serial number, and no flat field.
    assert!(!picture(&["--seed", "2"], "other").contains("flat field"));
}
