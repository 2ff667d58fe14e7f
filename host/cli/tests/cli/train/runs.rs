//! Runs of `nirspi train`, in a build that has training.

use crate::bench::Bench;

/// A run of seconds: a tiny network on procedural scenes.
const TINY: [&str; 12] = [
    "train",
    "fsrcnn",
    "--out",
    "run",
    "--width",
    "4,2",
    "--batch",
    "2",
    "--judge-every",
    "4",
    "--camera-share",
    "0",
];

fn tiny(more: &[&'static str]) -> Vec<&'static str> {
    TINY.iter().copied().chain(["--backend", "cpu"]).chain(more.iter().copied()).collect()
}

fn log(bench: &Bench) -> Vec<serde_json::Value> {
    let text = std::fs::read_to_string(bench.path("run/log.jsonl")).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn a_run_is_kept_in_its_folder_and_gone_on_with_and_not_overwritten() {
    let bench = Bench::new();
    let report = bench.run(&tiny(&["--steps", "8", "--json"])).succeeded().json();
    assert_eq!((&report["step"], &report["ended"]), (&8.into(), &"complete".into()));
    for name in ["checkpoint.bin", "data.json", "log.jsonl", "plot.png", "weights.safetensors"] {
        assert!(bench.path("run").join(name).exists(), "{name}");
    }
    assert_eq!(log(&bench).len(), 2);

    bench.run(&tiny(&["--steps", "8"])).failed(1, &["a run is kept there, expected --resume"]);
    let report = bench.run(&tiny(&["--steps", "12", "--resume", "--json"])).succeeded().json();
    assert_eq!(report["step"], 12);
    let steps: Vec<_> = log(&bench).iter().map(|entry| entry["step"].as_u64().unwrap()).collect();
    assert_eq!(steps, [4, 8, 12]);
    bench
        .run(&tiny(&["--steps", "12", "--seed", "2", "--resume"]))
        .failed(1, &["expected the same settings but steps and rate"]);
}

#[test]
fn what_cannot_be_trained_is_named_and_leaves_nothing() {
    let bench = Bench::new();
    bench.run(&tiny(&["--resume"])).failed(1, &["no checkpoint to go on from"]);
    bench.run(&tiny(&["--data", "none.npz"])).failed(1, &["none.npz: cannot read it"]);
    bench
        .run(&tiny(&["--rate", "7"]))
        .failed(1, &["rate is 7, expected more than 0 and less than 1"]);
    let classifier = ["train", "classifier", "--out", "run", "--steps", "2", "--backend", "cpu"];
    bench.run(&classifier).failed(1, &["images without labels"]);
    assert!(!bench.path("run").exists());
}
