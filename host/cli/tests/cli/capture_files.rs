//! The files that `nirspi capture` and the commands for pictures make: their names, and what happens where the system allows no
//! more.

use crate::bench::Bench;

#[test]
fn two_captures_started_at_once_make_two_recordings() {
    let bench = Bench::new();
    let arguments = ["capture", "--frames", "300", "--json"];
    let both = [bench.start(&arguments), bench.start(&arguments)];
    let mut names: Vec<String> = both
        .map(|capture| {
            let report = capture.wait().succeeded().json();
            assert_eq!(report["frames"]["received"], 300, "{report}");
            report["recording"].as_str().unwrap().to_owned()
        })
        .to_vec();
    names.sort();
    assert_eq!(names, ["capture-1.mcap", "capture-2.mcap"]);
    for name in &names {
        let again = ["reconstruct", name, "--method", "hadamard", "--json"];
        let report = bench.run(&again).succeeded().json();
        assert_eq!(report["frames"]["received"], 300, "{report}");
        assert_eq!(report["notes"].as_array().map_or(0, Vec::len), 0, "{report}");
    }
}

#[cfg(target_os = "linux")]
#[test]
#[ignore = "long: .ci/run demo"]
fn a_full_disk_is_told_with_the_frames_that_the_file_really_holds() {
    let bench = Bench::new();
    // 2 MB. The signal of the limit, which ends a program silently, is an error here.
    let limits = "ulimit -f 4000";
    let capture = ["capture", "--frames", "3000", "--no-calibration", "--adc-latency", "6"];
    let outcome = bench.run_limited(limits, &[&capture[..], &["--out", "rec.mcap"]].concat());
    let outcome = outcome.failed(1, &["rec.mcap: cannot record any more", "File too large"]);
    let told = outcome.stderr.split("cannot record any more, ").nth(1).unwrap();
    let told: u64 = told.split(' ').next().unwrap().parse().unwrap();
    let again = ["reconstruct", "rec.mcap", "--method", "hadamard", "--json"];
    let report = bench.run(&again).succeeded().json();
    assert_eq!(report["frames"]["received"], told, "{}: {report}", outcome.stderr);
    assert!(told > 100, "{told}");
    // A script learns the account of the run all the same.
    let json = [&capture[..], &["--out", "again.mcap", "--json"]].concat();
    let report = bench.run_limited(limits, &json).failed(1, &["again.mcap"]).json();
    assert_eq!((&report["complete"], &report["recording"]), (&false.into(), &"again.mcap".into()));
    assert!(report["missing"].as_str().unwrap().contains("File too large"), "{report}");
    assert!(report["frames"]["received"].as_u64().unwrap() > 100, "{report}");
}

#[cfg(target_os = "linux")]
#[test]
fn an_export_on_a_full_disk_is_one_line_and_leaves_nothing() {
    let bench = Bench::new();
    bench.run(&["capture", "--frames", "40", "--out", "rec.mcap"]).succeeded();
    for format in ["npz", "npy", "mcap", "apng"] {
        let out = format!("x.{format}");
        let export = ["recording", "export", "rec.mcap", "--to", format, "--out", &out];
        // 4 kB
        bench.run_limited("ulimit -f 8", &export).failed(1, &[&out, "File too large"]);
        assert_eq!(bench.names(), ["rec.mcap"], "{format}");
    }
}

#[cfg(unix)]
#[test]
fn a_reader_that_closes_the_pipe_ends_no_recording() {
    let bench = Bench::new();
    let out = bench.path("rec.mcap");
    let mut capture = std::process::Command::new(crate::bench::program())
        .args(["capture", "--frames", "200", "--json", "--out"])
        .arg(&out)
        .env("XDG_DATA_HOME", bench.path("data"))
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    drop((capture.stdout.take(), capture.stderr.take()));
    assert!(capture.wait().unwrap().success());
    let report = bench.run(&["camera", "info", "rec.mcap", "--json"]).succeeded().json();
    assert_eq!(report["frames"]["received"], 200, "{report}");
    // The usual code, also if the output is closed at once.
    let mut info = std::process::Command::new(crate::bench::program())
        .args(["camera", "info", "--json"])
        .arg(&out)
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    drop(info.stdout.take());
    let ended = info.wait_with_output().unwrap();
    assert!(ended.status.success() && ended.stderr.is_empty(), "{ended:?}");
}

#[cfg(unix)]
#[test]
fn a_folder_takes_more_pictures_than_a_process_may_have_files_open() {
    const COUNT: usize = 120;
    let bench = Bench::new();
    let pixels: Vec<f32> = (0..COUNT * 32 * 32).map(|at| (at % 97) as f32 / 96.0).collect();
    bench.write("many.npy", &nirspi::files::npy::encode(&[COUNT, 32, 32], &pixels));
    let upscale = ["dev", "upscale", "many.npy", "--backend", "cpu", "--out", "pictures"];
    bench.run_limited("ulimit -n 64", &upscale).succeeded();
    // With the list of the results.
    assert_eq!(std::fs::read_dir(bench.path("pictures")).unwrap().count(), COUNT + 1);
}

#[test]
fn a_capture_takes_the_light_that_was_asked_for_at_every_share() {
    let bench = Bench::new();
    for (name, share) in [("all.mcap", "100%"), ("few.mcap", "2%")] {
        let capture = ["capture", "--light", "20ms", "--sampling", share, "--out", name, "--json"];
        let report = bench.run(&capture).succeeded().json();
        assert_eq!(report["frames"]["lost"], 0, "{share}: {report}");
        // Of 1024 patterns and complements of 40 ns, or of 20.
        let sweep_ms = if share == "2%" { 20.0 } else { 1024.0 } * 80e-6;
        let info = bench.run(&["reconstruct", name, "--json", "--method", "hadamard"]).succeeded();
        assert_eq!(info.json()["frames"]["received"], report["frames"]["received"]);
        let recording = nirspi::recording::Recording::open(&bench.path(name)).unwrap();
        let light_ms =
            sweep_ms * f64::from(recording.setup.sweeps) * report["made"].as_f64().unwrap();
        assert!((light_ms / 20.0 - 1.0).abs() < 0.005, "{share}: {light_ms} ms");
    }
}
