//! `nirspi reconstruct DIR` and `nirspi dataset`: tables of many images.

use crate::bench::{Bench, Measured};

/// A folder `in` with `count` measurements of one scene.
fn archive_of(count: usize, side: usize) -> Bench {
    let (bench, bytes) = (Bench::new(), Measured::new(side).npz());
    std::fs::create_dir(bench.path("in")).unwrap();
    (0..count).for_each(|k| bench.write(&format!("in/{k:04}.npz"), &bytes));
    bench
}

#[test]
fn bad_files_are_named_and_the_exit_code_says_so() {
    let bench = archive_of(4, 8);
    let table = ["reconstruct", "in", "--out", "t.parquet"];
    let said = bench.run(&[&table[..], &["--jobs", "2"]].concat()).succeeded();
    assert!(said.stdout.starts_with("t.parquet: 4 images of 4 files"), "{said:?}");
    bench.write("in/bad.npz", b"PK damaged");
    let said = bench.run(&table).failed(1, &["t.parquet: 1 of 5 files gave no image"]);
    assert!(said.stdout.contains("note: skipped: in/bad.npz: "), "{said:?}");
    let json = bench.run(&[&table[..], &["--resume", "--json"]].concat());
    let json = json.failed(1, &["1 of 5 files"]).json();
    assert_eq!((&json["rows"], &json["files_before"]), (&4.into(), &5.into()));
    assert_eq!(json["skipped"][0]["file"], "bad.npz");
    assert_eq!(bench.names(), ["in", "t.parquet"]);
}

#[test]
fn what_belongs_to_a_file_or_a_folder_alone_is_refused() {
    let bench = archive_of(1, 8);
    for (arguments, told) in [
        (
            &["in"][..],
            "--out out: expected a name that ends in .parquet for the table of the folder in",
        ),
        (&["in", "--out", "t.parquet", "--warm-start"], "--warm-start belongs to a single file"),
        (&["in", "--out", "t.parquet", "--shard", "3/2"], "expected I/N with I from 1 to N"),
        (&["in/0000.npz", "--jobs", "2"], "--jobs belongs to a folder"),
        (&["in/0000.npz", "--resume"], "--resume belongs to a folder"),
        (&["in/0000.npz", "--shard", "1/2"], "--shard belongs to a folder"),
    ] {
        bench.run(&[&["reconstruct"], arguments].concat()).failed(2, &[told]);
    }
    std::fs::create_dir(bench.path("empty")).unwrap();
    let refused = bench.run(&["reconstruct", "empty", "--out", "t.parquet"]);
    refused
        .failed(1, &["empty: no measurement files in the folder, expected at least one of .npz"]);
    let refused = bench.run(&["reconstruct", "in", "--out", "none/t.parquet"]);
    refused.failed(1, &["none: cannot write to it: no such file or folder"]);
    assert_eq!(bench.names(), ["empty", "in"]);
}

#[test]
fn a_run_that_is_killed_is_continued_with_the_same_bytes() {
    let bench = archive_of(1200, 16);
    let table = |out: &'static str| ["reconstruct", "in", "--method", "omp", "--out", out];
    bench.run(&table("whole.parquet")).succeeded();
    let whole = std::fs::read(bench.path("whole.parquet")).unwrap();
    let mut process = bench.start(&[&table("t.parquet")[..], &["--jobs", "2"]].concat());
    // Killed when the second part of five is there: the first is then in the list.
    process.has_written(&bench.path("t.parquet.parts/000001.rows"), 1);
    process.kill();
    drop(process);
    assert!(!bench.path("t.parquet").exists(), "the run ended before it was killed");
    bench.run(&table("t.parquet")).failed(1, &["continue it with --resume"]);
    let resume = [&table("t.parquet")[..], &["--resume", "--json"]].concat();
    let said = bench.run(&resume).succeeded().json();
    assert!(said["files_before"].as_u64().unwrap() >= 256, "{said}");
    assert_eq!(said["rows"], 1200);
    assert!(std::fs::read(bench.path("t.parquet")).unwrap() == whole);
    assert_eq!(bench.names(), ["in", "t.parquet", "whole.parquet"]);
}

#[test]
fn shares_of_a_folder_are_disjoint_and_complete() {
    let bench = archive_of(5, 8);
    let mut rows = 0;
    for (shard, expected) in [("1/2", 3), ("2/2", 2)] {
        let out = format!("t{}.parquet", &shard[..1]);
        let run = bench.run(&["reconstruct", "in", "--out", &out, "--shard", shard, "--json"]);
        let said = run.succeeded().json();
        assert_eq!((&said["rows"], &said["shard"]), (&expected.into(), &shard.into()));
        rows += expected;
    }
    assert_eq!(rows, 5);
}

#[test]
fn a_set_of_the_virtual_camera_is_one_command_with_a_card() {
    let bench = Bench::new();
    let axes =
        ["--weathers", "none", "heavy", "--seeds", "1,2", "--samplings", "10%", "--frames", "2"];
    let set = [&["dataset"][..], &axes, &["--out", "set.parquet"]].concat();
    let said = bench.run(&set).succeeded();
    assert!(said.stdout.contains("4 images of 4 measurements"), "{said:?}");
    assert_eq!(bench.names(), ["set.md", "set.parquet"]);
    let card = std::fs::read_to_string(bench.path("set.md")).unwrap();
    assert!(card.contains("**simulated**") && card.contains("| weather | none, heavy |"), "{card}");
    let twice = bench.run(&["dataset", "--seeds", "1", "1"]);
    twice.failed(2, &["seed 1 stands twice, expected each value once"]);
}
