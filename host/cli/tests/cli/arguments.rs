//! Arguments, help, and where the output goes.

use crate::bench::{Bench, first_bytes, program};
use crate::help::commands;
use std::process::{Command, Stdio};

#[test]
fn every_command_explains_itself_with_an_example_and_shows_at_most_twelve_options_in_short() {
    let bench = Bench::new();
    for page in commands(&bench) {
        let (command, help) = (page.words(), &page.help);
        // The benchmarks and the paper's tables have their examples one level above.
        let above = bench.run(&[&command[..1], &["--help"]].concat()).stdout;
        let example = format!("\n  nirspi {}", command.join(" "));
        assert!(help.contains(&example) || above.contains(&example), "{help}");
        let short = bench.run(&[&command[..], &["-h"]].concat()).succeeded().stdout;
        let is_option = |line: &&str| line.starts_with("  -") || line.starts_with("      --");
        let options = short.lines().filter(is_option).count();
        assert!((1..=12).contains(&options), "{command:?}, {options} options: {short}");
    }
    let version = bench.run(&["-V"]).succeeded().stdout;
    assert_eq!(version, format!("nirspi {}\n", env!("CARGO_PKG_VERSION")));
}

#[test]
fn the_long_version_says_which_build_this_is() {
    let said = Bench::new().run(&["--version"]).succeeded().stdout;
    assert!(said.starts_with(&format!("nirspi {}\ncommit: ", env!("CARGO_PKG_VERSION"))), "{said}");
    assert!(said.contains("\nprotocol: version 1\n") && said.contains("\nfeatures: "), "{said}");
    for network in ["estimator", "fsrcnn", "diffusion", "prior", "classifier"] {
        let line = said.lines().find(|line| line.trim().starts_with(network)).unwrap();
        assert_eq!(line.split(' ').next_back().unwrap().len(), 64, "{line}");
    }
}

#[test]
fn an_option_of_another_command_gets_no_advice_to_pass_it_as_a_file() {
    let said = Bench::new().run(&["reconstruct", "in.npz", "--order", "zig-zag"]);
    assert_eq!(said.code, Some(2));
    assert_eq!(said.stderr.trim_end(), "nirspi: unexpected argument '--order' found");
}

#[test]
fn mistakes_in_the_arguments_get_one_line_and_code_2() {
    let bench = Bench::new();
    let boards = nirspi::boards::flashable();
    let mistakes: &[(&[&str], &[&str])] = &[
        (&["demo", "--bogus"], &["--bogus"]),
        (&["bogus"], &["bogus"]),
        (&["reconstruct"], &["<INPUT>"]),
        (&["demo", "--sampling", "0"], &["'0'", "--sampling", "more than 0 and at most 1"]),
        (&["demo", "--sampling", "1.5"], &["'1.5'", "--sampling", "1.5%"]),
        (&["demo", "--sampling", "2"], &["'2'", "--sampling", "write 2% or 0.02"]),
        (&["capture", "--sampling", "30"], &["'30'", "--sampling", "write 30% or 0.3"]),
        (&["demo", "--sampling", "101%"], &["'101%'", "--sampling", "at most 1"]),
        (&["demo", "--sampling", "nan"], &["'nan'", "--sampling"]),
        (&["demo", "--sampling", "-0.1"], &["'-0.1'", "--sampling"]),
        (&["demo", "--sampling", "x"], &["--sampling", "'x'"]),
        (&["reconstruct", "in.npz", "--sampling", "-1"], &["'-1'", "--sampling"]),
        (&["demo", "--method", "magic"], &["--method", "hadamard, omp"]),
        (&["demo", "--basis", "magic"], &["--basis", "magic", "dct"]),
        (&["demo", "--order", "magic"], &["--order", "magic", "cake-cutting", "table:FILE"]),
        (&["demo", "--sparsity", "0"], &["--sparsity is 0"]),
        (&["demo", "--residual", "1"], &["--residual is 1"]),
        (&["demo", "--method", "tv", "--sparsity", "9"], &["--sparsity belongs to --method omp"]),
        (&["demo", "--method", "tv", "--stop-at-noise"], &["--sparsity belongs to --method omp"]),
        (
            &["demo", "--method", "tv", "--backend", "cuda"],
            &["--backend cuda belongs to --method omp"],
        ),
        (
            &["demo", "--method", "omp", "--strength", "1"],
            &["--strength belongs to", "tikhonov, fista or tv"],
        ),
        (&["demo", "--method", "tv", "--strength", "0"], &["--strength is 0"]),
        (&["dev", "bench", "omp", "--sparsity", "0"], &["--sparsity is 0", "1 to 512"]),
        (
            &["dev", "bench", "omp", "--measurements", "1025"],
            &["--measurements is 1025", "1 to 1024"],
        ),
        (
            &["dev", "bench", "omp", "--backend", "abacus"],
            &["--backend", "abacus", "auto, cpu, wgpu or cuda"],
        ),
        (&["dev", "bench", "enhance", "--frames", "0"], &["--frames", "'0'"]),
        // As many frames would take more memory than there is.
        (&["dev", "bench", "omp", "--frames", "4294967295"], &["--frames", "1..=65536"]),
        (&["dev", "bench", "enhance", "--frames", "4294967295"], &["--frames", "1..=131072"]),
        (&["dev", "bench", "pipeline", "--frames", "4294967295"], &["--frames", "1..=131072"]),
        (&["dev", "bench", "pipeline", "--sparsity", "600"], &["--sparsity is 600", "1 to 512"]),
        (&["reconstruct", "in.npz", "--matrix", "p.npy", "--enhance"], &["--matrix", "--enhance"]),
        (&["eval", "sampling", "in.npz", "--sampling", "0.1,200"], &["'200'", "--sampling"]),
        (&["eval", "sampling", "in.npz", "--orders", "magic"], &["magic", "cake-cutting"]),
        (&["demo", "--rain", "snow"], &["snow", "none", "light", "heavy"]),
        (&["demo", "--frames", "0"], &["--frames", "'0'"]),
        (&["demo", "--sweeps", "0"], &["--sweeps", "'0'"]),
        (&["demo", "--light", "0"], &["'0'", "--light", "more than 0"]),
        (&["demo", "--light", "20"], &["'20'", "--light", "unit", "20ms or 20s"]),
        (&["demo", "--light", "-5ms"], &["'-5ms'", "--light", "more than 0"]),
        (&["demo", "--light", "2h"], &["'2h'", "--light", "20ms or 0.5s"]),
        (&["demo", "--light", "0.001ms"], &["--light", "0.001ms", "one sweep of 512 patterns"]),
        (&["demo", "--light", "20ms", "--frames", "9"], &["--light", "--frames"]),
        (&["capture", "--light", "20ms", "--frames", "9"], &["--light", "--frames"]),
        (&["capture", "--camera", "replay:r.mcap", "--light", "20ms"], &["--light", "--frames"]),
        (&["serve", "--light", "20ms", "--frames", "9"], &["--light", "--frames"]),
        (&["serve", "--light", "2s"], &["--light 2s", "at most 1024", "--sweeps"]),
        (&["eval", "table3", "--light", "1s", "--frames", "9"], &["--light", "--frames"]),
        (
            &["camera", "calibrate", "--white", "--light", "0.1ms"],
            &["--light 0.1ms", "1 sweeps", "8 to"],
        ),
        (&["demo", "--blanked", "5"], &["--blanked is 5", "--clocks-per-pattern"]),
        (&["capture", "--camera", "fax"], &["--camera", "tcp:HOST:PORT"]),
        (&["capture", "--camera", "serial:"], &["--camera", "serial:PATH[:BAUD]"]),
        (&["capture", "--calibrate", "--no-calibration"], &["--calibrate", "--no-calibration"]),
        (
            &["capture", "--calibration", "c.json", "--non-differential"],
            &["--calibration", "dark level", "--calibrate"],
        ),
        (&["camera", "info", "--camera", "usb:"], &["--camera", "usb:SERIAL"]),
        (&["camera", "flash"], &["--board"]),
        (&["camera", "flash", "--board", "toaster"], &["toaster", &boards]),
        (&["camera", "flash", "--board", "mps2-an505"], &["mps2-an505", "QEMU"]),
        (&["capture", "--camera", "tcp:nowhere"], &["--camera", "tcp:HOST:PORT"]),
        (&["deblur", "in.npy"], &["--out"]),
        (&["deblur", "in.npy", "--model", "magic", "--out", "o.npy"], &["magic", "diffusion"]),
        (&["deblur", "in.npy", "--steps", "0", "--out", "o.npy"], &["--steps", "'0'"]),
        (&["deblur", "in.npy", "--model", "gan", "--steps", "3", "--out", "o.npy"], &["--steps"]),
        (&["deblur", "in.npy", "--blur-px", "-1", "--out", "o.npy"], &["--blur-px is -1"]),
        (&["enhance", "in.npy", "--noise", "nan", "--out", "o.npy"], &["--noise is NaN"]),
        (
            &["enhance", "in.npy", "--backend", "tpu", "--out", "o.npy"],
            &["--backend", "tpu", "auto, cpu, wgpu or cuda"],
        ),
        (&["dev", "pairs", "--characters", "letters", "--out", "p.npz"], &["--data", "--fonts"]),
        (&["dev", "virtual", "--distance-m", "0"], &["--distance-m is 0"]),
    ];
    for (arguments, words) in mistakes {
        let outcome = bench.run(arguments).failed(2, words);
        assert!(outcome.stdout.is_empty(), "{outcome:?}");
    }
    assert!(bench.names().is_empty(), "{:?}", bench.names());
}

#[test]
fn an_order_table_that_is_no_permutation_is_refused() {
    let bench = Bench::new();
    let table = |change: &dyn Fn(&mut Vec<u32>)| {
        let mut rows: Vec<u32> = (0..1024).rev().collect();
        change(&mut rows);
        let text: Vec<String> = rows.iter().map(u32::to_string).collect();
        bench.write("order.txt", text.join("\n").as_bytes());
        bench.run(&["demo", "--frames", "1", "--order", "table:order.txt", "--out", "demo"])
    };
    table(&|rows| rows[5] = 0).failed(1, &["order.txt", "repeats row 0"]);
    table(&|rows| rows[5] = 1024).failed(1, &["order.txt", "1024", "0 to 1023"]);
    table(&|rows| rows.truncate(1000)).failed(1, &["order.txt", "1000 rows", "1024"]);
    assert_eq!(bench.names(), ["order.txt"]);
    table(&|_| {}).succeeded();
}

#[test]
fn a_reader_that_stops_reading_is_no_failure() {
    let bench = Bench::new();
    let demo = bench.path("demo");
    let mut child = Command::new(program())
        .args(["demo", "--frames", "1", "--json", "--out"])
        .arg(&demo)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // Closed before anything was written.
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
    assert!(demo.join("report.json").exists());

    let mut child = Command::new(program()).arg("--help").stdout(Stdio::piped()).spawn().unwrap();
    assert_eq!(first_bytes(&mut child.stdout.take().unwrap(), 2), b"ni");
    assert!(child.wait().unwrap().success());
}

#[cfg(target_os = "linux")]
#[test]
fn output_that_cannot_be_written_is_a_failure() {
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let output = Command::new(program()).args(["camera", "devices"]).stdout(full).output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let line = String::from_utf8(output.stderr).unwrap();
    assert!(line.lines().count() == 1 && line.contains("cannot write to stdout"), "{line}");
}
