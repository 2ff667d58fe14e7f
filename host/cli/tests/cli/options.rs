//! Options that no other test of the program looks at, in groups by their commands: each changes what comes out, as its help
//! says.

use crate::bench::{Bench, array, npz, provenance};
use nirspi::files::image::encode_grey;
use nirspi::files::npy;
use serde_json::Value;

/// The recording of the wire protocol's first version.
const RECORDING: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/recordings/v1.mcap");

/// The image of a file of measurements, by the method that changes nothing.
#[track_caller]
fn image(bench: &Bench, file: &str, more: &[&str]) -> Vec<f32> {
    let all = ["reconstruct", file, "--method", "hadamard", "--out", "out"];
    bench.run(&[&all, more].concat()).succeeded();
    bench.pixels("out/image.npy")
}

#[track_caller]
fn report(bench: &Bench, arguments: &[&str]) -> Value {
    bench.run(&[arguments, &["--json"]].concat()).succeeded().json()
}

#[track_caller]
fn are_close(found: &[f32], expected: &[f32]) {
    assert_eq!(found.len(), expected.len());
    let worst = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0_f32, f32::max);
    assert!(worst < 1e-3, "pixels differ by {worst}");
}

#[test]
fn the_leak_from_pattern_to_pattern_stays_if_the_user_says_so() {
    let bench = Bench::new();
    let (corrected, kept) =
        (image(&bench, RECORDING, &[]), image(&bench, RECORDING, &["--keep-leak"]));
    assert_ne!(corrected, kept);
    // An exported recording is what `reconstruct` sees.
    let exported = |more: &[&str]| {
        let all =
            ["recording", "export", RECORDING, "--to", "npz", "--out", "out.npz", "--overwrite"];
        bench.run(&[&all, more].concat()).succeeded();
        image(&bench, "out.npz", &[])
    };
    are_close(&exported(&[]), &corrected);
    are_close(&exported(&["--keep-leak"]), &kept);
}

#[test]
fn a_damaged_recording_is_recovered_into_the_named_file_alone() {
    let bench = Bench::new();
    let whole = std::fs::read(RECORDING).unwrap();
    bench.write("cut.mcap", &whole[..whole.len() * 3 / 4]);
    let recover = ["recording", "recover", "cut.mcap", "--out", "new.mcap"];
    let said = report(&bench, &recover);
    assert_eq!(said["damage"], "the file ends early", "{said}");
    let received = said["frames"]["received"].as_u64().unwrap();
    assert!((1..12).contains(&received), "{said}");
    let new = std::fs::read(bench.path("new.mcap")).unwrap();
    let info = bench.run(&["camera", "info", "new.mcap"]).succeeded().stdout;
    assert!(info.contains(&format!("{received} received")) && info.contains("recovered"), "{info}");
    bench.run(&recover).failed(1, &["new.mcap", "--overwrite"]);
    bench.write("new.mcap", b"another file");
    bench.run(&[&recover[..], &["--overwrite"]].concat()).succeeded();
    assert_eq!(std::fs::read(bench.path("new.mcap")).unwrap(), new);
    assert_eq!(bench.names(), ["cut.mcap", "new.mcap"]);
}

#[test]
fn pictures_of_another_size_are_cropped_and_resized_on_demand() {
    let bench = Bench::new();
    let grey: Vec<f32> = (0..100 * 80).map(|at| (at % 100 / 10 % 2) as f32).collect();
    bench.write("in.png", &encode_grey(100, 80, &grey, &provenance()));
    for (command, more) in
        [("dev upscale", &[][..]), ("deblur", &["--model", "wiener"]), ("enhance", &[])]
    {
        let words: Vec<&str> = command.split(' ').collect();
        let all = [&words, &["in.png", "--out", "out.npy", "--overwrite"][..], more].concat();
        bench.run(&all).failed(1, &["in.png", "80 x 100", "--resize"]);
        bench.run(&[&all[..], &["--resize"]].concat()).succeeded();
        assert_eq!(bench.pixels("out.npy").len(), 64 * 64, "{command}");
    }
}

#[test]
fn without_agreement_with_the_readings_the_network_alone_decides() {
    let bench = Bench::new();
    // A pattern that no network has seen.
    let odd: Vec<f32> =
        (0..4096).map(|at| ((at / 64 * 5 + at % 64 * 3) % 7) as f32 / 6.0).collect();
    bench.write("in.npy", &npy::encode(&[64, 64], &odd));
    let sharp = |more: &[&str]| {
        let all = ["deblur", "in.npy", "--out", "out.npy", "--overwrite", "--backend", "cpu"];
        bench.run(&[&all, more].concat()).succeeded();
        bench.pixels("out.npy")
    };
    assert_ne!(sharp(&[]), sharp(&["--no-consistency"]));
    let told = |more: &[&str]| {
        let all =
            ["dev", "bench", "pipeline", "--frames", "1", "--repeats", "1", "--backend", "cpu"];
        report(&bench, &[&all, more].concat())
    };
    let few = told(&["--measurements", "64", "--sparsity", "4", "--no-consistency"]);
    let more = told(&["--measurements", "256", "--sparsity", "32", "--seed", "2"]);
    for (name, without, with) in
        [("consistency", Value::from(false), true.into()), ("measurements", 64.into(), 256.into())]
    {
        assert_eq!((&few[name], &more[name]), (&without, &with), "{name}");
    }
    let psnr = |told: &Value| told["reconstructed_psnr_db"].as_f64().unwrap();
    assert!(psnr(&more) > psnr(&few), "{few} {more}");
}

/// The atoms that `bench omp` has chosen.
fn atoms(bench: &Bench, more: &[&str]) -> Vec<u8> {
    let all = ["dev", "bench", "omp", "--out", "solution.npz", "--overwrite", "--repeats", "1"];
    bench.run(&[&all, more].concat()).succeeded();
    array(&bench.path("solution.npz"), "support")
}

#[test]
fn a_pursuit_chooses_by_correlation_if_asked_and_by_its_seed() {
    let bench = Bench::new();
    // The second atom is the frame; the first one is longer.
    let dictionary = [10.0, 1.0, 10.0, 0.0];
    let fields: [(&str, &[usize], &[f32]); 3] =
        [("D", &[2, 2], &dictionary), ("Y", &[1, 2], &[1.0, 0.0]), ("k", &[], &[1.0])];
    bench.write("problem.npz", &npz(&fields));
    let chosen = |more: &[&str]| {
        let bytes = atoms(&bench, &[&["--input", "problem.npz"], more].concat());
        i64::from_le_bytes(*bytes.last_chunk().unwrap())
    };
    assert_eq!((chosen(&[]), chosen(&["--normalise"])), (0, 1));
    let random = |seed| atoms(&bench, &["--measurements", "64", "--sparsity", "4", "--seed", seed]);
    assert_eq!(random("1"), random("1"));
    assert_ne!(random("1"), random("2"));
}

#[test]
fn less_light_or_a_higher_demand_is_a_shorter_range() {
    let bench = Bench::new();
    // The range in light and in heavy rain, at one exposure.
    let ranges = |command: &[&str], more: &[&str]| -> Vec<f64> {
        let said = report(&bench, &[command, &["--exposures-us", "25"], more].concat());
        let rows = said["rows"].as_array().unwrap();
        assert!(rows.iter().all(|row| row["exposure_us"] == 25.0), "{said}");
        rows.iter().map(|row| row["physics_m"].as_f64().unwrap()).collect()
    };
    let all = ranges(&["physics", "range"], &[]);
    // `eval table2` is the same command.
    for less in [
        ranges(&["physics", "range"], &["--reflectance", "0.2"]),
        ranges(&["eval", "table2"], &["--snr", "5"]),
        ranges(&["physics", "range"], &["--camera-model", "fga015"]),
    ] {
        assert!(all.len() == 2 && all.iter().zip(&less).all(|(all, less)| less != all), "{less:?}");
    }
    let budget = |more: &[&str]| {
        let all = ["physics", "budget", "--wavelengths-nm", "1550", "--drops", "mono:2"];
        report(&bench, &[&all, more].concat())["snr_per_pixel"].as_f64().unwrap()
    };
    let snr = budget(&[]);
    assert!(
        budget(&["--exposure-us", "100"]) > 1.5 * snr && budget(&["--reflectance", "0.5"]) < snr
    );
}

#[test]
fn simulated_measurements_are_those_of_their_seed_and_replace_no_file_unasked() {
    let bench = Bench::new();
    let wing = |more: &[&str]| {
        bench.run(&[&["example", "wing", "--out", "wing.npz"], more].concat()).succeeded();
        image(&bench, "wing.npz", &[])
    };
    let first = wing(&[]);
    bench.run(&["example", "wing", "--out", "wing.npz"]).failed(1, &["wing.npz", "--overwrite"]);
    assert_ne!(wing(&["--seed", "7", "--overwrite"]), first);

    let pairs = ["dev", "pairs", "--count", "1", "--out", "pairs.npz"];
    bench.run(&pairs).succeeded();
    let paper = std::fs::read(bench.path("pairs.npz")).unwrap().len();
    bench.run(&pairs).failed(1, &["pairs.npz", "--overwrite"]);
    let again = [&pairs[..], &["--overwrite"]].concat();
    assert_eq!(report(&bench, &again)["held_out"], false);
    assert_eq!(report(&bench, &[&again[..], &["--only-held-out"]].concat())["held_out"], true);
    assert!(paper > 0);
}

#[test]
fn a_self_test_looks_at_the_scene_that_is_named() {
    let bench = Bench::new();
    let dark = bench.run(&["camera", "selftest", "--scene", "black", "--json"]);
    assert_eq!((dark.code, &dark.json()["passed"]), (Some(1), &false.into()), "{dark:?}");
}
