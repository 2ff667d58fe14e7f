//! Tests that the table of docs/crates.md agrees with `cargo metadata`, and that modules of a crate use each
//! other in one direction.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

mod modules;

use modules::Crate;
use nirspi_tests::root;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What one crate may depend on.
struct Allowed {
    ours: BTreeSet<String>,
    /// `None`: any crate from outside.
    outside: Option<BTreeSet<String>>,
}

fn table() -> BTreeMap<String, Allowed> {
    let page = std::fs::read_to_string(root().join("docs/crates.md")).unwrap();
    let names = |cell: &str| -> BTreeSet<String> {
        cell.split(',').map(|name| name.trim().to_owned()).filter(|name| !name.is_empty()).collect()
    };
    page.lines()
        .filter_map(|line| line.strip_prefix("| `nirspi")?.strip_suffix(" |"))
        .map(|row| {
            let cells: Vec<&str> = row.split('|').collect();
            let [name, ours, outside] = cells[..] else { panic!("three cells in {row:?}") };
            let name = format!("nirspi{}", name.trim().trim_end_matches('`'));
            let outside = (outside.trim() != "any").then(|| names(outside));
            (name, Allowed { ours: names(ours), outside })
        })
        .collect()
}

fn metadata() -> Value {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline"])
        .current_dir(root())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn packages() -> Vec<Value> {
    metadata()["packages"].as_array().unwrap().clone()
}

/// Every dependency that the table forbids, as `user -> used`.
fn violations(packages: &[Value], table: &BTreeMap<String, Allowed>) -> Vec<String> {
    let mut found = Vec::new();
    for package in packages {
        let user = package["name"].as_str().unwrap();
        let Some(allowed) = table.get(user) else {
            found.push(format!("{user} is not in the table"));
            continue;
        };
        for dependency in package["dependencies"].as_array().unwrap() {
            // Tests may use any crate from outside, but no upper layer of this workspace.
            let is_dev = dependency["kind"] == "dev";
            let used = dependency["name"].as_str().unwrap();
            let fine = if used.starts_with("nirspi") {
                allowed.ours.contains(used)
            } else {
                is_dev || allowed.outside.as_ref().is_none_or(|outside| outside.contains(used))
            };
            if !fine {
                found.push(format!("{user} -> {used}"));
            }
        }
    }
    found
}

#[test]
fn crates_use_what_the_architecture_page_allows_and_nothing_else() {
    let table = table();
    let packages = packages();
    assert_eq!(packages.len(), table.len(), "one row a crate");
    let found = violations(&packages, &table);
    assert!(found.is_empty(), "docs/crates.md does not allow: {found:#?}");
}

#[test]
fn a_forbidden_dependency_is_found() {
    let mut packages = packages();
    for package in &mut packages {
        if package["name"] == "nirspi-mcu" {
            package["dependencies"].as_array_mut().unwrap().extend([
                serde_json::json!({"name": "nirspi-recon", "kind": null}),
                serde_json::json!({"name": "embassy-executor", "kind": null}),
            ]);
        }
    }
    let found = violations(&packages, &table());
    assert_eq!(found, ["nirspi-mcu -> nirspi-recon", "nirspi-mcu -> embassy-executor"]);
}

/// Ordinary dependencies of a package of this workspace.
fn ordinary(package: &str) -> Vec<String> {
    let packages = packages();
    let package = packages.iter().find(|found| found["name"] == package).unwrap();
    let ordinary = package["dependencies"].as_array().unwrap().iter();
    ordinary
        .filter(|dependency| dependency["kind"].is_null())
        .map(|dependency| dependency["name"].as_str().unwrap().to_owned())
        .collect()
}

#[test]
fn the_command_line_computes_nothing() {
    let used = ordinary("nirspi-cli");
    for numeric in ["nalgebra", "rand", "rand_distr", "rand_pcg", "rayon", "cubecl"] {
        assert!(!used.iter().any(|used| used == numeric), "nirspi-cli -> {numeric}");
    }
}

/// The most lines of the command line's sources. What does not fit belongs into a library.
const CLI_LINES: usize = 6750;

#[test]
fn the_command_line_has_fewer_lines_than_its_limit() {
    fn lines(folder: &Path) -> usize {
        let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        let count = |path: PathBuf| match path.is_dir() {
            true => lines(&path),
            false => std::fs::read_to_string(&path).unwrap().lines().count(),
        };
        entries.map(count).sum()
    }
    let found = lines(&root().join("host/cli/src"));
    assert!((1000..CLI_LINES).contains(&found), "host/cli/src has {found} lines");
}

/// The library without its features builds no web server, no typefaces, no optics and no networks.
#[test]
fn capture_alone_builds_no_server_no_typefaces_no_optics_and_no_networks() {
    let tree = |more: &[&str]| {
        let output = Command::new(env!("CARGO"))
            .args(["tree", "--locked", "--offline", "--edges", "normal", "--prefix", "none"])
            .args(["--package", "nirspi"])
            .args(more)
            .current_dir(root())
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let text = String::from_utf8(output.stdout).unwrap();
        let first = |line: &str| line.split_whitespace().next().map(str::to_owned);
        text.lines().filter_map(first).collect::<BTreeSet<String>>()
    };
    let (capture, all) = (tree(&["--no-default-features"]), tree(&[]));
    assert!(capture.contains("nirspi-wire") && capture.contains("nirspi-recon"), "{capture:?}");
    for heavy in ["ab_glyph", "pdf-writer", "nirspi-nets", "cubecl"] {
        assert!(all.contains(heavy), "the full library has {heavy}");
        assert!(!capture.contains(heavy), "capture alone builds {heavy}");
    }
}

/// Plain `cargo test` builds no hardware simulator and nothing for browsers, and says so; CI runs the
/// tests left out.
#[test]
fn plain_cargo_test_leaves_out_simulator_and_browser_only_and_ci_runs_the_rest() {
    let metadata = metadata();
    let default: Vec<&Value> =
        metadata["workspace_default_members"].as_array().unwrap().iter().collect();
    let packages = metadata["packages"].as_array().unwrap();
    let name = |package: &Value| package["name"].as_str().unwrap().to_owned();
    let (default, left_out): (Vec<&Value>, Vec<&Value>) =
        packages.iter().partition(|package| default.contains(&&package["id"]));
    // The program for browsers, the Python package, the ELF on a model of its chip and the CUDA driver for tests have steps
    // of their own, and a list of features has nothing to test.
    let (apart, left_out): (Vec<&Value>, Vec<&Value>) = left_out.into_iter().partition(|package| {
        let apart = [
            "nirspi-web",
            "nirspi-python",
            "nirspi-tests-cuda",
            "nirspi-tests-features",
            "nirspi-tests-silicon",
        ];
        apart.contains(&&*name(package))
    });
    let uses_simulator = |package: &&Value| {
        let mut used = package["dependencies"].as_array().unwrap().iter().map(name);
        name(package) == "nirspi-hdl-sim" || used.any(|used| used == "nirspi-hdl-sim")
    };
    let builds: Vec<_> = default.into_iter().filter(uses_simulator).map(name).collect();
    assert!(builds.is_empty(), "plain `cargo test` builds the simulator for {builds:?}");
    let missing: Vec<_> =
        left_out.iter().filter(|package| !uses_simulator(package)).map(|p| name(p)).collect();
    assert!(missing.is_empty(), "not in default-members of Cargo.toml: {missing:?}");

    let packages: String =
        left_out.iter().map(|package| format!(" -p {}", name(package))).collect();
    let steps = std::fs::read_to_string(root().join(".ci/steps.sh")).unwrap();
    assert_eq!(
        apart.len(),
        5,
        "left out: the programs for browsers and Python, the list of features, the model of the chip, the CUDA driver"
    );
    assert!(
        steps.contains("-p nirspi-tests-silicon"),
        ".ci/steps.sh does not run the ELF on a model of its chip"
    );
    assert!(
        steps.contains("cargo test --locked -p nirspi-tests-cuda"),
        ".ci/steps.sh does not run the tests of the CUDA driver"
    );
    assert!(steps.contains("bash host/web/build.sh"), ".ci/steps.sh builds no page for browsers");
    assert!(steps.contains("./host/python\n"), ".ci/steps.sh builds no Python package");
    let with_simulator = format!("cargo test --locked $(default_packages){packages} --test rtl");
    for command in ["cargo test --locked\n", &with_simulator] {
        assert!(steps.contains(command), ".ci/steps.sh has no {command:?}");
    }
    // Prints past the test harness's capture, so that the message is visible.
    let _ = writeln!(
        std::io::stderr(),
        "not run by plain cargo test: the gateware's RTL; cargo test{packages} runs it"
    );
}

/// Crates for computation. The program leaves computation to the libraries.
const COMPUTING: [&str; 5] = ["nalgebra", "rand", "rand_distr", "rand_pcg", "rayon"];

/// The program's ordinary dependencies on crates for computation.
fn computing(packages: &[Value]) -> Vec<&str> {
    let program = packages.iter().find(|package| package["name"] == "nirspi-cli").unwrap();
    let ordinary =
        program["dependencies"].as_array().unwrap().iter().filter(|d| d["kind"].is_null());
    ordinary.map(|d| d["name"].as_str().unwrap()).filter(|name| COMPUTING.contains(name)).collect()
}

#[test]
fn the_program_itself_computes_nothing() {
    let mut packages = packages();
    assert_eq!(computing(&packages), Vec::<&str>::new());
    for package in &mut packages {
        if package["name"] == "nirspi-cli" {
            package["dependencies"].as_array_mut().unwrap().extend([
                serde_json::json!({"name": "rayon", "kind": null}),
                serde_json::json!({"name": "rand", "kind": "dev"}),
            ]);
        }
    }
    assert_eq!(computing(&packages), ["rayon"], "a forbidden dependency is found");
}

/// The root of every library and program of this repository, of every workspace.
fn crate_roots() -> Vec<PathBuf> {
    fn search(folder: &Path, found: &mut Vec<PathBuf>) {
        if folder.join("Cargo.toml").is_file() {
            let sources = folder.join("src");
            let programs = std::fs::read_dir(sources.join("bin")).into_iter().flatten();
            let programs = programs.map(|entry| entry.unwrap().path());
            let roots =
                [sources.join("lib.rs"), sources.join("main.rs")].into_iter().chain(programs);
            found.extend(roots.filter(|root| root.is_file()));
        }
        for entry in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            let name = entry.file_name().unwrap().to_string_lossy();
            // Built files, and data that is not part of the repository.
            let skipped =
                name.starts_with('.') || ["target", "shared", "node_modules"].contains(&&*name);
            if entry.is_dir() && !entry.is_symlink() && !skipped {
                search(&entry, found);
            }
        }
    }
    let mut found = Vec::new();
    search(&root().canonicalize().unwrap(), &mut found);
    found.sort();
    found
}

#[test]
fn modules_of_a_crate_use_each_other_in_one_direction() {
    let roots = crate_roots();
    let named = |path: &str| roots.iter().any(|root| root.ends_with(path));
    assert!(roots.len() > 25, "{roots:#?}");
    assert!(named("host/src/lib.rs") && named("boards/app/src/lib.rs"), "{roots:#?}");
    let repository = format!("{}/", root().canonicalize().unwrap().display());
    let mut found = Vec::new();
    for root in &roots {
        for knot in Crate::read(root).knots() {
            found.push(format!("{}: {knot}", root.display()).replace(&repository, ""));
        }
    }
    assert!(found.is_empty(), "a module belongs below those that use it:\n{}", found.join("\n"));
}

/// Who calls a method of reconstruction, and why it is no caller of `nirspi::reconstruct`, which makes the images of files,
/// recordings and exports.
const CALLERS: [(&str, &str); 10] = [
    ("host/eval/src/completion.rs", "judges methods"),
    ("host/eval/src/sampling.rs", "judges methods"),
    ("host/eval/src/trust/shots.rs", "judges methods"),
    ("host/eval/src/video.rs", "judges methods"),
    ("host/lesson/src/lesson.rs", "shows one number at a time, in a browser"),
    ("host/python/src/reconstruct.rs", "images of NumPy's arrays"),
    ("host/serve/src/imaging.rs", "pages change the method from picture to picture"),
    ("host/serve/src/own.rs", "the same with patterns of a user's own"),
    ("host/src/inspect/trial.rs", "tries forms of readings"),
    ("host/virtual/src/look.rs", "a simulated scene in shares of its white sheet"),
];

/// Files in which a method is made ready to be called, without tests, and without the crates of the methods.
fn callers(folder: &Path, found: &mut Vec<String>) {
    for entry in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        let name = entry.file_name().unwrap().to_string_lossy();
        let left_out =
            ["tests", "tests.rs", "benches", "examples", "target", "recon", "omp", "own", "nets"];
        if left_out.contains(&&*name) || entry.is_symlink() {
            continue;
        }
        if entry.is_dir() {
            callers(&entry, found);
        } else if name.ends_with(".rs") {
            let text = std::fs::read_to_string(&entry).unwrap();
            let code = text.split("#[cfg(test)]").next().unwrap();
            let calls = |line: &str| {
                !line.trim_start().starts_with("//")
                    && (line.contains("ethod.prepare(") || line.contains("OwnMatrix::new("))
            };
            if code.lines().any(calls) {
                found.push(entry.strip_prefix(root()).unwrap().display().to_string());
            }
        }
    }
}

#[test]
fn images_are_made_in_one_place_and_by_those_who_cannot_use_it() {
    let mut found = Vec::new();
    callers(&root().join("host"), &mut found);
    found.retain(|file| !file.starts_with("host/src/reconstruct/"));
    found.sort();
    assert_eq!(found, CALLERS.map(|(file, _)| file));
}
