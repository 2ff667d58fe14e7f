//! `nirspi train`: short runs in a folder, ended and gone on with; pairs for training elsewhere.

use crate::bench::Bench;

#[cfg(feature = "train")]
mod runs;

#[test]
#[cfg(not(feature = "train"))]
fn a_build_without_training_lists_it_and_says_which_build_has_it() {
    let bench = Bench::new();
    let help = bench.run(&["--help"]).succeeded().stdout;
    assert!(help.contains("\n  train "), "{help}");
    let line = "this build has no training; build it with: cargo build --release --features train";
    for network in ["fsrcnn", "diffusion", "ancestral", "gan", "estimator", "classifier"] {
        bench.run(&["train", network, "--out", "run"]).failed(1, &[line]);
    }
    assert!(!bench.path("run").exists());
}

#[test]
fn pairs_are_as_many_as_asked_and_those_of_their_seed() {
    let bench = Bench::new();
    let pairs = |seed: &str, out: &str| {
        let args = ["train", "degrade", "--count", "3", "--seed", seed, "--out", out, "--json"];
        let report = bench.run(&args).succeeded().json();
        assert_eq!((&report["pairs"], &report["simulated"]), (&3.into(), &true.into()));
        // The provenance has the command and the time.
        let file = std::fs::File::open(bench.path(out)).unwrap();
        let mut archive = zip::ZipArchive::new(file).unwrap();
        let names: Vec<String> =
            archive.file_names().map(|name| name.unwrap().into_owned()).collect();
        let mut arrays = Vec::new();
        for name in names.iter().filter(|name| *name != "provenance.npy") {
            let mut bytes = Vec::new();
            std::io::Read::read_to_end(&mut archive.by_name(name).unwrap(), &mut bytes).unwrap();
            arrays.push((name.clone(), bytes));
        }
        arrays.sort();
        arrays
    };
    let first = pairs("1", "a.npz");
    assert_eq!(pairs("1", "b.npz"), first);
    assert_ne!(pairs("2", "c.npz"), first);
}
