//! `nirspi reconstruct` of many files: one stack.

use crate::bench::{Bench, Measured};

/// A folder `in` with `count` measurements of one scene.
fn folder_of(count: usize, side: usize) -> Bench {
    let (bench, bytes) = (Bench::new(), Measured::new(side).npz());
    std::fs::create_dir(bench.path("in")).unwrap();
    (0..count).for_each(|k| bench.write(&format!("in/{k:04}.npz"), &bytes));
    bench
}

#[test]
fn many_files_are_one_stack_of_the_images_of_each() {
    let bench = folder_of(3, 8);
    std::fs::create_dir(bench.path("in/below")).unwrap();
    bench.write("in/below/other.npz", &Measured::new(8).npz());
    bench.write("last.npz", &Measured::new(8).npz());
    bench.run(&["reconstruct", "last.npz", "--out", "one"]).succeeded();
    let stack = ["reconstruct", "in", "last.npz", "--out", "stack"];
    let said = bench.run(&stack).succeeded();
    assert!(said.stdout.contains("5 images of 8 x 8 of 5 files"), "{said:?}");
    let (one, pixels) = (bench.pixels("one/image.npy"), bench.pixels("stack/image.npy"));
    assert_eq!(pixels.len(), 5 * 64);
    assert!(pixels.chunks_exact(64).all(|image| image == one));
    let report = bench.json("stack/report.json");
    let files: Vec<&str> = report["frames"]
        .as_array()
        .unwrap()
        .iter()
        .map(|frame| frame["file"].as_str().unwrap())
        .collect();
    let below = std::path::Path::new("in").join("below").join("other.npz");
    assert_eq!(files[3], below.to_str().unwrap());
    assert!(files[0].ends_with("0000.npz") && files[4] == "last.npz", "{files:?}");
    assert!(report.get("skipped").is_none());
}

#[test]
fn files_without_an_image_are_named_and_the_exit_code_says_so() {
    let bench = folder_of(4, 8);
    bench.write("in/bad.npz", b"PK damaged");
    bench.write("in/large.npz", &Measured::new(16).npz());
    let stack = ["reconstruct", "in", "--out", "out"];
    let said = bench.run(&stack).failed(1, &["out: 2 of 6 files gave no image"]);
    assert!(said.stdout.contains("note: skipped: in/bad.npz: "), "{said:?}");
    assert!(
        said.stdout.contains("large.npz: images of 16 x 16, expected 8 x 8 as of the first file"),
        "{said:?}"
    );
    assert_eq!(bench.pixels("out/image.npy").len(), 4 * 64);
    let skipped = &bench.json("out/report.json")["skipped"];
    assert_eq!(skipped.as_array().unwrap().len(), 2);
    assert!(skipped[0]["file"].as_str().unwrap().ends_with("bad.npz"), "{skipped}");
    let refused = bench.run(&["reconstruct", "in/bad.npz", "in/bad.npz", "--out", "none"]);
    refused.failed(1, &["none of 2 files gave an image; the first: in/bad.npz"]);
    assert_eq!(bench.names(), ["in", "out"]);
}

#[test]
#[ignore = "long: .ci/run demo"]
fn a_file_of_several_and_a_recording_give_each_measurement_or_their_sum() {
    let bench = Bench::new();
    bench.run(&["capture", "--frames", "3", "--sampling", "10%", "--out", "rec.mcap"]).succeeded();
    bench.run(&["reconstruct", "rec.mcap", "--out", "sum"]).succeeded();
    bench.run(&["recording", "export", "rec.mcap", "--to", "npz", "--out", "rec.npz"]).succeeded();
    bench.run(&["reconstruct", "rec.mcap", "--index", "all", "--out", "each"]).succeeded();
    let sum = bench.pixels("sum/image.npy");
    bench.run(&["reconstruct", "rec.mcap", "rec.mcap", "--out", "sums"]).succeeded();
    assert_eq!(bench.pixels("sums/image.npy"), [sum.clone(), sum].concat());
    let all = ["reconstruct", "rec.mcap", "rec.mcap", "--index", "all", "--out", "all"];
    bench.run(&all).succeeded();
    let each = bench.pixels("each/image.npy");
    assert_eq!(bench.pixels("all/image.npy"), [each.clone(), each].concat());
    let frames = &bench.json("all/report.json")["frames"];
    let index: Vec<u64> =
        frames.as_array().unwrap().iter().map(|frame| frame["index"].as_u64().unwrap()).collect();
    assert_eq!(index, [0, 1, 2, 0, 1, 2]);
    assert_eq!(bench.json("all/report.json")["provenance"]["origin"], "simulated");
    // A warning names the first image that it is about, and says how many more.
    let sharp = bench.run(&[&all[..5], &["--enhance", "--out", "sharp"]].concat());
    assert!(sharp.stderr.contains("warning: rec.mcap, 0 and "), "{}", sharp.stderr);
    std::fs::copy(bench.path("rec.mcap"), bench.path("same.mcap")).unwrap();
    let sharp = bench.run(&["reconstruct", "rec.mcap", "same.mcap", "--enhance", "--out", "two"]);
    assert!(sharp.stderr.contains("warning: rec.mcap and 1 more: "), "{}", sharp.stderr);
}

#[test]
fn what_belongs_to_a_single_file_is_refused() {
    let bench = folder_of(1, 8);
    let refused = bench.run(&["reconstruct", "in", "--index", "all", "--warm-start"]);
    refused.failed(2, &["--warm-start belongs to a single file"]);
    std::fs::create_dir(bench.path("empty")).unwrap();
    let refused = bench.run(&["reconstruct", "empty"]);
    refused.failed(
        1,
        &["empty: found no measurement file in the folder, expected at least one of .npz"],
    );
    assert_eq!(bench.names(), ["empty", "in"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_file_name_that_is_no_utf_8_costs_its_own_image_alone() {
    use std::os::unix::ffi::OsStrExt;
    let bench = folder_of(2, 8);
    let odd = bench.path("in").join(std::ffi::OsStr::from_bytes(b"0000\xff.npz"));
    std::fs::write(odd, Measured::new(8).npz()).unwrap();
    let outcome = bench.run(&["reconstruct", "in", "--out", "out"]);
    assert!(outcome.stdout.contains("2 images of 8 x 8 of 3 files"), "{outcome:?}");
    assert!(
        outcome.stdout.contains("skipped: in/0000\u{fffd}.npz: found a name that is no UTF-8"),
        "{outcome:?}"
    );
    outcome.failed(1, &["1 of 3 files gave no image"]);
    let skipped = &bench.json("out/report.json")["skipped"];
    assert_eq!(skipped[0]["file"], "in/0000\u{fffd}.npz", "{skipped}");
}

#[cfg(target_os = "linux")]
#[test]
#[ignore = "long: .ci/run demo"]
fn a_full_disk_leaves_the_images_before_it_and_says_how_many() {
    use nirspi::files::{archive, npy};
    // More than are worked on together.
    let (bench, count, before) = (Bench::new(), 5000, 4096);
    let values: Vec<f64> =
        (0..count * 256).map(|k| if k % 16 == 0 { 900.0 } else { (k * 7 % 31) as f64 }).collect();
    let rows: Vec<i64> = (0..256).collect();
    let members = [
        ("n", npy::encode(&[], &[16_i64])),
        ("h_row", npy::encode(&[256], &rows)),
        ("d", npy::encode(&[count, 256], &values)),
    ];
    bench.write("many.npz", &archive::encode(&bench.path("many.npz"), &members).unwrap());
    let command = ["reconstruct", "many.npz", "--index", "all", "--method", "hadamard", "--out"];
    bench.run(&[&command[..], &["whole"]].concat()).succeeded();
    // All images, of 1 kB, do not fit into a file, the first 4096 do. The shell counts blocks of 512 bytes.
    let limit = format!("ulimit -f {}", 2 * 4500);
    let said = bench.run_limited(&limit, &[&command[..], &["out"]].concat());
    said.failed(1, &["out: 4096 images, then: out: cannot write to it: File too large"]);
    assert_eq!(bench.pixels("out/image.npy"), bench.pixels("whole/image.npy")[..before * 256]);
    let report = bench.json("out/report.json");
    assert_eq!(report["frames"].as_array().unwrap().len(), before);
    assert!(report["ended"].as_str().unwrap().contains("File too large"), "{report}");
    // The next run knows the shortened files as its own, and replaces them.
    bench.run(&[&command[..], &["out"]].concat()).succeeded();
    assert_eq!(bench.pixels("out/image.npy").len(), count * 256);
    // Where not even the first ones fit, nothing is left.
    bench
        .run_limited("ulimit -f 100", &[&command[..], &["none"]].concat())
        .failed(1, &["File too large"]);
    assert_eq!(bench.names(), ["many.npz", "out", "whole"]);
}
