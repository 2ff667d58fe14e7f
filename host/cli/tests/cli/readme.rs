//! Every shell command of the README, the book and the boards' pages runs as it stands, from a folder that holds nothing,
//! or is in a list that says why it does not run here.

use crate::bench::Bench;
use std::fs;
use std::path::Path;

/// Commands that are not run: the page (every page, if empty), a part of the command, and the reason.
const NOT_RUN: &[(&str, &str, &str)] = &[
    ("", "git clone", "needs the network"),
    ("", "rustup target add", "fetches from rustup; .ci/run firmware and web"),
    ("", "cargo install", "builds from crates.io for minutes"),
    ("", "cargo build", "builds for minutes; .ci/run"),
    ("", "cargo test", "this test is a part of it"),
    ("", "cargo run --release --example", "another program; .ci/run examples"),
    (
        "",
        "cargo run --release -p nirspi-eval --example",
        "needs data of other groups (docs/data.md)",
    ),
    ("", "bash .ci/run silicon", "needs the board's ELF and PyPI; .ci/run silicon"),
    ("", "pip install", "needs Python and PyPI; .ci/run python"),
    ("", "bash boards/run.sh", "needs a board, or QEMU; tests/tests/qemu.rs"),
    ("", "sudo ", "changes the machine; tests/cli/versions.rs installs the udev rule in a folder"),
    ("", "nirspi serve", "runs until it is stopped; tests/cli/serve.rs"),
    ("", "-- serve", "runs until it is stopped; tests/cli/serve.rs"),
    (
        "",
        "virtual --",
        "runs until it is stopped; tests/cli/capture_tcp.rs and tests/tests/qemu.rs",
    ),
    ("", "--camera usb", "needs a camera on USB"),
    ("", "--camera feed:127.0.0.1:", "needs the readings of another program; tests/cli/feed.rs"),
    ("", "--camera tcp:", "needs the camera of another terminal; tests/cli/capture_tcp.rs"),
    ("", "nirspi dev pairs", "the user's characters; tests/cli/pairs.rs"),
    ("", "python -m nirspi.train", "needs PyTorch; .ci/run python-peers"),
    ("boards/electronics/README.md", "run.sh", "needs ngspice; .ci/run electronics"),
    ("boards/mps2-an505/README.md", "install-qemu.sh", "fetches from Debian; .ci/run emulation"),
    ("boards/mps2-an505/README.md", "qemu-system-arm", "needs QEMU and built firmware"),
    ("host/cli/README.md", "nirspi demo", "the README's first command, which runs there"),
    ("docs/bring-up.md", "hdl/build.py", "place and route; .ci/run place-route"),
    ("docs/bring-up.md", "openFPGALoader", "needs the FPGA board"),
    ("docs/bring-up.md", "nirspi camera devices", "opens every serial port of this machine"),
    ("docs/browser.md", "host/web/build.sh", "builds WebAssembly; .ci/run web"),
    (
        "docs/feeds.md",
        "inspect feed:127.0.0.1:",
        "needs the readings of another program; tests/cli/inspect.rs",
    ),
    ("docs/feeds.md", "python bench.py", "a bench sends for ever; tests/cli/feed.rs"),
    ("docs/feeds.md", "reconstruct rec.npz", "the recording of that bench; tests/cli/feed.rs"),
    ("docs/gallery.md", "host/web/build.sh", "builds WebAssembly; .ci/run web"),
    ("docs/browser.md", "http.server", "runs until it is stopped; .ci/run web"),
    ("docs/lesson.md", "host/web/build.sh", "builds WebAssembly; .ci/run web"),
    ("docs/lesson.md", "http.server", "runs until it is stopped; .ci/run web"),
    ("docs/clusters.md", "reconstruct archive/", "the user's archive; tests/cli/many.rs"),
    ("docs/clusters.md", "ray start", "needs Ray; .ci/run cluster"),
    ("docs/own-patterns.md", "theirs.npz", "the user's patterns; tests/cli/own_patterns.rs"),
    ("docs/live-page-network.md", "curl", "needs the page of another terminal; tests/cli/serve.rs"),
    ("docs/log/mutants.md", "cargo mutants", "hours; .ci/run mutants"),
    ("docs/log/performance.md", "host/scripts/live_speed.py", "a minute, on a quiet machine"),
    ("docs/log/performance.md", "host/gpu/benches/gpu.sh", "needs a GPU"),
    ("docs/log/quality.md", "eval quality", "needs data of other groups; tests/cli/quality.rs"),
    ("docs/log/quality.md", "eval table", "minutes; tests/cli/rain.rs has fewer scenes"),
    ("docs/log/quality.md", "metrics sharp.npy", "the user's stacks; tests/cli/metrics.rs"),
    ("docs/log/reliability.md", "serve_soak.py", "ten minutes; .ci/run crowd"),
    ("docs/measurements.md", "scheidt_car.npz", "data of another group; tests/cli/real_data.rs"),
    ("docs/measurements.md", "nirspi readings", "the user's traces; tests/cli/traces.rs"),
    ("docs/measurements.md", "benches/", "the user's archive; tests/cli/many.rs"),
    (
        "docs/training.md",
        "nirspi deblur in.npy",
        "the weights of a training; host/python/tests/test_train.py",
    ),
    ("docs/log/training.md", "python ", "needs torch and data of other groups"),
    (
        "docs/log/training.md",
        "cd host/nets/training",
        "a folder of the repository; the next lines need torch",
    ),
    ("docs/training.md", "cargo run -p nirspi-nets --example", "another program; .ci/run examples"),
];

/// Files that a page takes from another page or from a command in [`NOT_RUN`]: the command that writes the file instead.
const BEFORE: &[(&str, &str)] = &[
    ("docs/videos.md", "capture --frames 20 --out rec.mcap"),
    ("docs/log/reconstruction.md", "capture --frames 20 --out rec.mcap"),
];

/// Pages with a test of their own, because their commands take seconds.
const ALONE: [&str; 4] =
    ["README.md", "docs/first-picture.md", "docs/measurements.md", "docs/how-it-works.md"];

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}

fn text(page: &str) -> String {
    fs::read_to_string(root().join(page)).unwrap_or_else(|error| panic!("{page}: {error}"))
}

/// The pages that tell people what to type.
fn pages() -> Vec<String> {
    let mut found = vec!["README.md".to_owned(), "host/cli/README.md".to_owned()];
    for folder in ["docs", "docs/log", "boards"] {
        for entry in fs::read_dir(root().join(folder)).unwrap() {
            let name = format!("{folder}/{}", entry.unwrap().file_name().to_str().unwrap());
            let readme = format!("{name}/README.md");
            found.extend(
                [name, readme]
                    .into_iter()
                    .filter(|page| page.ends_with(".md") && root().join(page).is_file()),
            );
        }
    }
    found.sort();
    found
}

/// Lines of blocks of shell commands, without comments. A backslash joins a line and the next one.
fn commands(page: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut is_shell = false;
    let mut begun = String::new();
    for line in page.lines() {
        if let Some(language) = line.strip_prefix("```") {
            is_shell = language == "sh";
        } else if is_shell {
            let line = format!(" {}", line.trim());
            begun.push_str(line.split(" #").next().unwrap());
            if let Some(first) = begun.strip_suffix('\\') {
                begun = first.trim_end().to_owned();
            } else {
                found.push(std::mem::take(&mut begun).trim().to_owned());
            }
        }
    }
    found.retain(|command| !command.is_empty());
    found
}

fn is_left_out(page: &str, command: &str) -> bool {
    NOT_RUN.iter().any(|(of, part, _)| (of.is_empty() || *of == page) && command.contains(part))
}

/// Runs a command of `nirspi` in the folder of the bench. ` > FILE` at its end writes what it prints.
fn run(bench: &Bench, page: &str, command: &str) -> String {
    let by_cargo = command.strip_prefix("cargo run --release -- ");
    let Some(line) = by_cargo.or_else(|| command.strip_prefix("nirspi ")) else {
        panic!("{page}: `{command}` is no command of nirspi: add it to NOT_RUN with the reason");
    };
    let (arguments, file) = line.split_once(" > ").unwrap_or((line, ""));
    let printed = bench.run(&arguments.split_whitespace().collect::<Vec<_>>()).succeeded().stdout;
    if !file.is_empty() {
        bench.write(file, printed.as_bytes());
    }
    printed
}

/// Runs the commands of a page in turn, and returns what each one printed.
fn runs_as_it_stands(bench: &Bench, page: &str) -> Vec<String> {
    for (_, command) in BEFORE.iter().filter(|(of, _)| *of == page) {
        bench.run(&command.split_whitespace().collect::<Vec<_>>()).succeeded();
    }
    let commands = commands(&text(page));
    let run_here = commands.iter().filter(|command| !is_left_out(page, command));
    run_here.map(|command| run(bench, page, command)).collect()
}

#[test]
fn every_line_of_the_readme_runs_as_it_stands() {
    assert_eq!(runs_as_it_stands(&Bench::new(), "README.md").len(), 5);
}

#[test]
#[ignore = "long: .ci/run demo"]
fn every_line_of_the_first_picture_runs_as_it_stands() {
    assert_eq!(runs_as_it_stands(&Bench::new(), "docs/first-picture.md").len(), 7);
}

#[test]
#[ignore = "long: .ci/run demo"]
fn every_line_of_the_page_about_measurements_runs_as_it_stands() {
    assert_eq!(runs_as_it_stands(&Bench::new(), "docs/measurements.md").len(), 5);
}

#[test]
#[ignore = "long: .ci/run demo"]
fn every_line_of_how_it_works_runs_as_it_stands_and_gives_its_numbers() {
    let bench = Bench::new();
    assert_eq!(runs_as_it_stands(&bench, "docs/how-it-works.md").len(), 2);
    let words = text("docs/how-it-works.md").split_whitespace().collect::<Vec<_>>().join(" ");
    let db = |run: &str, stage: &str| {
        let report = bench.json(&format!("out/{run}/report.json"));
        report.pointer(&format!("{stage}/psnr_db")).unwrap().as_f64().unwrap()
    };
    let (plain, sparse) = (db("quarter", "/raw"), db("quarter", "/reconstruction"));
    let (blot, sharp) = (db("far", "/enhancement/upscaled"), db("far", "/enhancement/deblurred"));
    for said in [
        format!("has stripes ({plain:.1} dB), and the sparse image has fewer ({sparse:.1} dB)"),
        format!("the networks bring {blot:.1} dB to {sharp:.1} dB"),
    ] {
        assert!(words.contains(&said), "docs/how-it-works.md does not say: {said}");
    }
}

#[test]
#[ignore = "long: .ci/run demo"]
fn every_line_of_the_other_pages_runs_as_it_stands() {
    for page in pages().iter().filter(|page| !ALONE.contains(&page.as_str())) {
        runs_as_it_stands(&Bench::new(), page);
    }
}

#[test]
fn every_reason_for_not_running_a_command_has_its_command() {
    let pages = pages();
    let texts: Vec<_> = pages.iter().map(|page| (page, commands(&text(page)))).collect();
    for (of, part, why) in NOT_RUN {
        let mut on = texts.iter().filter(|(page, _)| of.is_empty() || page == of);
        let there = on.any(|(_, commands)| commands.iter().any(|line| line.contains(part)));
        assert!(there, "`{part}` ({why}) is in no command of {of:?}: remove it from NOT_RUN");
    }
}
