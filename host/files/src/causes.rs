//! An error and its causes in one line.
//!
//! # Invariant
//! An error of this workspace describes its own level. Its cause is its `source()` and not part of
//! its message, so a printed chain tells every cause once
//! (`tests::every_level_is_told_once_and_in_one_line`). Names and texts of a file cannot steer the
//! terminal that shows the line (`tests::a_file_cannot_steer_the_terminal_that_shows_its_error`).

use std::error::Error;

/// The most characters of a line, and those that stay of the beginning and of the end of a longer one.
const LONGEST: usize = 2000;
const KEPT: [usize; 2] = [1500, 400];

/// The error's message, then each cause after a colon, as one [`printable`] line. Of a line of more than
/// 2000 characters the middle is left out, because a file can hold a name of any length.
#[must_use]
pub fn in_one_line(error: &(dyn Error + 'static)) -> String {
    let mut line = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        line.push_str(": ");
        line.push_str(&error.to_string());
        cause = error.source();
    }
    cut(with_short_numbers(&printable(line.replace('\n', " ").trim_end())))
}

/// The most characters of a number in a line. The longest f64 that is told apart from its neighbours has 17 digits.
const LONGEST_NUMBER: usize = 40;

/// The text with numbers of more than [`LONGEST_NUMBER`] characters as powers of ten: `Display` writes 1e308 with 309
/// digits.
fn with_short_numbers(line: &str) -> String {
    let mut short = String::with_capacity(line.len());
    let mut rest = line;
    while let Some(start) = rest.find(|c: char| c.is_ascii_digit()) {
        let (before, number) = rest.split_at(start);
        let end = number.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(number.len());
        // A full stop after a number ends the sentence.
        let end = number[..end].trim_end_matches('.').len();
        let (number, after) = number.split_at(end);
        short.push_str(before);
        match number.parse::<f64>() {
            Ok(value) if number.len() > LONGEST_NUMBER && value.is_finite() => {
                short.push_str(&format!("{value:e}"));
            }
            _ => short.push_str(number),
        }
        rest = after;
    }
    short + rest
}

fn cut(line: String) -> String {
    let count = line.chars().count();
    if count <= LONGEST {
        return line;
    }
    let [first, last] = KEPT;
    line.chars().take(first).chain(" ... ".chars()).chain(line.chars().skip(count - last)).collect()
}

/// A text from a device, a file or a client as a part of one line: control characters, which could move a terminal's
/// cursor or forge a line, are escaped.
#[must_use]
pub fn printable(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        if c.is_control() || matches!(c, '\u{2028}' | '\u{2029}') {
            shown.extend(c.escape_default());
        } else {
            shown.push(c);
        }
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io;
    use thiserror::Error;

    #[derive(Debug, Error)]
    enum Told {
        #[error("the link to the camera failed")]
        Link(#[source] io::Error),
        /// Says what its cause says.
        #[error(transparent)]
        Transparent(Box<Told>),
        #[error("a.mcap: the recording's setup does not read: {0}")]
        Damaged(String),
    }

    #[test]
    fn every_level_is_told_once_and_in_one_line() {
        let cause = || io::Error::other("no\ncable");
        let link = || Told::Link(cause());
        assert_eq!(in_one_line(&link()), "the link to the camera failed: no cable");
        let transparent = Told::Transparent(Box::new(link()));
        assert_eq!(in_one_line(&transparent), "the link to the camera failed: no cable");
    }

    #[test]
    fn a_file_cannot_steer_the_terminal_that_shows_its_error() {
        let error = Told::Damaged("unknown field `\u{1b}[2J\r\u{2028}`\n".to_owned());
        let line = in_one_line(&error);
        assert!(line.ends_with(r"unknown field `\u{1b}[2J\r\u{2028}`"), "{line:?}");
        assert!(!line.contains(char::is_control), "{line:?}");
    }

    #[test]
    fn a_number_of_hundreds_of_digits_is_told_as_a_power_of_ten() {
        let line = |text: String| in_one_line(&io::Error::other(text));
        assert_eq!(
            line(format!("dark is {}, expected 0 to 8191.5", 1e308)),
            "dark is 1e308, expected 0 to 8191.5"
        );
        assert_eq!(
            line(format!("it is {}.", -f64::MIN_POSITIVE)),
            "it is -2.2250738585072014e-308."
        );
        // Not a number of ours.
        let digits = "7".repeat(400);
        assert_eq!(line(digits.clone()), digits);
        assert_eq!(
            line("0.30000000000000004 of 18446744073709551615".into()),
            "0.30000000000000004 of 18446744073709551615"
        );
    }

    /// Found by `tests/fuzz`: the name of an unknown field fills a terminal.
    #[test]
    fn of_a_very_long_line_beginning_and_end_stay() {
        let error =
            Told::Damaged(format!("unknown field `{}`, expected `order`", "ä".repeat(1 << 20)));
        let line = in_one_line(&error);
        assert!(line.starts_with("a.mcap: the recording's setup does not read: unknown field `ää"));
        assert!(line.ends_with("ää`, expected `order`") && line.chars().count() <= LONGEST);
    }
}
