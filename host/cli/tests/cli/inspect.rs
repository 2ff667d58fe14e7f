//! What a file holds, and the command that reconstructs it.

use crate::bench::{Bench, Measured, correlation, npz};
use crate::cases::cases;
use nirspi::files::npy::{encode, read_stack};
use nirspi_recon::{Order, Side};
use std::fmt::Write as _;
use std::path::Path;

/// The words of a command, as a shell reads them.
fn shell(command: &str) -> Vec<String> {
    let (mut words, mut word, mut quoted) = (Vec::new(), String::new(), false);
    for letter in command.chars() {
        match letter {
            '\'' => quoted = !quoted,
            ' ' if !quoted => words.push(std::mem::take(&mut word)),
            letter => word.push(letter),
        }
    }
    words.push(word);
    words
}

/// The report on a file, and what the commands of the first guess print.
#[track_caller]
fn first_guess(bench: &Bench, file: &str) -> (serde_json::Value, Vec<String>) {
    let report = bench.run(&["inspect", file, "--json"]).succeeded().json();
    let commands = report["guesses"][0]["commands"].as_array();
    let commands = commands.unwrap_or_else(|| panic!("no guess for {file}: {report}"));
    let run = |command: &serde_json::Value| {
        let words = shell(command.as_str().unwrap());
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        assert_eq!(words[0], "nirspi");
        let outcome = bench.run(&words[1..]).succeeded();
        outcome.stdout + &outcome.stderr
    };
    let said = commands.iter().map(run).collect();
    (report, said)
}

/// The readings of a scene of 16 x 16 in natural order.
struct Natural {
    measured: Measured,
    y: Vec<f32>,
    on: Vec<f32>,
    off: Vec<f32>,
}

impl Natural {
    fn new() -> Self {
        let measured = Measured::new(16);
        let y = measured.natural();
        let half = |which: usize| y.iter().copied().skip(which).step_by(2).collect();
        let (on, off) = (half(0), half(1));
        Self { measured, y, on, off }
    }

    fn d(&self) -> Vec<f32> {
        self.on.iter().zip(&self.off).map(|(on, off)| on - off).collect()
    }

    fn csv(&self, heading: &str, line: impl Fn(usize, f32, f32) -> String) -> Vec<u8> {
        let pairs = self.on.iter().zip(&self.off).enumerate();
        let mut text = format!("{heading}\n");
        for (at, (&on, &off)) in pairs {
            writeln!(text, "{}", line(at, on, off)).unwrap();
        }
        text.into_bytes()
    }
}

#[test]
#[ignore = "long: .ci/run demo"]
fn the_first_command_gives_the_image() {
    let scene = Natural::new();
    let (y, n) = (&scene.y, [512]);
    let exchanged: Vec<f32> = y.as_chunks::<2>().0.iter().flat_map(|p| [p[1], p[0]]).collect();
    let zig_zag = Order::ZigZag.rows(Side::new(16).unwrap()).unwrap();
    let shown: Vec<f32> =
        zig_zag.iter().flat_map(|&row| [y[2 * row as usize], y[2 * row as usize + 1]]).collect();
    let part: Vec<f32> = zig_zag.iter().take(150).map(|&row| scene.on[row as usize]).collect();
    let whole: (&str, &[usize], &[f32]) = ("n", &[], &[16.0]);
    let rows: Vec<f32> = (0..256).map(|row| row as f32).collect();
    let rows: (&str, &[usize], &[f32]) = ("h_row", &[256], &rows);
    // The file, its name, how the first guess reads it and in which order.
    let cases: Vec<(&str, Vec<u8>, &str, &str)> = vec![
        ("pairs.npy", encode(&n, y), "pairs", "natural"),
        ("halves.npy", encode(&n, &[&scene.on[..], &scene.off].concat()), "halves", "natural"),
        ("single.npy", encode(&[256], &scene.on), "single", "natural"),
        ("dark.npy", encode(&[256], &scene.off), "single, inverted", "natural"),
        ("d.npy", encode(&[256], &scene.d()), "differences", "natural"),
        ("spectrum.npy", encode(&[16, 16], &scene.d()), "differences", "natural"),
        ("spectrum of pairs.npy", encode(&[16, 16, 2], y), "pairs", "natural"),
        ("zig-zag.npy", encode(&n, &shown), "pairs", "zig-zag"),
        ("part.npy", encode(&[150], &part), "single", "zig-zag"),
        ("first.npy", encode(&n, &exchanged), "pairs, complements first", "natural"),
        ("early.npy", encode(&n, &[&y[1..], &y[..1]].concat()), "pairs, shifted by 1", "natural"),
        ("sweeps.npy", encode(&[2048], &y.repeat(4)), "pairs, 4 sweeps", "natural"),
        (
            "samples.npy",
            encode(&[2048], &y.iter().flat_map(|&y| [y; 4]).collect::<Vec<f32>>()),
            "pairs, 4 samples each",
            "natural",
        ),
        ("rows.npz", npz(&[whole, rows, ("my volts", &n, y)]), "pairs", "of h_row"),
        (
            "other names.npz",
            npz(&[("shown", &[256], &scene.measured.h_row), ("volts", &n, &scene.measured.y)]),
            "pairs",
            "of h_row",
        ),
        ("several.npz", npz(&[whole, rows, ("y", &[2, 512], &y.repeat(2))]), "pairs", "of h_row"),
        (
            "two columns.csv",
            scene.csv("t,lit pixels,dark", |at, on, off| format!("{at}.5,{on},{off}")),
            "pairs",
            "natural",
        ),
        (
            "commas.csv",
            scene.csv("volts", |_, on, _| format!("{:.4}", 2.0 + on).replace('.', ",")),
            "single",
            "natural",
        ),
    ];
    for (file, bytes, form, order) in cases {
        let bench = Bench::new();
        bench.write(file, &bytes);
        let (report, said) = first_guess(&bench, file);
        let guess = &report["guesses"][0];
        assert_eq!((&guess["form"], &guess["order"]), (&form.into(), &order.into()), "{file}");
        assert!(!said.concat().contains("warning"), "{file}: {said:?}");
        let alike = correlation(&bench.pixels("out/image.npy"), &scene.measured.image);
        let least = if file == "part.npy" { 0.9 } else { 0.99 };
        assert!(alike > least, "{file}: {alike}");
    }
}

#[test]
fn what_is_in_the_file_is_said_with_the_best_ways_and_their_picture() {
    let (bench, scene) = (Bench::new(), Natural::new());
    let text = scene.csv("a log\ntime,CH 1,note", |at, on, _| format!("{at}.5,{on:.4},ok"));
    bench.write("log.csv", &text);
    let inspect = ["inspect", "log.csv", "--out", "ways.png"];
    let outcome = bench.run(&inspect).succeeded();
    for words in [
        "log.csv: a text table\n",
        "  time (256,) numbers, from 0.5 to 255.5\n",
        "  'CH 1' (256,) numbers, from ",
        "1. `CH 1`: single, order natural, 16 x 16: explains 9",
        "\n   nirspi reconstruct log.csv --field 'CH 1' --readings single --shown natural --out out/\n",
        "ways tried; the others explain less",
        "note: left out of the text: 1 line before the table; columns that hold words: `note`",
        "wrote ways.png",
    ] {
        assert!(outcome.stdout.contains(words), "{words:?} in {}", outcome.stdout);
    }
    let picture = std::fs::read(bench.path("ways.png")).unwrap();
    assert!(picture.starts_with(b"\x89PNG") && picture.len() > 5000);
    bench.run(&inspect).failed(1, &["ways.png", "is there already", "--overwrite"]);
    bench.run(&[&inspect[..], &["--overwrite"]].concat()).succeeded();
    bench.run(&["inspect", "log.csv", "--out", "ways.jpg"]).failed(2, &["ends in .png"]);
    let report = bench.run(&["inspect", "log.csv", "--json"]).succeeded().json();
    assert_eq!(report["arrays"][1]["name"], "CH 1");
    assert_eq!(
        (&report["guesses"][0]["n"], &report["guesses"][0]["by_chance"]),
        (&16.into(), &false.into())
    );
    assert!(report["guesses"][0]["explained"].as_f64().unwrap() > 0.9);
    assert_eq!(report["provenance"]["file"], "log.csv");
}

/// A recorded feed states its form, so the form is no other way to read it. Large numbers are short.
#[test]
fn a_way_is_told_once_and_numbers_are_short() {
    let (bench, scene) = (Bench::new(), Natural::new());
    let mut y = scene.y.clone();
    y[70] = 9.9e37;
    let text: Vec<String> = y.iter().chain(&scene.y).map(ToString::to_string).collect();
    let header = r#"{"n": 16, "order": "natural", "readings": "pairs"}"#;
    bench.write("feed.txt", format!("{header}\n{}\n", text.join(" ")).as_bytes());
    let capture = ["capture", "--camera", "feed:feed.txt", "--frames", "2", "--out", "rec.npz"];
    bench.run(&capture);
    let report = bench.run(&["inspect", "rec.npz", "--json"]).succeeded().json();
    let guesses = report["guesses"].as_array().unwrap();
    let commands: Vec<&serde_json::Value> =
        guesses.iter().map(|guess| &guess["commands"]).collect();
    let other = (1..commands.len()).find(|&at| commands[..at].contains(&commands[at]));
    assert!(!commands.is_empty() && other.is_none(), "{commands:?}");
    bench.write("y.npy", &encode(&[512], &y));
    let said = bench.run(&["inspect", "y.npy"]).succeeded().stdout;
    assert!(said.contains(" to 9.9e37\n"), "{said}");
}

#[test]
#[ignore = "long: .ci/run demo"]
fn patterns_traces_and_recordings_are_named_for_what_they_are() {
    let (bench, scene) = (Bench::new(), Natural::new());
    let weights: Vec<f32> = (0..40 * 180_u32).map(|k| ((k * k + k / 7) % 2) as f32).collect();
    bench.write("stack.npy", &encode(&[40, 12, 15], &weights));
    let said = bench.run(&["inspect", "stack.npy"]).succeeded().stdout;
    assert!(said.contains("40 patterns of 12 x 15 pixels\n"), "{said}");
    assert!(
        said.contains("   nirspi reconstruct READINGS --matrix stack.npy --out out/"),
        "{said}"
    );
    let volts: Vec<f32> = (0..40).map(|k| ((k * 31) % 17) as f32 + 0.5).collect();
    bench.write("both.npz", &npz(&[("phi", &[40, 180], &weights), ("volts", &[40], &volts)]));
    let said = bench.run(&["inspect", "both.npz"]).succeeded().stdout;
    let command =
        "nirspi reconstruct both.npz --field volts --matrix both.npz --matrix-field phi --size HxW";
    assert!(
        said.contains("40 patterns of 180 pixels in `phi`") && said.contains(command),
        "{said}"
    );

    // Dark samples before and after, 12 of each reading, with a trigger and without.
    let lit = scene.y.iter().flat_map(|&y| (0..12).map(move |at| y + 0.01 * (at * 5 % 7) as f32));
    let samples: Vec<f32> = [1.0; 50].into_iter().chain(lit).chain([1.0; 30]).collect();
    let during = 50..50 + 12 * 512;
    let up = |at: usize| during.contains(&at) && (at - 50) % 12 < 5;
    let trigger: Vec<f32> = (0..samples.len()).map(|at| f32::from(u8::from(up(at)))).collect();
    let length = [samples.len()];
    bench.write("scope.npz", &npz(&[("ch1", &length, &samples), ("ch2", &length, &trigger)]));
    bench.write("adc.npy", &encode(&length, &samples));
    for (file, what, cut) in [
        (
            "scope.npz",
            "a trace `ch1` of 6224 samples, and a trigger `ch2`: 512 readings of 12 samples each",
            "--trigger ch2",
        ),
        (
            "adc.npy",
            "a trace of 6224 samples: 512 readings of 12 samples each",
            "--samples 12 --skip 50 --count 512",
        ),
    ] {
        let (report, _) = first_guess(&bench, file);
        assert_eq!(report["findings"][0]["what"], what);
        let command = report["guesses"][0]["commands"][0].as_str().unwrap();
        assert!(command.contains(cut), "{command}");
        assert!(
            correlation(&bench.pixels("out/image.npy"), &scene.measured.image) > 0.99,
            "{file}"
        );
        std::fs::remove_dir_all(bench.path("out")).unwrap();
    }

    let noise: Vec<f32> = (0..140_000_u32).map(|k| (k.wrapping_mul(k) % 8191) as f32).collect();
    bench.write("long.npy", &encode(&[noise.len()], &noise));
    let said = bench.run(&["inspect", "long.npy"]).succeeded().stdout;
    assert!(said.contains("   nirspi readings long.npy --samples K --out readings.npz"), "{said}");

    bench.run(&["capture", "--frames", "5", "--out", "rec.mcap"]).succeeded();
    let said = bench.run(&["inspect", "rec.mcap"]).succeeded().stdout;
    for words in
        ["rec.mcap: a recording", "5 received, 0 lost", "1. pairs, order cake-cutting, 32 x 32"]
    {
        assert!(said.contains(words), "{words:?} in {said}");
    }
    assert!(said.contains("   nirspi reconstruct rec.mcap --out out/"), "{said}");
}

#[test]
#[ignore = "long: .ci/run demo"]
fn numbers_that_are_no_readings_get_no_way_that_fits() {
    let (bench, scene) = (Bench::new(), Natural::new());
    let mut state = 7_u32;
    let noise: Vec<f32> = (0..256)
        .map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32
        })
        .collect();
    bench.write("noise.npy", &encode(&[256], &noise));
    bench.write("picture.npy", &encode(&[16, 16], &scene.measured.image));
    for file in ["noise.npy", "picture.npy"] {
        let said = bench.run(&["inspect", file]).succeeded().stdout;
        assert!(said.contains("ways tried, none fits; the best:"), "{said}");
        assert!(said.contains("no better than chance"), "{said}");
        assert!(said.contains(&format!("nirspi reconstruct {file} --matrix PATTERNS")), "{said}");
    }
}

#[test]
fn a_scene_that_few_patterns_see_is_not_called_noise() {
    let bench = Bench::new();
    // A square on the grid of the patterns, 8 x 8 of 16 x 16 pixels: 16 of 256 patterns see it.
    let lit = |p: usize| (4..12).contains(&(p / 16)) && (4..12).contains(&(p % 16));
    let of_row = |k: usize| -> f32 {
        let lit = (0..256).filter(|&p| lit(p));
        lit.map(|p| if (k & p).count_ones().is_multiple_of(2) { 1.0 } else { -1.0 }).sum()
    };
    let d: Vec<f32> = (0..256).map(of_row).collect();
    bench.write("square.npy", &encode(&[256], &d));
    let said = bench.run(&["inspect", "square.npy"]).succeeded().stdout;
    assert!(
        said.contains("readings of a scene that few patterns see: they fit every order"),
        "{said}"
    );
    assert!(said.contains("nirspi reconstruct square.npy --shown ORDER"), "{said}");
    // A file that names its patterns belongs to them.
    let rows: Vec<f32> = (0..256).map(|k| k as f32).collect();
    bench.write(
        "rows.npz",
        &npz(&[("n", &[], &[16.0]), ("h_row", &[256], &rows), ("d", &[256], &d)]),
    );
    let (report, said) = first_guess(&bench, "rows.npz");
    assert_eq!(report["guesses"][0]["by_chance"], false, "{report}");
    assert!(!said.concat().contains("warning"), "{said:?}");
}

#[test]
fn what_is_no_file_of_readings_is_one_line() {
    let (bench, scene) = (Bench::new(), Natural::new());
    bench.write("empty.csv", b"");
    bench.write("words.txt", b"no numbers\nin this text\n");
    bench.write("nan.npy", &encode(&[512], &[f32::NAN; 512]));
    bench.write("picture.npy", b"\x89PNG\r\n\x1a\n");
    bench.write("a.tdms", b"TDSm\x0e\0\0\0");
    bench.write("a.pkl", b"\x80\x04\x95\0\0\0\0");
    bench.write("a.mcap", b"\x89MCAP0\r\n");
    let cases: [(&str, &[&str]); 8] = [
        ("empty.csv", &["empty.csv", "an empty file"]),
        ("words.txt", &["words.txt", "expected"]),
        ("nan.npy", &["nan.npy", "no finite number"]),
        ("picture.npy", &["a PNG image"]),
        ("a.tdms", &["a.tdms", "TDMS", "two lines of Python"]),
        ("a.pkl", &["a pickle of Python"]),
        ("a.mcap", &["a.mcap"]),
        ("none.csv", &["none.csv", "no such file"]),
    ];
    for (file, words) in cases {
        let outcome = bench.run(&["inspect", file, "--out", "ways.png"]).failed(1, words);
        assert!(outcome.stdout.is_empty(), "{outcome:?}");
    }
    let whole: (&str, &[usize], &[f32]) = ("n", &[], &[16.0]);
    for (name, bytes) in
        [("cut.npy", encode(&[512], &scene.y)), ("cut.npz", npz(&[whole, ("y", &[512], &scene.y)]))]
    {
        for cut in (0..bytes.len()).step_by(bytes.len() / 12).chain([1, 7, bytes.len() - 1]) {
            bench.write(name, &bytes[..cut]);
            bench.run(&["inspect", name]).failed(1, &[name]);
        }
    }
    assert!(!bench.names().iter().any(|name| name == "ways.png"));
    // One reading that is NaN is one pattern less.
    let mut y = scene.y.clone();
    y[77] = f32::NAN;
    bench.write("nan.npy", &encode(&[512], &y));
    let (report, _) = first_guess(&bench, "nan.npy");
    assert_eq!(
        (&report["arrays"][0]["missing"], &report["guesses"][0]["patterns"]),
        (&1.into(), &255.into())
    );
}

#[test]
#[ignore = "long: .ci/run demo"]
fn the_files_of_other_benches_are_inspected_and_their_form_is_the_first() {
    let Some(folder) = cases() else { return };
    let bench = Bench::new();
    let truth = |name: &str| read_stack(&folder.join(name)).unwrap().values;
    let (truth16, truth8) = (truth("truth16.npy"), truth("truth8.npy"));
    let known: &[(&str, &str)] = &[
        ("ads32767.npy", "pairs"),
        ("arduino.txt", "pairs"),
        ("bad_na.csv", "differences"),
        ("channel1.csv", "pairs"),
        ("group.h5", "pairs"),
        ("halves.npy", "halves"),
        ("inverted.npy", "pairs, inverted"),
        ("nprepr.txt", "pairs"),
        ("offby1.npy", "pairs, shifted by 1"),
        ("over4.npy", "pairs, 4 samples each"),
        ("overload.csv", "pairs"),
        ("pandas.csv", "pairs"),
        ("pico_inf.csv", "pairs"),
        ("plusminus.csv", "pairs"),
        ("repeat4.npz", "pairs"),
        ("rigol.csv", "pairs"),
        ("sconv.npy", "single, inverted"),
        ("sep.csv", "differences"),
        ("spec2d.npz", "differences"),
        ("textcol.csv", "differences"),
        ("thorlabs.csv", "pairs"),
        ("trace.csv", "pairs"),
        ("twocol.npy", "pairs"),
        ("utf16.txt", "pairs"),
        ("v4.mat", "pairs"),
        ("y16.npy", "pairs"),
    ];
    for (file, form) in known {
        let path = folder.join(file);
        let (report, _) = first_guess(&bench, path.to_str().unwrap());
        assert_eq!(report["guesses"][0]["form"], *form, "{file}");
        let truth = if *file == "trace.csv" { &truth8 } else { &truth16 };
        let alike = correlation(&bench.pixels("out/image.npy"), truth);
        assert!(alike > 0.99, "{file}: {alike}");
        let _ = std::fs::remove_dir_all(bench.path("out"));
    }
    for (file, what) in [
        ("patterns_12x15.npy", "240 patterns of 180 pixels"),
        ("patterns_flat.npy", "128 patterns of 16 x 16 pixels"),
        ("patterns_stack.npy", "128 patterns of 16 x 16 pixels"),
    ] {
        let said = bench.run(&["inspect", folder.join(file).to_str().unwrap()]).succeeded().stdout;
        assert!(said.contains(what), "{said}");
    }
    for file in ["readings_12x15.npy", "truth_12x15.npy", "yP01.npy", "yP01_dark.npy"] {
        let said = bench.run(&["inspect", folder.join(file).to_str().unwrap()]).succeeded().stdout;
        assert!(said.contains("none fits"), "{said}");
    }
    let workbook = folder.join("book.xlsx");
    bench.run(&["inspect", workbook.to_str().unwrap()]).failed(1, &["save it as CSV"]);
    let all = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path());
    let is_named = |path: &Path| known.iter().any(|(name, _)| path.ends_with(name));
    for path in all.filter(|path| !is_named(path)) {
        let outcome = bench.run(&["inspect", path.to_str().unwrap()]);
        let told = outcome.code == Some(0) || outcome.stderr.lines().count() == 1;
        assert!(told, "{outcome:?}");
    }
}

/// The picture of the ways is signed by what the file says of itself.
#[test]
fn a_simulated_file_is_called_simulated() {
    let bench = Bench::new();
    bench.run(&["example", "wing", "--out", "wing.npz"]).succeeded();
    let report = bench.run(&["inspect", "wing.npz", "--json"]).succeeded().json();
    assert_eq!(report["provenance"]["origin"], "simulated");
}

/// The readings of a feed, and what its header should say.
#[test]
#[ignore = "long: .ci/run demo"]
fn a_feed_is_judged_by_its_header_and_its_readings() {
    let (bench, natural) = (Bench::new(), Natural::new());
    let header = |form| format!("{{\"n\":16,\"order\":\"natural\",\"readings\":\"{form}\"}}\n");
    let numbers = |readings: &[f32]| -> String {
        readings.iter().map(|reading| format!("{reading}\n")).collect::<String>().repeat(3)
    };
    let halves = [&natural.on[..], &natural.off].concat();
    bench.write("right.txt", (header("pairs") + &numbers(&natural.y)).as_bytes());
    bench.write("wrong.txt", (header("pairs") + &numbers(&halves)).as_bytes());
    let said = bench.run(&["inspect", "feed:right.txt"]).succeeded().stdout;
    assert!(said.contains("3 frames, all there before"), "{said}");
    assert!(!said.contains("the header breaks the law of light"), "{said}");
    let report = bench.run(&["inspect", "feed:right.txt", "--json"]).succeeded().json();
    assert_eq!(report["feed"]["declared"]["contradicted"], false, "{report}");
    let said = bench.run(&["inspect", "feed:wrong.txt", "--out", "ways.png"]).succeeded().stdout;
    let warning = "the header breaks the law of light; they fit halves, order natural, 16 x 16";
    let better = r#"the header for it: {"n": 16, "order": "natural", "readings": "halves"}"#;
    assert!(said.contains(warning) && said.contains(better), "{said}");
    assert!(said.contains("wrote ways.png"), "{said}");
    // What is no feed, and what sends no frame.
    bench.write("none.txt", b"1 2 3\n");
    bench.run(&["inspect", "feed:none.txt"]).failed(1, &["feed:none.txt", "one JSON line"]);
    bench.run(&["inspect", "feed:"]).failed(1, &["expected feed:HOST:PORT"]);
    bench.run(&["inspect", "feed:gone.txt"]).failed(1, &["no such file, pipe or socket"]);
    bench.write("begun.txt", (header("pairs") + "1 2 3\n").as_bytes());
    let said = bench.run(&["inspect", "feed:begun.txt"]);
    assert!(said.stdout.contains("s after 3 of 512 readings"), "{said:?}");
    assert!(said.stdout.contains("no data for "), "{said:?}");
    assert_eq!(said.code, Some(1), "{said:?}");
}
