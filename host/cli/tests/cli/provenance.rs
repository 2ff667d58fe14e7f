//! Every picture, report and export says where its readings come from and what made it.

use crate::bench::{Bench, Outcome, array, npz};
use crate::serve::serve;
use nirspi::files::image::{encode_grey, provenance_of};
use nirspi::files::npy::encode;
use nirspi::provenance::{Made, Origin, Provenance, Taken};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

/// Seconds since 1970, and the same moment in words.
const EPOCH: (&str, &str) = ("1764059400", "2025-11-25T08:30:00Z");

/// Runs a command on a fixed date.
fn run(bench: &Bench, arguments: &[&str]) -> Outcome {
    bench.run_with(&[("SOURCE_DATE_EPOCH", EPOCH.0)], arguments)
}

/// Checks the provenance of the command `name`.
#[track_caller]
fn is_signed(what: &str, found: &Provenance, origin: Origin, name: &str) {
    assert_eq!(found.taken.origin, origin, "{what}");
    let Made { program, command, date, .. } = &found.made;
    assert_eq!(program, concat!("nirspi ", env!("CARGO_PKG_VERSION")), "{what}");
    assert!(command.starts_with(&format!("nirspi {name}")), "{what}: {command}");
    assert_eq!(date, EPOCH.1, "{what}");
}

fn of_json(what: &str, json: &Value) -> Provenance {
    serde_json::from_value(json["provenance"].clone())
        .unwrap_or_else(|error| panic!("{what}: {error}: {json}"))
}

/// The field `provenance` of an `.npz` file: NumPy's text, four bytes a letter.
fn of_npz(path: &Path) -> Provenance {
    let text = array(path, "provenance");
    let letters = text.as_chunks::<4>().0.iter().map(|&letter| u32::from_le_bytes(letter));
    let text: String = letters.map(|letter| char::from_u32(letter).unwrap()).collect();
    serde_json::from_str(&text).unwrap()
}

/// The provenance of a figure: JSON in one line of its text.
fn of_text(path: &Path) -> Provenance {
    let text = String::from_utf8_lossy(&fs::read(path).unwrap()).into_owned();
    let text = text.replace("&quot;", "\"");
    let start = text.find("{\"origin\"").unwrap_or_else(|| panic!("{}", path.display()));
    let mut found = serde_json::Deserializer::from_str(&text[start..]).into_iter();
    found.next().unwrap().unwrap()
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

/// Checks every picture, report and archive of arrays in a folder, and how many there are.
#[track_caller]
fn all_are_signed(bench: &Bench, folder: &str, count: usize, origin: Origin, name: &str) {
    let mut found = 0;
    for file in files(&bench.path(folder)) {
        let what = file.display().to_string();
        // The list of the results, for the next run.
        if file.ends_with(".nirspi.json") {
            continue;
        }
        let provenance = match file.extension().and_then(|ending| ending.to_str()) {
            Some("png" | "apng") => {
                provenance_of(&file).unwrap().unwrap_or_else(|| panic!("{what}: not signed"))
            }
            Some("json") => {
                of_json(&what, &serde_json::from_slice(&fs::read(&file).unwrap()).unwrap())
            }
            Some("npz") => of_npz(&file),
            Some("svg" | "csv" | "pdf") => of_text(&file),
            _ => continue,
        };
        is_signed(&what, &provenance, origin, name);
        found += 1;
    }
    assert_eq!(found, count, "{folder}");
}

/// The report on stdout.
#[track_caller]
fn says(outcome: Outcome, origin: Origin, name: &str) -> Provenance {
    assert_eq!(outcome.code, Some(0), "{outcome:?}");
    let provenance = of_json(name, &outcome.json());
    is_signed(name, &provenance, origin, name);
    provenance
}

const SIMULATED: Origin = Origin::Simulated;

#[test]
#[ignore = "long: .ci/run demo"]
fn pictures_and_reports_of_a_recording_name_its_camera() {
    let bench = Bench::new();
    let capture = ["capture", "--frames", "20", "--out", "rec.mcap", "--picture", "seen"];
    let said = says(run(&bench, &[&capture[..], &["--json"]].concat()), SIMULATED, "capture");
    let camera = said.taken.camera.unwrap();
    assert_eq!((camera.board.as_str(), camera.serial.as_str()), ("virtual", "virtual-1"));
    assert_eq!(camera.firmware, env!("CARGO_PKG_VERSION"));
    assert!(camera.protocol > 0 && camera.gateware.contains('.'), "{camera:?}");
    assert_eq!(
        said.made.command,
        capture.join(" ").replace("capture", "nirspi capture") + " --json"
    );
    all_are_signed(&bench, "seen", 7, SIMULATED, "capture");

    let reconstruct = ["reconstruct", "rec.mcap", "--json"];
    for (more, out, count) in
        [(&["--enhance"][..], "one", 7), (&["--enhance", "--index", "all"], "video", 9)]
    {
        let arguments = [&reconstruct[..], more, &["--out", out]].concat();
        let said = says(run(&bench, &arguments), SIMULATED, "reconstruct");
        assert_eq!(said.taken.camera.as_ref(), Some(&camera));
        assert_eq!(said.taken.file.as_deref(), Some("rec.mcap"));
        all_are_signed(&bench, out, count, SIMULATED, "reconstruct");
    }

    for form in ["npz", "npy", "csv", "mcap", "apng"] {
        let out = format!("exported/{form}/rec.{form}");
        fs::create_dir_all(bench.path(&out).parent().unwrap()).unwrap();
        run(&bench, &["recording", "export", "rec.mcap", "--to", form, "--out", &out]).succeeded();
    }
    for form in ["npz", "npy", "apng"] {
        all_are_signed(&bench, &format!("exported/{form}"), 1, SIMULATED, "recording export");
    }
    let table = fs::read_to_string(bench.path("exported/csv/rec.csv")).unwrap();
    let line = table.lines().find_map(|line| line.strip_prefix("# provenance: ")).unwrap();
    is_signed("csv", &serde_json::from_str(line).unwrap(), SIMULATED, "recording export");
    let bytes = fs::read(bench.path("exported/mcap/rec.mcap")).unwrap();
    let text = String::from_utf8_lossy(&bytes);
    let (key, json) = (text.find("nirspi-provenance").unwrap(), "\"origin\":\"simulated\"");
    assert!(text[key..].contains(json) && text[key..].contains(EPOCH.1));
    // Readers of this program take these files as they took them without it.
    for file in ["npz/rec.npz", "csv/rec.csv", "mcap/rec.mcap"] {
        let file = format!("exported/{file}");
        let said = run(&bench, &["reconstruct", &file, "--out", "again", "--json"]);
        let said = says(said, SIMULATED, "reconstruct");
        assert_eq!(said.taken.camera.as_ref(), Some(&camera), "{file}");
        assert_eq!(said.taken.file.as_deref(), file.rsplit('/').next());
    }
    // One frame of an array, whose provenance is in a file beside it.
    let npy = ["reconstruct", "exported/npy/rec.npy", "--index", "3", "--readings", "differences"];
    let npy = [&npy[..], &["--shown", "cake-cutting", "--side", "32", "--out", "again", "--json"]]
        .concat();
    let said = says(run(&bench, &npy), SIMULATED, "reconstruct");
    assert_eq!(said.taken.camera.as_ref(), Some(&camera));
    // Samples of a trace, and the readings that were made of them.
    let readings = ["readings", "exported/npz/rec.npz", "--field", "d", "--samples", "2"];
    let readings = [&readings[..], &["--out", "trace/m.npz", "--json"]].concat();
    fs::create_dir_all(bench.path("trace")).unwrap();
    let said = says(run(&bench, &readings), SIMULATED, "readings");
    assert_eq!(said.taken.camera.as_ref(), Some(&camera));
    all_are_signed(&bench, "trace", 5, SIMULATED, "readings");
    assert_eq!(of_npz(&bench.path("trace/m.npz")).taken.camera, Some(camera));
}

#[test]
fn everything_that_a_demo_writes_is_signed() {
    let bench = Bench::new();
    let demo = ["demo", "--frames", "20", "--out", "demo", "--json"];
    let said = says(run(&bench, &demo), SIMULATED, "demo");
    assert_eq!(said.taken.camera.unwrap().serial, "virtual-1");
    let pictures = files(&bench.path("demo"));
    let pictures = pictures.iter().filter(|file| file.extension().is_some_and(|e| e == "png"));
    // The pictures, the figure as SVG and PDF, report.json and measurement.npz.
    all_are_signed(&bench, "demo", pictures.count() + 4, SIMULATED, "demo");
}

#[test]
fn enhanced_images_keep_the_origin_that_their_pictures_state() {
    let bench = Bench::new();
    let values: Vec<f32> = (0..64 * 64).map(|at| (at / 64 > 20) as u8 as f32 * 0.5).collect();
    let made = Made::by("another 1.0", None, ["another"], 0);
    let taken = Taken::of_file(Path::new("wing.npz"), Some(false));
    bench.write("signed.png", &encode_grey(64, 64, &values, &taken.made(&made)));
    bench.write("plain.npy", &encode(&[64, 64], &values));
    bench.write("small.npy", &encode(&[32, 32], &values[..1024]));
    fs::create_dir_all(bench.path("sharp")).unwrap();
    let deblur = |input: &str, out: &str| {
        let arguments = ["deblur", input, "--backend", "cpu", "--out", out, "--json"];
        run(&bench, &arguments)
    };
    let said = says(deblur("signed.png", "sharp/s.png"), Origin::Measured, "deblur");
    assert_eq!(said.taken.file.as_deref(), Some("wing.npz"));
    all_are_signed(&bench, "sharp", 4, Origin::Measured, "deblur");
    let said = says(deblur("plain.npy", "p.npy"), Origin::Unknown, "deblur");
    assert_eq!(said.taken.file.as_deref(), Some("plain.npy"));
    for name in ["enhance", "dev upscale"] {
        let out = format!("{name}/s.npy");
        fs::create_dir_all(bench.path(name)).unwrap();
        let words = name.split(' ').collect::<Vec<_>>();
        let arguments =
            [&words[..], &["small.npy", "--backend", "cpu", "--out", &out, "--json"]].concat();
        says(run(&bench, &arguments), Origin::Unknown, name);
        all_are_signed(&bench, name, 3, Origin::Unknown, name);
    }
}

#[test]
fn readings_of_others_are_named_by_their_file() {
    let bench = Bench::new();
    let y: Vec<f32> = (0..16).map(|at| at as f32).collect();
    bench.write("dmd.npz", &npz(&[("y", &[16], &y)]));
    let patterns: Vec<f32> = (0..256).map(|at| f32::from(u8::from(at % 17 == 0))).collect();
    bench.write("patterns.npy", &encode(&[16, 16], &patterns));
    let matrix = ["reconstruct", "dmd.npz", "--matrix", "patterns.npy", "--method", "tikhonov"];
    let said = run(&bench, &[&matrix[..], &["--out", "matrix", "--json"]].concat());
    assert_eq!(says(said, Origin::Unknown, "reconstruct").taken.file.as_deref(), Some("dmd.npz"));
    all_are_signed(&bench, "matrix", 4, Origin::Unknown, "reconstruct");

    let d: Vec<f32> = (0..64).map(|at| ((at * 37) % 23) as f32).collect();
    let rows: Vec<f32> = (0..64).map(|at| at as f32).collect();
    bench.write("lab.npz", &npz(&[("n", &[], &[8.0]), ("h_row", &[64], &rows), ("d", &[64], &d)]));
    let sampling = ["eval", "sampling", "lab.npz", "--sampling", "50%", "--orders", "zig-zag"];
    let said = run(&bench, &[&sampling[..], &["--out", "study", "--json"]].concat());
    says(said, Origin::Unknown, "eval sampling");
    all_are_signed(&bench, "study", 8, Origin::Unknown, "eval sampling");
    let tables = fs::read_to_string(bench.path("study/sampling.md")).unwrap();
    assert!(tables.contains("origin unknown, file lab.npz, nirspi "), "{tables}");
}

#[test]
#[ignore = "long: .ci/run demo"]
fn tables_charts_and_times_are_signed() {
    let bench = Bench::new();
    for (arguments, name, folder, count, origin) in [
        (
            &["physics", "range", "--out", "range", "--json"][..],
            "physics range",
            "range",
            21,
            SIMULATED,
        ),
        (
            &["eval", "table1", "--repeats", "10", "--out", "table", "--json"],
            "eval table1",
            "table",
            5,
            SIMULATED,
        ),
    ] {
        says(run(&bench, arguments), origin, name);
        all_are_signed(&bench, folder, count, origin, name);
    }
    let timed = ["dev", "bench", "enhance", "--frames", "1", "--repeats", "1", "--backend", "cpu"];
    says(run(&bench, &timed), Origin::Computed, "dev bench enhance");
    bench.write("a.npy", &encode(&[16, 16], &[0.5_f32; 256]));
    let metrics = ["metrics", "a.npy", "a.npy", "--json"];
    let said = run(&bench, &metrics);
    says(said, Origin::Computed, "metrics");
    for name in ["calibrate", "selftest"] {
        let said = run(&bench, &["camera", name, "--json"]);
        let said = says(said, SIMULATED, &format!("camera {name}"));
        assert_eq!(said.taken.camera.unwrap().serial, "virtual-1");
    }
    run(&bench, &["example", "wing", "--out", "wing.npz"]).succeeded();
    is_signed("example", &of_npz(&bench.path("wing.npz")), SIMULATED, "example");
}

#[test]
fn the_live_page_signs_the_pictures_that_a_script_asks_for_and_hides_its_token() {
    let bench = Bench::new();
    let server = serve(&bench, &["--token", "0123456789abcdef0123456789abcdef"]);
    let cookie = format!("/image.png?{}", server.query);
    let deadline = std::time::Instant::now() + crate::serve::LIMIT;
    let answer = loop {
        let answer = server.get(&cookie);
        if answer.status == 200 {
            break answer;
        }
        assert!(std::time::Instant::now() < deadline, "{answer:?}");
        std::thread::sleep(std::time::Duration::from_millis(50));
    };
    bench.write("got.png", &answer.body);
    let found = provenance_of(&bench.path("got.png")).unwrap().unwrap();
    assert_eq!((found.taken.origin, found.taken.simulated()), (SIMULATED, Some(true)));
    assert!(found.made.command.contains("--token hidden"), "{}", found.made.command);
    assert!(!String::from_utf8_lossy(&answer.body).contains("0123456789abcdef"));
}
