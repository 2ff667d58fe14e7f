//! `nirspi physics rain`, `range` and `eval`: what they print, and how they refuse.

use crate::bench::Bench;

#[test]
fn one_sphere_is_told_as_json() {
    let bench = Bench::new();
    let arguments =
        ["physics", "sphere", "--x", "100", "--m-re", "1.33", "--m-im", "1e-4", "--json"];
    let report = bench.run(&arguments).succeeded().json();
    // miepython 3.3.0: 2.1007189, 2.0589971, 0.8738868
    for (name, expected) in [("qext", 2.100_718_9), ("qsca", 2.058_997_1), ("g", 0.873_886_8)] {
        let found = report[name].as_f64().unwrap();
        assert!((found - expected).abs() < 1e-6, "{name}: {report}");
    }
}

#[test]
fn rain_is_told_at_the_wavelengths_asked_for() {
    let bench = Bench::new();
    let report = bench.run(&["physics", "rain", "--drops", "mono:2", "--json"]).succeeded().json();
    let wavelengths = report["wavelengths"].as_array().unwrap();
    let nm: Vec<f64> = wavelengths.iter().map(|w| w["wavelength_nm"].as_f64().unwrap()).collect();
    assert_eq!(nm, [550.0, 850.0, 1550.0]);
    assert!(wavelengths.iter().all(|w| w["extinction_per_m"].as_f64().unwrap() > 3.5e-4));
    let text = bench.run(&["physics", "budget"]).succeeded().stdout;
    for term in ["LED power", "dark current", "shot noise", "quantisation", "SNR, one pixel"] {
        assert!(text.contains(term), "{term}: {text}");
    }
    let budget = bench.run(&["physics", "budget", "--json"]).succeeded().json();
    let daylight = budget["daylight"].as_array().unwrap();
    let watts: Vec<f64> =
        daylight.iter().map(|d| d["on_target_w_per_m2"].as_f64().unwrap()).collect();
    // 15 klx of ASTM G173 within 100 nm around 550, 850 and 1550 nm.
    for (found, expected) in watts.iter().zip([20.668, 12.938, 3.495]) {
        assert!((found / expected - 1.0).abs() < 1e-3, "{watts:?}");
    }
    assert!(daylight.iter().all(|d| d["on_detector_nw"].as_f64().unwrap() > 0.0));
}

#[test]
fn uniformity_is_christiansens_of_the_last_column() {
    let bench = Bench::new();
    bench.write("volumes.csv", b"place,ml\n1,8\n2,12\n3,9\n4,11\n");
    let report =
        bench.run(&["physics", "rig", "--volumes", "volumes.csv", "--json"]).succeeded().json();
    assert!((report["uniformity_percent"].as_f64().unwrap() - 85.0).abs() < 1e-9, "{report}");
    bench.write("bad.csv", b"place,ml\n1,8\n2,wet\n");
    bench
        .run(&["physics", "rig", "--volumes", "bad.csv"])
        .failed(1, &["bad.csv", "line 3", "a number"]);
    // No heading, and places that are no numbers: the first volume counts.
    bench.write("named.csv", b"left,8\nmiddle,12\nright,9\nfront,11\n");
    let report =
        bench.run(&["physics", "rig", "--volumes", "named.csv", "--json"]).succeeded().json();
    assert_eq!(report["containers"], 4, "{report}");
    assert!((report["uniformity_percent"].as_f64().unwrap() - 85.0).abs() < 1e-9, "{report}");
    bench.run(&["physics", "rig", "--volumes", "none.csv"]).failed(1, &["none.csv"]);
}

#[test]
fn rain_that_cannot_be_is_refused_with_its_range() {
    let bench = Bench::new();
    let mistakes: &[(&[&str], &[&str])] = &[
        (&["rain", "--rate-mm-h", "-1"], &["rain rate is -1", "0 to 300 mm/h"]),
        (&["rain", "--distance-m", "0"], &["--distance-m is 0"]),
        (
            &["budget", "--wavelengths-nm", "1800"],
            &["--wavelengths-nm", "1750 to 1850 nm", "400 to 1700 nm"],
        ),
        (&["budget", "--distance-m", "100"], &["--distance-m is 100", "0.05 to 65 metres"]),
        (&["rig", "--tilt-deg", "30"], &["tilt is 30", "0 to 15"]),
        (
            &["sphere", "--x", "1e6", "--m-re", "1.3"],
            &["size parameter x is 1000000", "0.01 to 65000"],
        ),
        (&["sphere", "--x", "1"], &["--m-re"]),
    ];
    for (arguments, told) in mistakes {
        bench.run(&[&["physics"], *arguments].concat()).failed(2, told);
    }
    bench.run(&["physics", "range", "--snr", "0"]).failed(2, &["--snr is 0"]);
    bench
        .run(&["physics", "range", "--exposures-us", "-8"])
        .failed(2, &["exposure_us is -8", "more than 0"]);
}

#[test]
fn ranges_stand_beside_the_papers_and_the_plot_is_written() {
    let bench = Bench::new();
    let report = bench.run(&["physics", "range", "--out", "range", "--json"]).succeeded().json();
    let rows = report["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 4);
    for row in rows {
        let (wet, dry) = (row["physics_m"].as_f64().unwrap(), row["dry_air_m"].as_f64().unwrap());
        assert!(wet < dry && wet > 0.99 * dry, "{row}");
    }
    assert_eq!(bench.json("range/range.json"), report);
    assert!(bench.path("range/range.png").exists() && bench.path("range/exposure.png").exists());
    // Grows as the fourth power of the distance, where the paper has a ratio of three.
    let needed = |k: usize| report["exposures"][k]["needed_us"].as_f64().unwrap();
    assert!(needed(4) / needed(0) > 90.0, "{report}");
}

#[test]
#[ignore = "long: .ci/run demo"]
fn curves_of_rain_are_written_as_pictures_and_numbers() {
    let bench = Bench::new();
    let out = ["physics", "rain", "--drops", "mono:2", "--out", "curves"];
    let text = bench.run(&out).succeeded().stdout;
    assert!(text.contains("in a rig") && text.contains("wrote figures"), "{text}");
    for name in
        ["extinction_wavelength", "albedo_size", "drop_sizes", "fall_speed", "extinction_rate"]
    {
        assert!(bench.path(&format!("curves/{name}.png")).exists(), "{name}");
        let csv = std::fs::read_to_string(bench.path(&format!("curves/{name}.csv"))).unwrap();
        assert!(csv.contains("\nchart,curve,") && csv.lines().count() > 20, "{name}: {csv}");
    }
    assert_eq!(bench.json("curves/rain.json")["fall"]["rig"]["height_m"], 0.25);
    bench.run(&["physics", "budget", "--out", "curves"]).failed(2, &["--out"]);
}

#[test]
#[ignore = "long: .ci/run demo"]
fn weather_of_any_kind_stands_before_the_virtual_camera() {
    let bench = Bench::new();
    bench.write("counted.csv", b"0.5,3000\n1,400\n");
    let mut correlations = Vec::new();
    for (weather, depth) in [
        ("none", 0.0..=0.0),
        ("rain:50,mono:1", 1e-4..=0.01),
        ("counted.csv+window:0.1", 1e-4..=0.01),
        ("fog:1m+window:0.2", 1.0..=1.4),
    ] {
        let arguments = ["demo", "--weather", weather, "--frames", "20", "--out", "d", "--json"];
        let report = bench.run(&arguments).succeeded().json();
        assert_eq!(report["rain"], weather);
        let found = report["optical_depth"].as_f64().unwrap();
        assert!(depth.contains(&found), "{weather}: {found}");
        correlations.push(report["reconstruction"]["correlation"].as_f64().unwrap());
        std::fs::remove_dir_all(bench.path("d")).unwrap();
    }
    assert!(
        correlations.iter().all(|&c| c > 0.2 && c <= correlations[0] + 0.02),
        "{correlations:?}"
    );

    for (weather, told) in [
        ("snow", "--weather: found snow, expected none, light, heavy"),
        ("fog:", "--weather: found fog:, expected an amount after the colon"),
        ("fog:0.2m", "fog:0.2m at --distance-m 0.3: rain: optical depth is"),
    ] {
        bench.run(&["demo", "--weather", weather, "--out", "d"]).failed(2, &[told]);
        assert!(!bench.path("d").exists(), "{weather}");
    }
    bench.run(&["demo", "--weather", "none.csv"]).failed(1, &["none.csv"]);
    bench.run(&["demo", "--weather", "light", "--rain", "light"]).failed(2, &["--rain"]);
    let table = ["eval", "table3", "--scenes", "2", "--frames", "4", "--weather", "fog:20m"];
    let report =
        bench.run(&[&table[..], &["--ancestral", "0", "--json"]].concat()).succeeded().json();
    assert_eq!(report["rain"], "fog:20m");
}

#[test]
#[ignore = "long: .ci/run demo"]
fn table_3_has_both_cameras_at_every_distance_with_intervals() {
    let bench = Bench::new();
    let line = "eval table3 --scenes 2 --frames 20 --ancestral 2 --out t --json";
    let report = bench.run_line(line).succeeded().json();
    // Six pictures (both cameras, GAN, regression, diffusion, ancestral) at three distances and at all.
    assert_eq!(report["rows"].as_array().unwrap().len(), 24);
    assert_eq!(report["simulated"], true);
    let psnr = &report["rows"][0]["psnr_db"];
    assert!(psnr["low"].as_f64().unwrap() <= psnr["high"].as_f64().unwrap(), "{psnr}");
    assert!(bench.path("t/table3.png").exists() && bench.path("t/table3.json").exists());
}
