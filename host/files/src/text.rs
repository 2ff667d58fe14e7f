//! Reads numbers in a text file of a spreadsheet or a logger: `.csv`, `.txt`, with decimal points
//! or commas.
//!
//! # Invariant
//! A comma is never guessed to be a decimal comma
//! (`tests::a_decimal_comma_is_seen_where_the_file_shows_it_and_asked_for_where_not`). A comma is
//! decimal only if the user says so, or if the file shows it in one of three ways: numbers are
//! separated by semicolons, tabs or blanks; a number has digits that a whole number does not have,
//! as in `0,05` or `1,5E-3`; some numbers of a line have commas and others have none. One comma a
//! line, under a heading with one comma, separates two columns.

mod export;
#[cfg(test)]
mod reference;

use super::FileError;
use super::field::{EXPECTED, Field};
use super::plain::{is_heading, read_large_text, start_of_text};
use rayon::prelude::*;
use std::path::Path;

/// Words for a reading that was not taken.
const UNREAD: [&str; 10] =
    ["nan", "null", "na", "none", "#n/a", "n/a", "#num!", "-1.#ind", "1.#qnan", "-nan"];

/// Words for a reading beyond what an instrument measures.
const OVERLOADED: [&str; 5] = ["∞", "+∞", "ol", "ovld", "overload"];

/// What instruments write themselves for such a reading.
const OVERLOAD: f64 = 9.9e37;

/// What a text file holds.
pub(super) struct Text {
    pub(super) numbers: Numbers,
    /// What was left out, in one line.
    pub(super) skipped: Option<String>,
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
    const BEGIN: &[u8] = b"#+-.\"%_,;([";
    !text.is_empty() && text.iter().all(|&b| b >= b' ' && b != 0x7f || b"\t\r\n".contains(&b)) && {
        let first = text.iter().position(|b| !b.is_ascii_whitespace());
        first.is_some_and(|at| text[at].is_ascii_alphanumeric() || BEGIN.contains(&text[at]))
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
    let lines = Lines::of(&text);
    let refused = match plain(path, &lines, decimal_comma) {
        Ok(numbers) => return Ok(Text { numbers, skipped: None }),
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
    Ok(Text { numbers, skipped })
}

/// A line and its number.
type Line<'t> = (usize, &'t str);

/// The lines of a text that count, and the text.
struct Lines<'t> {
    text: &'t str,
    lines: Vec<Line<'t>>,
}

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
        let found: Vec<(usize, Vec<Line<'t>>)> =
            pieces.par_iter().map(|piece| lines_of(piece)).collect();
        let mut lines = Vec::with_capacity(found.iter().map(|(_, lines)| lines.len()).sum());
        let mut before = 0;
        for (count, found) in found {
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
        Self { text, lines }
    }

    /// Whether one of these lines has this mark.
    fn have(&self, body: &[Line<'_>], mark: char) -> bool {
        self.text.contains(mark) && body.iter().any(|(_, line)| line.contains(mark))
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
        separators.split(heading).map(|name| name.trim_matches('"').to_owned()).collect()
    });
    Ok(match names.filter(|names| names.len() == width) {
        Some(names) => Numbers::Columns(
            names
                .into_iter()
                .enumerate()
                .map(|(at, name)| {
                    let real = real.iter().copied().skip(at).step_by(width).collect();
                    (name, Field { shape: vec![height], real, imaginary: None })
                })
                .collect(),
        ),
        None => Numbers::Table(Field { shape: vec![height, width], real, imaginary: None }),
    })
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
            Ok(Self { between, decimal, closes: between.is_some_and(ends) })
        };
        if decimal_comma {
            return decimal(between, ',');
        }
        if !has(',') {
            return decimal(between, '.');
        }
        if has('.') {
            return match between {
                None => decimal(Some(','), '.'),
                Some(_) => Err(FileError::field(
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
            if heading.is_some_and(|heading| heading.matches(',').count() == 1) {
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

    /// The words between separators.
    fn split<'l>(&self, line: &'l str) -> Words<'l> {
        let closing = self.between.filter(|_| self.closes);
        let line = closing.map_or(line, |mark| line.strip_suffix(mark).unwrap_or(line));
        Words::of(line, self.between, false)
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

/// The number that a word states, with the point or comma of its decimals; NaN for a reading that was not
/// taken, 9.9e37 for one beyond what an instrument measures.
pub(super) fn parse(word: &str, decimal: char) -> Option<f64> {
    let bytes = word.as_bytes();
    let word = match bytes.first() == Some(&b'"') || bytes.last() == Some(&b'"') {
        true => word.trim_matches('"'),
        false => word,
    };
    plain_number(word, decimal).or_else(|| odd_number(word, decimal))
}

/// The longest of [`UNREAD`] and [`OVERLOADED`].
const LONGEST_WORD: usize = 8;

/// What is no plain number.
#[inline(never)]
fn odd_number(word: &str, decimal: char) -> Option<f64> {
    // Most words are none of these.
    let has_exponent = || word.bytes().any(|byte| matches!(byte, b'd' | b'D'));
    if word.len() > LONGEST_WORD
        && word.is_ascii()
        && !word.starts_with(['n', 'N'])
        && !has_exponent()
    {
        return None;
    }
    let lower = word.to_lowercase();
    if word.is_empty() || UNREAD.contains(&lower.as_str()) {
        return Some(f64::NAN);
    }
    if OVERLOADED.contains(&lower.as_str()) {
        return Some(OVERLOAD);
    }
    if lower == "-∞" || lower == "−∞" {
        return Some(-OVERLOAD);
    }
    // What NumPy 2 prints, and Fortran's exponents.
    let printed = ["np.float64(", "np.float32(", "np.int64("].iter();
    let inner = printed.filter_map(|by| lower.strip_prefix(by)?.strip_suffix(')')).next();
    let plain = inner.unwrap_or(&lower).replace('−', "-");
    let is_exponent = plain.contains(|c: char| c.is_ascii_digit()) && plain.contains('d');
    plain_number(&if is_exponent { plain.replacen('d', "e", 1) } else { plain }, decimal)
}

/// The longest number with a decimal comma that is read without an allocation.
const SHORT: usize = 32;

fn plain_number(word: &str, decimal: char) -> Option<f64> {
    match decimal {
        '.' => word.parse().ok(),
        _ if word.contains('.') => None,
        ',' if word.len() <= SHORT => {
            let mut bytes = [0; SHORT];
            let with_point = &mut bytes[..word.len()];
            with_point.copy_from_slice(word.as_bytes());
            if let Some(comma) = with_point.iter_mut().find(|byte| **byte == b',') {
                *comma = b'.';
            }
            std::str::from_utf8(with_point).ok()?.parse().ok()
        }
        _ => word.replacen(decimal, ".", 1).parse().ok(),
    }
}

fn shortened(word: &str) -> String {
    word.chars().take(40).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{file, line};
    use proptest::collection::vec;
    use proptest::prelude::*;
    use proptest::sample::select;

    fn table(content: &str) -> (Vec<usize>, Vec<f64>) {
        let (_folder, path) = file("y.txt", content.as_bytes());
        match read(&path, false).unwrap().numbers {
            Numbers::Table(field) => (field.shape, field.real),
            Numbers::Columns(columns) => panic!("{columns:?}"),
        }
    }

    /// A table as bits, because NaN differs from itself; or the refusal.
    fn seen(read: Result<Text, FileError>) -> String {
        let bits = |field: &Field| -> Vec<u64> { field.real.iter().map(|v| v.to_bits()).collect() };
        match read {
            Err(error) => error.to_string(),
            Ok(Text { numbers: Numbers::Table(field), skipped }) => {
                format!("{:?} {:?} {skipped:?}", field.shape, bits(&field))
            }
            Ok(Text { numbers: Numbers::Columns(columns), skipped }) => {
                let columns: Vec<_> =
                    columns.iter().map(|(name, field)| (name, &field.shape, bits(field))).collect();
                format!("{columns:?} {skipped:?}")
            }
        }
    }

    const CELLS: [&str; 40] = [
        "1",
        "1.5",
        "-2",
        "3e-1",
        "1,5",
        "0,05",
        "2,5E-3",
        "nan",
        "NaN",
        "null",
        "",
        " ",
        "#N/A",
        "-1.#IND",
        "OL",
        "overload",
        "∞",
        "-∞",
        "−3",
        "1.25D+01",
        "np.float64(1.5)",
        "\"7\"",
        "\"a, b\"",
        "word",
        "two words",
        "10:00:01",
        "1.5.2",
        "+4",
        ".5",
        "inf",
        "-inf",
        "d",
        "1d",
        "0x10",
        "1_000",
        "\u{a0}6",
        "µV",
        "(V)",
        "Volt",
        "\"",
    ];

    fn text() -> impl Strategy<Value = String> {
        let cell = prop_oneof![6 => "[0-9]{1,3}(\\.[0-9]{1,3})?", 1 => select(&CELLS[..]).prop_map(str::to_owned)];
        let mark = select(&[",", ";", "\t", " ", ", ", ";\t", "  "][..]);
        let end = select(&["\n", "\r\n", "\r", " \n"][..]);
        let lines = vec(vec(cell, 1..5), 1..24);
        let width = prop_oneof![4 => (1_usize..5).prop_map(Some), 1 => Just(None)];
        let before = vec("[ -~µ]{0,20}", 0..4);
        (lines, width, mark, end, before, 0_u8..8).prop_map(
            |(lines, width, mark, end, before, odd)| {
                let mut text = String::new();
                if odd & 1 == 1 {
                    before.iter().for_each(|line| text += &format!("{line}{end}"));
                }
                if odd == 6 {
                    text = format!("sep={mark}{end}{text}");
                }
                for cells in lines {
                    let cells = match width {
                        Some(width) => cells.iter().cycle().take(width).cloned().collect(),
                        None => cells,
                    };
                    text += &cells.join(mark);
                    if odd & 2 == 2 {
                        text += mark;
                    }
                    text += end;
                }
                text
            },
        )
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]
        #[test]
        fn a_text_gives_the_table_of_the_simple_reader(text in text(), decimal_comma: bool) {
            let path = Path::new("y.csv");
            let fast = seen(read_str(path, text.clone(), decimal_comma));
            prop_assert_eq!(fast, seen(reference::read(path, &text, decimal_comma)));
        }
    }

    /// Processor time and time of the reader and of the simple one, in MB/s of a text of 100 MB, medians of five in turn:
    /// `cargo test --release -p nirspi-files --lib text_a_second -- --ignored --nocapture`
    #[test]
    #[ignore = "takes minutes, and prints figures"]
    fn text_a_second() {
        fn processor_s() -> f64 {
            let stat = std::fs::read_to_string("/proc/self/stat").unwrap();
            let fields = stat.rsplit_once(") ").unwrap().1.split(' ');
            fields.skip(11).take(2).map(|ticks| ticks.parse::<f64>().unwrap() / 100.0).sum()
        }
        fn median(mut of: Vec<f64>) -> f64 {
            of.sort_by(f64::total_cmp);
            of[of.len() / 2]
        }
        let value = |k: u32| f64::from(k.wrapping_mul(2_654_435_761) >> 8) * 1e-5;
        let one: String = (0..11_000_000).map(|k| format!("{:.4}\n", value(k) % 1000.0)).collect();
        let row = |k: u32| {
            let [a, b, c, d] = [1, 2, 3, 4].map(|j| value(k * j) % 10.0);
            format!("{:.6},{a:.5},{b:.5},{c:.5},{d:.5}\n", f64::from(k) * 1e-6)
        };
        let five: String = (0..2_700_000).map(row).collect();
        let five = format!("Model,X1\nDate,today\n\ntime,CH1,CH2,CH3,CH4\ns,V,V,V,V\n{five}");
        let path = Path::new("y.csv");
        for (name, text) in [("one column", one), ("five columns, preamble", five)] {
            let mut times = [const { Vec::new() }; 4];
            for _ in 0..5 {
                for (at, is_fast) in [(0, true), (2, false)] {
                    let given = text.clone();
                    let (processor, began) = (processor_s(), std::time::Instant::now());
                    let found = match is_fast {
                        true => read_str(path, given, false),
                        false => reference::read(path, &given, false),
                    };
                    times[at + 1].push(began.elapsed().as_secs_f64());
                    times[at].push(processor_s() - processor);
                    found.unwrap();
                }
            }
            let megabytes = text.len() as f64 * 1e-6;
            let [a, b, c, d] = times.map(|times| megabytes / median(times));
            println!(
                "{name}, {megabytes:.0} MB: processor {a:.0} MB/s, time {b:.0} MB/s; before {c:.0}, {d:.0}"
            );
        }
    }

    /// Lines of many pieces and blocks, and an error in one of the last.
    #[test]
    fn a_long_text_gives_the_table_of_the_simple_reader() {
        let row = |k: usize| format!("{k},{}.{:02},{}\n", k % 777, k % 100, k * k % 1001);
        let plain: String = (0..140_000).map(row).collect();
        assert!(plain.len() > 2 * PIECE);
        let path = Path::new("y.csv");
        let wrong = plain.clone() + "1,2\n" + &plain + "x,2,3\n";
        let word = plain.clone() + "1,two,3\n1,2\n" + &plain;
        for text in [
            plain.clone(),
            format!("# log\nt,a,b\n{plain}"),
            format!("A meter\nmade: today\n\nt,a,b\n{plain}total,of,all\n"),
            wrong,
            word,
        ] {
            let simple = seen(reference::read(path, &text, false));
            assert!(seen(read_str(path, text, false)) == simple, "{simple:.200}");
        }
    }

    #[test]
    fn numbers_are_read_however_a_spreadsheet_writes_them() {
        assert_eq!(table("1.5\n-2\n3e-1\n"), (vec![3, 1], vec![1.5, -2.0, 0.3]));
        assert_eq!(table("1.5, 2\n3,4.5\n"), (vec![2, 2], vec![1.5, 2.0, 3.0, 4.5]));
        assert_eq!(table("1,5;2;\n3;4,25;\n"), (vec![2, 2], vec![1.5, 2.0, 3.0, 4.25]));
        assert_eq!(table("1,5\t2\r\n3\t4\r\n"), (vec![2, 2], vec![1.5, 2.0, 3.0, 4.0]));
        assert_eq!(table("# log\n1 2 3\n"), (vec![1, 3], vec![1.0, 2.0, 3.0]));
        assert_eq!(table("1,2,3\n4,5,6\n").0, [2, 3]);
        assert_eq!(table("voltage of the wing\n1\n2\n3 ").1, [1.0, 2.0, 3.0]);
        // A byte that is not valid UTF-8, as in a heading of another code page.
        let (_folder, path) = file("y.txt", b"U in \xb5V\n1\n2\n");
        assert!(
            matches!(read(&path, false).unwrap().numbers, Numbers::Table(field) if field.real == [1.0, 2.0])
        );
    }

    #[test]
    fn text_in_utf_16_is_known_by_its_beginning() {
        let text = "\u{feff}d\r\n1,5\r\n";
        for bytes_of in [u16::to_le_bytes, u16::to_be_bytes] {
            let bytes: Vec<u8> = text.encode_utf16().flat_map(bytes_of).collect();
            // Only the first bytes of a file are looked at, which may end within a character.
            assert!(is_start(&bytes) && is_start(&bytes[..7]), "{bytes:?}");
        }
        assert!(is_start(b"\xef\xbb\xbf1\n") && !is_start(b"\xff\xfe\x01\x00\x02\x00"));
    }

    #[test]
    fn a_decimal_comma_is_seen_where_the_file_shows_it_and_asked_for_where_not() {
        assert_eq!(table("0,5\n0,05\n").1, [0.5, 0.05]);
        assert_eq!(table("1,5E-3\n2,5E-3\n").1, [0.0015, 0.0025]);
        assert_eq!(table("1,5\n2\n").1, [1.5, 2.0]);
        assert_eq!(table("1,5 2,5\n3 4\n").1, [1.5, 2.5, 3.0, 4.0]);
        let (_folder, path) = file("y.txt", b"1,5\n2,5\n");
        let message = line(&read(&path, false).err().unwrap(), "y.txt");
        assert!(message.contains("one comma a line") && message.contains("--decimal-comma"));
        let Numbers::Table(field) = read(&path, true).unwrap().numbers else { panic!("a table") };
        assert_eq!(field.real, [1.5, 2.5]);
        let (_folder, path) = file("y.csv", b"h_row,d\n0,15\n3,-4\n");
        let Numbers::Columns(columns) = read(&path, false).unwrap().numbers else {
            panic!("columns")
        };
        assert_eq!(columns[1].1.real, [15.0, -4.0]);
        let (_folder, path) = file("y.txt", b"1,5;2.5\n");
        assert!(line(&read(&path, false).err().unwrap(), "y.txt").contains("points and commas"));
    }

    #[test]
    fn numbers_are_read_however_programs_print_them() {
        let printed = "np.float64(1.5)\nnp.float64(-2)\n1.25D+01\n\u{2212}3\n";
        assert_eq!(table(printed).1, [1.5, -2.0, 12.5, -3.0]);
        let (_, found) =
            table("1\n#N/A\n-1.#IND\nOL\n-\u{221e}\n".replace("\n#", "\n\"#").as_str());
        assert!(found[1].is_nan() && found[2].is_nan(), "{found:?}");
        assert_eq!([found[0], found[3], found[4]], [1.0, OVERLOAD, -OVERLOAD]);
        assert_eq!(table("1.5\r2.5\r").1, [1.5, 2.5]);
        assert_eq!(table("sep=;\n1,5;2\n3;4,5\n").1, [1.5, 2.0, 3.0, 4.5]);
        let (_folder, path) = file("y.csv", b",y\n0,1.5\n1,2.5\n");
        let Numbers::Columns(columns) = read(&path, false).unwrap().numbers else { panic!() };
        assert_eq!((&*columns[1].0, &columns[1].1.real), ("y", &vec![1.5, 2.5]));
    }

    #[test]
    fn a_heading_names_the_columns_and_words_for_unread_are_nan() {
        let (_folder, path) = file("y.csv", b"h_row; d\n0;1,5\n3;null\n2;\n1;NaN\n");
        let Numbers::Columns(columns) = read(&path, false).unwrap().numbers else {
            panic!("columns")
        };
        assert_eq!([&columns[0].0, &columns[1].0], ["h_row", "d"]);
        assert_eq!(columns[0].1.real, [0.0, 3.0, 2.0, 1.0]);
        let d = &columns[1].1.real;
        assert!(d[0] == 1.5 && d[1..].iter().all(|v| v.is_nan()) && d.len() == 4, "{d:?}");
    }

    #[test]
    fn what_is_no_number_is_named_with_its_line() {
        for (content, found) in [
            ("1\n2\nthree\n", "\"three\" in line 3"),
            ("1 2\n3\n", "1 numbers in line 2"),
            ("a b\n", "without numbers"),
            ("1,2;x\n", "\"x\" in line 1"),
            ("1.5.2\n2\n3\n", "\"1.5.2\" in line 1"),
        ] {
            let (_folder, path) = file("y.txt", content.as_bytes());
            let message = line(&read(&path, false).err().unwrap(), "y.txt");
            assert!(message.contains(found), "{message}");
        }
    }
}
