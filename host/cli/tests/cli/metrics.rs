//! `nirspi metrics`. That the figures are right is tested in `nirspi-recon`.

use crate::bench::{Bench, Measured};
use nirspi::files::npy;

#[test]
fn two_stacks_are_compared_image_by_image() {
    let bench = Bench::new();
    let reference: Vec<f32> = (0..2 * 256).map(|i| (i % 16) as f32 / 16.0).collect();
    let mut test = reference.clone();
    test[256..].iter_mut().for_each(|pixel| *pixel += 0.05);
    bench.write("a.npy", &npy::encode(&[2, 16, 16], &reference));
    bench.write("b.npy", &npy::encode(&[2, 16, 16], &test));
    let report = bench.run(&["metrics", "a.npy", "b.npy", "--json"]).succeeded().json();
    // The first is identical, which has no finite PSNR; the second is off by 0.05 everywhere: 26.02 dB.
    assert!(report["each"][0]["psnr_db"].is_null() && report["each"][0]["ssim"] == 1.0, "{report}");
    assert!((report["each"][1]["psnr_db"].as_f64().unwrap() - 26.0206).abs() < 1e-3, "{report}");
    let twice = ["metrics", "a.npy", "b.npy", "--json", "--data-range", "2"];
    let psnr_db = &bench.run(&twice).succeeded().json()["each"][1]["psnr_db"];
    assert!((psnr_db.as_f64().unwrap() - 32.0412).abs() < 1e-3, "{psnr_db}");
    let said = bench.run(&["metrics", "a.npy", "b.npy"]).succeeded().stdout;
    assert!(said.starts_with("2 images of 16 x 16\nPSNR 26.02 dB, SSIM 0.9"), "{said}");
}

#[test]
fn pictures_with_labels_are_compared_by_the_images_in_them() {
    let bench = Bench::new();
    let measured = Measured::new(16);
    bench.write("in.npz", &measured.npz());
    for (out, share) in [("all", "1"), ("part", "0.5")] {
        bench.run(&["reconstruct", "in.npz", "--sampling", share, "--out", out]).succeeded();
    }
    let compare =
        |test: &str| bench.run(&["metrics", "all/image.png", test, "--json"]).succeeded().json();
    assert_eq!(compare("all/image.png")["mean_ssim"], 1.0);
    let part = compare("part/image.png")["mean_ssim"].as_f64().unwrap();
    // The labels are equal in both pictures, so the comparison leaves them out.
    let range = bench
        .run(&["metrics", "all", "part", "--align", "gain-offset", "--json"])
        .succeeded()
        .json();
    assert!((part - range["mean_ssim"].as_f64().unwrap()).abs() < 0.1, "{part} {range}");
}

/// Three images of 64 x 64 with stripes of their own.
fn stripes(shift: usize) -> Vec<u8> {
    let pixel = |at: usize| ((at % 64 + shift + 7 * (at / 4096)) % 9) as f32 / 8.0;
    npy::encode(&[3, 64, 64], &(0..3 * 4096).map(pixel).collect::<Vec<f32>>())
}

#[test]
fn sets_of_characters_have_a_distance_of_their_own_name() {
    let bench = Bench::new();
    bench.write("a.npy", &stripes(0));
    bench.write("b.npy", &stripes(4));
    bench.write("labels.npy", &npy::encode(&[3], &[10.0, 11.0, 61.0_f64]));
    let far = bench
        .run(&["metrics", "a.npy", "b.npy", "--labels", "labels.npy", "--json"])
        .succeeded()
        .json();
    let near = bench.run(&["metrics", "a.npy", "a.npy", "--json"]).succeeded().json();
    let distance =
        |report: &serde_json::Value| report["frechet_character_distance"].as_f64().unwrap();
    assert!(distance(&near) < 1e-3 && distance(&far) > distance(&near), "{near} {far}");
    assert!(near["character_accuracy"].is_null(), "{far}");
    assert!(far["character_accuracy"]["test"].as_f64().unwrap() <= 1.0, "{far}");
}

#[test]
fn a_figure_that_cannot_be_had_says_why() {
    let bench = Bench::new();
    bench.write("small.npy", &npy::encode(&[16, 16], &[0.5; 256]));
    let report = bench.run(&["metrics", "small.npy", "small.npy", "--json"]).succeeded().json();
    assert!(report["frechet_character_distance"].is_null());
    assert!(report["notes"][0].as_str().unwrap().contains("64 x 64, not 16 x 16"), "{report}");
    bench.write("one.npy", &stripes(0));
    bench.write("labels.npy", &npy::encode(&[2], &[10.0, 11.0_f64]));
    bench.write("odd.npy", &npy::encode(&[3], &[10.0, 11.5, 1.0_f64]));
    bench.write("flat.npy", &npy::encode(&[3, 1], &[1.0_f64; 3]));
    let with = |more: &[&str]| bench.run(&[&["metrics", "one.npy", "one.npy"], more].concat());
    with(&["--labels", "labels.npy"]).failed(1, &["labels.npy", "2 labels, expected 3"]);
    with(&["--labels", "odd.npy"]).failed(1, &["odd.npy", "11.5 at [1]", "0 to 61"]);
    with(&["--labels", "flat.npy"]).failed(1, &["flat.npy", "(3, 1)", "(N,)"]);
    with(&["--legibility"]).failed(2, &["--labels"]);
}

#[test]
fn stacks_that_cannot_be_compared_are_refused() {
    let bench = Bench::new();
    bench.write("a.npy", &npy::encode(&[16, 16], &[0.5; 256]));
    bench.write("wide.npy", &npy::encode(&[16, 32], &[0.5; 512]));
    bench.write("bright.npy", &npy::encode(&[16, 16], &[[0.5; 255].as_slice(), &[1.5]].concat()));
    bench.write("small.npy", &npy::encode(&[8, 8], &[0.5; 64]));
    let compare = |a, b| bench.run(&["metrics", a, b]);
    compare("a.npy", "wide.npy").failed(1, &["wide.npy", "(1, 16, 32)", "(1, 16, 16)", "a.npy"]);
    compare("a.npy", "bright.npy").failed(1, &["bright.npy", "1.5 at [0, 15, 15]", "0 to 1"]);
    compare("a.npy", "none.npy").failed(1, &["none.npy", "no such file"]);
    compare("small.npy", "small.npy").failed(1, &["small.npy", "8 x 8", "11 x 11"]);
}
