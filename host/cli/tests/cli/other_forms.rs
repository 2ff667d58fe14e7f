//! Measurements in the forms in which other groups keep theirs open and give the image that they stand for.

use crate::bench::{Bench, correlation};
use std::io::Write;
use std::path::PathBuf;
use std::process::Command;

/// Real measurements, written anew in each form by `host/scripts/measurements_in_other_forms.py`: it needs a Python with numpy, scipy and
/// h5py (`NIRSPI_PYTHON`, or `python3`) and the shared data, and the test says so where one is missing.
#[test]
fn real_measurements_open_in_the_forms_of_other_groups() {
    // Past libtest, which swallows what a passing test prints.
    let skipped = |why: &str| {
        let _ = writeln!(std::io::stderr(), "skipped: measurements in other forms: {why}");
    };
    let data = std::env::var_os("NIRSPI_DATA").map(PathBuf::from);
    let Some(data) = data.filter(|folder| folder.join("spi/opar_ala1.npz").is_file()) else {
        return skipped("no data (NIRSPI_DATA)");
    };
    let python = std::env::var_os("NIRSPI_PYTHON").unwrap_or_else(|| "python3".into());
    let has_packages = Command::new(&python).args(["-c", "import h5py, numpy, scipy.io"]).output();
    if !has_packages.is_ok_and(|output| output.status.success()) {
        return skipped("no python with numpy, scipy and h5py (NIRSPI_PYTHON)");
    }
    let bench = Bench::new();
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../scripts/measurements_in_other_forms.py");
    let made = Command::new(&python)
        .arg(script)
        .arg(data.join("spi"))
        .arg(bench.path("forms"))
        .output()
        .unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let cases = bench.json("forms/cases.json");
    let cases = cases.as_array().unwrap();
    assert!(cases.len() > 20, "{} cases", cases.len());
    for case in cases {
        let file = format!("forms/{}", case["file"].as_str().unwrap());
        let mut command = vec!["reconstruct", &file, "--method", "hadamard", "--out", "out"];
        command.extend(case["arguments"].as_array().unwrap().iter().map(|a| a.as_str().unwrap()));
        bench.run(&command).succeeded();
        let expected = bench.pixels(&format!("forms/{}", case["image"].as_str().unwrap()));
        let found = correlation(&bench.pixels("out/image.npy"), &expected);
        assert!(found > 0.999, "{command:?}: {found}");
    }
}
