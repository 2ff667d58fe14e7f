//! The same recording gives the same picture, whichever command makes it.

use crate::bench::Bench;
use crate::serve::serve;
use nirspi::calibration::FlatField;
use nirspi::files::image::read_grey;
use nirspi::imaging::enhance_frames;
use nirspi::picture::FigureStyle;
use nirspi::provenance::Made;
use nirspi::reconstruct::{Pipeline, Recipe, ResultFolder, Solver};
use nirspi::source::{Source, SourceOptions, Sources};
use nirspi::stage_times::StageTimes;
use nirspi_recon::Backend;
use nirspi_recon::reconstruct::Method;

/// Bright LEDs that differ by a fifth, one of them dead, so that the flat field shows.
const UNEQUAL: &[u8] = b"[leds]\npower_mw = 40\npower_spread = 0.2\ndead = [[3, 7]]\n";

#[test]
#[ignore = "long: .ci/run demo"]
fn one_recording_gives_one_picture_through_every_door() {
    let bench = Bench::new();
    bench.write("lab.toml", UNEQUAL);
    let lab = ["--camera-model", "lab.toml"];
    bench
        .run(&[&["camera", "calibrate", "--white", "--sweeps", "200"][..], &lab].concat())
        .succeeded();
    let capture = ["capture", "--frames", "40", "--out", "rec.mcap", "--picture", "seen"];
    done(&bench, &[&capture[..], &lab].concat());
    done(&bench, &["reconstruct", "rec.mcap", "--enhance", "--out", "rec"]);
    let plain = ["reconstruct", "rec.mcap", "--enhance", "--no-flat-field", "--out", "plain"];
    done(&bench, &plain);
    for name in ["image.npy", "enhanced.npy"] {
        let door = |folder: &str| bench.pixels(&format!("{folder}/{name}"));
        assert_eq!(door("seen"), door("rec"), "{name}");
        // The flat field is part of the picture.
        assert_ne!(door("rec"), door("plain"), "{name}");
    }
    let picture = |folder: &str| read_grey(&bench.path(&format!("{folder}/enhanced.png"))).unwrap();
    assert_eq!(picture("seen"), picture("rec"));

    // A program that calls the library, of one picture and of a stack. The flat field lies where the program kept it.
    done(&bench, &["reconstruct", "rec.mcap", "--index", "all", "--enhance", "--out", "all"]);
    let made = Made::by("a test", None, ["a test"], 0);
    let solver = Solver::new(Recipe::default()).unwrap();
    let pipeline = Pipeline::new(solver).with_networks(Backend::Cpu).unwrap();
    let (recording, options) = (bench.path("rec.mcap"), SourceOptions::default());
    let folder = |out| ResultFolder::of_file(&recording, out, &made, FigureStyle::Paper);
    let (one, all) = (bench.path("library"), bench.path("library-all"));
    let flat = kept(&bench);
    let mut source = Source::read(&recording, &options).unwrap();
    source.flat_field = Some(flat.clone());
    pipeline.one(source, &folder(&one), StageTimes::default()).unwrap();
    let sources = Sources::open(&recording, &options).unwrap();
    pipeline.all(sources, &folder(&all), &|_| true, StageTimes::default()).unwrap();
    let plain = ["reconstruct", "rec.mcap", "--no-flat-field", "--index", "all", "--enhance"];
    done(&bench, &[&plain[..], &["--out", "all-plain"]].concat());
    for name in ["image.npy", "enhanced.npy"] {
        let bytes = |folder: &str| std::fs::read(bench.path(&format!("{folder}/{name}"))).unwrap();
        assert_eq!(bytes("library"), bytes("rec"), "{name}");
        assert_eq!(bytes("library-all"), bytes("all-plain"), "{name}");
        assert_ne!(bytes("all"), bytes("all-plain"), "{name}");
    }

    // The library's functions, as `demo` calls them.
    let source = Source::read(&bench.path("rec.mcap"), &SourceOptions::default()).unwrap();
    assert!(source.flat_field.is_none(), "a flat field of this user's own");
    let ready = Method::default().prepare(&nirspi_nets::prior::settings()).unwrap();
    let made = ready.reconstruct(&source.measurements).unwrap();
    let image = made.image.clone();
    assert_eq!(image.pixels(), bench.pixels("plain/image.npy"));
    let given = FlatField::corrected(Some(&flat), made.with_readings(&source.measurements));
    let image = FlatField::corrected(Some(&flat), image);
    assert_eq!(image.pixels(), bench.pixels("rec/image.npy"));
    let rows = source.measurements.rows();
    let (sharp, _) = enhance_frames(&[(&given, rows)], &mut StageTimes::default()).unwrap();
    assert_eq!(sharp, bench.pixels("rec/enhanced.npy"));

    // The live page of the recording, once it has summed all frames.
    // The page chooses by its first picture, of fewer frames.
    let chosen = made.report.chosen.unwrap();
    let live = ["--camera", "replay:rec.mcap,100", "--frames", "40", "--method", chosen];
    let server = serve(&bench, &live);
    server.state("of all frames", |state| state["picture"]["frames"] == 40);
    let answer = server.get("/image.npy");
    bench.write("live.npy", &answer.body);
    assert_eq!(bench.pixels("live.npy"), bench.pixels("rec/image.npy"));
}

/// Runs a command to its end. It may warn of the image.
#[track_caller]
fn done(bench: &Bench, arguments: &[&str]) {
    let outcome = bench.run(arguments);
    assert_eq!(outcome.code, Some(0), "{outcome:?}");
}

/// The flat field that `calibrate --white` has kept.
fn kept(bench: &Bench) -> FlatField {
    let mut folders = vec![bench.path("data")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
            let path = entry.path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() {
                folders.push(path);
            } else if name.contains("flat") {
                let json: serde_json::Value =
                    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
                return serde_json::from_value(json["flat"].clone()).unwrap();
            }
        }
    }
    panic!("no flat field is kept");
}
