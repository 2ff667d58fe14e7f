//! `nirspi reconstruct` on measurement files.

use crate::bench::{Bench, Measured, correlation, npz};

#[test]
fn a_measurement_comes_back_as_the_image_it_was_made_from() {
    for n in [2, 8, 32] {
        let (bench, measured) = (Bench::new(), Measured::new(n));
        bench.write("in.npz", &measured.npz());
        let said = bench
            .run(&["reconstruct", "in.npz", "--method", "hadamard", "--out", "out", "--json"])
            .succeeded();
        let pixels = bench.pixels("out/image.npy");
        let worst =
            pixels.iter().zip(&measured.image).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(worst < 1e-3, "{n}: off by {worst}");
        let report = bench.json("out/report.json");
        assert_eq!(said.json(), report);
        assert_eq!((&report["n"], &report["used"]), (&n.into(), &(n * n).into()));
        assert!(report["correlation_with_files_recon"].as_f64().unwrap() > 0.9999, "{report}");
        assert_eq!(bench.names(), ["in.npz", "out"]);
        // The picture has labels, and programs find the image in it; its range is in the report.
        let [picture] = report["pictures"].as_array().unwrap().as_slice() else { panic!() };
        assert_eq!(picture["file"], "image.png");
        let range = |name: &str| picture["images"][0][name].as_f64().unwrap();
        assert!(range("least") <= range("black") && range("white") <= range("most"), "{picture}");
        assert_eq!(picture["images"][0]["unit"], "units of the readings");
        let found = nirspi::files::image::read_grey(&bench.path("out/image.png")).unwrap();
        assert_eq!((found.width, found.height), (n as u32, n as u32));
        let level = |p: &f32| (f64::from(*p) - range("black")) / (range("white") - range("black"));
        for (pixel, found) in pixels.iter().zip(&found.values) {
            assert!((level(pixel).clamp(0.0, 1.0) - f64::from(*found)).abs() < 0.005, "{pixel}");
        }
    }
}

#[test]
fn the_printed_algorithm_chooses_as_many_atoms_as_asked_and_keeps_no_measurement() {
    let (bench, measured) = (Bench::new(), Measured::new(32));
    bench.write("in.npz", &measured.npz());
    let printed = ["reconstruct", "in.npz", "--as-printed", "--sparsity", "7"];
    bench.run(&printed).failed(2, &["--as-printed belongs to --method omp"]);
    bench.run(&[&printed[..], &["--method", "omp"]].concat()).succeeded();
    let report = bench.json("out/report.json");
    let weight = &report["omp"]["weight_of_readings"];
    assert_eq!((&report["omp"]["sparsity"], weight), (&7.into(), &0.0.into()));
    bench.run(&["reconstruct", "in.npz", "--as-printed"]).failed(2, &["--sparsity"]);
}

#[test]
#[ignore = "long: .ci/run demo"]
fn every_method_predicts_a_phantom_better_than_zero_does_and_says_how() {
    let (bench, measured) = (Bench::new(), Measured::new(32));
    bench.write("in.npz", &measured.npz());
    let correlation_by = |arguments: &[&str]| {
        let part =
            ["reconstruct", "in.npz", "--sampling", "0.3", "--first-of", "zig-zag", "--method"];
        bench.run(&[&part, arguments].concat()).succeeded();
        correlation(&bench.pixels("out/image.npy"), &measured.image)
    };
    // However the share is written, and with the default of the library's list.
    let share = |share: &str| {
        bench.run(&["reconstruct", "in.npz", "--sampling", share, "--json"]).succeeded().json()
    };
    for written in ["0.3", "30%", "30 %"] {
        assert_eq!(
            (&share(written)["used"], &share(written)["method"]),
            (&307.into(), &"auto".into())
        );
    }
    let zero = correlation_by(&["hadamard"]);
    assert_eq!(correlation_by(&["pseudo-inverse"]), zero);
    for method in ["tikhonov", "fista", "tv"] {
        let found = correlation_by(&[method]);
        assert!(found > zero, "{method}: {found}, zero filling {zero}");
        let report = bench.json("out/report.json");
        assert_eq!(report["method"], method);
        assert!(report["penalty"]["strength"].as_f64().unwrap() > 0.0, "{report}");
    }
    assert!(correlation_by(&["prior"]) > zero);
    let prior = &bench.json("out/report.json")["prior"];
    assert!(prior["trust_in_prediction"].is_number() || prior["note"].is_string(), "{prior}");
    correlation_by(&["tikhonov", "--strength", "2", "--basis", "daubechies4"]);
    let penalty = &bench.json("out/report.json")["penalty"];
    assert_eq!((&penalty["strength"], &penalty["basis"]), (&2.0.into(), &"daubechies4".into()));
    correlation_by(&["omp", "--stop-at-noise"]);
    assert!(bench.json("out/report.json")["omp"]["sparsity"].as_u64().unwrap() > 0);
}

#[test]
fn a_dropped_out_detector_is_named_and_does_not_stripe_the_image() {
    let (bench, mut measured) = (Bench::new(), Measured::new(32));
    for reading in &mut measured.y[300..309] {
        *reading *= 1e-4;
    }
    bench.write("in.npz", &measured.npz());
    let said = bench.run(&["reconstruct", "in.npz", "--method", "omp"]).succeeded();
    assert!(said.stdout.contains("drop-out: 9 readings from y[300] on, 5 patterns"), "{said:?}");
    let dropouts = &bench.json("out/report.json")["dropouts"];
    assert_eq!(dropouts[0]["first_reading"], 300);
    assert_eq!(dropouts[0]["rows"].as_array().unwrap().len(), 5);
    assert!(correlation(&bench.pixels("out/image.npy"), &measured.image) > 0.99);
}

#[test]
fn an_order_of_the_users_own_chooses_which_patterns_count() {
    let (bench, measured) = (Bench::new(), Measured::new(8));
    bench.write("in.npz", &measured.npz());
    let recorded: Vec<String> = measured.h_row.iter().map(f32::to_string).collect();
    bench.write("order.txt", recorded.join("\n").as_bytes());
    let half = ["reconstruct", "in.npz", "--sampling", "0.5", "--method", "hadamard"];
    bench.run(&[&half[..], &["--out", "a", "--first-of", "recorded"]].concat()).succeeded();
    bench.run(&[&half[..], &["--out", "b", "--first-of", "table:order.txt"]].concat()).succeeded();
    bench.run(&[&half[..], &["--out", "c", "--first-of", "sequency"]].concat()).succeeded();
    let (a, b, c) =
        (bench.pixels("a/image.npy"), bench.pixels("b/image.npy"), bench.pixels("c/image.npy"));
    assert_eq!(a, b);
    assert_ne!(a, c);
}

#[test]
fn a_run_that_fails_leaves_older_results_alone() {
    let (bench, mut measured) = (Bench::new(), Measured::new(8));
    bench.write("in.npz", &measured.npz());
    bench.run(&["reconstruct", "in.npz"]).succeeded();
    let before = std::fs::read(bench.path("out/report.json")).unwrap();
    measured.y[7] = f32::INFINITY;
    bench.write("in.npz", &measured.npz());
    bench.run(&["reconstruct", "in.npz"]).failed(1, &["in.npz", "`y`", "inf", "[7]"]);
    assert_eq!(std::fs::read(bench.path("out/report.json")).unwrap(), before);
    let files = ["image.npy", "image.png", "image.svg", "image.pdf", "report.json", ".nirspi.json"];
    assert!(files.iter().all(|name| bench.path(&format!("out/{name}")).is_file()));
    assert_eq!(std::fs::read_dir(bench.path("out")).unwrap().count(), files.len());
}

#[test]
fn results_replace_those_of_the_run_before_and_no_file_of_the_users() {
    let (bench, measured) = (Bench::new(), Measured::new(32));
    bench.write("in.npz", &measured.npz());
    let there = |name: &str| bench.path(&format!("out/{name}")).exists();
    bench.run(&["reconstruct", "in.npz", "--enhance"]).succeeded();
    assert!(there("enhanced.npy") && there("enhanced.png"));
    bench.run(&["reconstruct", "in.npz", "--method", "hadamard"]).succeeded();
    assert!(there("image.npy") && !there("enhanced.npy") && !there("enhanced.png"));
    // Readings that have the name of a result.
    std::fs::create_dir(bench.path("mine")).unwrap();
    bench.write("mine/image.npy", b"readings");
    let told = ["mine/image.npy: is there already", "expected another folder for the results"];
    bench.run(&["reconstruct", "in.npz", "--out", "mine"]).failed(1, &told);
    assert_eq!(std::fs::read(bench.path("mine/image.npy")).unwrap(), b"readings");
    assert_eq!(std::fs::read_dir(bench.path("mine")).unwrap().count(), 1);
}

#[test]
fn light_that_may_not_be_negative_is_not() {
    let (bench, measured) = (Bench::new(), Measured::new(16));
    bench.write("in.npz", &measured.npz());
    let lit = ["reconstruct", "in.npz", "--sampling", "0.5", "--non-negative"];
    let part = [&lit[..], &["--method", "omp"]].concat();
    bench.run(&[&part[..], &["--basis", "pixel", "--sparsity", "40"]].concat()).succeeded();
    assert!(bench.pixels("out/image.npy").iter().all(|&p| p > -1e-5));
    assert_eq!(bench.json("out/report.json")["omp"]["weight_of_readings"], 0.0);
    bench
        .run(&part)
        .failed(2, &["--non-negative in the dct basis", "--basis pixel or --dictionary"]);
    let tv = [&lit[..], &["--basis", "pixel", "--method", "tv"]].concat();
    bench.run(&tv).failed(2, &["--non-negative belongs to --method omp"]);
}

/// Frames of the phantom, brighter and brighter, as a stack.
fn stack(measured: &Measured, frames: usize) -> Vec<u8> {
    let count = measured.h_row.len();
    let brighter = |k: usize| 1.0 + 0.1 * k as f32;
    let all: Vec<f32> =
        (0..frames).flat_map(|k| measured.d.iter().map(move |d| d * brighter(k))).collect();
    let fields: [(&str, &[usize], &[f32]); 3] = [
        ("n", &[], &[measured.n as f32]),
        ("h_row", &[count], &measured.h_row),
        ("d", &[frames, count], &all),
    ];
    npz(&fields)
}

#[test]
fn all_measurements_of_a_file_are_reconstructed_one_by_one_or_each_from_the_one_before() {
    let (bench, measured) = (Bench::new(), Measured::new(16));
    bench.write("in.npz", &stack(&measured, 4));
    let part = ["reconstruct", "in.npz", "--index", "all", "--method", "omp", "--sampling", "0.4"];
    let cold = bench.run(&[&part[..], &["--out", "cold", "--json"]].concat()).succeeded().json();
    let warm = bench.run(&[&part[..], &["--out", "warm", "--warm-start"]].concat()).succeeded();
    assert!(warm.stdout.contains("4 frames of 16 x 16") && warm.stdout.contains("3 started from"));
    assert_eq!(
        (&cold["frames"][3]["warm"], cold["frames"].as_array().unwrap().len()),
        (&false.into(), 4)
    );
    assert_eq!(bench.json("warm/report.json")["frames"][3]["warm"], true);
    let (cold, warm) = (bench.pixels("cold/image.npy"), bench.pixels("warm/image.npy"));
    assert_eq!((cold.len(), warm.len()), (4 * 256, 4 * 256));
    for (cold, warm) in cold.chunks(256).zip(warm.chunks(256)) {
        assert!(correlation(cold, warm) > 0.99);
    }
    bench
        .run(&["reconstruct", "in.npz", "--index", "1", "--method", "omp", "--warm-start"])
        .failed(2, &["--warm-start belongs to --index all"]);
    bench.run(&["reconstruct", "in.npz", "--index", "some"]).failed(2, &["a number or all"]);
    bench.run(&["reconstruct", "in.npz"]).failed(2, &["in.npz", "`d`", "--index 0..3"]);
    bench.run(&["reconstruct", "in.npz", "--index", "4"]).failed(2, &["no index 4", "0..3"]);
    bench.run(&["eval", "sampling", "in.npz", "--index", "all"]).failed(2, &["one measurement"]);
}

#[test]
#[ignore = "long: .ci/run demo"]
fn frames_of_some_patterns_each_make_up_one_scene_with_those_before() {
    let (bench, measured) = (Bench::new(), Measured::new(16));
    let count = measured.h_row.len();
    // Each frame has every fourth pattern, and NaN for the others.
    let of = |frame: usize, k: usize| k % 4 == frame % 4 || measured.h_row[k] < 64.0;
    let d: Vec<f32> = (0..8 * count)
        .map(|at| if of(at / count, at % count) { measured.d[at % count] } else { f32::NAN })
        .collect();
    let fields: [(&str, &[usize], &[f32]); 3] = [
        ("n", &[], &[measured.n as f32]),
        ("h_row", &[count], &measured.h_row),
        ("d", &[8, count], &d),
    ];
    bench.write("in.npz", &npz(&fields));
    let all = ["reconstruct", "in.npz", "--index", "all"];
    bench.run(&[&all[..], &["--out", "cold"]].concat()).succeeded();
    let warm = bench.run(&[&all[..], &["--out", "warm", "--warm-start"]].concat()).succeeded();
    assert!(warm.stdout.contains("7 started from the frame before"), "{}", warm.stdout);
    let note = bench.json("warm/report.json")["frames"][7]["penalty"]["note"].to_string();
    assert!(note.contains("patterns known, scene moved by 0 px down and 0 px right"), "{note}");
    let last = |path: &str| correlation(&bench.pixels(path)[7 * 256..], &measured.image);
    let (cold, warm) = (last("cold/image.npy"), last("warm/image.npy"));
    assert!(warm > cold, "{cold} {warm}");
    let haar = ["--warm-start", "--basis", "haar", "--method", "tikhonov"];
    let haar = [&all[..], &haar].concat();
    bench.run(&haar).failed(1, &["frame before", "dct basis, found haar"]);
    let tv = [&all[..], &["--warm-start", "--method", "tv", "--out", "tv"]].concat();
    bench.run(&tv).succeeded();
    assert!(last("tv/image.npy") > 0.9, "{cold}");
    let zeros = [&all[..], &["--warm-start", "--method", "hadamard"]].concat();
    bench.run(&zeros).failed(2, &["--warm-start belongs to --method omp, tikhonov, fista"]);
}
