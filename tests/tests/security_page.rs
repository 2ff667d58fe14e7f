//! Tests that `docs/log/security.md` lists every place of unsafe code, and that every test that `docs/security.md` names
//! exists.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use nirspi_tests::root;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

const PAGE: &str = "docs/log/security.md";
const ATTACKS: &str = "docs/security.md";
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

/// Crates that do not deny unsafe code, each with the reason in its `Cargo.toml`. Without a reason the crate may have none.
fn crates_that_allow_it() -> BTreeMap<PathBuf, Option<String>> {
    let mut found = BTreeMap::new();
    for source in all_sources() {
        let is_crate = |folder: &&Path| folder.join("Cargo.toml").is_file();
        let folder = source.ancestors().find(is_crate).unwrap();
        let text = std::fs::read_to_string(folder.join("Cargo.toml")).unwrap();
        let own = concat!("unsafe", "_code = \"deny\"");
        if !text.contains("[lints]\nworkspace = true\n") && !text.contains(own) {
            let reason = text.split_once("[package.metadata.nirspi]\nunsafe = \"");
            let reason = reason.and_then(|(_, rest)| rest.split_once("\"\n"));
            found.insert(folder.to_owned(), reason.map(|(reason, _)| reason.to_owned()));
        }
    }
    found
}

/// The number of times that code says the word.
fn unsafe_places(text: &str) -> usize {
    let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
    let is_name = |letter: char| letter.is_alphanumeric() || letter == '_';
    code.flat_map(|line| line.split(|letter| !is_name(letter)))
        .filter(|&word| word == "unsafe")
        .count()
}

/// Every workspace denies what its crates leave to their workspace.
#[test]
fn every_workspace_denies_unsafe_code() {
    for workspace in ["Cargo.toml", "boards/Cargo.toml"] {
        let text = std::fs::read_to_string(root().join(workspace)).unwrap();
        let lints = text.split_once("[workspace.lints.rust]\n").unwrap().1;
        let lints = lints.split("\n\n").next().unwrap();
        assert!(lints.contains(concat!("unsafe", "_code = \"deny\"")), "{workspace}");
    }
}

#[test]
fn every_place_of_unsafe_code_is_listed_with_its_reason() {
    let mut table = "| file | places | reason |\n| -- | -- | -- |\n".to_owned();
    let allowing = crates_that_allow_it();
    for path in all_sources() {
        let file = path.strip_prefix(root()).unwrap().display().to_string();
        let text = std::fs::read_to_string(&path).unwrap();
        for (reason, places) in reasons(&text) {
            writeln!(table, "| `{file}` | {places} | {reason} |").unwrap();
        }
        let allowed = path.ancestors().find_map(|folder| allowing.get(folder));
        let (Some(reason), places @ 1..) = (allowed, unsafe_places(&text)) else { continue };
        let Some(reason) = reason else {
            panic!(
                "{file}: unsafe code in a crate whose Cargo.toml neither denies it nor gives a reason"
            );
        };
        writeln!(table, "| `{file}` | {places} | {reason} |").unwrap();
    }
    let path = root().join(PAGE);
    let page = std::fs::read_to_string(&path).unwrap();
    let (before, rest) = page.split_once(BEGIN).unwrap();
    let (_, after) = rest.split_once(END).unwrap();
    let made = format!("{before}{BEGIN}\n{table}\n{END}{after}");
    if std::env::var_os("NIRSPI_BLESS").is_some() {
        std::fs::write(&path, &made).unwrap();
    } else {
        assert!(
            page == made,
            "{PAGE} is stale: NIRSPI_BLESS=1 cargo test --test all security_page"
        );
    }
}

#[test]
fn every_test_that_the_page_names_exists() {
    let page = std::fs::read_to_string(root().join(ATTACKS)).unwrap();
    let code: String =
        all_sources().iter().map(|path| std::fs::read_to_string(path).unwrap()).collect();
    let attacks = page.split("## What is tried on us").nth(1).unwrap();
    let attacks = attacks.split("## Report a vulnerability").next().unwrap();
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
