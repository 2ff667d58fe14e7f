//! `nirspi dev bench omp` and `nirspi eval sampling`.

use crate::bench::{Bench, Measured, array, npz};
use std::io::Write;

/// Two frames over eight spikes and one even atom of unit norm.
fn problem() -> Vec<u8> {
    let mut dictionary = vec![0.0_f32; 8 * 9];
    for m in 0..8 {
        dictionary[m * 9 + m] = 1.0;
        dictionary[m * 9 + 8] = 0.125_f32.sqrt();
    }
    let mut frames = vec![0.0_f32; 16];
    (frames[2], frames[5]) = (3.0, -4.0);
    frames[8..].fill(1.0);
    frames[8 + 1] = 3.0;
    npz(&[("D", &[8, 9], &dictionary), ("Y", &[2, 8], &frames), ("k", &[], &[2.0])])
}

/// Solves the problem, and gives the report.
#[track_caller]
fn solved(bench: &Bench, more: &[&str]) -> serde_json::Value {
    bench.write("problem.npz", &problem());
    let line = ["dev", "bench", "omp", "--input", "problem.npz", "--out", "solution.npz"];
    let line = [&line[..], &["--overwrite", "--repeats", "2"], more].concat();
    let report = bench.run(&line).succeeded().json();
    assert!(report["median_ms"].as_f64().unwrap() > 0.0, "{report}");
    assert_eq!((&report["frames"], &report["atoms"]), (&2.into(), &9.into()));
    let solution = |name| array(&bench.path("solution.npz"), name).as_chunks().0.to_vec();
    assert_eq!(solution("support"), [5_i64, 2, 8, 1].map(i64::to_le_bytes));
    let coef: Vec<f64> = solution("coef").into_iter().map(f64::from_le_bytes).collect();
    let off = [coef[0] + 4.0, coef[1] - 3.0, coef[3] - 2.0];
    assert!(off.iter().all(|off| off.abs() < 1e-5), "{coef:?}");
    report
}

#[test]
fn a_given_problem_is_solved_and_timed() {
    let bench = Bench::new();
    for precision in ["auto", "f32", "f64"] {
        solved(&bench, &["--precision", precision]);
    }
}

#[test]
fn a_problem_that_does_not_fit_leaves_nothing_behind() {
    let bench = Bench::new();
    bench.write("problem.npz", &npz(&[("D", &[2, 3], &[1.0; 6]), ("Y", &[1, 3], &[1.0; 3])]));
    let arguments = ["dev", "bench", "omp", "--input", "problem.npz", "--out", "solution.npz"];
    bench.run(&arguments).failed(1, &["problem.npz", "no `k`", "D, Y and k"]);
    assert_eq!(bench.names(), ["problem.npz"]);
}

#[test]
fn a_random_problem_needs_no_file() {
    let bench = Bench::new();
    let arguments =
        ["dev", "bench", "omp", "--measurements", "128", "--sparsity", "8", "--frames", "3"];
    let report = bench.run(&[&arguments[..], &["--repeats", "1"]].concat()).succeeded().json();
    assert_eq!((&report["measurements"], &report["mean_atoms"]), (&128.into(), &8.0.into()));
}

/// What wgpu finds here, or `None` (said aloud) if nothing.
fn adapter(bench: &Bench) -> Option<String> {
    let arguments =
        ["dev", "bench", "omp", "--backend", "wgpu", "--measurements", "16", "--sparsity", "1"];
    let said = bench.run(&arguments);
    if said.code != Some(0) {
        assert!(said.stderr.contains("no GPU found (wgpu: "), "{said:?}");
        // Past the test harness's capture, so that a skipped test is seen.
        let _ = writeln!(std::io::stderr(), "skipped: {}", said.stderr.trim());
        return None;
    }
    Some(said.json()["device"].as_str().unwrap().to_owned())
}

#[test]
fn a_device_asked_for_by_name_computes_and_is_named() {
    let bench = Bench::new();
    let Some(adapter) = adapter(&bench) else { return };
    for precision in ["auto", "f32"] {
        let report = solved(&bench, &["--backend", "wgpu", "--precision", precision]);
        assert_eq!(
            (&report["device"], &report["backend"]),
            (&adapter.as_str().into(), &"wgpu".into())
        );
    }
    let double = ["dev", "bench", "omp", "--backend", "wgpu", "--precision", "f64"];
    bench.run(&double).failed(1, &["f32", "cpu backend for f64"]);

    let measured = Measured::new(16);
    bench.write("in.npz", &measured.npz());
    let image = |backend: &str| {
        let arguments =
            ["reconstruct", "in.npz", "--method=omp", "--sampling", "0.4", "--sparsity", "20"];
        let to = ["--out", backend, "--backend", backend];
        bench.run(&[&arguments[..], &to].concat()).succeeded();
        let report = bench.json(&format!("{backend}/report.json"));
        assert_eq!(report["omp"]["backend"], backend);
        bench.pixels(&format!("{backend}/image.npy"))
    };
    let (there, here) = (image("wgpu"), image("cpu"));
    assert!(there.iter().zip(&here).all(|(a, b)| (a - b).abs() < 1e-4));
}

#[test]
fn without_a_gpu_auto_says_so_once_and_goes_on() {
    let bench = Bench::new();
    let arguments =
        ["dev", "bench", "omp", "--measurements", "64", "--sparsity", "4", "--repeats", "1"];
    let run = |more: &[&str]| bench.run(&[&arguments[..], more].concat());
    // The batch is too small for a GPU, or the CPU was chosen: the program looks for no GPU.
    assert_eq!(run(&["--frames", "63"]).succeeded().json()["backend"], "cpu");
    assert_eq!(run(&["--frames", "64", "--backend", "cpu"]).succeeded().json()["backend"], "cpu");
    let said = run(&["--frames", "64"]);
    let report = said.json();
    assert_eq!((said.code, &report["software"]), (Some(0), &false.into()));
    if report["backend"] == "cpu" {
        let line = said.stderr.strip_suffix("; using the CPU\n").unwrap();
        assert!(line.starts_with("nirspi: no GPU found (wgpu: ") && line.contains("; CUDA: "));
    }
    let named = run(&["--backend", "cuda"]);
    if named.code == Some(0) {
        assert_eq!(named.json()["backend"], "cuda");
    } else {
        named.failed(1, &["no GPU found (CUDA: "]);
    }
}

#[test]
fn sampling_is_judged_against_the_full_image() {
    let (bench, measured) = (Bench::new(), Measured::new(16));
    bench.write("in.npz", &measured.npz());
    let arguments =
        ["eval", "sampling", "in.npz", "--sampling", "0.25,1", "--orders", "zig-zag,natural"];
    let said = bench.run(&[&arguments[..], &["--out", "out", "--json"]].concat()).succeeded();
    let rows = said.json()["rows"].as_array().unwrap().clone();
    assert_eq!(rows.len() % 4, 0);
    let psnr = |method: &str, sampling: f64, order: &str| {
        let wanted = |row: &&serde_json::Value| {
            row["method"] == method && row["order"] == order && row["sampling"] == sampling
        };
        rows.iter().find(wanted).unwrap()["psnr_db"].as_f64()
    };
    // All patterns give the image itself: no finite PSNR, or one beyond single precision.
    assert!(psnr("hadamard", 1.0, "zig-zag").is_none_or(|db| db > 100.0));
    let (zero, best) = (psnr("hadamard", 0.25, "zig-zag"), psnr("tikhonov, dct", 0.25, "zig-zag"));
    assert!(best > zero, "{zero:?} {best:?}");
    let table = std::fs::read_to_string(bench.path("out/sampling.md")).unwrap();
    assert!(table.contains("| zig-zag | natural |") && table.contains("| omp, haar |"), "{table}");
    assert!(
        table.starts_with("Judged by the image of all patterns of the same readings"),
        "{table}"
    );
    assert!(table.contains("Best methods of each order, 25 % of the patterns"), "{table}");
    let plot = nirspi::files::image::read_grey(&bench.path("out/sampling.png")).unwrap();
    assert!(plot.width > 1000 && plot.height > 1000, "{} x {}", plot.width, plot.height);
}
