//! `nirspi metrics`. That the figures are right is tested in `nirspi-recon`.

use crate::bench::Bench;
use nirspi::files::npy;

#[test]
fn two_stacks_are_compared_image_by_image() {
    let bench = Bench::new();
    let reference: Vec<f32> = (0..2 * 256).map(|i| (i % 16) as f32 / 16.0).collect();
    let mut test = reference.clone();
    test[256..].iter_mut().for_each(|pixel| *pixel += 0.05);
    bench.write("a.npy", &npy::encode(&[2, 16, 16], &reference));
    bench.write("b.npy", &npy::encode(&[2, 16, 16], &test));
    let report = bench.run(&["metrics", "a.npy", "b.npy"]).succeeded().json();
    // The first is identical, which has no finite PSNR; the second is off by 0.05 everywhere: 26.02 dB.
    assert!(report["each"][0]["psnr_db"].is_null() && report["each"][0]["ssim"] == 1.0, "{report}");
    assert!((report["each"][1]["psnr_db"].as_f64().unwrap() - 26.0206).abs() < 1e-3, "{report}");
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
