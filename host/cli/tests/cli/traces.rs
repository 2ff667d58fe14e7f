//! Readings of traces: samples of a detector while patterns were shown.

use crate::bench::{Bench, Outcome, correlation};

/// Samples of a reading, and before the first one.
const SAMPLES: usize = 20;
const BEFORE: usize = 137;

/// A scene of 8 x 8 pixels, and a trace of its patterns and complements in natural order, with the trigger.
struct Trace {
    scene: Vec<f32>,
    signal: Vec<f64>,
    trigger: Vec<f64>,
}

impl Trace {
    fn new() -> Self {
        let scene: Vec<f32> =
            (0..64).map(|p| if p % 9 < 3 || p > 50 { 0.9 } else { 0.1 }).collect();
        let lit = |k: usize, sign: u32| -> f64 {
            let pixels = scene.iter().enumerate();
            let lit = pixels.filter(|(p, _)| (k & p).count_ones() % 2 == sign);
            lit.map(|(_, &light)| f64::from(light)).sum()
        };
        let readings: Vec<f64> = (0..128).map(|at| lit(at / 2, at as u32 % 2)).collect();
        let (mut signal, mut trigger) = (vec![0.3; BEFORE], vec![0.0; BEFORE]);
        for (k, reading) in readings.iter().enumerate() {
            // The light of the pattern before fades during the first samples.
            let before = k.checked_sub(1).map_or(0.0, |before| readings[before]);
            for at in 0..SAMPLES {
                let ripple = 0.01 * ((at * 7 + k * 3) % 11) as f64;
                signal.push(if at < 4 { before } else { *reading } + ripple);
                trigger.push(if at < 3 { 5.0 } else { 0.0 });
            }
        }
        signal.extend([0.3; 60]);
        trigger.extend([0.0; 60]);
        Self { scene, signal, trigger }
    }

    fn csv(&self) -> String {
        let rows = self.signal.iter().zip(&self.trigger).enumerate();
        let rows = rows.map(|(at, (s, t))| format!("{},{s:.4},{t}\n", at as f64 * 1e-5));
        format!("time,CH1,TRIG\n{}", rows.collect::<String>())
    }
}

/// Makes readings into `m.npz`, then an image, which is like the scene.
#[track_caller]
fn gives_the_image(bench: &Bench, trace: &Trace, arguments: &[&str]) -> Outcome {
    let all = [&["readings"], arguments, &["--settle", "4", "--out", "m.npz", "--overwrite"]];
    let outcome = bench.run(&all.concat()).succeeded();
    assert!(outcome.stderr.is_empty(), "{outcome:?}");
    let image = ["reconstruct", "m.npz", "--shown", "natural", "--method", "hadamard"];
    let image = bench.run(&image).succeeded();
    assert!(!image.stderr.contains("warning"), "{image:?}");
    let alike = correlation(&bench.pixels("out/image.npy"), &trace.scene);
    assert!(alike > 0.99, "{arguments:?}: {alike}");
    outcome
}

#[test]
#[ignore = "long: .ci/run demo"]
fn a_trace_gives_the_image_by_its_trigger_and_by_the_number_of_samples() {
    let (bench, trace) = (Bench::new(), Trace::new());
    bench.write("trace.csv", trace.csv().as_bytes());
    let by_trigger = ["trace.csv", "--field", "CH1", "--trigger", "TRIG"];
    let outcome = gives_the_image(&bench, &trace, &by_trigger);
    let lines: Vec<&str> = outcome.stdout.lines().collect();
    assert_eq!(
        lines[..2],
        [
            "128 readings by the trigger, 20 samples a pattern; of the trace's 2757 samples, 137 are before the first \
             pattern and 60 after the last reading",
            "a full sweep: 8 x 8 patterns and their complements"
        ]
    );
    let by_number = ["--samples", "20", "--skip", "137", "--count", "128"];
    gives_the_image(&bench, &trace, &[&["trace.csv", "--field", "CH1"], &by_number[..]].concat());
    let f64s: Vec<u8> = trace.signal.iter().flat_map(|v| v.to_le_bytes()).collect();
    bench.write("trace.dat", &f64s);
    gives_the_image(&bench, &trace, &[&["trace.dat", "--raw", "f64"], &by_number[..]].concat());

    let json = [&["readings"], &by_trigger[..], &["--out", "j.npz", "--json"]].concat();
    let report = bench.run(&json).succeeded().json();
    assert_eq!((&report["readings"], &report["samples_before"]), (&128.into(), &137.into()));
    assert_eq!(report["provenance"]["file"], "trace.csv");
    let picture = std::fs::read(bench.path("j.picture.png")).unwrap();
    assert!(picture.starts_with(b"\x89PNG") && picture.len() > 5000);
    let taken = [&["readings"], &by_trigger[..], &["--out", "j.npz"]].concat();
    bench.run(&taken).failed(1, &["j.npz", "is there already", "--overwrite"]);
}

#[test]
fn lost_and_extra_edges_are_warnings_and_cost_one_pattern() {
    let (bench, mut trace) = (Bench::new(), Trace::new());
    trace.trigger[BEFORE + 31 * SAMPLES..][..3].fill(0.0);
    trace.trigger[BEFORE + 90 * SAMPLES + 7] = 5.0;
    bench.write("trace.csv", trace.csv().as_bytes());
    let readings =
        ["readings", "trace.csv", "--field", "CH1", "--trigger", "TRIG", "--settle", "4"];
    let outcome = bench.run(&[&readings[..], &["--out", "m.npz"]].concat()).succeeded();
    let warnings: Vec<&str> = outcome.stderr.lines().collect();
    assert!(warnings[0].contains("1 reading is not there") && warnings[0].ends_with(": 31"));
    assert!(warnings[1].contains("comes too early") && warnings[1].ends_with(": at 1944"));
    assert!(warnings.len() == 2 && outcome.stdout.starts_with("128 readings"), "{outcome:?}");
    let image = ["reconstruct", "m.npz", "--shown", "natural", "--method", "tikhonov"];
    bench.run(&image).succeeded();
    assert_eq!(bench.json("out/report.json")["not_read"], serde_json::json!([15]));
    let alike = correlation(&bench.pixels("out/image.npy"), &trace.scene);
    assert!(alike > 0.97, "{alike}");
}

#[test]
fn a_trace_that_gives_no_readings_is_refused_in_one_line_and_writes_nothing() {
    let (bench, trace) = (Bench::new(), Trace::new());
    bench.write("trace.csv", trace.csv().as_bytes());
    bench.write("flat.csv", trace.csv().replace(",5\n", ",0\n").as_bytes());
    let by_trigger = ["--field", "CH1", "--trigger", "TRIG"];
    // That every trace without readings is refused is tested in `nirspi-files`.
    let cases: [(&str, &[&str], i32, &[&str]); 6] = [
        ("flat.csv", &by_trigger, 1, &["flat.csv", "`TRIG` rises nowhere"]),
        ("none.csv", &by_trigger, 1, &["none.csv", "no such file"]),
        ("trace.csv", &["--samples", "20"], 1, &["--field with one of time, CH1, TRIG"]),
        ("trace.csv", &["--field", "CH1", "--samples", "0"], 2, &["--samples", "0"]),
        ("trace.csv", &["--field", "CH1"], 2, &["--samples", "--trigger"]),
        ("trace.csv", &["--trigger", "TRIG", "--raw", "f64"], 2, &["--raw"]),
    ];
    for (file, arguments, code, words) in cases {
        let all = [&["readings", file], arguments, &["--out", "m.npz"]].concat();
        let outcome = bench.run(&all).failed(code, words);
        assert!(outcome.stdout.is_empty(), "{outcome:?}");
    }
    let name = ["readings", "trace.csv", "--samples", "20", "--out", "m.npy"];
    bench.run(&name).failed(2, &["m.npy", "ends in .npz"]);
    let itself = ["readings", "t.npz", "--samples", "20", "--out", "t.npz", "--overwrite"];
    bench.write("t.npz", b"PK");
    bench.run(&itself).failed(1, &["t.npz", "the result is made of this file"]);
    assert!(!bench.names().iter().any(|name| name.starts_with("m.")), "{:?}", bench.names());
}
