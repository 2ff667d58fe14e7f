//! Tests that the pages under `docs/` make two books, the user's book and the engineering log: every page is in the summary
//! of its book, every link leads to something, and the table of variables names every variable of the code.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use nirspi_tests::pages::unfenced;
use nirspi_tests::root;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Folders of the user's book and of the engineering log.
const BOOKS: [&str; 2] = ["docs", "docs/log"];

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The place after the code that a run of this many backticks has begun.
fn end_of_code(text: &str, backticks: usize) -> Option<usize> {
    let mut at = 0;
    while let Some(next) = text[at..].find('`') {
        let start = at + next;
        let length = text[start..].bytes().take_while(|&byte| byte == b'`').count();
        at = start + length;
        if length == backticks {
            return Some(at);
        }
    }
    None
}

/// A paragraph without its code.
fn without_code(paragraph: &str) -> String {
    let mut kept = String::new();
    let mut rest = paragraph;
    while let Some(start) = rest.find('`') {
        let backticks = rest[start..].bytes().take_while(|&byte| byte == b'`').count();
        kept.push_str(&rest[..start]);
        rest = &rest[start + backticks..];
        if let Some(end) = end_of_code(rest, backticks) {
            rest = &rest[end..];
        }
    }
    kept + rest
}

/// Targets of all links and images of a page.
fn links(page: &str) -> Vec<String> {
    let paragraphs: Vec<String> = unfenced(page).split("\n\n").map(without_code).collect();
    let text = paragraphs.join("\n\n");
    let targets = text.split("](").skip(1).filter_map(|rest| rest.split([')', ' ', '\n']).next());
    targets.map(str::to_owned).collect()
}

/// The anchor that GitHub and mdBook give a heading.
fn anchor(heading: &str) -> String {
    let letters = heading.chars().filter_map(|letter| match letter {
        ' ' => Some('-'),
        '-' | '_' => Some(letter),
        _ if letter.is_alphanumeric() => letter.to_lowercase().next(),
        _ => None,
    });
    letters.collect()
}

/// Anchors of all headings of a page.
fn anchors(page: &str) -> BTreeSet<String> {
    let is_heading = |line: &&str| line.starts_with('#');
    let page = unfenced(page);
    page.lines().filter(is_heading).map(|line| anchor(line.trim_matches(['#', ' ']))).collect()
}

/// Whether a link of this page leads to no file, or to no heading of the file.
fn leads_nowhere(page: &Path, link: &str) -> bool {
    if link.contains("://") || link.starts_with("mailto:") {
        return false;
    }
    let (file, anchor) = link.split_once('#').unwrap_or((link, ""));
    let target = match file {
        "" => page.to_owned(),
        file => page.parent().unwrap().join(file),
    };
    let is_page = target.extension().is_some_and(|extension| extension == "md");
    !target.exists() || (is_page && !anchor.is_empty() && !anchors(&read(&target)).contains(anchor))
}

/// Markdown files of a folder, by name.
fn pages(folder: &Path) -> BTreeSet<String> {
    let names = folder.read_dir().unwrap().map(|entry| entry.unwrap().file_name());
    names.filter_map(|name| name.into_string().ok()).filter(|name| name.ends_with(".md")).collect()
}

/// Every page that people read in the repository.
fn all_pages() -> Vec<PathBuf> {
    let boards = root().join("boards");
    let mut all = vec![root().join("README.md"), boards.join("README.md")];
    for book in BOOKS {
        all.extend(pages(&root().join(book)).iter().map(|name| root().join(book).join(name)));
    }
    let folders = boards.read_dir().unwrap().map(|entry| entry.unwrap().path());
    all.extend(folders.map(|folder| folder.join("README.md")).filter(|page| page.is_file()));
    all
}

#[test]
fn every_page_is_in_the_summary_once_and_every_entry_is_a_page() {
    for book in BOOKS {
        let folder = root().join(book);
        let entries = links(&read(&folder.join("SUMMARY.md")));
        let listed: BTreeSet<String> = entries.iter().cloned().collect();
        assert_eq!(entries.len(), listed.len(), "an entry twice in {book}/SUMMARY.md: {entries:?}");
        let mut there = pages(&folder);
        assert!(there.remove("SUMMARY.md"));
        let missing: Vec<_> = there.difference(&listed).collect();
        assert!(missing.is_empty(), "add to {book}/SUMMARY.md: {missing:?}");
        let gone: Vec<_> = listed.difference(&there).collect();
        assert!(gone.is_empty(), "{book}/SUMMARY.md names pages that do not exist: {gone:?}");
    }
}

#[test]
fn every_link_leads_to_a_file_and_every_anchor_to_a_heading() {
    let mut broken = Vec::new();
    let mut checked = 0;
    for page in all_pages() {
        for link in links(&read(&page)) {
            checked += 1;
            if leads_nowhere(&page, &link) {
                broken.push(format!("{}: {link}", page.strip_prefix(root()).unwrap().display()));
            }
        }
    }
    assert!(checked > 100, "{checked} links");
    assert!(broken.is_empty(), "links that lead nowhere: {broken:#?}");
}

/// Files under a folder whose text may name a variable: sources, scripts, settings.
fn code(folder: &Path, into: &mut Vec<PathBuf>) {
    let endings = ["rs", "py", "sh", "toml", "yml"];
    let is_code = |path: &Path| match path.extension() {
        Some(ending) => endings.iter().any(|code| ending == *code),
        None => path.ends_with(".ci/run"),
    };
    for entry in folder.read_dir().unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() && !path.ends_with("target") {
            code(&path, into);
        } else if is_code(&path) {
            into.push(path);
        }
    }
}

/// Names of the variables in a text: `NIRSPI_`, then capitals.
fn variables(text: &str) -> BTreeSet<String> {
    let is_part = |c: char| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_';
    let names = text.split("NIRSPI_").skip(1).map(|rest| {
        let end = rest.find(|c| !is_part(c)).unwrap_or(rest.len());
        rest[..end].trim_end_matches('_')
    });
    names.filter(|name| !name.is_empty()).map(|name| format!("NIRSPI_{name}")).collect()
}

#[test]
fn the_table_of_variables_names_every_variable_of_the_code_that_is_no_option() {
    let mut files = vec![root().join(".justfile")];
    for folder in [".ci", ".github", "boards", "hdl", "host", "mcu", "tests"] {
        code(&root().join(folder), &mut files);
    }
    let mut found: BTreeSet<String> =
        files.iter().flat_map(|file| variables(&read(file))).collect();
    // `NIRSPI_DISTANCE_M` is the option `--distance-m`.
    let commands = read(&root().join("docs/commands.md"));
    let options: BTreeSet<&str> = commands.split_whitespace().collect();
    let option =
        |name: &str| format!("--{}", name["NIRSPI_".len()..].to_lowercase().replace('_', "-"));
    let page = read(&root().join("docs/contributing.md"));
    let rows = page.lines().filter(|line| line.starts_with("| `NIRSPI_"));
    let listed = variables(&rows.filter_map(|row| row.split(" | ").next()).collect::<String>());
    // `NIRSPI_DATA` is both: the tests' folder, and the option `--data` of `nirspi dev pairs`.
    found.retain(|name| listed.contains(name) || !options.contains(option(name).as_str()));
    assert_eq!(
        found, listed,
        "left: variables of the code, right: the table of docs/contributing.md"
    );
}

#[test]
fn a_broken_link_is_found_and_a_link_in_code_is_none() {
    let readme = root().join("README.md");
    for link in ["docs/none.md", "#none", "docs/glossary.md#none"] {
        assert!(leads_nowhere(&readme, link), "{link}");
    }
    for link in
        ["docs/glossary.md", "#boards", "docs/log/physics.md#8-photon-budget", "https://a.b/#c"]
    {
        assert!(!leads_nowhere(&readme, link), "{link}");
    }
    let page = "[`a`](a.md) `[b](b.md)` ![c\nd](c.png)\n\n```text\n[e](e.md)\n# No heading\n```\n";
    assert_eq!(links(page), ["a.md", "c.png"]);
    assert!(anchors(page).is_empty());
}

#[test]
fn the_page_of_camera_descriptions_has_every_table_of_a_description() {
    let tables = |text: &str, is_row: fn(&str) -> Option<&str>| -> BTreeSet<String> {
        text.lines()
            .filter_map(is_row)
            .map(|row| row.split(']').next().unwrap().to_owned())
            .collect()
    };
    let of_page =
        tables(&read(&root().join("docs/camera-description.md")), |line| line.strip_prefix("| `["));
    let paper = read(&root().join("host/optics/cameras/paper.toml"));
    assert_eq!(of_page, tables(&paper, |line| line.strip_prefix('[')));
}

/// Pictures that no command of `docs/pictures.sh` makes: those of a browser.
const OF_A_BROWSER: [&str; 2] = ["browser.png", "serve.png"];
/// Width of a figure for paper, 178 mm or 85 mm at 300 dpi.
const PAPER_PX: [u32; 2] = [2102, 1004];

/// The PNG files of a folder and of the folders in it, but for notebooks, whose cells make them, and the engineering log's own.
fn pictures(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut found = Vec::new();
    for path in entries.filter(|path| !path.ends_with("notebooks") && !path.ends_with("docs/log")) {
        match path.is_dir() {
            true => found.extend(pictures(&path)),
            false if path.extension().is_some_and(|ending| ending == "png") => found.push(path),
            false => {}
        }
    }
    found
}

#[test]
fn one_script_makes_every_picture_of_the_pages_for_paper() {
    let script = read(&root().join("docs/pictures.sh"));
    let words: BTreeSet<&str> =
        script.split(|c: char| !(c.is_alphanumeric() || c == '_')).collect();
    let mut count = 0;
    for path in pictures(&root().join("docs")) {
        let name = path.file_name().unwrap().to_str().unwrap();
        if OF_A_BROWSER.contains(&name) {
            continue;
        }
        let stem = path.file_stem().unwrap().to_str().unwrap();
        assert!(words.contains(stem), "docs/pictures.sh does not make {}", path.display());
        // The width stands in the first chunk of a PNG.
        let bytes = std::fs::read(&path).unwrap();
        let width = u32::from_be_bytes(bytes[16..20].try_into().unwrap());
        assert!(PAPER_PX.contains(&width), "{}: {width} pixels wide", path.display());
        count += 1;
    }
    assert!(count >= 18, "{count} pictures");
}
