//! Two cameras at one computer: their clocks drift, their frames get one time.

use crate::bench::{Bench, Process};

/// Serves a virtual camera in real time on a free port. Its simulated clock has this error.
fn serve(bench: &Bench, seed: &str, ppm: &str) -> (Process, String) {
    let mut server = bench.start(&[
        "virtual",
        "--listen",
        "127.0.0.1:0",
        "--seed",
        seed,
        "--precompute",
        "4",
        "--real-time",
        "--clock-ppm",
        ppm,
    ]);
    let line = server.says("virtual camera on tcp:");
    let address = line.split_whitespace().find_map(|word| word.strip_prefix("tcp:")).unwrap();
    (server, format!("tcp:{}", address.trim_end_matches(':')))
}

/// Records both cameras side by side, and syncs the recordings. `None` if this machine was too busy to keep the cameras
/// in real time: they then lose time, and say so by their uncertainty or are refused.
fn side_by_side(bench: &Bench, cameras: &[String; 2]) -> Option<serde_json::Value> {
    let capture = |camera: &str, out: &str| {
        let measured = ["--sweeps", "122", "--no-calibration", "--adc-latency", "6"];
        let named = ["--camera", camera, "--frames", "400", "--out", out, "--overwrite", "--json"];
        bench.start(&[&["capture"][..], &measured, &named].concat())
    };
    let captures = [capture(&cameras[0], "left.mcap"), capture(&cameras[1], "right.mcap")];
    for capture in captures {
        assert_eq!(capture.wait().succeeded().json()["frames"]["received"], 400);
    }
    let synced = bench.run(&["sync", "left.mcap", "right.mcap", "--out", "frames.csv", "--json"]);
    if synced.code != Some(0) {
        synced.failed(1, &["times the computer's, expected 1"]);
        return None;
    }
    let report = synced.json();
    let sure = |camera: &serde_json::Value| {
        camera["drift_uncertainty_ppm"].as_f64().is_some_and(|within| within < 1500.0)
    };
    report["cameras"].as_array().unwrap().iter().all(sure).then_some(report)
}

#[test]
fn two_cameras_with_clocks_that_drift_get_one_time() {
    let bench = Bench::new();
    // Errors far above those of quartz, so that they show in seconds on a busy machine.
    let (_left, left) = serve(&bench, "1", "3000");
    let (_right, right) = serve(&bench, "2", "-3000");
    let cameras = [left, right];
    let Some(report) = (0..5).find_map(|_| side_by_side(&bench, &cameras)) else {
        println!("skipped: this machine is too busy for two cameras in real time");
        return;
    };
    for (camera, serial, truth) in [(0, "virtual-1", 3000.0), (1, "virtual-2", -3000.0)] {
        let camera = &report["cameras"][camera];
        assert_eq!(camera["serial"], serial);
        let number = |name: &str| camera[name].as_f64().unwrap();
        let (ppm, within) = (number("drift_ppm"), number("drift_uncertainty_ppm"));
        println!("{serial}: {ppm:+.1} +-{within:.1} ppm, simulated {truth:+}");
        assert!((ppm - truth).abs() <= within, "{camera}");
    }
    let text = std::fs::read_to_string(bench.path("frames.csv")).unwrap();
    let times: Vec<u64> =
        text.lines().skip(1).map(|line| line.split(',').next().unwrap().parse().unwrap()).collect();
    assert!(times.len() == 800 && times.is_sorted());
    assert_eq!(report["rows"], 800);
    let told = bench.run(&["sync", "left.mcap", "right.mcap"]).succeeded();
    assert!(told.stdout.contains("recording 2 beside 1: clock"), "{told:?}");
}

#[test]
fn recordings_of_a_camera_that_was_not_in_real_time_are_refused() {
    let bench = Bench::new();
    let measured = ["--frames", "60", "--sampling", "2%", "--sweeps", "1000"];
    bench.run(&[&["capture"][..], &measured, &["--out", "rec.mcap"]].concat()).succeeded();
    let refused = bench.run(&["sync", "rec.mcap", "--out", "frames.csv"]);
    refused.failed(1, &["rec.mcap", "real-time"]);
    assert!(!bench.path("frames.csv").exists());
}
