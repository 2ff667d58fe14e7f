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
        let png = std::fs::read(bench.path("out/image.png")).unwrap();
        assert!(png.starts_with(b"\x89PNG"));
        assert_eq!(bench.names(), ["in.npz", "out"]);
    }
}

#[test]
fn the_printed_algorithm_chooses_as_many_atoms_as_asked_and_keeps_no_measurement() {
    let (bench, measured) = (Bench::new(), Measured::new(32));
    bench.write("in.npz", &measured.npz());
    bench.run(&["reconstruct", "in.npz", "--as-printed", "--sparsity", "7"]).succeeded();
    let report = bench.json("out/report.json");
    assert_eq!((&report["omp"]["sparsity"], &report["omp"]["keep"]), (&7.into(), &"sparse".into()));
    bench.run(&["reconstruct", "in.npz", "--as-printed"]).failed(2, &["--sparsity"]);
}

#[test]
fn omp_predicts_what_was_not_measured_better_than_zero_does() {
    let (bench, measured) = (Bench::new(), Measured::new(32));
    bench.write("in.npz", &measured.npz());
    let mut correlations = Vec::new();
    for method in ["omp", "hadamard"] {
        let part = ["--method", method, "--sampling", "0.4", "--order", "random:1"];
        bench.run(&[&["reconstruct", "in.npz"][..], &part].concat()).succeeded();
        assert_eq!(bench.json("out/report.json")["used"], 410);
        correlations.push(correlation(&bench.pixels("out/image.npy"), &measured.image));
    }
    assert!(correlations[0] > correlations[1] + 0.1, "{correlations:?}");
}

#[test]
fn every_method_predicts_a_phantom_better_than_zero_does_and_says_how() {
    let (bench, measured) = (Bench::new(), Measured::new(32));
    bench.write("in.npz", &measured.npz());
    let correlation_by = |arguments: &[&str]| {
        let part = ["reconstruct", "in.npz", "--sampling", "0.3", "--order", "zig-zag", "--method"];
        bench.run(&[&part, arguments].concat()).succeeded();
        correlation(&bench.pixels("out/image.npy"), &measured.image)
    };
    let zero = correlation_by(&["hadamard"]);
    assert_eq!(correlation_by(&["pseudo-inverse"]), zero);
    for method in ["tikhonov", "fista", "tv"] {
        let found = correlation_by(&[method]);
        assert!(found > zero, "{method}: {found}, zero filling {zero}");
        let report = bench.json("out/report.json");
        assert_eq!(report["method"], method);
        assert!(report["penalty"]["strength"].as_f64().unwrap() > 0.0, "{report}");
    }
    correlation_by(&["tikhonov", "--strength", "2", "--basis", "daubechies4"]);
    let penalty = &bench.json("out/report.json")["penalty"];
    assert_eq!((&penalty["strength"], &penalty["basis"]), (&2.0.into(), &"daubechies4".into()));
    correlation_by(&["omp", "--stop-at-noise"]);
    assert!(bench.json("out/report.json")["omp"]["sparsity"].as_u64().unwrap() > 0);
}

#[test]
fn of_several_measurements_the_one_asked_for_is_taken() {
    let (bench, measured) = (Bench::new(), Measured::new(8));
    let dark = vec![0.0; measured.d.len()];
    let both = [dark, measured.d.clone()].concat();
    let fields: [(&str, &[usize], &[f32]); 3] =
        [("n", &[1], &[8.0]), ("h_row", &[64], &measured.h_row), ("d", &[2, 64], &both)];
    bench.write("in.npz", &npz(&fields));
    bench.run(&["reconstruct", "in.npz"]).failed(2, &["in.npz", "`d`", "--index 0..1"]);
    bench.run(&["reconstruct", "in.npz", "--index", "2"]).failed(2, &["no index 2", "0..1"]);
    assert_eq!(bench.names(), ["in.npz"]);
    bench.run(&["reconstruct", "in.npz", "--index", "1"]).succeeded();
    assert!(correlation(&bench.pixels("out/image.npy"), &measured.image) > 0.9999);
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
    bench.run(&[&half[..], &["--out", "a", "--order", "recorded"]].concat()).succeeded();
    bench.run(&[&half[..], &["--out", "b", "--order", "table:order.txt"]].concat()).succeeded();
    bench.run(&[&half[..], &["--out", "c", "--order", "sequency"]].concat()).succeeded();
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
    measured.y[7] = f32::NAN;
    bench.write("in.npz", &measured.npz());
    bench.run(&["reconstruct", "in.npz"]).failed(1, &["in.npz", "`y`", "NaN", "[7]"]);
    assert_eq!(std::fs::read(bench.path("out/report.json")).unwrap(), before);
    assert_eq!(std::fs::read_dir(bench.path("out")).unwrap().count(), 3);
}
