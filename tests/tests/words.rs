//! Tests that the user's book is one that is read: a page answers its question in at most 1200 words, its sentences carry few
//! numbers, and the whole has a length that a person can know.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use nirspi_tests::pages::unfenced;
use nirspi_tests::root;
use std::path::Path;

const WORDS_OF_A_PAGE: usize = 1200;
/// Of `measurements.md`, which people read from its beginning although it is reference.
const WORDS_OF_MEASUREMENTS: usize = 1500;
const WORDS_OF_THE_BOOK: usize = 45_000;
const NUMBERS_IN_100_WORDS: f64 = 4.0;
/// Below so many words of prose, a single number is a large share.
const LEAST_PROSE: usize = 100;
/// Tests write these pages.
const GENERATED: [&str; 5] =
    ["command-table.md", "commands.md", "python-reference.md", "registers.md", "report.md"];

/// A page of the user's book.
struct Page {
    name: String,
    is_reference: bool,
    /// Words of text and tables, without blocks of code.
    words: usize,
    prose: Prose,
}

/// Text outside tables, code and addresses.
struct Prose {
    words: usize,
    numbers: usize,
}

fn has_letter_or_digit(word: &&str) -> bool {
    word.chars().any(char::is_alphanumeric)
}

/// Without what stands between two marks, such as a pair of backticks, or the address behind a link's text.
fn without(text: &str, open: &str, close: &str) -> String {
    let mut kept = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once(open) {
        kept.push_str(before);
        kept.push(' ');
        rest = after.split_once(close).map_or("", |(_, behind)| behind);
    }
    kept + rest
}

/// Whether a word is a number, perhaps with its unit: `LD1` and `TIM3` are names.
fn is_number(word: &&str) -> bool {
    let word = word.trim_start_matches(['(', '[', '-', '+', '~', '*', '"']);
    word.starts_with(|letter: char| letter.is_ascii_digit())
}

/// What the number behind such a word is the name of.
const NAMED: [&str; 6] = ["Eq.", "Fig.", "Table", "Algorithm", "section", "step"];

/// Words and numbers of a text without code. `32 x 32` is one number; the number of a step, an equation or a table is none.
fn prose(text: &str) -> Prose {
    let lines = text.lines().filter(|line| !line.trim_start().starts_with('|'));
    let lines = lines.map(|line| match line.trim_start().split_once(". ") {
        Some((step, rest)) if step.parse::<u32>().is_ok() => rest,
        _ => line,
    });
    let text = lines.collect::<Vec<_>>().join("\n");
    let text = without(&without(&text, "`", "`"), "](", ")");
    let text = without(&text, "<http", ">");
    let words: Vec<&str> = text.split_whitespace().collect();
    let is_counted = |at: usize| {
        let before = at.checked_sub(1).map_or("", |at| words[at].trim_start_matches(['*', '(']));
        let is_second_side = before == "x" && at > 1 && is_number(&words[at - 2]);
        is_number(&words[at]) && !is_second_side && !NAMED.contains(&before)
    };
    let numbers = (0..words.len()).filter(|&at| is_counted(at)).count();
    Prose { words: words.iter().filter(|word| has_letter_or_digit(word)).count(), numbers }
}

/// The pages that the summary names, with the part of the book in which each stands.
fn pages() -> Vec<Page> {
    let docs = root().join("docs");
    let summary = std::fs::read_to_string(docs.join("SUMMARY.md")).unwrap();
    let mut part = "";
    let mut found = Vec::new();
    for line in summary.lines() {
        if let Some(name) = line.strip_prefix("# ") {
            part = name;
        } else if let Some((_, target)) = line.split_once("](") {
            let name = target.trim_end_matches(')').to_owned();
            if Path::new(&name).extension().is_some_and(|kind| kind == "md")
                && !GENERATED.contains(&name.as_str())
            {
                let text = unfenced(&std::fs::read_to_string(docs.join(&name)).unwrap());
                let words = text.split_whitespace().filter(has_letter_or_digit).count();
                found.push(Page {
                    is_reference: part == "Reference",
                    words,
                    prose: prose(&text),
                    name,
                });
            }
        }
    }
    found
}

#[test]
fn a_page_has_one_question_and_the_book_a_length_that_is_read() {
    let pages = pages();
    assert!(pages.len() > 30, "{} pages found", pages.len());
    let longest = |page: &Page| match (page.name.as_str(), page.is_reference) {
        ("measurements.md", _) => WORDS_OF_MEASUREMENTS,
        (_, true) => usize::MAX,
        (_, false) => WORDS_OF_A_PAGE,
    };
    let long: Vec<_> = pages.iter().filter(|page| page.words > longest(page)).collect();
    let long: Vec<_> =
        long.iter().map(|page| format!("{}: {} words", page.name, page.words)).collect();
    assert!(long.is_empty(), "too long, so cut, or move to docs/log: {long:#?}");
    let words: usize = pages.iter().map(|page| page.words).sum();
    println!("{words} words in {} pages", pages.len());
    assert!(words <= WORDS_OF_THE_BOOK, "{words} words, at most {WORDS_OF_THE_BOOK}");
}

#[test]
fn sentences_carry_few_numbers() {
    let share = |prose: &Prose| 100.0 * prose.numbers as f64 / prose.words as f64;
    let pages = pages();
    let dense = pages.iter().filter(|page| {
        page.prose.words >= LEAST_PROSE && share(&page.prose) > NUMBERS_IN_100_WORDS
    });
    let dense: Vec<_> =
        dense.map(|page| format!("{}: {:.1}", page.name, share(&page.prose))).collect();
    assert!(
        dense.is_empty(),
        "numbers in 100 words of prose, which a table or docs/log would show better: {dense:#?}"
    );
}

#[test]
fn numbers_are_counted_as_a_reader_sees_them() {
    let page = "1. Show 32 x 32 pixels (5 V) on `12` lines\n\n| 1 | 2 |\n\nSee [3 of LD1](log/9.md#8), -2.5 dB in **Eq. (1)**.\n";
    let Prose { words, numbers } = prose(&unfenced(page));
    assert_eq!((words, numbers), (18, 4));
}
