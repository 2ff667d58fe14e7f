//! `docs/commands.md` and `docs/command-table.md` are the program's own help. `NIRSPI_BLESS=1` writes the pages.

use crate::bench::Bench;
use crate::help::{Page, pages};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::Path;

const HEAD: &str = "\
# Commands

<!-- Written by host/cli/tests/cli/reference.rs: NIRSPI_BLESS=1 cargo test -p nirspi-cli --test cli reference -->

This page is the program's own help, of a build with the default features. Options of several commands stand once, at the end.
`nirspi COMMAND --help` prints all of them, and `nirspi COMMAND -h` those that most people need. From the repository,
`cargo run --release -- COMMAND` runs `nirspi COMMAND`.

Exit codes: 0 done, 1 failed (one line on stderr says why), 2 used wrongly.
";

const TABLE_HEAD: &str = "\
# Commands at a glance

<!-- Written by host/cli/tests/cli/reference.rs: NIRSPI_BLESS=1 cargo test -p nirspi-cli --test cli reference -->

This page is for people who look for a command. `nirspi` alone prints the same groups on one screen,
`nirspi COMMAND -h` the options that most people need, `--help` all of them.

Options that you need every time go into a settings file (`--settings lab.toml`) or the environment
(`NIRSPI_CAMERA=usb`): [settings](settings.md). Exit codes: 0 done, 1 failed (one line says why), 2
used wrongly.
";

/// Pages of the book that say more of a command.
const MORE: [(&str, &str); 26] = [
    ("demo", "[first picture](first-picture.md)"),
    ("example", "[measurements](measurements.md#try-it-on-an-example)"),
    ("serve", "[live page](live-page.md), [any bench](feeds.md)"),
    ("reconstruct", "[measurements](measurements.md), [methods](reconstruction.md)"),
    ("inspect", "[unknown files](measurements.md#a-file-that-you-do-not-know)"),
    ("readings", "[traces](measurements.md#traces)"),
    ("order", "[live readings](feeds.md)"),
    ("enhance", "[networks](networks.md)"),
    ("deblur", "[networks](networks.md)"),
    ("metrics", "[networks](networks.md#how-to-read-the-figures)"),
    ("recording export", "[recordings](recordings.md#for-other-programs)"),
    ("recording recover", "[recordings](recordings.md)"),
    ("capture", "[recordings](recordings.md), [any bench](feeds.md)"),
    ("camera selftest", "[failed checks](troubleshooting.md#a-self-test-fails)"),
    ("camera model", "[camera description](camera-description.md)"),
    ("camera safety", "[safety](safety.md)"),
    ("camera update", "[update](install.md#update-a-camera)"),
    ("eval table1", "[reproduce](reproduce.md)"),
    ("eval table3", "[reproduce](reproduce.md)"),
    ("eval table4", "[reproduce](reproduce.md)"),
    ("eval quality", "[networks](networks.md)"),
    ("physics rain", "[rain](rain.md)"),
    ("physics range", "[light and range](light.md)"),
    ("dev pairs", "[train a network](training.md)"),
    ("dev bench omp", "[GPU](gpu.md)"),
    ("dev virtual", "[recordings](recordings.md)"),
];

/// An option that at least this number of commands have, with the same words, stands in the shared part of the page.
const SHARED_BY: usize = 3;

/// A part of a help text behind the line of usage.
struct Section<'h> {
    heading: &'h str,
    /// An option each; anything else is one block.
    blocks: Vec<String>,
}

/// What a help text says before its sections, and these.
fn sections(help: &str) -> (String, Vec<Section<'_>>) {
    let lines: Vec<&str> = help.trim_end().lines().map(str::trim_end).collect();
    let usage = lines.iter().position(|line| line.starts_with("Usage: ")).unwrap();
    let is_heading = |line: &str| line.ends_with(':') && !line.starts_with(' ');
    let first = (usage..lines.len()).find(|&at| is_heading(lines[at])).unwrap_or(lines.len());
    let mut found: Vec<Section<'_>> = Vec::new();
    for line in &lines[first..] {
        if is_heading(line) {
            found.push(Section { heading: line, blocks: Vec::new() });
            continue;
        }
        let blocks = &mut found.last_mut().unwrap().blocks;
        let begins = line.trim_start().starts_with('-') && line.len() - line.trim_start().len() < 8;
        match blocks.last_mut() {
            Some(block) if !begins => {
                *block += "\n";
                *block += line;
            }
            _ => blocks.push((*line).to_owned()),
        }
    }
    for section in &mut found {
        section.blocks.iter_mut().for_each(|block| *block = block.trim_end().to_owned());
        section.blocks.retain(|block| !block.starts_with("  -h, --help"));
    }
    (lines[..first].join("\n").trim_end().to_owned(), found)
}

/// The option that a block describes.
fn option(block: &str) -> Option<&str> {
    let words = block.split_whitespace().take_while(|word| word.starts_with('-'));
    words.map(|word| word.trim_end_matches(',')).find(|word| word.starts_with("--"))
}

/// Of each option that several commands have in the same words: heading and words.
fn shared(pages: &[Page]) -> BTreeMap<String, (String, String)> {
    let mut counts: BTreeMap<String, BTreeMap<(String, String), usize>> = BTreeMap::new();
    for page in pages.iter().filter(|page| page.help.contains("\nUsage: ")) {
        for section in sections(&page.help).1 {
            for block in section.blocks {
                if let Some(name) = option(&block) {
                    let same = counts.entry(name.to_owned()).or_default();
                    *same.entry((section.heading.to_owned(), block)).or_default() += 1;
                }
            }
        }
    }
    let most = |same: BTreeMap<(String, String), usize>| {
        let (words, count) = same.into_iter().max_by_key(|(_, count)| *count)?;
        (count >= SHARED_BY).then_some(words)
    };
    counts.into_iter().filter_map(|(name, same)| Some((name, most(same)?))).collect()
}

/// Adds the section of a command: what it does, its own options, and the names of those that it shares.
fn describe(page: &Page, shared: &BTreeMap<String, (String, String)>, text: &mut String) {
    let (mut own, sections) = sections(&page.help);
    let mut names = Vec::new();
    for section in &sections {
        let is_shared = |block: &&String| {
            let common = option(block).and_then(|name| shared.get(name));
            common.is_some_and(|(heading, words)| heading == section.heading && words == *block)
        };
        let (common, left): (Vec<&String>, Vec<&String>) =
            section.blocks.iter().partition(|block| is_shared(block));
        if !left.is_empty() {
            let left: Vec<&str> = left.into_iter().map(String::as_str).collect();
            let gap = if left[0].starts_with("  -") || left[0].starts_with("      --") {
                "\n\n"
            } else {
                "\n"
            };
            write!(own, "\n\n{}\n{}", section.heading, left.join(gap)).unwrap();
        }
        if section.heading != "Every command:" {
            names.extend(common.into_iter().filter_map(|block| option(block)));
        }
    }
    let heading = "#".repeat(page.path.len() + 1);
    write!(text, "\n{heading} {}\n\n```text\n{own}\n```\n", page.name()).unwrap();
    if !names.is_empty() && !page.has_commands {
        let names: Vec<String> = names
            .into_iter()
            .map(|name| format!("[`{name}`](#options-of-several-commands)"))
            .collect();
        write!(text, "\nAlso {}.\n", names.join(", ")).unwrap();
    }
}

fn reference(pages: &[Page]) -> String {
    let shared = shared(pages);
    let (first, commands) = pages.split_first().unwrap();
    let mut text = format!("{HEAD}\n## nirspi\n\n```text\n{}\n```\n", first.help.trim_end());
    commands.iter().for_each(|page| describe(page, &shared, &mut text));
    let mut headings: Vec<&String> = shared.values().map(|(heading, _)| heading).collect();
    headings.sort();
    headings.dedup();
    text += "\n## Options of several commands\n";
    for heading in headings {
        let of = shared.values().filter(|(other, _)| other == heading).map(|(_, words)| &**words);
        let words: Vec<&str> = of.collect();
        write!(text, "\n```text\n{heading}\n{}\n```\n", words.join("\n\n")).unwrap();
    }
    text
}

fn table(pages: &[Page]) -> String {
    let mut text = TABLE_HEAD.to_owned();
    let mut group = "";
    let commands = pages.iter().filter(|page| !page.has_commands && !page.path.is_empty());
    for page in commands {
        if page.group != group {
            group = &page.group;
            write!(text, "\n## {group}\n\n| command | what it does | more |\n| -- | -- | -- |\n")
                .unwrap();
        }
        let about: Vec<&str> = page.help.lines().take_while(|line| !line.is_empty()).collect();
        let about = about.join(" ").replace('|', "\\|");
        let (name, path) = (page.name(), page.path.join(" "));
        let more = MORE.iter().find(|(of, _)| *of == path).map_or("", |(_, more)| more);
        let anchor = name.replace(' ', "-");
        writeln!(text, "| [`{name}`](commands.md#{anchor}) | {about} | {more} |").unwrap();
    }
    text
}

#[track_caller]
fn is(name: &str, expected: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs").join(name);
    if std::env::var_os("NIRSPI_BLESS").is_some() {
        std::fs::write(&path, expected).unwrap();
    }
    let found = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(found == expected, "{} is stale: NIRSPI_BLESS=1 writes it", path.display());
}

#[test]
fn the_reference_of_commands_is_the_help_of_this_program() {
    let pages = pages(&Bench::new());
    let text = reference(&pages);
    leaves_no_option_out(&text, &pages);
    is("commands.md", &text);
    is("command-table.md", &table(&pages));
    let paths: BTreeSet<String> = pages.iter().map(|page| page.path.join(" ")).collect();
    let gone: Vec<_> = MORE.iter().filter(|(of, _)| !paths.contains(*of)).collect();
    assert!(gone.is_empty(), "no such commands: {gone:?}");
}

/// Every option of every command stands in the page: in its own part or in the shared one.
fn leaves_no_option_out(text: &str, pages: &[Page]) {
    let (own, shared) = text.split_once("\n## Options of several commands\n").unwrap();
    let mut count = 0;
    for page in pages.iter().filter(|page| !page.has_commands) {
        let heading = format!(" {}\n", page.name());
        let part = own.split("\n#").find(|part| part.trim_start_matches('#').starts_with(&heading));
        let part = part.unwrap_or_else(|| panic!("no part{heading}"));
        for line in page.help.lines().filter(|line| line.starts_with("      --")) {
            let name = option(line).unwrap();
            let named = part.contains(&format!("`{name}`")) || part.contains(line);
            let of_all = shared.contains(line);
            assert!(named || of_all, "{}: {name}", page.name());
            count += 1;
        }
    }
    assert!(count > 400, "{count} options");
}
