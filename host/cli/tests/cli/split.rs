//! `nirspi capture --split`: one run in several files.

use crate::bench::Bench;

#[test]
#[ignore = "long: .ci/run demo"]
fn a_split_capture_names_its_files_and_each_is_read_alone() {
    let bench = Bench::new();
    let capture = ["capture", "--frames", "900", "--no-calibration", "--adc-latency", "6"];
    let split = [&capture[..], &["--out", "rec.mcap", "--split", "1MB", "--json"]].concat();
    let report = bench.run(&split).succeeded().json();
    let files: Vec<String> = report["files"]
        .as_array()
        .unwrap()
        .iter()
        .map(|file| file.as_str().unwrap().to_owned())
        .collect();
    assert!(files.len() > 1, "{report}");
    assert_eq!((&report["frames"]["received"], &report["complete"]), (&900.into(), &true.into()));
    assert_eq!(bench.names(), files);
    let expected: Vec<String> = (1..=files.len()).map(|n| format!("rec-{n:04}.mcap")).collect();
    assert_eq!(files, expected);
    let mut frames = 0;
    for (at, file) in files.iter().enumerate() {
        let info = bench.run(&["camera", "info", file, "--json"]).succeeded().json();
        assert_eq!((&info["damage"], &info["account"]["missing"]), (&().into(), &().into()));
        assert_eq!(info["part"]["first_frame"], frames, "{info}");
        let next = files.get(at + 1).map(String::as_str);
        assert_eq!(info["account"]["continues"].as_str(), next, "{info}");
        frames += info["frames"]["received"].as_u64().unwrap();
        let image = ["reconstruct", file, "--method", "hadamard", "--json"];
        let image = bench.run(&image).succeeded().json();
        assert_eq!(image["frames"], info["frames"], "{image}");
    }
    assert_eq!(frames, 900);

    // No name of an earlier run is used again, also where the first name is free.
    std::fs::rename(bench.path("rec-0001.mcap"), bench.path("first.mcap")).unwrap();
    bench.run(&split).failed(2, &["--out rec-0002.mcap is there already", "choose another name"]);
    // A run of its own name, told in words.
    let other = [&capture[..], &["--split", "1MB"]].concat();
    let told = bench.run(&other).succeeded().stdout;
    assert!(told.contains("MB in capture-1-0001.mcap to capture-1-000"), "{told}");
    assert!(told.contains(" files)"), "{told}");
}

#[test]
fn a_split_that_is_no_size_and_no_time_is_one_line() {
    let bench = Bench::new();
    let run = |split: &str, words: &[&str]| {
        bench.run(&["capture", "--out", "rec.mcap", "--split", split]).failed(2, words);
    };
    run("10", &["--split", "a size such as 500MB or 2GB, or a time such as 90s, 10min or 1h"]);
    run("-1GB", &["--split", "a size from 1MB"]);
    run("0.1s", &["--split", "a time from 1s"]);
    let overwrite = ["capture", "--out", "rec.mcap", "--split", "1h", "--overwrite"];
    bench.run(&overwrite).failed(2, &["--split", "--overwrite"]);
    assert_eq!(bench.names(), [""; 0]);
}
