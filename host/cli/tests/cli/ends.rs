//! How a capture ends: by its number of frames, by the user, or by anything else.

use crate::bench::{Bench, Process};
use std::time::Duration;

/// A capture without an end, after these commands of a shell, that has frames.
fn endless(bench: &Bench, commands: &str) -> Process {
    let capture = bench.start_limited(commands, &["capture", "--out", "rec.mcap", "--json"]);
    let mut is_there = false;
    for _ in 0..3000 {
        is_there = std::fs::metadata(bench.path("rec.mcap")).is_ok_and(|file| file.len() > 500_000);
        if is_there {
            break;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    assert!(is_there, "no frames in the file");
    capture
}

#[test]
fn only_the_wish_of_the_user_ends_a_capture_well() {
    for (signal, code, ended) in [
        ("INT", 0, "stopped by the user"),
        ("TERM", 1, "ended by a signal"),
        ("HUP", 1, "ended by a signal"),
    ] {
        let bench = Bench::new();
        let capture = endless(&bench, "true");
        capture.signal(signal);
        let outcome = capture.wait();
        assert_eq!(outcome.code, Some(code), "{signal}: {outcome:?}");
        let report: serde_json::Value = serde_json::from_str(&outcome.stdout).unwrap();
        assert_eq!(report["ended"], ended);
        assert_eq!(report["complete"], code == 0, "{report}");
        // The file says it too.
        let info = bench.run(&["camera", "info", "rec.mcap", "--json"]).stdout;
        assert_eq!(info.contains(&format!("SIG{signal}")), code == 1, "{signal}: {info}");
    }
}

/// `nohup` and the background jobs of scripts: a signal that is ignored when the program begins stays ignored.
#[test]
fn a_signal_that_was_ignored_at_the_start_does_not_end_a_capture() {
    for signal in ["HUP", "INT", "TERM"] {
        let bench = Bench::new();
        let capture = endless(&bench, &format!("trap '' {signal}"));
        capture.signal(signal);
        let before = std::fs::metadata(bench.path("rec.mcap")).unwrap().len();
        std::thread::sleep(Duration::from_millis(1500));
        let after = std::fs::metadata(bench.path("rec.mcap")).unwrap().len();
        assert!(after > before, "{signal} ended the capture at {before} bytes");
        capture.signal(if signal == "INT" { "TERM" } else { "INT" });
        assert_eq!(capture.wait().code, Some(i32::from(signal == "INT")), "{signal}");
    }
}

#[test]
fn a_capture_of_seconds_ends_by_itself_and_well() {
    let bench = Bench::new();
    let capture = ["capture", "--seconds", "0.7", "--out", "rec.mcap", "--json"];
    let report = bench.run(&capture).succeeded().json();
    let seconds = report["seconds"].as_f64().unwrap();
    assert!((0.7..5.0).contains(&seconds) && report["complete"] == true, "{report}");
    for bad in ["0", "-1", "nan", "1e300", "soon"] {
        let seconds = format!("--seconds={bad}");
        bench.run(&["capture", &seconds]).failed(2, &["--seconds", "expected seconds above 0"]);
    }
}

#[test]
fn the_standard_output_is_refused_as_a_file() {
    let bench = Bench::new();
    bench.run(&["capture", "--frames", "2", "--out", "-"]).failed(1, &["-: found no name"]);
    bench.run(&["example", "wing", "--out=-"]).failed(2, &["expected a name that ends in .npz"]);
    assert!(bench.names().is_empty());
}
