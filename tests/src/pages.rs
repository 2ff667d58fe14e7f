//! Tables of the pages under `docs/`, which tests hold against what they are about.

use crate::root;

/// A page, by its path in the repository.
///
/// # Panics
/// If it cannot be read.
#[must_use]
pub fn page(path: &str) -> String {
    std::fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// Rows of the table under this heading, its own heading left out: cells without spaces and backticks around them.
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
    rows.filter_map(|line| line.strip_prefix("| ")?.strip_suffix(" |"))
        .skip(1)
        .map(|row| row.split(" | ").map(cell).collect())
        .collect()
}
