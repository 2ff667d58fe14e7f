//! `nirspi reconstruct --matrix`: patterns of the user's own, in whatever form they come.

use crate::bench::{Bench, Measured, bits, correlation, npz, provenance, seen};
use nirspi::files::image::encode_grey;
use nirspi::files::npy;

/// Patterns of zeros and ones that no one has a name for, and what they measure of the phantom.
fn own_patterns(measured: &Measured, patterns: usize) -> (Vec<f32>, Vec<f32>) {
    let weights = bits(patterns * measured.image.len());
    let y = seen(&weights, &measured.image);
    (weights, y)
}

/// `order` writes the patterns of a set, which give the image of their readings by the set's name and as a file. That a
/// set's patterns are those of its definition is tested in `nirspi-files` and `nirspi-patterns`.
#[test]
fn sets_of_patterns_have_names() {
    let bench = Bench::new();
    for (set, size, square) in [
        ("s-matrix:15", "3x5", &[][..]),
        ("fourier:3", "6x6", &["--n", "6"]),
        ("fourier:4", "6x6", &["--n", "6"]),
    ] {
        bench.run(&[&["order", set, "--out", "set"], square].concat()).succeeded();
        let area = if square.is_empty() { 15 } else { 36 };
        let scene: Vec<f32> = (0..area).map(|at| (at * 37 % 23) as f32 + 1.0).collect();
        let y = seen(&bench.pixels("set/patterns.npy"), &scene);
        let lines: String = y.iter().map(|reading| format!("{reading}\n")).collect();
        bench.write("y.txt", lines.as_bytes());
        for (patterns, more) in [(set, &["--size", size][..]), ("set/patterns.npy", &[])] {
            let line = ["reconstruct", "y.txt", "--matrix", patterns, "--method", "pseudo-inverse"];
            let said = bench.run(&[&line[..], &["--no-dark"], more].concat()).succeeded().stdout;
            let image = bench.pixels("out/image.npy");
            assert!(image.iter().zip(&scene).all(|(a, b)| (a - b).abs() < 0.01), "{patterns}");
            let whole = format!("{area} of {area} patterns of {set}");
            assert!(patterns != set || said.contains(&whole), "{said}");
        }
        std::fs::remove_dir_all(bench.path("set")).unwrap();
    }
    bench.run(&["order", "s-matrix:15", "--n", "8"]).failed(2, &["--n does not go with this set"]);
    bench.run(&["order", "s-matrix:9"]).failed(2, &["s-matrix:9: expected an order up to 4095"]);
    let refused = |set: &str, words: &str| {
        bench.run(&["reconstruct", "y.txt", "--matrix", set]).failed(1, &[words]);
    };
    refused("fourier:6", "expected fourier:3, fourier:4, or s-matrix:N");
    refused("s-matrix:31", "expected (31,)");
}

/// Ambient light is in each reading alike. That it is found is tested in `nirspi-recon`.
#[test]
fn the_dark_level_is_told_and_left_out_on_demand() {
    let (bench, measured) = (Bench::new(), Measured::new(16));
    let (weights, y) = own_patterns(&measured, 140);
    let lifted: Vec<f32> = y.iter().map(|y| y + 500.0).collect();
    bench.write("phi.npy", &npy::encode(&[140, 256], &weights));
    bench.write("in.npz", &npz(&[("y", &[140], &lifted)]));
    let run = |more: &[&str]| {
        let all = ["reconstruct", "in.npz", "--matrix", "phi.npy", "--method", "tv"];
        let said = bench.run(&[&all, more].concat()).succeeded().stdout;
        (said.contains("dark level "), bench.json("out/report.json")["dark_level"].clone())
    };
    let (is_told, level) = run(&[]);
    assert!(is_told && (level.as_f64().unwrap() / 500.0 - 1.0).abs() < 0.05, "{level}");
    assert_eq!(run(&["--no-dark"]), (false, ().into()));
    bench.run(&["reconstruct", "in.npz", "--no-dark"]).failed(2, &["--matrix"]);
}

#[test]
fn patterns_of_the_users_own_are_inverted_by_every_method() {
    let (bench, measured) = (Bench::new(), Measured::new(16));
    let (weights, y) = own_patterns(&measured, 150);
    bench.write("phi.npy", &npy::encode(&[150, 256], &weights));
    bench.write("in.npz", &npz(&[("y", &[150], &y)]));
    let run = |more: &[&str]| {
        bench.run(&[&["reconstruct", "in.npz", "--matrix", "phi.npy"], more].concat())
    };
    let mut least = 1.0;
    for method in ["pseudo-inverse", "tikhonov", "fista", "tv", "omp"] {
        run(&["--method", method]).succeeded();
        let found = correlation(&bench.pixels("out/image.npy"), &measured.image);
        if method == "pseudo-inverse" {
            least = found;
        } else {
            assert!(found > least, "{method}: {found}, pseudo-inverse {least}");
        }
        let report = bench.json("out/report.json");
        assert_eq!((&report["method"], &report["rank"]), (&method.into(), &150.into()));
    }
    run(&["--method", "tv", "--sampling", "0.25"]).succeeded();
    assert_eq!(bench.json("out/report.json")["used"], 64);
}

#[test]
fn what_is_wrong_with_patterns_of_the_users_own_is_named() {
    let (bench, measured) = (Bench::new(), Measured::new(4));
    let (mut weights, y) = own_patterns(&measured, 10);
    let write = |name: &str, shape: &[usize], values: &[f32]| {
        bench.write(name, &npy::encode(shape, values));
    };
    bench.write("in.npz", &npz(&[("y", &[10], &y)]));
    let run = |matrix: &str, more: &[&str]| {
        bench.run(&[&["reconstruct", "in.npz", "--matrix", matrix], more].concat())
    };
    write("nine.npy", &[9, 16], &weights[..144]);
    run("nine.npy", &[])
        .failed(1, &["in.npz", "`y` has shape (10,)", "(9,)", "one reading a pattern"]);
    write("pairs.npy", &[5, 16], &weights[..80]);
    run("pairs.npy", &[]).failed(1, &["are read with --readings pairs or halves"]);
    write("odd.npy", &[10, 15], &weights[..150]);
    run("odd.npy", &[]).failed(1, &["odd.npy", "has shape (10, 15)", "--size HxW"]);
    run("odd.npy", &["--size", "4x4"]).failed(1, &["has shape (10, 15)", "(M, 16) or (M, 4, 4)"]);
    run("odd.npy", &["--size", "4"]).failed(2, &["4 pixels", "height x width such as 12x15"]);
    run("odd.npy", &["--size", "3x5", "--basis", "haar", "--method", "omp"])
        .failed(1, &["odd.npy", "haar basis of 3 x 5 images", "expected dct or pixel"]);
    write("flat.npy", &[160], &weights);
    run("flat.npy", &[]).failed(1, &["flat.npy", "has shape (160,)", "(M, n * n)"]);
    write("dark.npy", &[10, 16], &[0.0; 160]);
    run("dark.npy", &[]).failed(1, &["dark.npy", "rank 0"]);
    write("phi.npy", &[10, 16], &weights);
    run("phi.npy", &["--method", "hadamard"]).failed(2, &["needs Hadamard rows", "pseudo-inverse"]);
    run("phi.npy", &["--first-of", "zig-zag"]).failed(2, &["--matrix", "--first-of"]);
    weights[35] = f32::NAN;
    write("phi.npy", &[10, 16], &weights);
    run("phi.npy", &[]).failed(1, &["phi.npy", "is NaN at [2, 3]"]);
    assert!(!bench.names().contains(&"out".to_owned()));
    // Twice the same pattern is no mistake.
    weights.copy_within(16..32, 32);
    write("phi.npy", &[10, 16], &weights);
    let said = run("phi.npy", &["--method", "pseudo-inverse"]).succeeded();
    assert!(said.stdout.contains("rank 9") && said.stdout.contains("1 of 10 patterns"), "{said:?}");
    // Patterns as pictures are the same patterns.
    let image = std::fs::read(bench.path("out/image.npy")).unwrap();
    write("phi.npy", &[10, 4, 4], &weights);
    run("phi.npy", &["--method", "pseudo-inverse", "--out", "again"]).succeeded();
    assert_eq!(std::fs::read(bench.path("again/image.npy")).unwrap(), image);
    // Pictures have rows and columns of their own.
    run("phi.npy", &["--transpose"]).failed(1, &["has shape (10, 4, 4)", "patterns as rows"]);
    std::fs::create_dir(bench.path("empty")).unwrap();
    run("empty", &[]).failed(1, &["empty", "a folder without pictures", "a pattern each"]);
}

/// Random patterns of 0 and 1, and what they see of a scene that no symmetry maps onto itself.
fn of_size(height: usize, width: usize, patterns: usize) -> (Vec<f32>, Vec<f32>, Vec<f32>) {
    let scene: Vec<f32> = (0..height * width)
        .map(|p| (p / width, p % width))
        .map(|(r, c)| match () {
            () if (2..height / 2).contains(&r) && (1..2 * width / 3).contains(&c) => 1.0,
            () if r > 3 * height / 4 && c > width / 2 => 0.6,
            () => 0.1,
        })
        .collect();
    let weights = bits(patterns * height * width);
    let y = seen(&weights, &scene);
    (scene, weights, y)
}

#[test]
fn patterns_come_in_any_size_and_form() {
    let bench = Bench::new();
    let (count, height, width) = (160, 12, 15);
    let area = height * width;
    let (scene, weights, y) = of_size(height, width, count);
    let down: Vec<f32> =
        (0..count * area).map(|at| weights[at % count * area + at / count]).collect();
    let by_columns: Vec<f32> = weights
        .chunks_exact(area)
        .flat_map(|p| (0..area).map(move |at| p[at % height * width + at / height]))
        .collect();
    bench.write("y.npy", &npy::encode(&[count], &y));
    bench.write("rows.npy", &npy::encode(&[count, area], &weights));
    bench.write("pictures.npy", &npy::encode(&[count, height, width], &weights));
    bench.write("columns.npy", &npy::encode(&[area, count], &down));
    bench.write("last.npy", &npy::encode(&[height, width, count], &down));
    bench.write("matlab.npy", &npy::encode(&[count, area], &by_columns));
    let both = npz(&[("y", &[count], &y), ("patterns", &[count, area], &weights)]);
    bench.write("both.npz", &both);
    bench.write("named.npz", &npz(&[("y", &[count], &y), ("phi", &[count, area], &weights)]));
    std::fs::create_dir(bench.path("folder")).unwrap();
    for (k, pattern) in weights.chunks_exact(area).enumerate() {
        let picture = encode_grey(width, height, pattern, &provenance());
        bench.write(&format!("folder/pattern {k}.png"), &picture);
    }
    let size = ["--size", "12x15"];
    let cases: [(&str, &str, &[&str], &str); 9] = [
        ("y.npy", "rows.npy", &size, ""),
        ("y.npy", "pictures.npy", &[], ""),
        ("y.npy", "pictures.npy", &size, ""),
        ("y.npy", "columns.npy", &size, "along the last axis of columns.npy"),
        ("y.npy", "last.npy", &[], "along the last axis of last.npy"),
        ("y.npy", "matlab.npy", &["--size", "12x15", "--transpose"], ""),
        ("both.npz", "both.npz", &size, ""),
        ("named.npz", "named.npz", &["--size", "12x15", "--matrix-field", "phi"], ""),
        ("y.npy", "folder", &[], ""),
    ];
    let mut image = None;
    for (input, matrix, more, note) in cases {
        let line = ["reconstruct", input, "--matrix", matrix, "--method", "tikhonov"];
        let said = bench.run(&[&line, more].concat()).succeeded();
        assert!(said.stdout.contains(": 12 x 15, 160 of 160 patterns"), "{said:?}");
        assert_eq!(said.stdout.contains("along the last axis"), !note.is_empty(), "{said:?}");
        assert!(said.stdout.contains(note), "{said:?}");
        let report = bench.json("out/report.json");
        assert_eq!((&report["height"], &report["width"]), (&12.into(), &15.into()));
        let found = bench.pixels("out/image.npy");
        let alike = correlation(&found, &scene);
        assert!(alike > 0.9, "{matrix}: {alike}");
        assert_eq!(image.get_or_insert_with(|| found.clone()), &found, "{matrix}");
        std::fs::remove_dir_all(bench.path("out")).unwrap();
    }
    // Squares need no size, whatever their side.
    let (scene, weights, y) = of_size(10, 10, 90);
    bench.write("y.npy", &npy::encode(&[90], &y));
    bench.write("rows.npy", &npy::encode(&[90, 100], &weights));
    bench.run(&["reconstruct", "y.npy", "--matrix", "rows.npy"]).succeeded();
    assert!(correlation(&bench.pixels("out/image.npy"), &scene) > 0.9);
}

/// An array of two axes as `save -v4` of MATLAB writes it.
fn level_4(name: &str, height: usize, width: usize, rows: &[f32]) -> Vec<u8> {
    let words = [0, height as u32, width as u32, 0, name.len() as u32 + 1];
    let mut bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    bytes.extend(name.bytes().chain([0]));
    let down = (0..height * width).map(|at| rows[at % height * width + at / height]);
    bytes.extend(down.flat_map(|weight| f64::from(weight).to_le_bytes()));
    bytes
}

#[test]
fn patterns_and_readings_come_in_one_file_of_matlab() {
    let bench = Bench::new();
    let (scene, weights, y) = of_size(12, 15, 160);
    let both = [level_4("phi", 160, 180, &weights), level_4("volts", 160, 1, &y)].concat();
    bench.write("both.mat", &both);
    let line = ["reconstruct", "both.mat", "--matrix", "both.mat", "--size", "12x15"];
    bench.run(&[&line[..], &["--field", "volts"]].concat()).succeeded();
    let alike = correlation(&bench.pixels("out/image.npy"), &scene);
    assert!(alike > 0.95, "{alike}");
    bench
        .run(&[&line[..], &["--field", "volts", "--matrix-field", "psi"]].concat())
        .failed(1, &["`psi` is not in the file, expected --matrix-field with one of phi, volts"]);
    // A refusal says what a file holds, by the paths of its structures and groups.
    for (name, paths) in [
        ("nested.mat", "`run.n`, `run.adc.text`, `run.adc.y`, `run.h_row`"),
        ("nested.h5", "`run/"),
    ] {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../files/src/small/");
        bench.write(name, &std::fs::read(format!("{folder}{name}")).unwrap());
        bench.run(&["reconstruct", name, "--shown", "natural"]).failed(1, &[name, paths]);
    }
}

/// Readings that do not belong to their patterns, alone and among the measurements of a stack.
#[test]
fn readings_that_no_scene_gives_by_these_patterns_are_named() {
    let (bench, measured) = (Bench::new(), Measured::new(16));
    let (weights, y) = own_patterns(&measured, 201);
    bench.write("phi.npy", &npy::encode(&[200, 256], &weights[..200 * 256]));
    let mut spoilt = y[..200].to_vec();
    spoilt[50] *= 8.0;
    let run = |y: &[f32], more: &[&str]| {
        bench.write("y.npy", &npy::encode(&[y.len() / 200, 200], y));
        let line = ["reconstruct", "y.npy", "--matrix", "phi.npy", "--method", "tikhonov"];
        bench.run(&[&line[..], more].concat()).succeeded()
    };
    let right = run(&y[..200], &["--index", "0"]);
    assert!(!right.stderr.contains("warning"), "{}", right.stderr);
    let confirmed = bench.json("out/report.json")["held_back"]["confirmed_share"].as_f64().unwrap();
    assert!(confirmed > 0.5, "{confirmed}");
    let words = "warning: outlier: reading [50] is far outside all others; its pattern is left out";
    assert!(run(&spoilt, &["--index", "0"]).stderr.contains(words));
    assert!(correlation(&bench.pixels("out/image.npy"), &measured.image) > 0.9);
    let report = bench.json("out/report.json");
    assert_eq!((&report["used"], &report["outliers"]), (&199.into(), &[50].into()));
    assert_eq!(report["rank"], 199, "of the patterns that are left");
    let all = [&y[..200], &spoilt].concat();
    let said = run(&all, &["--index", "all"]).stderr;
    assert!(said.contains("frame 1: outlier: reading [50]") && !said.contains("frame 0"), "{said}");
    let late = run(&y[1..], &["--index", "0"]).stderr;
    let words = "they fit readings of the pattern 1 place later in the order";
    assert!(late.contains("no better than chance") && late.contains(words), "{late}");
}

/// All measurements of a file in one step: each image is the one that its measurement alone gives.
#[test]
#[ignore = "long: .ci/run demo"]
fn all_measurements_of_a_file_become_one_stack() {
    let bench = Bench::new();
    let (scene, weights, y) = of_size(12, 15, 160);
    let mut frames: Vec<f32> =
        [1.0, -0.5, 3.0].iter().flat_map(|g| y.iter().map(move |y| g * y)).collect();
    // The second one lacks two patterns.
    frames[160 + 7] = f32::NAN;
    frames[160 + 90] = f32::NAN;
    bench.write("y.npy", &npy::encode(&[3, 160], &frames));
    bench.write("phi.npy", &npy::encode(&[160, 12, 15], &weights));
    for method in ["auto", "tikhonov", "omp"] {
        let line = ["reconstruct", "y.npy", "--matrix", "phi.npy", "--method", method, "--index"];
        let said = bench.run(&[&line[..], &["all", "--out", "all"]].concat()).succeeded().stdout;
        assert!(said.contains("y.npy: 3 frames of 12 x 15, 160 patterns of phi.npy"), "{said}");
        assert!(
            said.contains("note: frame 1: not read: 2 patterns left out, at [7, 90]"),
            "{said}"
        );
        let all = bench.pixels("all/image.npy");
        let report = bench.json("all/report.json");
        for (k, image) in all.chunks_exact(180).enumerate() {
            bench.run(&[&line[..], &[&k.to_string(), "--out", "one"]].concat()).succeeded();
            assert_eq!(image, bench.pixels("one/image.npy"), "{method}, frame {k}");
            let one = bench.json("one/report.json");
            for key in
                ["used", "rank", "method", "strength", "not_read", "relative_residual", "notes"]
            {
                assert_eq!(report["frames"][k][key], one[key], "{method}, frame {k}: {key}");
            }
        }
        assert_eq!(report["frames"][1]["used"], 158);
        assert!(correlation(&all[..180], &scene) > 0.8, "{method}");
    }
    for picture in ["image.png", "image.apng", "image.svg"] {
        assert!(bench.path("all").join(picture).exists(), "{picture}");
    }
    // Fourier coefficients of two measurements: one with a frequency that was not read.
    let steps: String = [1.0, 2.0]
        .iter()
        .map(|gain| {
            let cells: Vec<String> = (0..64)
                .map(|k| match (*gain, k) {
                    (2.0, 9) => "nan".to_owned(),
                    _ => format!("{}", gain * f64::from(k * 7 % 19)),
                })
                .collect();
            cells.join(",") + "\n"
        })
        .collect();
    bench.write("steps.csv", steps.as_bytes());
    let line = ["reconstruct", "steps.csv", "--matrix", "fourier:4", "--size", "4x4"];
    bench.run(&[&line[..], &["--index", "all", "--out", "f"]].concat()).succeeded();
    let all = bench.pixels("f/image.npy");
    for (k, image) in all.chunks_exact(16).enumerate() {
        bench.run(&[&line[..], &["--index", &k.to_string(), "--out", "g"]].concat()).succeeded();
        assert_eq!(image, bench.pixels("g/image.npy"), "frame {k}");
    }
    bench.write(
        "gone.npy",
        &npy::encode(&[2, 160], &[vec![1.0; 160], vec![f32::NAN; 160]].concat()),
    );
    bench
        .run(&["reconstruct", "gone.npy", "--matrix", "phi.npy", "--index", "all"])
        .failed(1, &["gone.npy", "is NaN everywhere in measurement 1"]);
}

/// Measurements of one scene, patterns that are shown again, and a file that states its noise.
#[test]
fn a_known_noise_is_used_and_told() {
    let (bench, measured) = (Bench::new(), Measured::new(16));
    let (mut weights, mut y) = own_patterns(&measured, 150);
    let mut random = 7_u32;
    let mut noise = |y: &f32| {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        y + 8.0 * ((random >> 8) as f32 / (1 << 24) as f32 - 0.5) * 12.0_f32.sqrt()
    };
    let frames: Vec<f32> =
        (0..4).flat_map(|_| y.iter().map(&mut noise).collect::<Vec<_>>()).collect();
    bench.write("phi.npy", &npy::encode(&[150, 256], &weights));
    bench.write("y.npy", &npy::encode(&[4, 150], &frames));
    bench.write("d.npz", &npz(&[("d", &[150], &frames[..150]), ("noise", &[], &[8.0])]));
    // The first ten patterns once more.
    weights.extend_from_within(..10 * 256);
    y.extend_from_within(..10);
    let again: Vec<f32> = y.iter().map(&mut noise).collect();
    bench.write("again.npy", &npy::encode(&[160, 256], &weights));
    bench.write("y160.npy", &npy::encode(&[160], &again));
    let report = |input: &str, matrix: &str, more: &[&str]| {
        let line = ["reconstruct", input, "--matrix", matrix, "--method", "tikhonov"];
        let said = bench.run(&[&line, more].concat()).succeeded().stdout;
        let report = bench.json("out/report.json");
        let made = report["frames"].as_array().map_or(&report, |frames| &frames[0]).clone();
        std::fs::remove_dir_all(bench.path("out")).unwrap();
        let told = made["noise_from"].as_str().unwrap_or("nothing").to_owned();
        assert_eq!(said.contains("noise of a reading"), told != "nothing", "{said}");
        (told, made["noise_of_a_reading"].as_f64().unwrap_or_default(), made["strength"].as_f64())
    };
    let (from, of_scene, strength) = report("y.npy", "phi.npy", &["--index", "all"]);
    assert_eq!(from, "measurements of one scene");
    assert!((of_scene - 8.0).abs() < 0.8, "{of_scene}");
    let (from, sigma, alone) = report("y.npy", "phi.npy", &["--index", "0"]);
    assert_eq!((from.as_str(), sigma), ("nothing", 0.0));
    // The likeliest strength, beside that of held-back readings.
    assert_ne!(strength, alone);
    let (from, sigma, _) = report("d.npz", "phi.npy", &[]);
    assert_eq!((from.as_str(), sigma), ("stated with the readings", 8.0));
    let (from, of_patterns, _) = report("y160.npy", "again.npy", &[]);
    assert_eq!(from, "patterns shown several times");
    assert!((of_patterns - 8.0).abs() < 4.5, "{of_patterns}");
}

/// The complement of a pattern lights what the pattern leaves dark.
#[test]
fn pattern_and_complement_give_differences() {
    let bench = Bench::new();
    let (scene, weights, y) = of_size(12, 15, 170);
    let all: f32 = scene.iter().sum();
    let other: Vec<f32> = y.iter().map(|y| all - y).collect();
    // Ambient light that drifts, which a difference does not see.
    let dark = |k: usize| 40.0 + k as f32;
    let lifted = |y: &[f32]| y.iter().enumerate().map(|(k, y)| y + dark(k)).collect::<Vec<f32>>();
    let (on, off) = (lifted(&y), lifted(&other));
    let pairs: Vec<f32> = on.iter().zip(&off).flat_map(|(a, b)| [*a, *b]).collect();
    let differences: Vec<f32> = on.iter().zip(&off).map(|(a, b)| a - b).collect();
    bench.write("phi.npy", &npy::encode(&[170, 12, 15], &weights));
    bench.write("side.npy", &npy::encode(&[170, 2], &pairs));
    bench.write("turns.npy", &npy::encode(&[340], &pairs));
    bench.write("halves.npy", &npy::encode(&[340], &[&on[..], &off].concat()));
    bench.write("two.npz", &npz(&[("on", &[170], &on), ("off", &[170], &off)]));
    bench.write("d.npz", &npz(&[("d", &[170], &differences)]));
    let cases: [(&str, &[&str]); 5] = [
        ("side.npy", &[]),
        ("turns.npy", &["--readings", "pairs"]),
        ("halves.npy", &["--readings", "halves"]),
        ("two.npz", &["--field", "on,off"]),
        ("d.npz", &[]),
    ];
    for (input, more) in cases {
        let line = ["reconstruct", input, "--matrix", "phi.npy", "--method", "tikhonov"];
        let said = bench.run(&[&line, more].concat()).succeeded();
        let found = bench.pixels("out/image.npy");
        let apart = found.iter().zip(&scene).map(|(a, b)| (a - b).abs()).sum::<f32>() / 180.0;
        // In the units of the scene: the weights are 1 and -1.
        assert!(apart < 0.05, "{input}: {apart}");
        let says = said.stdout.contains("the image is that of pattern minus complement");
        assert_eq!(says, input != "d.npz", "{said:?}");
        std::fs::remove_dir_all(bench.path("out")).unwrap();
    }
    bench.write("nan.npy", &npy::encode(&[170, 2], &[f32::NAN; 340]));
    bench.run(&["reconstruct", "nan.npy", "--matrix", "phi.npy"]).failed(1, &["is NaN everywhere"]);
}
