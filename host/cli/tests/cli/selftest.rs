//! `nirspi camera selftest`, and the calibration that it leaves for `nirspi capture`.

use crate::bench::Bench;
use nirspi_optics::Scene;
use nirspi_virtual::{ServeOptions, VirtualCamera, VirtualOptics, serve};
use std::net::TcpListener;
use std::sync::atomic::AtomicBool;

#[test]
#[ignore = "long: .ci/run demo"]
fn a_self_test_keeps_a_calibration_that_capture_then_uses_and_names() {
    let bench = Bench::new();
    let report = bench.run(&["camera", "selftest", "--json"]).succeeded().json();
    assert_eq!(report["passed"], true, "{report}");
    let kept = report["calibration"].as_str().unwrap();
    assert!(kept.starts_with(bench.path("data").to_str().unwrap()), "{kept}");
    assert!(kept.ends_with("virtual-1.json"), "{kept}");
    let date = report["measured"].as_str().unwrap();

    let capture = |more: &[&str]| {
        let arguments = ["capture", "--frames", "3", "--overwrite", "--out", "rec.mcap"];
        bench.run(&[&arguments, more].concat())
    };
    let used = capture(&["--json"]).succeeded().json();
    assert_eq!(used["calibration"]["measured"], date, "{used}");
    assert_eq!((&used["calibrated"], &used["adc_latency_clocks"]), (&true.into(), &6.into()));
    let said = capture(&[]).succeeded().stdout;
    assert!(said.contains(&format!("calibration of {date}")), "{said}");
    // What is recorded is what a reconstruction needs.
    let reconstruct = ["reconstruct", "rec.mcap", "--method", "hadamard", "--out", "out", "--json"];
    bench.run(&reconstruct).succeeded();

    for fresh in [&["--calibrate", "--json"][..], &["--non-differential", "--json"]] {
        let report = capture(fresh).succeeded().json();
        assert!(report["calibration"].is_null() && report["calibrated"] == true, "{report}");
    }
    let none = capture(&["--no-calibration", "--adc-latency", "6", "--json"]).succeeded().json();
    assert_eq!(none["calibrated"], false);
}

#[test]
#[ignore = "long: .ci/run demo"]
fn a_calibration_of_another_camera_or_gateware_is_refused() {
    let bench = Bench::new();
    bench.run(&["camera", "selftest", "--calibration", "mine.json"]).succeeded();
    let capture = |more: &[&str]| {
        let arguments = ["capture", "--frames", "3", "--out", "rec.mcap"];
        bench.run(&[&arguments, more].concat())
    };
    capture(&["--calibration", "mine.json", "--seed", "2"]).failed(
        1,
        &["mine.json", "serial number virtual-1", "virtual-2", "nirspi camera calibrate"],
    );
    let serial = bench.json("mine.json")["camera"]["serial"].as_str().unwrap().to_owned();
    let mut text = std::fs::read_to_string(bench.path("mine.json")).unwrap();
    text = text.replace(r#""gateware": "0.4.0""#, r#""gateware": "0.0.1""#);
    bench.write("mine.json", text.as_bytes());
    capture(&["--calibration", "mine.json"]).failed(1, &["gateware 0.0.1", "0.4.0"]);
    capture(&["--calibration", "none.json"]).failed(1, &["none.json"]);
    assert_eq!(bench.names(), ["mine.json"]);

    // The one kept for the camera is passed over with a word, and the capture goes on.
    let folder = bench.path("data").join("nirspi/calibration");
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::copy(bench.path("mine.json"), folder.join(format!("{serial}.json"))).unwrap();
    let said = capture(&[]).succeeded().stdout;
    assert!(said.contains("measured afresh") && said.contains("gateware 0.0.1"), "{said}");
}

#[test]
fn a_failed_self_test_names_the_fault_and_exits_with_1() {
    let bench = Bench::new();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("tcp:{}", listener.local_addr().unwrap());
    let server = std::thread::spawn(move || {
        let sheet = Scene::new(vec![0.9; 64 * 64], 64, 60.0).unwrap();
        let optics = VirtualOptics::new(sheet, 300.0).unwrap();
        let fpga = optics
            .fpga(1)
            .unwrap()
            .wired(|array, lines| array.light(lines.rows | 1 << 12, lines.columns, lines.enable));
        let mut camera = VirtualCamera::new(fpga, optics.depth(1).unwrap(), "broken");
        let options = ServeOptions { once: true, ..ServeOptions::default() };
        serve(&listener, &mut camera, options, &AtomicBool::new(false), &mut |_| {}).unwrap();
    });
    let outcome = bench.run(&["camera", "selftest", "--camera", &address]);
    let said = "nirspi: the self-test failed: LED lines\n";
    assert_eq!((outcome.code, outcome.stderr.as_str()), (Some(1), said), "{outcome:?}");
    let failed: Vec<&str> =
        outcome.stdout.lines().filter(|line| line.starts_with("FAIL")).collect();
    assert_eq!(failed.len(), 1, "{outcome:?}");
    assert!(outcome.stdout.contains("no calibration kept: the self-test failed"), "{outcome:?}");
    assert!(!bench.path("data/nirspi/calibration/broken.json").exists());
    assert!(failed[0].contains("LED lines") && failed[0].contains("row line 12"), "{failed:?}");
    server.join().unwrap();
}
