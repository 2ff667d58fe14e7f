//! Tests that `docs/security.md` lists every place of unsafe code, and that every test it names exists.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use nirspi_tests::root;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

const PAGE: &str = "docs/security.md";
const BEGIN: &str = "<!-- unsafe code -->\n";
const END: &str = "<!-- end of unsafe code -->";

/// Rust sources under a folder.
fn sources(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() && !path.ends_with("target") {
            sources(&path, into);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            into.push(path);
        }
    }
}

fn all_sources() -> Vec<PathBuf> {
    let mut found = Vec::new();
    for folder in ["boards", "hdl", "host", "mcu", "tests"] {
        sources(&root().join(folder), &mut found);
    }
    found.sort();
    found
}

/// The reasons for unsafe code in a source, each with the number of its places. The name of the lint is put together, so
/// that this file has none.
fn reasons(text: &str) -> BTreeMap<String, u32> {
    let mut found = BTreeMap::new();
    for place in text.split(concat!("unsafe", "_code,")).skip(1) {
        let reason = place.split_once("reason = \"").unwrap().1.split_once('"').unwrap().0;
        *found.entry(reason.to_owned()).or_default() += 1;
    }
    found
}

#[test]
fn every_place_of_unsafe_code_is_listed_with_its_reason() {
    let mut table = "| file | places | reason |\n| -- | -- | -- |\n".to_owned();
    for path in all_sources() {
        let file = path.strip_prefix(root()).unwrap().display().to_string();
        for (reason, places) in reasons(&std::fs::read_to_string(&path).unwrap()) {
            writeln!(table, "| `{file}` | {places} | {reason} |").unwrap();
        }
    }
    let path = root().join(PAGE);
    let page = std::fs::read_to_string(&path).unwrap();
    let (before, rest) = page.split_once(BEGIN).unwrap();
    let (_, after) = rest.split_once(END).unwrap();
    let made = format!("{before}{BEGIN}\n{table}\n{END}{after}");
    if std::env::var_os("NIRSPI_BLESS").is_some() {
        std::fs::write(&path, &made).unwrap();
    } else {
        assert!(page == made, "{PAGE} is stale: NIRSPI_BLESS=1 cargo test --test security_page");
    }
}

#[test]
fn every_test_that_the_page_names_exists() {
    let page = std::fs::read_to_string(root().join(PAGE)).unwrap();
    let code: String =
        all_sources().iter().map(|path| std::fs::read_to_string(path).unwrap()).collect();
    let attacks = page.split("## What is tried on us").nth(1).unwrap();
    let attacks = attacks.split("## Unsafe code").next().unwrap();
    let rows = attacks.lines().filter(|line| line.starts_with("| ")).skip(2);
    let mut named = 0;
    for row in rows {
        let cell = row.trim_end_matches(" |").rsplit('|').next().unwrap();
        for name in cell.split('`').skip(1).step_by(2).filter(|name| !name.contains(' ')) {
            assert!(code.contains(&format!("fn {name}(")), "{name}");
            named += 1;
        }
    }
    assert!(named > 10, "{named}");
}
