//! `nirspi eval quality` on a few made-up characters: what is written, and on what it rests.

use crate::bench::{Bench, Measured, npz};

/// Six images of bars, two of each of three writers.
fn stack() -> Vec<u8> {
    let ink = |image: usize, at: usize| {
        let (r, c) = (at / 64, at % 64);
        (16..48).contains(&r) && (12 + 5 * image..20 + 5 * image).contains(&c)
    };
    let x: Vec<f32> =
        (0..6 * 4096).map(|at| if ink(at / 4096, at % 4096) { 255.0 } else { 0.0 }).collect();
    let label: Vec<f32> = (0..6).map(|k| (10 + k) as f32).collect();
    let writer = [1.0, 1.0, 2.0, 2.0, 3.0, 3.0];
    npz(&[("x", &[6, 64, 64], &x), ("label", &[6], &label), ("writer", &[6], &writer)])
}

#[test]
#[ignore = "long: .ci/run demo"]
fn every_row_is_measured_on_the_same_unseen_images() {
    let bench = Bench::new();
    bench.write("own.npz", &stack());
    bench.write("unseen.json", br#"{"own": [3, 1]}"#);
    std::fs::create_dir(bench.path("measured")).unwrap();
    bench.write("measured/disc.npz", &Measured::new(32).npz());
    let line = "eval quality --data own.npz --held-out unseen.json --spi measured --count 2 --sampler-count 2 \
                --most-steps 1 --json";
    let report = bench.run_line(line).succeeded().json();
    assert_eq!(report["images"][0]["images"], 2, "{report}");
    assert_eq!(report["images"][0]["choice"], "of 4 held out");
    let conditions = report["conditions"].as_array().unwrap();
    // 11 conditions, 10 rows, all stacks together and the one alone.
    assert_eq!(conditions.len(), 11 * 10 * 2);
    assert!(conditions.iter().all(|row| row["images"] == 2), "{report}");
    let psnr = |row: &str, sigma: f64, noise: f64| {
        let near = |v: &serde_json::Value, x: f64| (v.as_f64().unwrap() - x).abs() < 1e-6;
        let found = conditions
            .iter()
            .find(|c| c["row"] == row && near(&c["sigma_px"], sigma) && near(&c["noise"], noise));
        found.unwrap()["psnr_db"]["value"].as_f64().unwrap()
    };
    // A bar is what total variation is made for.
    assert!(psnr("total variation", 2.0, 0.03) > psnr("Lanczos", 2.0, 0.03) + 2.0);
    // The measurement in the folder that `--spi` names is among the scenes, and it has no known truth.
    let others = report["others"].as_array().unwrap();
    let disc = others.iter().find(|case| case["name"] == "disc (measured)").unwrap();
    assert!(disc["psnr_after_db"].is_null() && disc["changed"].as_f64().unwrap() > 0.0, "{disc}");
    for name in [
        "blur.png",
        "blur.svg",
        "blur.pdf",
        "blur.csv",
        "noise.png",
        "steps.png",
        "others.png",
        "quality.json",
    ] {
        assert!(bench.path("quality").join(name).is_file(), "{name}");
    }
}

#[test]
fn data_that_cannot_be_judged_is_refused() {
    let bench = Bench::new();
    bench.write("own.npz", &stack());
    bench.write("seen.json", br#"{"own": []}"#);
    bench.write("odd.json", b"[1]");
    let with = |list| bench.run(&["eval", "quality", "--data", "own.npz", "--held-out", list]);
    with("seen.json").failed(1, &["own.npz", "training has not seen"]);
    with("odd.json").failed(1, &["odd.json", "stack"]);
    with("none.json").failed(1, &["none.json"]);
    assert!(!bench.path("quality").exists());
}
