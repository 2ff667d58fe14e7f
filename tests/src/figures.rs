//! Figures of pages, and those of the sources that they follow from. A figure is found by its sentence.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use crate::pages::page;

/// Figures are at most this long: `0x000730C0`, `12 480`, `a quarter`.
const LONGEST: usize = 12;

/// A figure in words.
const WORDS: [(&str, f64); 14] = [
    ("one", 1.0),
    ("twice", 2.0),
    ("two", 2.0),
    ("Two", 2.0),
    ("three", 3.0),
    ("four", 4.0),
    ("five", 5.0),
    ("six", 6.0),
    ("eight", 8.0),
    ("ten", 10.0),
    ("a half", 0.5),
    ("a quarter", 0.25),
    ("a fifth", 0.2),
    ("a tenth", 0.1),
];

/// The value of a figure, and what one more in its last digit would be.
fn number(text: &str) -> Option<(f64, f64)> {
    let text = text.replace(' ', "").replace("**", "");
    if let Some((_, value)) = WORDS.iter().find(|(word, _)| word.replace(' ', "") == text) {
        return Some((*value, 1e-9));
    }
    if let Some(hexadecimal) = text.strip_prefix("0x") {
        return Some((u32::from_str_radix(hexadecimal, 16).ok()?.into(), 1.0));
    }
    if let Some(exponent) = text.strip_prefix("2^") {
        return Some((2_f64.powi(exponent.parse().ok()?), 1.0));
    }
    let decimals = text.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    Some((text.parse().ok()?, 0.1_f64.powi(i32::try_from(decimals).unwrap())))
}

/// The figures in the place of each `{}` of a sentence of a page, line ends taken as blanks.
#[track_caller]
pub fn figures(path: &str, sentence: &str) -> Vec<(String, f64, f64)> {
    let text = page(path).split_whitespace().collect::<Vec<_>>().join(" ");
    let mut parts = sentence.split("{}");
    let first = parts.next().unwrap();
    let parts: Vec<&str> = parts.collect();
    let after = |at: usize| {
        let mut rest = &text[at + first.len()..];
        let mut found = Vec::new();
        for part in &parts {
            let end = rest.find(part).filter(|end| *end <= LONGEST)?;
            let (value, step) = number(&rest[..end])?;
            found.push((rest[..end].to_owned(), value, step));
            rest = &rest[end + part.len()..];
        }
        Some(found)
    };
    let found = text.match_indices(first).find_map(|(at, _)| after(at));
    found.unwrap_or_else(|| panic!("{path} has no sentence \"{sentence}\": name the new one here"))
}

/// The sentence has these figures, rounded as they stand there.
#[track_caller]
pub fn says(path: &str, sentence: &str, right: &[f64]) {
    let found = figures(path, sentence);
    assert_eq!(found.len(), right.len(), "{path}: {sentence}");
    for ((shown, value, step), right) in found.iter().zip(right) {
        let is_right = (value - right).abs() <= 0.5 * step * (1.0 + 1e-6);
        assert!(is_right, "{path} says {shown}, the code {right}: {sentence}");
    }
}

/// As [`says`], for one round figure, which may be off by this share.
#[track_caller]
pub fn says_about(path: &str, sentence: &str, right: f64, share: f64) {
    let found = figures(path, sentence);
    let (shown, value, _) = &found[0];
    assert!(
        (value / right - 1.0).abs() <= share,
        "{path} says {shown}, the code {right}: {sentence}"
    );
}

/// The numbers of a source between these texts.
#[track_caller]
pub fn numbers(path: &str, after: &str, until: &str) -> Vec<f64> {
    let text = page(path);
    let Some((_, rest)) = text.split_once(after) else { panic!("{path} has no {after:?}") };
    let between = rest.split_once(until).unwrap().0;
    between.split(',').map(|number| evaluated(number.trim())).collect()
}

/// A constant of a source that is its module's own, by its name: in seconds if it is a time.
#[track_caller]
pub fn constant(path: &str, name: &str) -> f64 {
    let text = page(path);
    let value = text.match_indices(name).find_map(|(at, _)| {
        let before = text[..at].chars().next_back();
        let (kind, value) = text[at + name.len()..].split_once(" = ")?;
        let is_constant = (kind.is_empty() || kind.starts_with(": ")) && !kind.contains('\n');
        let is_whole = before.is_none_or(|c| !c.is_alphanumeric() && c != '_');
        (is_constant && is_whole).then(|| value.split([';', ',', '\n']).next().unwrap())
    });
    evaluated(value.unwrap_or_else(|| panic!("{path} has no constant {name}")))
}

/// The value of a number, a shift, or a time in seconds.
#[track_caller]
fn evaluated(expression: &str) -> f64 {
    for (unit, seconds) in [("secs", 1.0), ("millis", 1e-3)] {
        let inside = expression.strip_prefix(&format!("Duration::from_{unit}("));
        if let Some(number) = inside.and_then(|rest| rest.strip_suffix(')')) {
            return seconds * evaluated(number);
        }
    }
    if let Some((number, places)) = expression.split_once(" << ") {
        return evaluated(number) * evaluated(places).exp2();
    }
    expression.replace('_', "").parse().unwrap_or_else(|_| panic!("not a number: {expression}"))
}
