//! Inputs of other benches, which lie beside the shared data, and files of ours in as many forms: as they are, cut, and with NaN.

use crate::bench::{Bench, Measured, correlation, npz};
use crate::exports::exports;
use nirspi::files::contents::Contents;
use nirspi::files::measurement::{Selection, Several};
use nirspi::files::npy::{encode, read_stack};
use nirspi::files::trace::{self, Cut};
use nirspi_recon::Order;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// The inputs; they are not part of this repository.
pub fn cases() -> Option<PathBuf> {
    let data = std::env::var_os("NIRSPI_DATA").map(PathBuf::from);
    let folder = data.map(|data| data.join("../cases/readings")).filter(|folder| folder.is_dir());
    if folder.is_none() {
        let why = "skipped: no data (../cases/readings of NIRSPI_DATA)";
        let _ = writeln!(std::io::stderr(), "{why}");
    }
    folder
}

/// What is right for an input.
enum Right {
    /// An image like this one, and these words.
    Image(&'static str, f64, &'static str),
    /// A warning with these words.
    Warning(&'static str),
    /// A refusal with these words.
    Refusal(&'static str),
}

/// What they print. That each one gives its image by the command that `nirspi inspect` names is tested in `inspect`.
#[test]
#[ignore = "long: .ci/run demo"]
fn the_inputs_of_other_benches_are_read_as_their_readme_says() {
    use Right::{Image, Refusal, Warning};
    let Some(folder) = cases() else { return };
    let like = |words| Image("truth16.npy", 0.99, words);
    let rows: Vec<(&str, &str, Right)> = vec![
        ("halves.npy", "--shown natural", Warning("try --readings halves")),
        ("inverted.npy", "--shown natural", Warning("an inverting amplifier")),
        ("offby1.npy", "--shown natural", Warning("one reading early")),
        ("over4.npy", "--shown natural", Warning("4 samples of each reading")),
        ("overload.csv", "--shown natural", like("not read: 1 pattern left out, at [0]")),
        ("ads32767.npy", "--shown natural", like("outlier: reading [77], 32767")),
        ("sconv.npy", "--shown natural --readings single", Warning("patterns that light the -1")),
        ("yP01.npy", "--matrix patterns_flat.npy --method tv", like("")),
        (
            "yP01_dark.npy",
            "--matrix patterns_flat.npy --method tv",
            Image("truth16.npy", 0.98, "dark level 30."),
        ),
        (
            "yP01_dark.npy",
            "--matrix patterns_stack.npy --method tv",
            Image("truth16.npy", 0.98, "dark level 30."),
        ),
        (
            "readings_12x15.npy",
            "--matrix patterns_12x15.npy --size 12x15",
            Image("truth_12x15.npy", 0.99, "12 x 15, 240 of 240"),
        ),
        ("repeat4.npz", "", like("each pattern was shown 4 times")),
        ("textcol.csv", "", like("columns that hold words: `comment`")),
        ("rigol.csv", "--shown natural", like("the units below its heading")),
        ("pico_inf.csv", "--shown natural", like("not read: 1 pattern left out, at [0]")),
        ("thorlabs.csv", "--shown natural", like("3 lines before the table")),
        ("arduino.txt", "--shown natural", like("columns that hold words: 1, 2")),
        ("bad_na.csv", "", like("not read: 1 pattern left out, at [9]")),
        ("group.h5", "--shown natural", Refusal("found `run1/adc/y`, `meta/date`")),
        ("book.xlsx", "--shown natural", Refusal("a workbook of Excel (save it as CSV)")),
    ];
    let bench = Bench::new();
    for entry in std::fs::read_dir(&folder).unwrap() {
        let path = entry.unwrap().path();
        std::fs::copy(&path, bench.path(path.file_name().unwrap().to_str().unwrap())).unwrap();
    }
    let truth = |name: &str| read_stack(&bench.path(name)).unwrap().values;
    for (file, options, right) in rows {
        let mut line = vec!["reconstruct", file, "--out", "out"];
        line.extend(options.split_whitespace());
        if !line.contains(&"--matrix") {
            line.extend(["--method", "tikhonov"]);
        }
        let outcome = bench.run(&line);
        match right {
            Refusal(words) => drop(outcome.failed(1, &[file, words])),
            Warning(words) => {
                let outcome = outcome.succeeded();
                assert!(outcome.stderr.contains(words), "{outcome:?}");
            }
            Image(name, least, words) => {
                let outcome = outcome.succeeded();
                assert!(outcome.stdout.contains(words), "{words:?} in {outcome:?}");
                let alike = correlation(&bench.pixels("out/image.npy"), &truth(name));
                assert!(alike >= least, "{file}: {alike}");
            }
        }
        let _ = std::fs::remove_dir_all(bench.path("out"));
    }
}

/// Files of every form that is read, of the shipped tests or made here, and the inputs of other benches where they are.
fn all_files() -> Vec<(String, Vec<u8>)> {
    let measured = Measured::new(8);
    let y = measured.natural();
    let doubles: Vec<f64> = y.iter().map(|&y| y.into()).collect();
    let mut files: Vec<(String, Vec<u8>)> = vec![
        ("f32.npy".into(), encode(&[128], &y)),
        ("f64.npy".into(), encode(&[64, 2], &doubles)),
        ("named.npz".into(), measured.npz()),
        ("two.npz".into(), npz(&[("on", &[128], &y), ("off", &[128], &y)])),
    ];
    for name in [
        "level5.mat",
        "level5_compressed.mat",
        "level4.mat",
        "nested.mat",
        "h5py.h5",
        "level73.mat",
    ] {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../files/src/small/");
        files.push((name.into(), std::fs::read(format!("{folder}{name}")).unwrap()));
    }
    let texts =
        exports(&y).into_iter().map(|export| (export.file.to_owned(), export.text.into_bytes()));
    files.extend(texts);
    for path in cases().iter().flat_map(|folder| std::fs::read_dir(folder).unwrap()) {
        let path = path.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        if !name.starts_with("README") {
            files.push((name, std::fs::read(path).unwrap()));
        }
    }
    files
}

/// The file with NaN in it, in several places.
fn with_nan(bytes: &[u8]) -> Vec<Vec<u8>> {
    let places = |count: usize| {
        let last = count.saturating_sub(1);
        [0, 1.min(last), count / 3, count / 2, last]
    };
    if let Ok(text) = std::str::from_utf8(bytes)
        && text.contains('\n')
    {
        // In place of the last number of a line.
        let lines: Vec<&str> = text.split_inclusive('\n').collect();
        let spoilt = |at: usize| {
            let mut lines: Vec<String> = lines.iter().map(|&line| line.to_owned()).collect();
            let line = lines[at].trim_end().to_owned();
            let end = line.rfind(|c: char| c.is_ascii_digit()).map_or(0, |at| at + 1);
            let start = line[..end].rfind([',', ';', '\t', ' ', ':', '(']).map_or(0, |at| at + 1);
            lines[at] = format!("{}nan{}\n", &line[..start], &line[end..]);
            lines.concat().into_bytes()
        };
        return places(lines.len()).map(spoilt).to_vec();
    }
    let data = if bytes.starts_with(b"\x93NUMPY") { 128 } else { bytes.len() / 4 };
    let mut all = Vec::new();
    for nan in [&f64::NAN.to_le_bytes()[..], &f32::NAN.to_le_bytes()] {
        let count = bytes.len().saturating_sub(data) / nan.len();
        for place in places(count) {
            let mut spoilt = bytes.to_vec();
            let at = data + place * nan.len();
            if let Some(number) = spoilt.get_mut(at..at + nan.len()) {
                number.copy_from_slice(nan);
                all.push(spoilt);
            }
        }
    }
    all
}

/// A selection of patterns in natural order, or by the file's own rows.
fn selection(shown: Option<Order>) -> Selection {
    Selection { shown, ..Selection::default() }
}

/// What every reader says of the file at this path is one line, or readings that are finite.
fn is_read_or_refused(path: &Path, orders: &[Option<Order>]) {
    let is_line = |line: String| {
        assert!(line.starts_with(path.to_str().unwrap()), "{line}");
        assert_eq!(line.lines().count(), 1, "{line}");
    };
    for shown in orders {
        let want = selection(shown.clone());
        match Several::open(path, &want).and_then(|mut several| several.each()) {
            Ok(all) => {
                for one in all {
                    let values = one.readings.values();
                    assert!(values.iter().all(|value| value.is_finite()), "{}", path.display());
                }
            }
            Err(error) => is_line(error.to_string()),
        }
    }
    if let Err(error) = Contents::open(path, false) {
        is_line(error.to_string());
    }
    let cut = Cut { samples: Some(4), ..Cut::default() };
    if let Err(error) = trace::read(path, &cut) {
        is_line(error.to_string());
    }
}

/// A text with its first and its last lines: those between them are all alike.
fn with_few_lines(bytes: Vec<u8>) -> Vec<u8> {
    let lines: Vec<&[u8]> = bytes.split_inclusive(|&byte| byte == b'\n').collect();
    match std::str::from_utf8(&bytes).is_ok() && lines.len() > FIRST + LAST {
        true => [lines[..FIRST].concat(), lines[lines.len() - LAST..].concat()].concat(),
        false => bytes,
    }
}

/// Lines that are kept: all of an instrument's preamble, and some of its table.
const FIRST: usize = 30;
const LAST: usize = 2;

/// Longest file that is cut at every byte, and bytes at either end of a longer one that is cut at each of them.
const SHORT: usize = 900;
const ENDS: usize = 100;

/// Files of every form with NaN, and cut: at many bytes, and at every byte of a short one and of both ends of a longer one.
#[test]
#[ignore = "long: .ci/run demo"]
fn a_damaged_file_is_read_in_part_or_refused_in_one_line() {
    let bench = Bench::new();
    for (name, bytes) in all_files() {
        let path = bench.path(&name);
        let cuts = (0..bytes.len()).step_by((bytes.len() / 60).max(1));
        for damaged in cuts.map(|end| bytes[..end].to_vec()).chain(with_nan(&bytes)) {
            std::fs::write(&path, &damaged).unwrap();
            is_read_or_refused(&path, &[None, Some(Order::Natural)]);
        }
        let bytes = with_few_lines(bytes);
        let middle = match bytes.len() {
            0..=SHORT => 0..0,
            length => ENDS..length - ENDS,
        };
        // The way in which the whole file is read.
        std::fs::write(&path, &bytes).unwrap();
        let by_rows = Several::open(&path, &selection(None)).is_ok();
        let order = [(!by_rows).then_some(Order::Natural)];
        for end in (0..bytes.len()).filter(|end| !middle.contains(end)) {
            std::fs::write(&path, &bytes[..end]).unwrap();
            is_read_or_refused(&path, &order);
        }
        std::fs::remove_file(&path).unwrap();
    }
}

/// The same through the program: a picture and a report, or one line and nothing else.
#[test]
#[ignore = "long: .ci/run demo"]
fn the_program_makes_an_image_of_a_damaged_file_or_nothing() {
    let bench = Bench::new();
    for (name, bytes) in all_files() {
        let cuts = [1, bytes.len() / 3, bytes.len() - 1].map(|end| bytes[..end].to_vec());
        let spoilt = with_nan(&bytes).into_iter().skip(2).step_by(2);
        for damaged in cuts.into_iter().chain(spoilt) {
            bench.write(&name, &damaged);
            let line = ["reconstruct", &name, "--method", "hadamard", "--out", "out"];
            for more in [&["--shown", "natural"][..], &[]] {
                let outcome = bench.run(&[&line[..], more].concat());
                if outcome.code == Some(0) {
                    let outcome = outcome.succeeded();
                    for file in ["image.npy", "image.png", "report.json"] {
                        assert!(bench.path("out").join(file).exists(), "{file}: {outcome:?}");
                    }
                    assert!(bench.pixels("out/image.npy").iter().all(|pixel| pixel.is_finite()));
                    std::fs::remove_dir_all(bench.path("out")).unwrap();
                } else {
                    let is_choice = outcome.code == Some(2) && outcome.stderr.contains("--index");
                    let outcome = outcome.failed(if is_choice { 2 } else { 1 }, &[&name]);
                    assert!(outcome.stdout.is_empty(), "{outcome:?}");
                }
                assert!(
                    !bench.path("out").exists() && bench.names().len() == 1,
                    "{:?}",
                    bench.names()
                );
            }
        }
        std::fs::remove_file(bench.path(&name)).unwrap();
    }
}
