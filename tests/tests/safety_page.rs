//! Tests that the tables of `docs/log/safety.md` are what `nirspi camera safety` prints, and that every test and proof that the safety
//! case names exists.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use nirspi_eval::safety_case::{DarkAfter, FAULTS, SafetyCase};
use nirspi_optics::CameraModel;
use nirspi_tests::root;
use std::path::Path;

const PAGE: &str = "docs/log/safety.md";

/// The page with this block written anew, between its two comments.
fn with_block(page: &str, name: &str, table: &str) -> String {
    let (begin, end) = (format!("<!-- {name} -->\n"), format!("<!-- end of {name} -->"));
    let (before, rest) = page.split_once(&begin).unwrap_or_else(|| panic!("{PAGE} has no {begin}"));
    let (_, after) = rest.split_once(&end).unwrap_or_else(|| panic!("{PAGE} has no {end}"));
    format!("{before}{begin}\n{table}\n{end}{after}")
}

/// Lines of at most 100 characters, as every page has them.
fn wrapped(sentence: &str) -> String {
    let mut lines = vec![String::new()];
    for word in sentence.split(' ') {
        let line = lines.last().unwrap();
        match (line.is_empty(), line.len() + 1 + word.len() <= 100) {
            (true, _) => lines.last_mut().unwrap().push_str(word),
            (false, true) => *lines.last_mut().unwrap() = format!("{line} {word}"),
            (false, false) => lines.push(word.to_owned()),
        }
    }
    lines.join("\n")
}

#[test]
fn the_tables_of_the_page_are_those_of_the_command() {
    let path = root().join(PAGE);
    let page = std::fs::read_to_string(&path).unwrap();
    let mut made = page.clone();
    for name in ["paper", "one-metre"] {
        let case = SafetyCase::of(&CameraModel::named(name).unwrap()).unwrap();
        made = with_block(
            &made,
            &format!("light of {name}"),
            &format!("{}\n{}\n", case.exposure_table(), wrapped(&case.risk_groups())),
        );
        if name == "paper" {
            made = with_block(&made, "single faults", &case.fault_table());
        }
    }
    if std::env::var_os("NIRSPI_BLESS").is_some() {
        std::fs::write(&path, &made).unwrap();
    } else {
        assert!(page == made, "{PAGE} is stale: NIRSPI_BLESS=1 cargo test --test all safety_page");
    }
}

/// Sources under a folder, one after the other.
fn sources(folder: &Path, into: &mut String) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let extension = path.extension().and_then(|extension| extension.to_str());
        if path.is_dir() && !path.ends_with("target") {
            sources(&path, into);
        } else if matches!(extension, Some("rs" | "sv" | "py")) && !path.ends_with("faults.rs") {
            into.push_str(&std::fs::read_to_string(&path).unwrap());
        }
    }
}

#[test]
fn every_barrier_is_shown_by_a_test_or_proof_that_exists() {
    let mut text = String::new();
    for folder in ["hdl", "mcu", "tests/tests", "tests/silicon/src", "boards"] {
        sources(&root().join(folder), &mut text);
    }
    for fault in FAULTS {
        let is_ended = fault.dark_after != DarkAfter::Never;
        assert_eq!(is_ended, !fault.shown_by.is_empty(), "{}", fault.fault);
        for name in fault.shown_by {
            let known = [format!("fn {name}("), format!("module {name}"), format!("{name}:")];
            assert!(known.iter().any(|form| text.contains(form)), "{name}: {}", fault.fault);
        }
    }
}
