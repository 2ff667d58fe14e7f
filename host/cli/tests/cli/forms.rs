//! Every row of the table of forms in docs/measurements.md: a file of that form is an image with the row's option.

use crate::bench::{Bench, Measured, correlation, npz};
use nirspi::files::npy::encode;

/// The heading above the table.
const HEADING: &str = "## What an option says about a file";

/// A form: the first cell of its row, the bytes of its file by the file's name, and the options.
struct Form {
    row: &'static str,
    file: &'static str,
    bytes: Vec<u8>,
    options: Vec<&'static str>,
}

/// Rows of the table: their two cells.
fn rows() -> Vec<(String, String)> {
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/measurements.md");
    let page = std::fs::read_to_string(page).unwrap();
    let (_, table) = page.split_once(HEADING).unwrap();
    let lines = table.lines().skip_while(|line| !line.starts_with('|'));
    let lines = lines.take_while(|line| line.starts_with('|')).skip(2);
    let cells = |line: &str| {
        let (first, second) = line.trim_matches('|').split_once(" | ").unwrap();
        (first.trim().to_owned(), second.trim().to_owned())
    };
    lines.map(cells).collect()
}

/// Complex readings, as NumPy writes them.
fn complex(values: &[f32]) -> Vec<u8> {
    let shape = values.len();
    let header = format!("{{'descr': '<c8', 'fortran_order': False, 'shape': ({shape},), }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(values.iter().flat_map(|v| [0.6 * v, 0.8 * v]).flat_map(f32::to_le_bytes));
    bytes
}

/// A file of each form, of the scene measured with patterns in natural order.
fn forms(measured: &Measured) -> Vec<Form> {
    let (n, area) = (measured.n, measured.image.len());
    let at = |row: usize| measured.h_row.iter().position(|&shown| shown == row as f32).unwrap();
    let rows: Vec<f32> = (0..area).map(|row| row as f32).collect();
    let d: Vec<f32> = (0..area).map(|row| measured.d[at(row)]).collect();
    let y = measured.natural();
    let side = |which: usize| y.iter().copied().skip(which).step_by(2).collect::<Vec<f32>>();
    let (on, off) = (side(0), side(1));
    let whole: (&str, &[usize], &[f32]) = ("n", &[], &[n as f32]);
    let shown: (&str, &[usize], &[f32]) = ("h_row", &[area], &rows);
    let readings: (&str, &[usize], &[f32]) = ("y", &[2 * area], &y);
    let turned: Vec<f32> = (0..area).map(|row| ((row % n) * n + row / n) as f32).collect();
    let other: Vec<f32> = y.iter().rev().copied().collect();
    let first: Vec<f32> = y.iter().flat_map(|&y| [y, 0.0]).collect();
    let commas: String = y.iter().map(|y| format!("{y:.4}\n").replace('.', ",")).collect();
    // Five samples before the first reading; ten of each reading.
    let samples: Vec<f32> =
        [0.0; 5].into_iter().chain(y.iter().flat_map(|&y| [y; 10])).chain([0.0; 5]).collect();
    let trigger: Vec<f32> = (0..samples.len())
        .map(|at| {
            f32::from(u8::from((5..5 + 10 * y.len()).contains(&at) && at % 10 < 8 && at % 10 > 4))
        })
        .collect();
    let length = [samples.len()];
    let trace: [(&str, &[usize], &[f32]); 2] =
        [("ch1", &length, &samples), ("ch2", &length, &trigger)];
    let form = |row, file, bytes, options: &[&'static str]| Form {
        row,
        file,
        bytes,
        options: options.to_vec(),
    };
    vec![
        form(
            "has many samples of each reading, perhaps with a trigger",
            "trace.npz",
            npz(&trace),
            &["--shown", "natural"],
        ),
        form("has no `h_row`", "y.npy", encode(&[2 * area], &y), &["--shown", "natural"]),
        form("has no `n`", "rows.npz", npz(&[shown, readings]), &["--side", "16"]),
        form(
            "calls the readings something else",
            "volts.npz",
            npz(&[whole, shown, ("volts", &[2 * area], &y)]),
            &["--field", "volts"],
        ),
        form(
            "calls `h_row`, `n` or `sign` something else",
            "named.npz",
            npz(&[("side", &[], &[n as f32]), ("shown", &[area], &rows), readings]),
            &["--field", "y,h_row=shown,n=side"],
        ),
        form(
            "has patterns and complements in two fields or columns",
            "two.npz",
            npz(&[whole, shown, ("on", &[area], &on), ("off", &[area], &off)]),
            &["--field", "on,off"],
        ),
        form(
            "holds all patterns first, then all complements",
            "halves.npz",
            npz(&[whole, shown, ("y", &[2 * area], &[&on[..], &off].concat())]),
            &["--readings", "halves"],
        ),
        form(
            "holds patterns without complements",
            "single.npz",
            npz(&[whole, shown, ("y", &[area], &on)]),
            &["--readings", "single"],
        ),
        form(
            "holds differences under the name `y` or without a name",
            "d.npy",
            encode(&[area], &d),
            &["--readings", "differences", "--shown", "natural"],
        ),
        form(
            "holds several measurements, (..., M)",
            "several.npz",
            npz(&[whole, shown, ("y", &[2, 2 * area], &[&other[..], &y].concat())]),
            &["--index", "1"],
        ),
        form(
            "has the patterns along the first axis, (M, ...)",
            "first.npz",
            npz(&[whole, shown, ("y", &[2 * area, 2], &first)]),
            &["--patterns-first", "--index", "0"],
        ),
        form(
            "numbers pixels down the columns, as MATLAB does",
            "matlab.npz",
            npz(&[whole, ("h_row", &[area], &turned), readings]),
            &["--transpose"],
        ),
        form("holds complex readings", "complex.npy", complex(&y), &["--shown", "natural"]),
        form(
            "is a text with decimal commas, and the text does not show that",
            "commas.txt",
            commas.into_bytes(),
            &["--decimal-comma", "--shown", "natural"],
        ),
        form(
            "was measured with other patterns",
            "on.npy",
            encode(&[area], &on),
            &["--matrix", "patterns.npy", "--method", "tikhonov"],
        ),
    ]
}

/// A page that a newcomer reads before the first picture.
#[test]
fn the_page_has_at_most_1500_words() {
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/measurements.md");
    let page = std::fs::read_to_string(page).unwrap();
    let words = page.split_whitespace().filter(|word| *word != "|").count();
    assert!(words <= 1500, "{words} words");
}

/// A steady lamp is told, and one that drifts by a third is told, warned of because it harms the image, and corrected. The
/// report of the steady one.
#[track_caller]
fn tells_and_corrects(bench: &Bench, form: &[&str], words: &str) -> serde_json::Value {
    let image = |file: &str, more: &[&str]| {
        let line = ["reconstruct", file, "--method", "hadamard"];
        let told = bench.run(&[&line[..], form, more].concat()).succeeded();
        let lamp = bench.json("out/report.json")["lamp"].clone();
        (bench.pixels("out/image.npy"), told, lamp)
    };
    let (truth, told, steady) = image("steady.npz", &[]);
    assert!(told.stdout.contains(words) && told.stderr.is_empty(), "{told:?}");
    assert!(steady["drift"].as_f64().unwrap() < 0.01, "{steady}");
    let (harmed, told, lamp) = image("drifts.npz", &[]);
    let words = ["the lamp drifts by 3", "--divide-by-lamp"];
    assert!(words.iter().all(|words| told.stderr.contains(words)), "{told:?}");
    assert!((lamp["drift"].as_f64().unwrap() - 0.33).abs() < 0.04, "{lamp}");
    let (corrected, told, _) = image("drifts.npz", &["--divide-by-lamp"]);
    assert!(told.stderr.is_empty(), "{told:?}");
    let (before, after) = (correlation(&harmed, &truth), correlation(&corrected, &truth));
    assert!(1.0 - after < 0.05 * (1.0 - before) && before < 0.999, "{before} {after}");
    steady
}

#[test]
fn the_sums_of_pairs_tell_and_correct_a_lamp_that_drifts() {
    let (bench, measured) = (Bench::new(), Measured::new(16));
    bench.write("steady.npz", &measured.npz());
    let last = measured.y.len() as f32;
    let y: Vec<f32> =
        (0..measured.y.len()).map(|at| measured.y[at] * (1.0 + 0.4 * at as f32 / last)).collect();
    bench.write("drifts.npz", &Measured { y, ..Measured::new(16) }.npz());
    tells_and_corrects(&bench, &[], "sums of pairs: spread ");
    bench
        .run(&["reconstruct", "steady.npz", "--readings", "single", "--divide-by-lamp"])
        .failed(1, &["expected (256,) or"]);
    bench.write("d.npy", &encode(&[256], &measured.d));
    let line = ["reconstruct", "d.npy", "--shown", "natural", "--readings", "differences"];
    bench.run(&[&line[..], &["--divide-by-lamp"]].concat()).failed(
        1,
        &["holds no complements (differences) and 1 all-on reading", "at least 4 times"],
    );
}

/// Readings without complements tell less: a shift by what the patterns predict, a drift by their level.
#[test]
fn a_shift_and_a_drift_of_patterns_alone_are_told() {
    let (bench, measured) = (Bench::new(), Measured::new(32));
    let y = measured.natural();
    let pairs = y.as_chunks::<2>().0;
    let (single, d): (Vec<f32>, Vec<f32>) = pairs.iter().map(|[p, m]| (*p, p - m)).unzip();
    let told = |y: &[f32], form: &str| {
        bench.write("y.npy", &encode(&[y.len()], y));
        let line = ["reconstruct", "y.npy", "--shown", "natural", "--side", "32", "--readings"];
        bench.run(&[&line[..], &[form]].concat()).succeeded().stderr
    };
    for (y, form) in [(&single, "single"), (&d, "differences")] {
        let said = told(y, form);
        assert!(!said.contains("warning"), "{form}: {said}");
    }
    let said = told(&d[1..], "differences");
    assert!(said.contains("readings of the pattern 1 place later in the order"), "{said}");
    // The all-on reading is missed, and one of another pattern taken for it.
    let said = told(&single[1..], "single");
    assert!(said.contains("the all-on reading may be saturated"), "{said}");
    let drifting: Vec<f32> =
        single.iter().enumerate().map(|(at, y)| y * (1.0 + 0.1 * at as f32 / 1024.0)).collect();
    let said = told(&drifting, "single");
    assert!(said.contains("the level of the readings drifts by 9."), "{said}");
}

/// Readings without complements, with the all-on pattern in each 16th place, under a lamp of known drift and flicker.
#[test]
fn readings_of_the_all_on_pattern_tell_and_correct_a_lamp_that_drifts() {
    let (bench, measured) = (Bench::new(), Measured::new(16));
    let on = measured.h_row.iter().position(|&row| row == 0.0).unwrap();
    let (mut rows, mut steady) = (Vec::new(), Vec::new());
    for (pair, &row) in measured.y.chunks_exact(2).zip(&measured.h_row) {
        if rows.len() % 16 == 0 {
            rows.push(0.0);
            steady.push(measured.y[2 * on]);
        }
        rows.push(row);
        steady.push(pair[0]);
    }
    let lamp = |at: usize| {
        let share = at as f32 / rows.len() as f32;
        1.0 + 0.4 * share + 0.05 * (20.0 * share).sin()
    };
    let drifts: Vec<f32> = steady.iter().enumerate().map(|(at, y)| y * lamp(at)).collect();
    let count = [rows.len()];
    for (name, y) in [("steady.npz", &steady), ("drifts.npz", &drifts)] {
        bench.write(name, &npz(&[("n", &[], &[16.0]), ("h_row", &count, &rows), ("y", &count, y)]));
    }
    let words = "all-on readings: spread 0.00 %, drift 0.00 %";
    let told = tells_and_corrects(&bench, &["--readings", "single"], words);
    assert_eq!(told["all_on_readings"], 19, "{told}");
}

#[test]
fn every_form_of_the_page_is_an_image_with_its_option() {
    let (bench, measured) = (Bench::new(), Measured::new(16));
    let area = measured.image.len();
    let lit = |k: usize, p: usize| f32::from(u8::from((k & p).count_ones().is_multiple_of(2)));
    let patterns: Vec<f32> = (0..area * area).map(|at| lit(at / area, at % area)).collect();
    bench.write("patterns.npy", &encode(&[area, 16, 16], &patterns));
    let (rows, forms) = (rows(), forms(&measured));
    let titles: Vec<&str> = rows.iter().map(|(form, _)| &**form).collect();
    assert_eq!(titles, forms.iter().map(|form| form.row).collect::<Vec<_>>());
    for ((_, says), Form { row, file, bytes, options }) in rows.iter().zip(forms) {
        let option = says.split('`').find(|part| part.starts_with("--"));
        let option = option.map(|option| option.split(' ').next().unwrap());
        let is_said =
            option.is_none_or(|option| options.contains(&option) || row.contains("complex"));
        assert!(is_said, "{row}: {says}, tried {options:?}");
        bench.write(file, &bytes);
        let mut input = file;
        if says.contains("nirspi readings") {
            let cut = ["--field", "ch1", "--trigger", "ch2", "--out", "m.npz"];
            bench.run(&[&["readings", file], &cut[..]].concat()).succeeded();
            input = "m.npz";
        }
        let out = format!("out-{file}");
        let mut line = vec!["reconstruct", input, "--out", &out];
        if !options.contains(&"--method") {
            line.extend(["--method", "hadamard"]);
        }
        line.extend(&options);
        bench.run(&line).succeeded();
        let found = correlation(&bench.pixels(&format!("{out}/image.npy")), &measured.image);
        assert!(found > 0.999, "{row}: {found}");
    }
}
