//! `nirspi demo`.

use crate::bench::{Bench, provenance};
use nirspi::files::image::encode_grey;

const FILES: [&str; 20] = [
    "deblurred.npy",
    "deblurred.png",
    "frames.npy",
    "fused.npy",
    "fused.png",
    "interval.npy",
    "interval.png",
    "measurement.npz",
    "raw.npy",
    "raw.png",
    "reconstruction.npy",
    "reconstruction.png",
    "report.json",
    "scene.npy",
    "scene.png",
    "side_by_side.png",
    "truth.npy",
    "truth_64.npy",
    "upscaled.npy",
    "upscaled.png",
];

#[test]
fn the_letter_is_captured_without_loss_and_plain_to_see() {
    let bench = Bench::new();
    let said = bench.run(&["demo", "--scene", "letter:R", "--out", "demo", "--json"]).succeeded();
    let mut names: Vec<_> = std::fs::read_dir(bench.path("demo"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(names, FILES);
    let report = bench.json("demo/report.json");
    assert_eq!(said.json(), report);
    assert_eq!(report["frames"]["received"], 244);
    for counter in ["lost", "corrupt", "late"] {
        assert_eq!(report["frames"][counter], 0, "{counter}");
    }
    assert_eq!(report["simulated"], true);
    let quality = &report["reconstruction"];
    assert!(quality["ssim"].as_f64().unwrap() > 0.9, "{quality}");
    assert!(quality["correlation"].as_f64().unwrap() > 0.97, "{quality}");
    assert!(quality["psnr_db"].as_f64() > report["raw"]["psnr_db"].as_f64(), "{report}");
    let stage = |name: &str| report["enhancement"][name]["psnr_db"].as_f64().unwrap();
    assert!(stage("fused") > stage("upscaled"), "{report}");
    assert!(stage("deblurred") > stage("fused") + 1.0, "{report}");
    // What an enhanced pixel may be off by, and what the character may be.
    let enhancement = &report["enhancement"];
    let widths = bench.pixels("demo/interval.npy");
    let mean = widths.iter().map(|&width| f64::from(width)).sum::<f64>() / widths.len() as f64;
    assert!((enhancement["mean_half_width"].as_f64().unwrap() - mean).abs() < 1e-5, "{mean}");
    assert!(enhancement["prior_share"].as_f64().unwrap() < 0.2, "{enhancement}");
    let reading = &enhancement["reading"];
    assert_eq!(reading["alternatives"][0]["characters"], "R", "{reading}");
    assert_eq!((&reading["legible"], &reading["answer"]), (&true.into(), &"character".into()));
    // What was written is what was judged.
    let judged =
        bench.run(&["metrics", "demo/truth.npy", "demo/reconstruction.npy"]).succeeded().json();
    let difference = judged["mean_ssim"].as_f64().unwrap() - quality["ssim"].as_f64().unwrap();
    assert!(difference.abs() < 1e-9, "{difference}");
}

#[test]
fn far_out_of_focus_the_distance_tells_the_blur_and_too_little_light_is_said() {
    let bench = Bench::new();
    let run = |frames| {
        let far = ["demo", "--rain", "heavy", "--distance-m", "0.6", "--out", "demo", "--json"];
        bench.run(&[&far[..], &["--frames", frames, "--seed", "4"]].concat()).succeeded().json()
    };
    let dim = run("244");
    let of = |report: &serde_json::Value, name: &str| report["enhancement"][name].as_f64().unwrap();
    // The lens's disc of 20 mm in a field of 96 mm: a fourth of its diameter is 3.3 of 64 pixels.
    assert!((of(&dim, "sigma_px") - 10.0 / 3.0).abs() < 0.05, "{dim}");
    assert!(of(&dim, "estimated_sigma_px") < of(&dim, "sigma_px"), "{dim}");
    let warnings = |report: &serde_json::Value| report["enhancement"]["warnings"].to_string();
    assert!(warnings(&dim).contains("the readings contradict the enhanced image"), "{dim}");
    // Ten times the light.
    let bright = run("2440");
    let db = |name: &str| bright["enhancement"][name]["psnr_db"].as_f64().unwrap();
    assert!(db("deblurred") > db("upscaled") + 3.0, "{bright}");
    assert!(!warnings(&bright).contains("contradict"), "{bright}");
}

#[test]
fn a_seed_gives_the_same_image_and_another_seed_another() {
    let bench = Bench::new();
    let image = |seed: &str| {
        bench.run(&["demo", "--frames", "3", "--seed", seed, "--out", "demo"]).succeeded();
        bench.pixels("demo/raw.npy")
    };
    let first = image("7");
    assert_eq!(image("7"), first);
    assert_ne!(image("8"), first);
}

#[test]
fn a_picture_fills_the_field() {
    let bench = Bench::new();
    let half: Vec<f32> = (0..64 * 64).map(|p| if p % 64 < 32 { 0.9 } else { 0.1 }).collect();
    bench.write("half.png", &encode_grey(64, 64, &half, &provenance()));
    bench.run(&["demo", "--scene", "half.png", "--out", "demo"]).succeeded();
    let pixels = bench.pixels("demo/reconstruction.npy");
    let mean = |columns: std::ops::Range<usize>| {
        let of = |c| (0..32).map(|r| pixels[r * 32 + c]).sum::<f32>() / 32.0;
        columns.clone().map(of).sum::<f32>() / columns.len() as f32
    };
    assert!(mean(2..14) > 0.8 && mean(18..30) < 0.2, "{} {}", mean(2..14), mean(18..30));
}

#[test]
fn scenes_and_distances_that_cannot_be_leave_nothing_behind() {
    let bench = Bench::new();
    bench.write("text.png", b"no picture at all");
    let demo = |arguments: &[&str]| bench.run(&[&["demo", "--out", "demo"], arguments].concat());
    demo(&["--scene", "text.png"]).failed(1, &["text.png", "expected a PNG or JPEG image"]);
    demo(&["--scene", "none.png"]).failed(1, &["none.png", "no such file"]);
    demo(&["--scene", "letter:RR"]).failed(2, &["letter:RR", "expected one"]);
    for distance in ["0", "-1", "nan", "inf", "1e9", "1e-9"] {
        demo(&["--distance-m", distance]).failed(2, &["--distance-m"]);
    }
    assert_eq!(bench.names(), ["text.png"]);
    bench.run(&["demo", "--frames", "1", "--out", "text.png"]).failed(1, &["text.png", "a file"]);
    assert_eq!(std::fs::read(bench.path("text.png")).unwrap(), b"no picture at all");
}

#[test]
fn a_far_letter_is_dim_and_never_inverted() {
    let bench = Bench::new();
    for (distance, least) in [("0.7", 0.3), ("1", 0.1)] {
        let report = bench
            .run(&["demo", "--distance-m", distance, "--out", "demo", "--json"])
            .succeeded()
            .json();
        assert_eq!(report["adc_latency_clocks"], 6, "{report}");
        for stage in ["raw", "reconstruction"] {
            let likeness = report[stage]["correlation"].as_f64().unwrap();
            assert!(likeness > least, "{stage} at {distance} m: {likeness}");
            assert!(report[stage]["inverted"].is_null(), "{report}");
        }
    }
}
