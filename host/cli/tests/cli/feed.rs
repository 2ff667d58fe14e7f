//! `--camera feed:ADDR`: live readings of a bench that is no camera of nirspi, here a DMD with a DAQ that is a thread of the
//! test.

use crate::bench::{Bench, Measured, Process};
use std::fs::OpenOptions;
use std::io::Write;
use std::net::TcpListener;
use std::thread::JoinHandle;
use std::time::Duration;

/// The header of a scene's pairs, with `more` of it.
pub fn header(scene: &Measured, more: &str) -> String {
    let rows: Vec<String> = scene.h_row.iter().map(ToString::to_string).collect();
    let (n, rows) = (scene.n, rows.join(","));
    format!("{{\"n\":{n},\"h_row\":[{rows}],\"readings\":\"pairs\",\"unit\":\"V\"{more}}}\n")
}

/// A DAQ that sends blocks of readings, which do not know where a frame ends, to the first program that connects.
fn daq(bytes: Vec<u8>, block: usize) -> (JoinHandle<()>, String) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("feed:{}", listener.local_addr().unwrap());
    let sender = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        for block in bytes.chunks(block) {
            // The program may have all that it wants.
            if stream.write_all(block).is_err() {
                return;
            }
        }
    });
    (sender, address)
}

fn as_f32(readings: &[f32]) -> Vec<u8> {
    readings.iter().flat_map(|reading| reading.to_le_bytes()).collect()
}

pub fn as_text(readings: &[f32]) -> String {
    // The file has these numbers to the bit.
    readings.iter().map(|&reading| format!("{}\n", f64::from(reading))).collect()
}

/// The image of the scene's own measurement file.
pub fn image_of_file(bench: &Bench, scene: &Measured) -> Vec<f32> {
    bench.write("file.npz", &scene.npz());
    bench.run(&["reconstruct", "file.npz", "--method", "hadamard", "--out", "file"]).succeeded();
    bench.pixels("file/image.npy")
}

/// The images of all frames of a recording.
fn images(bench: &Bench, recording: &str) -> Vec<f32> {
    let arguments = ["reconstruct", recording, "--index", "all", "--method", "hadamard"];
    bench.run(&[&arguments[..], &["--out", "frames"]].concat()).succeeded();
    bench.pixels("frames/image.npy")
}

#[test]
fn a_dmd_with_a_daq_is_recorded_and_its_images_are_those_of_a_file() {
    let bench = Bench::new();
    let scene = Measured::new(16);
    let expected = image_of_file(&bench, &scene);
    let name = ",\"numbers\":\"f32\",\"name\":\"DMD of room 3\",\"simulated\":true";
    let mut bytes = header(&scene, name).into_bytes();
    (0..5).for_each(|_| bytes.extend(as_f32(&scene.y)));
    let (sender, address) = daq(bytes, 1000);
    let capture = ["capture", "--camera", &address, "--out", "rec.npz", "--json"];
    let report = bench.run(&capture).succeeded().json();
    sender.join().unwrap();
    assert_eq!((&report["complete"], &report["account"]["frames"]), (&true.into(), &5.into()));
    assert_eq!((&report["name"], &report["n"]), (&"DMD of room 3".into(), &16.into()));
    assert_eq!(report["provenance"]["origin"], "simulated");
    let found = images(&bench, "rec.npz");
    assert_eq!(found.len(), 5 * expected.len());
    assert!(found.chunks(expected.len()).all(|image| image == expected), "the same to the bit");
    // The name of the recording is taken now.
    let (_, address) = daq(Vec::new(), 1);
    let again = ["capture", "--camera", &address, "--out", "rec.npz"];
    bench.run(&again).failed(1, &["rec.npz: is there already"]);
}

#[test]
fn a_file_that_grows_is_read_as_it_grows() {
    let bench = Bench::new();
    let scene = Measured::new(8);
    let expected = image_of_file(&bench, &scene);
    bench.write("log.txt", b"");
    let arguments =
        ["capture", "--camera", "feed:log.txt", "--frames", "3", "--out", "rec.npz", "--json"];
    let capture = bench.start(&arguments);
    let mut log = OpenOptions::new().append(true).open(bench.path("log.txt")).unwrap();
    log.write_all(header(&scene, "").as_bytes()).unwrap();
    for line in as_text(&scene.y).repeat(4).split_inclusive('\n').collect::<Vec<_>>().chunks(100) {
        log.write_all(line.concat().as_bytes()).unwrap();
        std::thread::sleep(Duration::from_millis(5));
    }
    let report = capture.wait().succeeded().json();
    assert_eq!((&report["complete"], &report["account"]["frames"]), (&true.into(), &3.into()));
    let found = images(&bench, "rec.npz");
    assert!(found.chunks(expected.len()).all(|image| image == expected));
}

/// A capture of this text on the standard input.
#[cfg(unix)]
fn capture_of(bench: &Bench, text: impl AsRef<[u8]>) -> Process {
    bench.write("in.txt", text.as_ref());
    let arguments = ["capture", "--camera", "feed:-", "--out", "rec.npz", "--overwrite"];
    bench.start_limited("exec < in.txt", &arguments)
}

#[cfg(unix)]
#[test]
fn what_a_feed_lacks_is_counted_and_what_came_is_kept() {
    let bench = Bench::new();
    let scene = Measured::new(8);
    let (header, frame) = (header(&scene, ""), as_text(&scene.y));
    let run = |text: String| capture_of(&bench, text).wait();
    let whole = run(format!("{header}{frame}{frame}")).succeeded();
    assert!(whole.stdout.contains("2 frames; the feed ended"), "{whole:?}");
    let tail = &frame[..frame.len() / 2];
    run(format!("{header}{frame}{tail}"))
        .failed(1, &["feed:-: ", "of a last frame that is not complete"]);
    assert_eq!(images(&bench, "rec.npz").len(), 64);
    // A word costs its own pattern and no other.
    let worded = frame.replacen('\n', "\nERROR\n", 2).replacen("ERROR\n", "", 1);
    let lines: Vec<&str> = worded.lines().collect();
    let text = format!("{header}{frame}{}\n", lines[..scene.y.len()].join("\n"));
    run(text).failed(1, &["1 number refused (first \"ERROR\" as reading 3 of frame 2)"]);
    assert_eq!(images(&bench, "rec.npz").len(), 2 * 64);
    let second = format!("{header}{frame}{}", header.replacen("\"n\":8", "\"n\":4", 1));
    run(format!("{second}{frame}")).failed(1, &["a second header after 1 frame: "]);
    let words = run(format!("{header}{}", "none-here\n".repeat(256)));
    words.failed(1, &["2 frames without any reading", "no complete frame"]);
}

#[cfg(unix)]
#[test]
fn what_is_no_feed_is_refused_in_one_line() {
    let bench = Bench::new();
    let run = |text: &[u8]| capture_of(&bench, text).wait();
    run(b"").failed(1, &["feed:-: the header did not come: the feed was empty"]);
    run(b"1 2 3").failed(1, &["begins with \"1 2 3\", expected one JSON line such as {\"n\": 64"]);
    run(b"{\"n\":8,\"gain\":1}\n").failed(1, &["unknown field `gain`"]);
    run(b"{\"n\":9,\"order\":\"natural\",\"readings\":\"single\"}\n")
        .failed(1, &["\"n\": 9, expected a power of two from 2 to 256"]);
    run(&[b"{".to_vec(), vec![b' '; 17 << 20]].concat())
        .failed(1, &["the header is longer than 16 MiB"]);
    assert!(!bench.names().contains(&"rec.npz".to_owned()));
    let at = |address: &str| bench.run(&["capture", "--camera", address]);
    at("feed:nothing").failed(1, &["feed:nothing: no such file, pipe or socket"]);
    at("feed:").failed(2, &["expected feed:HOST:PORT"]);
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let gone = format!("feed:{}", listener.local_addr().unwrap());
    drop(listener);
    at(&gone).failed(1, &["no program listens there"]);
    for (option, value) in [("--order", "natural"), ("--light", "1s"), ("--scene", "white")] {
        let arguments = ["capture", "--camera", "feed:-", option, value];
        let words = [option, "does not go with --camera feed:ADDR"];
        bench.run(&arguments).failed(2, &words);
    }
    bench.run(&["capture", "--camera", "feed:-", "--out", "a.mcap"]).failed(2, &["ends in .npz"]);
    bench.run(&["camera", "info", "--camera", "feed:-"]).failed(1, &["a feed sends readings"]);
}

/// `--picture` is the image of the mean of all frames, as `reconstruct` makes it of a file with the mean.
#[test]
fn the_picture_of_a_capture_is_that_of_the_mean_of_its_frames() {
    let bench = Bench::new();
    for n in [8, 32] {
        let scene = Measured::new(n);
        bench.write("file.npz", &scene.npz());
        bench.run(&["reconstruct", "file.npz", "--out", "file"]).succeeded();
        let doubled: Vec<f32> = scene.y.iter().map(|&reading| 2.0 * reading).collect();
        let none: Vec<f32> = scene.y.iter().map(|_| 0.0).collect();
        let text = [header(&scene, ""), as_text(&doubled), as_text(&none)].concat();
        bench.write("log.txt", text.as_bytes());
        let arguments = ["capture", "--camera", "feed:log.txt", "--frames", "2", "--overwrite"];
        let more = ["--out", "rec.npz", "--picture", "seen"];
        let said = bench.run(&[&arguments[..], &more].concat()).succeeded().stdout;
        assert_eq!(bench.pixels("seen/image.npy"), bench.pixels("file/image.npy"));
        // Networks enhance images of 32 x 32 and 64 x 64.
        let name = if n == 32 { "enhanced.png" } else { "image.png" };
        assert!(said.contains("picture: ") && said.contains(name), "{said}");
        assert_eq!(bench.path("seen/enhanced.png").exists(), n == 32);
    }
}

/// Patterns of the bench's own are recorded, and the recording is read beside the patterns.
#[test]
fn patterns_of_the_bench_are_recorded_and_shown_by_their_matrix() {
    let bench = Bench::new();
    // Of 3 x 4 pixels each pattern lights one.
    let header =
        r#"{"height":3,"width":4,"patterns":12,"readings":"pairs","samples":4,"trigger":2}"#;
    let sample = |level: usize| format!("{level} 5\n{level} 0\n{level} 0\n{level} 0\n");
    let frame: String = (0..12).map(|at| sample(20 + at) + &sample(20)).collect();
    bench.write("log.txt", format!("{header}\n0 0\n{frame}{frame}").as_bytes());
    let capture = ["capture", "--camera", "feed:log.txt", "--frames", "2", "--out", "rec.npz"];
    let said = bench.run(&capture).succeeded().stdout;
    assert!(said.contains("3 x 4, 12 patterns of its own, readings pairs"), "{said}");
    let advice = "nirspi reconstruct rec.npz --index all --matrix PATTERNS --size 3x4 makes images";
    assert!(said.contains(advice), "{said}");
    let rows: String = (0..12)
        .map(|at| (0..12).map(|k| if k == at { "1 " } else { "0 " }).collect::<String>() + "\n")
        .collect();
    bench.write("masks.txt", rows.as_bytes());
    let image =
        ["reconstruct", "rec.npz", "--index", "1", "--matrix", "masks.txt", "--size", "3x4"];
    let more = ["--method", "pseudo-inverse", "--no-dark", "--out", "out"];
    bench.run(&[&image[..], &more].concat()).succeeded();
    // A pattern less its complement weighs each other pixel with -1.
    let found = bench.pixels("out/image.npy");
    let sum: f32 = found.iter().sum();
    let differences: Vec<f32> = found.iter().map(|pixel| 2.0 * pixel - sum).collect();
    assert!(
        differences.iter().enumerate().all(|(at, d)| (d - at as f32).abs() < 1e-3),
        "{found:?}"
    );
    let own = "the feed shows 12 patterns of its own on 3 x 4 pixels, expected Hadamard patterns";
    let serve = ["serve", "-q", "--listen", "127.0.0.1:0", "--camera", "feed:log.txt"];
    bench.run(&serve).failed(1, &[own]);
    let picture = [&capture[..3], &["--out", "b.npz", "--picture", "seen"]].concat();
    bench.run(&picture).failed(1, &["--picture of feed:log.txt: ", own]);
    assert!(!bench.names().contains(&"b.npz".to_owned()));
}

#[cfg(unix)]
#[test]
fn a_capture_of_a_feed_ends_at_ctrl_c_and_keeps_its_frames() {
    let bench = Bench::new();
    let scene = Measured::new(8);
    let text = format!("{}{}", header(&scene, ""), as_text(&scene.y).repeat(2));
    bench.write("log.txt", text.as_bytes());
    for (signal, code) in [("INT", 0), ("TERM", 1)] {
        let out = format!("{signal}.npz");
        let arguments = ["capture", "--camera", "feed:log.txt", "--out", &out, "--json"];
        let capture = bench.start(&arguments);
        // The numbers have come when the reader has waited for more.
        std::thread::sleep(Duration::from_secs(1));
        capture.signal(signal);
        let outcome = capture.wait();
        assert_eq!(outcome.code, Some(code), "{outcome:?}");
        assert_eq!(outcome.json()["account"]["frames"], 2);
        assert_eq!(images(&bench, &out).len(), 2 * 64);
    }
    assert!(!bench.names().iter().any(|name| name.starts_with('.')), "{:?}", bench.names());
}

#[test]
fn patterns_for_a_dmd_are_those_of_the_order_and_begin_a_feed() {
    let bench = Bench::new();
    let order = ["order", "zig-zag", "--n", "8", "--scale", "2", "--out", "patterns"];
    let said = bench.run(&order).succeeded().stdout;
    assert!(said.contains("wrote 128 patterns and complements (pictures)"), "{said}");
    assert!(bench.path("patterns/00127.png").exists());
    // Readings under the all-on pattern and its complement, and under all others.
    let header = std::fs::read_to_string(bench.path("patterns/header.json")).unwrap();
    let readings = "9 1\n".to_owned() + &"5 5\n".repeat(63);
    bench.write("log.txt", (header + &readings).as_bytes());
    let capture = ["capture", "--camera", "feed:log.txt", "--frames", "1", "--out", "rec.npz"];
    bench.run(&capture).succeeded();
    let image = images(&bench, "rec.npz");
    assert!(image.iter().all(|&pixel| (pixel - 8.0 / 64.0).abs() < 1e-6), "{image:?}");
    // The table says the same as the name of the order.
    bench.write("y.txt", readings.as_bytes());
    for shown in ["zig-zag", "table:patterns/order.txt"] {
        let arguments = ["reconstruct", "y.txt", "--readings", "pairs", "--shown", shown, "--out"];
        bench.run(&[&arguments[..], &[&shown[..5]]].concat()).succeeded();
    }
    assert_eq!(bench.pixels("zig-z/image.npy"), bench.pixels("table/image.npy"));
    bench.run(&["order", "natural", "--n", "9"]).failed(2, &["--n: an image side of 9 pixels"]);
    bench
        .run(&["order", "natural", "--patterns", "0"])
        .failed(2, &["0 patterns, expected 1 to 1024 for n = 32"]);
}

/// The Python of docs/feeds.md, with a simulated DAQ, in front of the command of the page.
#[cfg(unix)]
#[test]
fn five_lines_of_python_make_a_dmd_with_a_daq_a_feed() {
    let bench = Bench::new();
    let page = include_str!("../../../../docs/feeds.md");
    let code = page.split("```python\n").nth(3).and_then(|rest| rest.split("```").next()).unwrap();
    let commands = page.matches("python bench.py | nirspi ").count();
    assert!(code.lines().filter(|line| !line.is_empty()).count() <= 5 && commands == 2, "{code}");
    // A scene of one bright pixel: all patterns of a row light it with +1.
    let daq = "pairs = [v for _ in range(64 * 64) for v in (2.5, 0.5)]\n\
               daq = [(pairs * 3)[at:at + 1000] for at in range(0, 3 * len(pairs), 1000)]\n";
    bench.write("bench.py", format!("{daq}{code}").as_bytes());
    let python = std::env::var("NIRSPI_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let pipe = format!("{python} bench.py > in.txt; exec < in.txt");
    let arguments =
        ["capture", "--camera", "feed:-", "--frames", "3", "--out", "rec.npz", "--json"];
    let report = bench.start_limited(&pipe, &arguments).wait().succeeded().json();
    assert_eq!((&report["name"], &report["account"]["frames"]), (&"DMD".into(), &3.into()));
    let image = images(&bench, "rec.npz");
    assert_eq!(image.len(), 3 * 64 * 64);
    assert!((image[0] - 2.0).abs() < 1e-3 && image[1].abs() < 1e-3, "{:?}", &image[..2]);
}
