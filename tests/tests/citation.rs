//! Tests that the file by which people cite this program names this version, and the paper that the README names.

use nirspi_tests::root;

#[test]
fn the_citation_names_this_version_and_the_paper() {
    let read = |name: &str| std::fs::read_to_string(root().join(name)).unwrap();
    let citation = read("CITATION.cff");
    let line = format!("\nversion: {}\n", env!("CARGO_PKG_VERSION"));
    assert!(citation.contains(&line), "expected{line}in {citation}");
    let doi = citation.lines().find_map(|line| line.trim().strip_prefix("doi: ")).unwrap();
    assert!(read("README.md").contains(&format!("https://doi.org/{doi}")), "{doi}");
}
