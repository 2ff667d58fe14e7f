//! `nirspi demo`.

use crate::bench::{Bench, provenance};
use nirspi::files::image::encode_grey;

const FILES: [&str; 21] = [
    "deblurred.npy",
    "deblurred.png",
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
    "side_by_side.pdf",
    "side_by_side.png",
    "side_by_side.svg",
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
        .filter(|name| !name.starts_with('.'))
        .collect();
    names.sort();
    assert_eq!(names, FILES);
    let report = bench.json("demo/report.json");
    assert_eq!(said.json(), report);
    assert_eq!((&report["rain"], &report["method"]), (&"heavy".into(), &"omp".into()));
    assert_eq!((&report["frames"]["received"], &report["sweeps"]), (&61.into(), &8.into()));
    assert!((report["acquisition_ms"].as_f64().unwrap() - 20.0).abs() < 0.1, "{report}");
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
    assert!(stage("deblurred") > 29.0, "{report}");
    // What an enhanced pixel may be off by, and what the character may be.
    let enhancement = &report["enhancement"];
    let widths = bench.pixels("demo/interval.npy");
    let mean = widths.iter().map(|&width| f64::from(width)).sum::<f64>() / widths.len() as f64;
    assert!((enhancement["mean_half_width"].as_f64().unwrap() - mean).abs() < 1e-5, "{mean}");
    assert!(enhancement["prior_share"].as_f64().unwrap() < 0.2, "{enhancement}");
    let reading = &enhancement["reading"];
    assert_eq!(reading["alternatives"][0]["characters"], "R", "{reading}");
    assert_eq!((&reading["legible"], &reading["answer"]), (&true.into(), &"character".into()));
}

/// The image as its scores see it: after the fit that stands beside them.
fn scored_db(image: &[f32], truth: &[f32], quality: &serde_json::Value) -> f64 {
    let of = |name: &str| quality["fit"][name].as_f64().unwrap();
    let (gain, offset) = (of("gain"), of("offset"));
    let error = |(&seen, &true_value): (&f32, &f32)| {
        ((f64::from(seen) * gain + offset).clamp(0.0, 1.0) - f64::from(true_value)).powi(2)
    };
    let sum: f64 = image.iter().zip(truth).map(error).sum();
    -10.0 * (sum / truth.len() as f64).log10()
}

#[test]
#[ignore = "long: .ci/run demo"]
fn images_are_shares_of_white_with_their_noise_and_the_fit_stands_beside_the_scores() {
    let bench = Bench::new();
    // A grey picture: a fit to the truth would hide a wrong scale.
    let grey: Vec<f32> = (0..64 * 64).map(|p| if p % 64 < 32 { 0.1 } else { 0.4 }).collect();
    bench.write("grey.png", &encode_grey(64, 64, &grey, &provenance()));
    let demo = ["demo", "--scene", "grey.png", "--sampling", "1", "--out", "demo", "--json"];
    let report = bench.run(&demo).succeeded().json();
    for (file, grid, stage) in [
        ("raw", "truth", &report["raw"]),
        ("reconstruction", "truth", &report["reconstruction"]),
        ("upscaled", "truth_64", &report["enhancement"]["upscaled"]),
        ("fused", "truth_64", &report["enhancement"]["fused"]),
        ("deblurred", "truth_64", &report["enhancement"]["deblurred"]),
    ] {
        let image = bench.pixels(&format!("demo/{file}.npy"));
        let truth = bench.pixels(&format!("demo/{grid}.npy"));
        let mean = |values: &[f32]| values.iter().sum::<f32>() / values.len() as f32;
        assert!((mean(&image) - mean(&truth)).abs() < 0.01, "{file}: {}", mean(&image));
        let gain = stage["fit"]["gain"].as_f64().unwrap();
        assert!((gain - 1.0).abs() < 0.06 && gain != 1.0, "{file}: {stage}");
        let (found, said) = (scored_db(&image, &truth, stage), stage["psnr_db"].as_f64().unwrap());
        assert!((found - said).abs() < 1e-3, "{file}: {found} {said}");
        let blank = scored_db(
            &vec![mean(&truth); truth.len()],
            &truth,
            &serde_json::json!({
                "fit": {"gain": 1.0, "offset": 0.0}
            }),
        );
        let over = stage["over_blank_db"].as_f64().unwrap();
        assert!((said - blank - over).abs() < 1e-3, "{file}: {said} {blank} {over}");
    }
    // A covered lens reads noise about 0, and half of the noise is below 0.
    bench.run(&["demo", "--scene", "black", "--out", "black"]).succeeded();
    let dark = bench.pixels("black/reconstruction.npy");
    let below = dark.iter().filter(|&&value| value < 0.0).count();
    assert!((300..700).contains(&below), "{below} of 1024");
}

#[test]
#[ignore = "long: .ci/run demo"]
fn a_flat_scene_has_a_noise_figure_and_its_own_grey() {
    let bench = Bench::new();
    bench.write("grey.png", &encode_grey(8, 8, &[0.4; 64], &provenance()));
    // The noise of a white pixel by the photon budget: SNR 26.8 at 0.3 m and 2.5 at 1 m.
    for (scene, level, distance, std) in
        [("white", 0.9, "0.3", 0.0373), ("black", 0.0, "0.3", 0.0365), ("grey.png", 0.4, "1", 0.39)]
    {
        let demo = ["demo", "--scene", scene, "--distance-m", distance, "--sampling", "1"];
        let dry = ["--rain", "none", "--method", "hadamard", "--out", "demo"];
        let said = bench.run(&[&demo[..], &dry].concat()).succeeded().stdout;
        assert!(!said.contains(" inf"), "{said}");
        assert!(said.contains("of white") && said.contains("no PSNR: the scene is flat"), "{said}");
        let report = bench.json("demo/report.json");
        let stage = &report["reconstruction"];
        assert!(stage["psnr_db"].is_null() && stage["ssim"].is_null(), "{stage}");
        assert!(stage["no_psnr"].as_str().unwrap().contains("flat"), "{stage}");
        let noise = |name: &str| stage["noise"][name].as_f64().unwrap();
        assert!((noise("std") / std - 1.0).abs() < 0.1, "{scene}: {stage}");
        assert!((noise("mean") - level).abs() < 0.05 * level + 0.01, "{scene}: {stage}");
        assert_eq!(stage["noise"]["snr"].is_null(), level == 0.0, "{stage}");
        // As drawn, the picture has the grey of its value and not black.
        let drawn = nirspi::files::image::read_grey(&bench.path("demo/deblurred.png")).unwrap();
        let mean = drawn.values.iter().sum::<f32>() / drawn.values.len() as f32;
        let known = bench.pixels("demo/deblurred.npy");
        let expected = known.iter().map(|v| v.clamp(0.0, 1.0)).sum::<f32>() / known.len() as f32;
        assert!((mean - expected).abs() < 0.01, "{scene}: {mean} {expected}");
    }
}

#[test]
#[ignore = "long: .ci/run demo"]
fn all_panels_show_one_field_on_one_scale() {
    let bench = Bench::new();
    let demo = ["demo", "--distance-m", "0.6", "--out", "demo", "--json"];
    let report = bench.run(&demo).succeeded().json();
    let panels = report["pictures"][0]["images"].as_array().unwrap();
    let titles: Vec<&str> = panels.iter().map(|panel| panel["title"].as_str().unwrap()).collect();
    assert_eq!(titles[0], "scene");
    assert_eq!(titles[6], "uncertainty: bright is unsure");
    for panel in &panels[..6] {
        assert_eq!((&panel["black"], &panel["white"]), (&0.0.into(), &1.0.into()), "{panel}");
    }
    // The letter is as high in the scene as in the reference: 39 of 96 mm.
    let rows = |file: &str| {
        let image = bench.pixels(file);
        let side = image.len().isqrt();
        let lit: Vec<usize> =
            (0..side).filter(|r| image[r * side..][..side].iter().any(|&v| v > 0.45)).collect();
        (lit[lit.len() - 1] - lit[0] + 1) as f64 / side as f64
    };
    let (scene, truth) = (rows("demo/scene.npy"), rows("demo/truth_64.npy"));
    assert!((scene - truth).abs() < 0.03 && (scene - 0.40).abs() < 0.02, "{scene} {truth}");
}

#[test]
#[ignore = "long: .ci/run demo"]
fn figures_show_the_panels_asked_for_at_the_width_asked_for() {
    let bench = Bench::new();
    let demo = ["demo", "--frames", "2", "--out", "demo", "--json"];
    let width = || {
        let svg = std::fs::read_to_string(bench.path("demo/side_by_side.svg")).unwrap();
        svg.split("width=\"").nth(1).unwrap().split("mm").next().unwrap().parse::<f64>().unwrap()
    };
    let of = |more: &[&str]| {
        let report = bench.run(&[&demo[..], more].concat()).succeeded().json();
        let panels = report["pictures"][0]["images"].as_array().unwrap().clone();
        let titles: Vec<String> =
            panels.iter().map(|panel| panel["title"].as_str().unwrap().to_owned()).collect();
        (titles, width().round() as u32)
    };
    assert_eq!(of(&[]).1, 178);
    let two = ["--panels", "deblurred,scene", "--figure", "column"];
    assert_eq!(of(&two), (vec!["deblurred".to_owned(), "scene".to_owned()], 85));
    let wrong = [&demo[..], &["--panels", "noise"]].concat();
    bench.run(&wrong).failed(2, &["noise", "uncertainty"]);
    let wrong = [&demo[..], &["--figure", "poster"]].concat();
    bench.run(&wrong).failed(2, &["poster", "paper"]);
}

#[test]
#[ignore = "long: .ci/run demo"]
fn the_papers_rain_gives_way_to_other_weather() {
    let bench = Bench::new();
    bench.write("foggy.toml", b"name = \"foggy\"\n[weather]\nair = \"fog:5m\"");
    for (options, rain) in [
        (&["--rain", "none"][..], "none"),
        (&["--weather", "fog:5m"], "fog:5m"),
        (&["--camera-model", "foggy.toml"], "fog:5m"),
        (&["--camera-model", "fga015"], "heavy"),
    ] {
        let demo = ["demo", "--frames", "2", "--out", "demo", "--json"];
        let report = bench.run(&[&demo[..], options].concat()).succeeded().json();
        assert_eq!(report["rain"], rain, "{options:?}");
    }
}

#[test]
#[ignore = "long: .ci/run demo"]
fn the_light_is_the_same_at_every_share_and_no_frame_is_lost() {
    let bench = Bench::new();
    let demo = |options: &[&str]| {
        let run = ["demo", "--rain", "none", "--method", "hadamard", "--out", "demo", "--json"];
        bench.run(&[&run[..], options].concat())
    };
    let (frames, light) = (&["--frames", "244"][..], &["--light", "20ms"][..]);
    for (share, length) in
        [("1%", frames), ("2%", &[]), ("7%", frames), ("10%", light), ("1", &[]), ("1", frames)]
    {
        let report = demo(&[&["--sampling", share], length].concat()).succeeded().json();
        assert_eq!(report["frames"]["lost"], 0, "{share} {length:?}");
        let light = report["acquisition_ms"].as_f64().unwrap();
        let most = if length.first() == Some(&"--frames") { 0.02 } else { 0.005 };
        assert!((light / 20.0 - 1.0).abs() < most, "{share} {length:?}: {light} ms");
    }
    std::fs::remove_dir_all(bench.path("demo")).unwrap();
    let lost = demo(&["--sampling", "2%", "--frames", "244", "--sweeps", "1"]);
    lost.failed(1, &["of 244 frames made", "lost", "more sweeps"]);
    assert!(bench.names().is_empty(), "{:?}", bench.names());
}

#[test]
#[ignore = "long: .ci/run demo"]
fn far_out_of_focus_the_distance_tells_the_blur_and_too_little_light_is_said() {
    let bench = Bench::new();
    let run = |light| {
        let far = ["demo", "--rain", "heavy", "--distance-m", "0.6", "--out", "demo", "--json"];
        bench.run(&[&far[..], &["--light", light, "--seed", "4"]].concat()).succeeded().json()
    };
    let dim = run("5ms");
    let of = |report: &serde_json::Value, name: &str| report["enhancement"][name].as_f64().unwrap();
    // The lens's disc of 20 mm in a field of 96 mm: a fourth of its diameter is 3.3 of 64 pixels.
    assert!((of(&dim, "sigma_px") - 10.0 / 3.0).abs() < 0.05, "{dim}");
    assert!(of(&dim, "estimated_sigma_px") < of(&dim, "sigma_px"), "{dim}");
    let warnings = |report: &serde_json::Value| report["enhancement"]["warnings"].to_string();
    assert!(warnings(&dim).contains("too little light: the noise is"), "{dim}");
    // Twenty times the light.
    let bright = run("100ms");
    let db = |name: &str| bright["enhancement"][name]["psnr_db"].as_f64().unwrap();
    assert!(db("deblurred") > db("upscaled") + 3.0, "{bright}");
    assert!(!warnings(&bright).contains("contradict"), "{bright}");
    assert!(!warnings(&bright).contains("too little light"), "{bright}");
}

#[test]
#[ignore = "long: .ci/run demo"]
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
    demo(&["--scene", "nowhere/none.png"]).failed(1, &["nowhere/none.png", "no such file"]);
    demo(&["--scene", "letter:RR"]).failed(2, &["letter:RR", "expected one"]);
    for distance in ["0", "-1", "nan", "inf", "1e9", "1e-9"] {
        demo(&["--distance-m", distance]).failed(2, &["--distance-m"]);
    }
    assert_eq!(bench.names(), ["text.png"]);
    bench.run(&["demo", "--frames", "1", "--out", "text.png"]).failed(1, &["text.png", "a file"]);
    assert_eq!(std::fs::read(bench.path("text.png")).unwrap(), b"no picture at all");
}

#[test]
#[ignore = "long: .ci/run demo"]
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
