//! The page's tooltips are the glossary's sentences.

use std::collections::BTreeMap;
use std::path::Path;

/// Each word of the glossary and what it says of it.
fn glossary(page: &str) -> BTreeMap<&str, String> {
    let entries = page.split("\n- **").skip(1);
    entries
        .filter_map(|entry| entry.split_once("**: "))
        .map(|(word, meaning)| (word, meaning.split_whitespace().collect::<Vec<_>>().join(" ")))
        .collect()
}

#[test]
fn tooltips_of_the_page_are_the_glossarys_sentences() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let read = |name: &str| std::fs::read_to_string(root.join(name)).unwrap();
    let text = read("../docs/glossary.md");
    let glossary = glossary(&text);
    assert!(glossary.keys().is_sorted() && glossary.len() > 20, "{:?}", glossary.keys());
    let page = read("serve/src/page/words.js");
    let (before, rest) = page.split_once("const MEANINGS = ").unwrap();
    let (object, after) = rest.split_once(";\n").unwrap();
    let found: BTreeMap<String, String> =
        serde_json::from_str(&object.replacen(",\n}", "\n}", 1)).unwrap();
    assert!(found.len() > 5, "{found:?}");
    let fresh: BTreeMap<&str, &str> = found
        .keys()
        .map(|word| {
            // A heading counts several of a thing.
            let one = word.strip_suffix('s').filter(|one| glossary.contains_key(one));
            let meaning = glossary.get(one.unwrap_or(word));
            (word.as_str(), meaning.expect("every word of the page is in the glossary").as_str())
        })
        .collect();
    let lines: Vec<String> =
        fresh.iter().map(|(word, meaning)| format!("  {word:?}: {meaning:?},\n")).collect();
    let wanted = format!("{before}const MEANINGS = {{\n{}}};\n{after}", lines.concat());
    if std::env::var_os("NIRSPI_BLESS").is_some() {
        std::fs::write(root.join("serve/src/page/words.js"), wanted).unwrap();
    } else {
        assert_eq!(page, wanted, "NIRSPI_BLESS=1 cargo test --test library glossary rewrites them");
    }
}
