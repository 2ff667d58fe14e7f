//! Reads tables of the pages under `docs/`, for tests that compare a table with its subject.

use crate::root;
use std::collections::BTreeMap;

/// A page, by its path in the repository.
///
/// # Panics
/// If it cannot be read.
#[must_use]
pub fn page(path: &str) -> String {
    std::fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// Rows of the table under this heading, without the header row; cells are trimmed of spaces and
/// backticks.
///
/// # Panics
/// If there is no such heading.
#[must_use]
pub fn table(page: &str, heading: &str) -> Vec<Vec<String>> {
    let Some((_, rest)) = page.split_once(&format!("\n{heading}\n")) else {
        panic!("no heading {heading:?}");
    };
    let rows = rest.lines().take_while(|line| !line.starts_with('#'));
    let cell = |cell: &str| cell.trim().trim_matches('`').to_owned();
    let is_rule = |row: &&str| row.chars().all(|c| "|-: ".contains(c));
    rows.filter_map(|line| line.strip_prefix("| ")?.strip_suffix(" |"))
        .filter(|row| !is_rule(row))
        .skip(1)
        .map(|row| row.split(" | ").map(cell).collect())
        .collect()
}

/// The column under this title of the table under this heading, by the first cell of each row. Empty if the table has no
/// such column.
///
/// # Panics
/// If there is no such heading.
#[must_use]
pub fn column(page: &str, heading: &str, title: &str) -> BTreeMap<String, String> {
    let Some((_, rest)) = page.split_once(&format!("\n{heading}\n")) else {
        panic!("no heading {heading:?}");
    };
    let cells =
        |row: &str| row.trim_matches('|').split(" | ").map(str::trim).position(|c| c == title);
    let Some(at) = rest.lines().find(|line| line.starts_with('|')).and_then(cells) else {
        return BTreeMap::new();
    };
    let cell = |row: Vec<String>| Some((row.first()?.clone(), row.get(at)?.clone()));
    table(page, heading).into_iter().filter_map(cell).collect()
}

/// A page without its fenced blocks.
#[must_use]
pub fn unfenced(page: &str) -> String {
    let mut is_fenced = false;
    let mut kept = String::new();
    for line in page.lines() {
        if line.trim_start().starts_with("```") {
            is_fenced = !is_fenced;
        } else if !is_fenced {
            kept.push_str(line);
            kept.push('\n');
        }
    }
    kept
}
