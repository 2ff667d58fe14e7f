//! `nirspi camera model`, and `--camera-model` of the commands that simulate.

use crate::bench::Bench;

#[test]
fn a_printed_description_is_read_again_and_changes_what_is_simulated() {
    let bench = Bench::new();
    let printed = bench.run(&["camera", "model", "--print"]).succeeded().stdout;
    assert!(printed.contains("# The camera of the paper") && printed.contains("power_mw = 4.0"));
    bench.write("lab.toml", printed.replace("power_mw = 4.0", "power_mw = 8.0").as_bytes());
    let snr = |camera: &str| {
        let report = bench.run(&["camera", "model", camera, "--json"]).succeeded().json();
        report["distances"][0]["electrons_per_led"].as_f64().unwrap()
    };
    assert!((snr("lab.toml") / snr("paper") - 2.0).abs() < 1e-9);
    // Every command that simulates takes it.
    let range = |camera: &str| {
        let report =
            bench.run(&["physics", "range", "--camera-model", camera, "--json"]).succeeded().json();
        report["rows"][1]["physics_m"].as_f64().unwrap()
    };
    assert!(range("lab.toml") > 1.2 * range("paper"));
    let budget = ["physics", "budget", "--camera-model", "lab.toml", "--json"];
    let budget = bench.run(&budget).succeeded().json();
    assert_eq!(budget["terms"][0]["value"], 8.0, "{budget}");
    let info = |camera: &str| {
        let report =
            bench.run(&["camera", "info", "--camera-model", camera, "--json"]).succeeded().json();
        report["camera"]["serial"].as_str().unwrap().to_owned()
    };
    assert_eq!(info("paper"), "virtual-1");
    assert!(
        info("lab.toml").starts_with("virtual-1-"),
        "another instrument, another serial number"
    );
}

#[test]
fn a_camera_whose_leds_rise_unlike_they_fall_says_what_the_image_shows() {
    let bench = Bench::new();
    bench
        .write("uneven.toml", b"[leds]\nrise_ns = 12.76\nfall_ns = 16.36\nturn_on_delay_ns = 1.22");
    let said = bench.run(&["camera", "model", "uneven.toml"]).succeeded().stdout;
    assert!(said.contains("Pixel (0, 0) of a white sheet would read -2.7"), "{said}");
    let report = bench.run(&["camera", "model", "uneven.toml", "--json"]).succeeded().json();
    assert!((report["first_pixel_off"].as_f64().unwrap() + 3.7).abs() < 0.05, "{report}");
    let said = bench.run(&["camera", "model", "paper"]).succeeded().stdout;
    assert!(!said.contains("rise and fall"), "{said}");
}

#[test]
fn mistakes_in_a_description_are_told_in_one_line() {
    let bench = Bench::new();
    bench.write("key.toml", b"[leds]\npower = 4");
    bench.write("range.toml", b"[leds]\npower_mw = -4");
    bench.write("text.toml", b"[leds\n");
    let cases: [(&str, &[&str]); 4] = [
        ("key.toml", &["key.toml", "leds.power", "expected one of", "power_mw"]),
        ("range.toml", &["leds.power_mw is -4", "0.001 to 1000"]),
        ("text.toml", &["text.toml", "line 1", "expected TOML"]),
        ("none.toml", &["none.toml", "no such file", "paper, fga015, one-metre"]),
    ];
    for (file, told) in cases {
        for command in [&["camera", "model"][..], &["physics", "range", "--camera-model"]] {
            bench.run(&[command, &[file]].concat()).failed(1, told);
        }
    }
    bench.write("blue.toml", b"wavelength_nm = 1300\n[detector]\nresponsivity_a_per_w = 0.9");
    let demo = ["demo", "--camera-model", "blue.toml", "--out", "demo"];
    bench.run(&demo).failed(2, &["wavelength_nm is 1300", "expected 1550"]);
}

#[test]
#[ignore = "long: .ci/run demo"]
fn the_one_metre_camera_shows_a_letter_at_one_metre_in_heavy_rain() {
    let bench = Bench::new();
    let demo = "demo --camera-model one-metre --scene letter:R --distance-m 1 --rain heavy --json";
    let report = bench.run_line(demo).succeeded().json();
    assert!(report["acquisition_ms"].as_f64().unwrap() <= 100.0, "{report}");
    let quality = &report["reconstruction"];
    assert!(quality["psnr_db"].as_f64().unwrap() >= 24.0, "{quality}");
    assert!(quality["ssim"].as_f64().unwrap() >= 0.7, "{quality}");
    let light = bench.run(&["camera", "model", "one-metre", "--json"]).succeeded().json();
    assert!(light["eye_safety"]["at_lens_w_per_m2"].as_f64().unwrap() < 100.0, "{light}");
}

#[test]
fn a_wavelength_that_reaches_the_retina_gets_no_statement_about_eyes() {
    let bench = Bench::new();
    let description = "wavelength_nm = 850.0\n\n[detector]\nresponsivity_a_per_w = 0.5\n";
    std::fs::write(bench.path("cheap.toml"), description).unwrap();
    bench.run(&["camera", "safety", "cheap.toml"]).failed(1, &["cheap.toml", "850 nm", "retina"]);
    let said = bench.run(&["camera", "model", "cheap.toml"]).succeeded().stdout;
    assert!(said.contains("eyes: refused: no eye limits for a wavelength of 850 nm"), "{said}");
    let light = bench.run(&["camera", "model", "cheap.toml", "--json"]).succeeded().json();
    assert!(light["eye_safety"].is_null() && light["eye_safety_refused"].is_string(), "{light}");
}

#[test]
fn resolution_and_snr_against_distance_are_drawn() {
    let bench = Bench::new();
    let range = ["physics", "range", "--camera-model", "one-metre", "--out", "range"];
    let said = bench.run(&range).succeeded().stdout;
    assert!(said.contains("camera one-metre"), "{said}");
    for name in ["range.png", "resolution.png", "snr.png", "assumptions.png", "range.json"] {
        assert!(bench.path(&format!("range/{name}")).exists(), "{name}");
    }
}
