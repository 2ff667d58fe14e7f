//! The acceptance figures on real measurements, where these are at hand.

use crate::bench::{Bench, correlation};
use std::io::Write;
use std::path::PathBuf;

/// A file of the shared data; they are not part of this repository.
fn data(name: &str) -> Option<String> {
    let folder = std::env::var_os("NIRSPI_DATA").map(PathBuf::from);
    let path = folder.map(|folder| folder.join("spi").join(name)).filter(|path| path.is_file());
    if path.is_none() {
        // Past libtest, which swallows what a passing test prints.
        let _ = writeln!(std::io::stderr(), "skipped: no data (spi/{name} in NIRSPI_DATA)");
    }
    Some(path?.to_str().unwrap().to_owned())
}

/// The image by `arguments`, and the report.
fn image(bench: &Bench, input: &str, arguments: &[&str]) -> (Vec<f32>, serde_json::Value) {
    bench.run(&[&["reconstruct", input], arguments].concat()).succeeded();
    (bench.pixels("out/image.npy"), bench.json("out/report.json"))
}

/// What OMP, the default and zero filling make of the first 30 %: correlations with the image of all patterns.
fn thirty_percent(bench: &Bench, input: &str, index: &[&str]) -> (f64, f64, f64) {
    let with = |arguments: &[&str]| image(bench, input, &[arguments, index].concat()).0;
    let full = with(&["--method", "hadamard"]);
    let omp = with(&["--method", "omp", "--sampling", "0.3", "--basis", "dct"]);
    let default = with(&["--sampling", "30%"]);
    let zero = with(&["--method", "hadamard", "--sampling", "0.3"]);
    (correlation(&omp, &full), correlation(&default, &full), correlation(&zero, &full))
}

#[test]
fn the_insect_wing_is_the_one_in_the_file_and_omp_keeps_it() {
    let Some(input) = data("opar_ala1.npz") else { return };
    let bench = Bench::new();
    let (_, report) = image(&bench, &input, &["--method", "hadamard"]);
    assert!(report["correlation_with_files_recon"].as_f64().unwrap() > 0.9999, "{report}");
    let (omp, default, zero) = thirty_percent(&bench, &input, &[]);
    assert!(omp >= zero && omp > 0.85, "OMP {omp}, zero filling {zero}");
    assert!(default > omp, "the default {default}, OMP {omp}");
}

#[test]
fn the_toy_car_is_seen_from_thirty_percent() {
    let Some(input) = data("scheidt_car.npz") else { return };
    let bench = Bench::new();
    bench.run(&["reconstruct", &input]).failed(2, &["scheidt_car.npz", "--index 0..32"]);
    let (omp, default, zero) = thirty_percent(&bench, &input, &["--index", "0"]);
    assert!(omp >= zero && omp > 0.95, "OMP {omp}, zero filling {zero}");
    assert!(default > omp, "the default {default}, OMP {omp}");
}
