//! Reads numbers in a text file of a spreadsheet or a logger: `.csv`, `.txt`, with decimal points
//! or commas.
//!
//! # Invariant
//! A comma is never guessed to be a decimal comma
//! (`tests::a_decimal_comma_is_seen_where_the_file_shows_it_and_asked_for_where_not`). A comma is
//! decimal only if the user says so, or if the file shows it in one of three ways: numbers are
//! separated by semicolons, tabs or blanks; a number has digits that a whole number does not have,
//! as in `0,05` or `1,5E-3`; some numbers of a line have commas and others have none. One comma a
//! line, under a heading of two names, separates two columns.

mod export;
mod number;

pub use number::parse;

use super::FileError;
use super::field::Field;
use super::formats::EXPECTED;
use super::plain::{is_heading, read_large_text, start_of_text};
use crate::provenance;
use rayon::prelude::*;
use std::path::Path;

/// What a text file holds.
pub(super) struct Text {
    pub(super) numbers: Numbers,
    /// What was left out, in one line.
    pub(super) skipped: Option<String>,
    /// The provenance in a comment, as JSON.
    pub(super) provenance: Option<String>,
}

/// The numbers of a text file.
pub(super) enum Numbers {
    /// Columns with names from a heading.
    Columns(Vec<(String, Field)>),
    /// Rows of numbers without names.
    Table(Field),
}

/// Whether a file with these first bytes is text.
pub(super) fn is_start(start: &[u8]) -> bool {
    let text = &*start_of_text(start);
    // Beside letters and digits; pandas leaves the name of its first column empty.
    const BEGIN: &[u8] = b"#+-.\"%_,;([{";
    !text.is_empty() && text.iter().all(|&b| b >= b' ' && b != 0x7f || b"\t\r\n".contains(&b)) && {
        let first = text.iter().position(|b| !b.is_ascii_whitespace());
        first.is_some_and(|at| {
            text[at].is_ascii_alphanumeric() || text[at] >= 0xa0 || BEGIN.contains(&text[at])
        })
    }
}

/// Reads a file. With `decimal_comma`, every comma is a decimal comma. A text that is no plain table may
/// [have one in it](export).
pub(super) fn read(path: &Path, decimal_comma: bool) -> Result<Text, FileError> {
    read_str(path, read_large_text(path, EXPECTED)?, decimal_comma)
}

/// Reads the text of a file.
fn read_str(path: &Path, text: String, decimal_comma: bool) -> Result<Text, FileError> {
    // Lines that end as on an old Macintosh.
    let text = if text.contains('\n') { text } else { text.replace('\r', "\n") };
    let text = listed(&text).or_else(|| labelled(&text)).unwrap_or(text);
    let lines = Lines::of(&text);
    let signed =
        |numbers, skipped| Text { provenance: provenance(&text), ..Text::new(numbers, skipped) };
    let refused = match plain(path, &lines, decimal_comma) {
        Ok(numbers) => return Ok(signed(numbers, None)),
        Err(error) => error,
    };
    let Some(found) = export::find(path, &lines, decimal_comma) else { return Err(refused) };
    let export::Found { columns, names, skipped } = found?;
    let numbers = match names {
        Some(names) => Numbers::Columns(names.into_iter().zip(columns).collect()),
        None => {
            let (height, width) = (columns[0].real.len(), columns.len());
            let row = |at: usize| columns.iter().map(move |column| column.real[at]);
            let real = (0..height).flat_map(row).collect();
            Numbers::Table(Field { shape: vec![height, width], real, imaginary: None })
        }
    };
    Ok(signed(numbers, skipped))
}

/// The provenance in one of the comments before the table, as an export writes it.
fn provenance(text: &str) -> Option<String> {
    let mut comments = text.lines().take_while(|line| line.starts_with('#'));
    let of = |line: &str| {
        Some(line[1..].trim_start().strip_prefix(provenance::FIELD)?.strip_prefix(": ")?.to_owned())
    };
    comments.find_map(of)
}

/// The rows of a list in brackets, as Python prints it and the Red Pitaya sends it: brackets within the outer ones hold a row
/// each, and ends of lines mean nothing.
fn listed(text: &str) -> Option<String> {
    let text = text.trim();
    let [open, close] = ["[]", "{}", "()"]
        .map(|kind| [&kind[..1], &kind[1..]])
        .into_iter()
        .find(|kind| text.starts_with(kind[0]))?;
    let inner = text.strip_prefix(open)?.strip_suffix(close)?;
    let row = |row: &str| {
        let row = row.replace(open, " ").replace(['\r', '\n'], " ");
        let row = row.trim().trim_start_matches(',').trim().to_owned();
        Some(row).filter(|row| !row.is_empty())
    };
    Some(inner.split(close).filter_map(row).collect::<Vec<String>>().join("\n"))
}

/// The table of lines such as `light:71,limit:90`, which the Arduino's plotter reads: the names become its heading.
fn labelled(text: &str) -> Option<String> {
    fn parted(line: &str) -> Option<(Vec<&str>, Vec<&str>)> {
        let words = line.split([',', '\t', ' ']).filter(|word| !word.is_empty());
        let is_labelled = |(name, number): &(&str, &str)| {
            parse(name, '.').is_none() && !number.is_empty() && parse(number, '.').is_some()
        };
        words.map(|word| word.split_once(':').filter(is_labelled)).collect()
    }
    let mut lines = text.lines().filter(|line| !line.trim().is_empty()).map(parted);
    let (names, first) = lines.next()??;
    let mut rows = vec![names.join(","), first.join(",")];
    for line in lines {
        let (of, numbers) = line?;
        if of != names {
            return None;
        }
        rows.push(numbers.join(","));
    }
    (!names.is_empty()).then(|| rows.join("\n"))
}

impl Text {
    /// Columns of one name get numbers, as pandas gives them, and a note.
    fn new(mut numbers: Numbers, skipped: Option<String>) -> Self {
        let mut notes: Vec<String> = skipped.into_iter().collect();
        if let Numbers::Columns(columns) = &mut numbers {
            for at in 1..columns.len() {
                let name = columns[at].0.clone();
                let before = columns[..at].iter().filter(|(other, _)| *other == name).count();
                if before > 0 && !name.is_empty() {
                    columns[at].0 = format!("{name}.{before}");
                    notes.push(format!(
                        "another column is called `{name}`, too: here `{name}.{before}`"
                    ));
                }
            }
        }
        let skipped = (!notes.is_empty()).then(|| notes.join("; "));
        Self { numbers, skipped, provenance: None }
    }
}

/// A line and its number.
type Line<'t> = (usize, &'t str);

/// The lines of a text that count.
struct Lines<'t> {
    lines: Vec<Line<'t>>,
    /// Which of the marks are in the text.
    marks: Vec<char>,
}

/// What may stand between, in or around numbers.
const MARKS: [char; 6] = [';', '\t', ',', '.', ' ', '"'];

/// Bytes, and lines, that one thread takes at a time.
const PIECE: usize = 1 << 20;
const BLOCK: usize = 1 << 14;

impl<'t> Lines<'t> {
    fn of(text: &'t str) -> Self {
        let mut pieces = Vec::new();
        let mut rest = text;
        while !rest.is_empty() {
            let from = PIECE.min(rest.len());
            let end = rest.as_bytes()[from..].iter().position(|&byte| byte == b'\n');
            // A line end is a character of its own.
            let (piece, after) = rest.split_at(end.map_or(rest.len(), |end| from + end + 1));
            pieces.push(piece);
            rest = after;
        }
        let has = |piece: &str| MARKS.map(|mark| piece.contains(mark));
        let found: Vec<(usize, Vec<Line<'t>>, [bool; MARKS.len()])> = pieces
            .par_iter()
            .map(|piece| {
                let (count, lines) = lines_of(piece);
                (count, lines, has(piece))
            })
            .collect();
        let holds = |&at: &usize| found.iter().any(|(_, _, has)| has[at]);
        let marks = (0..MARKS.len()).filter(holds).map(|at| MARKS[at]).collect();
        let mut lines = Vec::with_capacity(found.iter().map(|(_, lines, _)| lines.len()).sum());
        let mut before = 0;
        for (count, found, _) in found {
            lines.extend(found.into_iter().map(|(at, line)| (before + at, line)));
            before += count;
        }
        // Spreadsheets tell each other the separator.
        let is_separator = |&(at, line): &Line<'_>| {
            at == 1 && line.get(..4).is_some_and(|start| start.eq_ignore_ascii_case("sep="))
        };
        if lines.first().is_some_and(is_separator) {
            lines.remove(0);
        }
        Self { lines, marks }
    }

    /// Whether one of these lines has this mark.
    fn have(&self, body: &[Line<'_>], mark: char) -> bool {
        self.marks.contains(&mark) && body.iter().any(|(_, line)| line.contains(mark))
    }
}

/// Number of the lines of a piece of a text, and those that count, numbered from 1.
fn lines_of(piece: &str) -> (usize, Vec<Line<'_>>) {
    let mut count = 0;
    let mut lines = Vec::new();
    for line in piece.lines() {
        count += 1;
        // A tab at the end of a line may close an empty cell.
        let line = match is_bare(line) {
            true => line,
            false => line.trim_start().trim_end_matches([' ', '\r']),
        };
        if !line.is_empty() && !line.starts_with(['#', '%']) {
            lines.push((count, line));
        }
    }
    (count, lines)
}

/// The numbers of a plain table: a heading if there is one, and lines of numbers.
fn plain(path: &Path, lines: &Lines<'_>, decimal_comma: bool) -> Result<Numbers, FileError> {
    let names_columns = |(_, line): &Line<'_>| {
        let words = line.split([',', ';', '\t', ' ']).filter(|word| !word.is_empty());
        is_heading(words.clone()) && words.clone().all(|word| parse(word, '.').is_none())
    };
    let (heading, body) = match lines.lines.split_first() {
        Some((first, body)) if names_columns(first) => (Some(first.1), body),
        _ => (None, &lines.lines[..]),
    };
    if body.is_empty() {
        return Err(FileError::kind(path, "a text file without numbers", EXPECTED));
    }
    let separators = Separators::of(path, heading, lines, body, decimal_comma)?;
    let width = separators.split(body[0].1).count();
    let real = numbers_of(path, body, &separators, width)?;
    let height = body.len();
    let names: Option<Vec<String>> = heading.map(|heading| {
        let names = Words::of(separators.open(heading), separators.between, true);
        names.map(|name| name.trim_matches('"').to_owned()).collect()
    });
    Ok(match names.filter(|names| names.len() == width) {
        Some(names) => Numbers::Columns(names.into_iter().zip(columns_of(&real, width)).collect()),
        None => Numbers::Table(Field { shape: vec![height, width], real, imaginary: None }),
    })
}

/// The columns of a table with `width` numbers in each line.
fn columns_of(numbers: &[f64], width: usize) -> Vec<Field> {
    let column = |at| {
        let real: Vec<f64> = numbers.iter().copied().skip(at).step_by(width).collect();
        Field { shape: vec![real.len()], real, imaginary: None }
    };
    (0..width).into_par_iter().map(column).collect()
}

/// The numbers of these lines, `width` in each, one line after another. The error is that of the first line
/// with one.
fn numbers_of(
    path: &Path,
    body: &[Line<'_>],
    separators: &Separators,
    width: usize,
) -> Result<Vec<f64>, FileError> {
    let wrong = |line: usize, found: String, expected: &str| {
        FileError::field(path, "table", format!("has {found} in line {line}"), expected)
    };
    let of_block = |lines: &[Line<'_>]| -> Result<Vec<f64>, FileError> {
        let mut numbers = Vec::with_capacity(lines.len() * width);
        for &(line, content) in lines {
            let before = numbers.len();
            for word in separators.split(content) {
                match parse(word, separators.decimal) {
                    Some(number) => numbers.push(number),
                    None => {
                        return Err(wrong(line, format!("{:?}", shortened(word)), "a number"));
                    }
                }
            }
            let found = numbers.len() - before;
            if found != width {
                let expected = format!("{width} as in the lines before");
                return Err(wrong(line, format!("{found} numbers"), &expected));
            }
        }
        Ok(numbers)
    };
    // A text that is no plain table shows it in its first lines.
    let (first, others) = body.split_at(body.len().min(BLOCK));
    let mut numbers = of_block(first)?;
    let blocks: Vec<Result<Vec<f64>, FileError>> = others.par_chunks(BLOCK).map(of_block).collect();
    numbers.reserve_exact(others.len() * width);
    for block in blocks {
        numbers.append(&mut block?);
    }
    Ok(numbers)
}

/// The separator between numbers, and the decimal mark.
struct Separators {
    /// The separator; `None` means any blank.
    between: Option<char>,
    decimal: char,
    /// Whether every line ends with the separator. The last separator then closes the line and
    /// starts no further number.
    closes: bool,
    /// Whether numbers stand in quotes. A separator in quotes separates nothing.
    quotes: bool,
}

impl Separators {
    fn of(
        path: &Path,
        heading: Option<&str>,
        lines: &Lines<'_>,
        body: &[Line<'_>],
        decimal_comma: bool,
    ) -> Result<Self, FileError> {
        let has = |mark: char| lines.have(body, mark);
        let between = [';', '\t'].into_iter().find(|&mark| has(mark));
        let decimal = |between: Option<char>, decimal| {
            let ends = |mark| body.iter().all(|(_, line)| line.ends_with(mark));
            let closes = between.is_some_and(ends);
            Ok(Self { between, decimal, closes, quotes: has('"') })
        };
        if decimal_comma {
            return decimal(between, ',');
        }
        if !has(',') {
            return decimal(between, '.');
        }
        if has('.') {
            // A date has points, too.
            let words = body.iter().take(1).flat_map(|(_, line)| Words::of(line, between, true));
            let shows =
                |mark| words.clone().any(|word| word.contains(mark) && parse(word, mark).is_some());
            return match (between, shows('.'), shows(',')) {
                (None, ..) => decimal(Some(','), '.'),
                (_, true, false) => decimal(between, '.'),
                (_, false, true) => decimal(between, ','),
                _ => Err(FileError::field(
                    path,
                    "table",
                    "has points and commas in its numbers",
                    "decimal points, or decimal commas with --decimal-comma",
                )),
            };
        }
        let blanks = body.par_iter().with_min_len(BLOCK).any(|(_, line)| {
            // A blank that does not follow a comma separates two numbers.
            line.split_whitespace().rev().skip(1).any(|word| !word.ends_with(','))
        });
        if between.is_some() || blanks {
            return decimal(between, ',');
        }
        let commas = |(_, line): &Line<'_>| line.matches(',').take(2).count();
        if body.iter().all(|line| commas(line) <= 1) {
            let shows_decimals = |(_, line): &Line<'_>| {
                line.split_once(',').is_some_and(|(whole, part)| {
                    let part = part.trim();
                    whole.trim() == "-0"
                        || part.contains(['e', 'E'])
                        || part.len() > 1 && part.starts_with('0')
                })
            };
            if body.iter().any(|line| commas(line) == 0) || body.iter().any(shows_decimals) {
                return decimal(None, ',');
            }
            // Two names head two columns.
            let names = |heading| Words::of(heading, Some(','), true).count();
            if heading.is_some_and(|heading| names(heading) == 2) {
                return decimal(Some(','), '.');
            }
            return Err(FileError::field(
                path,
                "table",
                "has one comma a line, which is a decimal comma or parts two columns",
                "--decimal-comma, or numbers parted by semicolons",
            ));
        }
        decimal(Some(','), '.')
    }

    /// The line without the separator that closes it.
    fn open<'l>(&self, line: &'l str) -> &'l str {
        let closing = self.between.filter(|_| self.closes);
        closing.map_or(line, |mark| line.strip_suffix(mark).unwrap_or(line))
    }

    /// The words between separators.
    fn split<'l>(&self, line: &'l str) -> Words<'l> {
        Words::of(self.open(line), self.between, self.quotes)
    }
}

/// The words of a line.
#[derive(Clone)]
struct Words<'l> {
    rest: Option<&'l str>,
    /// The separator; `None` means any blank, and words are never empty.
    between: Option<char>,
    /// Whether a separator in quotes separates nothing.
    quotes: bool,
    /// Whether bytes tell where words end.
    is_simple: bool,
}

impl<'l> Words<'l> {
    fn of(line: &'l str, between: Option<char>, quotes: bool) -> Self {
        let quotes = quotes && line.contains('"');
        let is_simple = between.map_or_else(|| line.is_ascii(), |mark| mark.is_ascii());
        Self { rest: Some(line), between, quotes, is_simple }
    }

    /// The length of the first word, and that of the separator after it, if there is one.
    fn cut(&self, rest: &str) -> Option<(usize, usize)> {
        let mut quoted = false;
        if self.is_simple {
            let is_end = |byte: u8| match self.between {
                Some(mark) => byte == mark as u8,
                None => matches!(byte, b'\t'..=b'\r' | b' '),
            };
            let at = match self.quotes {
                false => rest.bytes().position(is_end),
                true => rest.bytes().position(|byte| {
                    quoted ^= byte == b'"';
                    !quoted && is_end(byte)
                }),
            };
            return at.map(|at| (at, 1));
        }
        let end = |&(_, c): &(usize, char)| {
            quoted ^= self.quotes && c == '"';
            !quoted && self.between.map_or(c.is_whitespace(), |mark| c == mark)
        };
        rest.char_indices().find(end).map(|(at, c)| (at, c.len_utf8()))
    }
}

impl<'l> Iterator for Words<'l> {
    type Item = &'l str;

    fn next(&mut self) -> Option<&'l str> {
        loop {
            let rest = self.rest?;
            let word = match self.cut(rest) {
                None => {
                    self.rest = None;
                    rest
                }
                Some((length, separator)) => {
                    self.rest = Some(&rest[length + separator..]);
                    &rest[..length]
                }
            };
            let word = trimmed(word);
            if self.between.is_some() || !word.is_empty() {
                return Some(word);
            }
        }
    }
}

/// The word without blanks around it.
fn trimmed(word: &str) -> &str {
    if is_bare(word) { word } else { word.trim() }
}

/// Whether a text certainly begins and ends without a blank.
fn is_bare(text: &str) -> bool {
    let is_plain = |byte: Option<&u8>| byte.is_some_and(|byte| matches!(byte, b'!'..=b'~'));
    is_plain(text.as_bytes().first()) && is_plain(text.as_bytes().last())
}

fn shortened(word: &str) -> String {
    word.chars().take(40).collect()
}

#[cfg(test)]
mod tests;
