//! A table among other lines, as instruments and programs export it: with lines before and after it,
//! a line of units, and columns of words.
//!
//! # Invariant
//! No number of a table is lost in silence: what is left out is no line of numbers like those of the
//! table, and is told (`tests::a_table_with_a_gap_is_refused_as_before`).

use super::number::{OVERLOAD, sign};
use super::{BLOCK, Line, Lines, Separators, Words, columns_of, numbers_of, parse, shortened};
use crate::FileError;
use crate::field::Field;
use nirspi_recon::words::count_of;
use rayon::prelude::*;
use std::path::Path;

/// The fewest lines of such a table. Fewer may be anything.
const LEAST_LINES: usize = 8;

/// The most lines before the table, and after it.
const MOST_BEFORE: usize = 64;
const MOST_AFTER: usize = 3;

/// Words for units below a heading, in brackets or without.
const UNITS: [&str; 20] = [
    "s", "ms", "us", "ns", "sec", "second", "seconds", "v", "mv", "uv", "volt", "volts", "a", "ma",
    "w", "mw", "hz", "db", "sequence", "counts",
];

/// A table, and what was left out.
pub(super) struct Found {
    pub columns: Vec<Field>,
    pub names: Option<Vec<String>>,
    /// One line; `None` if nothing was left out.
    pub skipped: Option<String>,
}

/// The table in these lines; `None` if no table is found, or if it is not certain that the lines are one
/// table.
pub(super) fn find(
    path: &Path,
    all: &Lines<'_>,
    decimal_comma: bool,
) -> Option<Result<Found, FileError>> {
    let lines = &all.lines;
    let (body, table) = match Table::of_numbers(path, all, decimal_comma) {
        Some(found) => found,
        None => {
            let body = longest(lines, &all.marks)?;
            match Table::of(path, all, body.clone(), decimal_comma)? {
                Ok(table) => (body, table),
                Err(error) => return Some(Err(error)),
            }
        }
    };
    let Table { separators, width, numeric, columns, words, ends } = table;
    let (before, after) = (&lines[..body.start], &lines[body.end..]);
    let number = |word: &str| parse(word, separators.decimal);
    // Beside a number, a preamble has a name where the table has a time.
    let has_digit = |word: &str| word.contains(|c: char| c.is_ascii_digit());
    let of_table = |(_, line): &Line<'_>| {
        let mut beside = cells(line, separators.between)
            .zip(cells(lines[body.start].1, separators.between))
            .enumerate()
            .filter(|(at, _)| !numeric.contains(at));
        is_row(line, &separators, width, &numeric)
            && beside.all(|(_, (one, other))| has_digit(one) == has_digit(other))
    };
    if numeric.is_empty() || before.iter().chain(after).any(of_table) {
        return None;
    }
    let (heading, units) = heading(before, separators.between, &numeric, number);
    let named = |heading: &Vec<&str>, at: usize| heading[at].trim_matches('"').trim().to_owned();
    let word = |at: usize| match heading.as_ref().filter(|heading| at < heading.len()) {
        Some(heading) => format!("`{}`", shortened(&named(heading, at))),
        None => format!("{}", at + 1),
    };
    let words: Vec<String> = words.into_iter().map(word).collect();
    let headed = usize::from(heading.is_some()) + usize::from(units);
    let mut skipped = Vec::new();
    if before.len() > headed {
        let count = count_of(before.len() - headed, "line");
        skipped.push(format!("{count} before the table"));
    }
    if units {
        skipped.push("the units below its heading".to_owned());
    }
    if !words.is_empty() {
        skipped.push(format!("columns that hold words: {}", words.join(", ")));
    }
    if after.len() + ends > 0 {
        skipped.push(format!("{} after it", count_of(after.len() + ends, "line")));
    }
    let names = heading.map(|heading| numeric.iter().map(|&at| named(&heading, at)).collect());
    let told = || format!("left out of the text: {}", skipped.join("; "));
    let skipped = (!skipped.is_empty()).then(told);
    Some(Ok(Found { columns, names, skipped }))
}

/// Whether a line outside of a table is a row like those of the table: numbers or signs in the columns that have them,
/// of which a few may be missing.
fn is_row(line: &str, separators: &Separators, width: usize, numeric: &[usize]) -> bool {
    let row: Vec<&str> = cells(line, separators.between).collect();
    row.len() == width
        && numeric
            .iter()
            .all(|&at| parse(row[at], separators.decimal).or_else(|| sign(row[at])).is_some())
        && numeric.iter().any(|&at| !row[at].is_empty())
}

/// The lines of a table.
struct Table {
    separators: Separators,
    /// Number of cells of a line.
    width: usize,
    /// The columns of numbers, and their numbers.
    numeric: Vec<usize>,
    columns: Vec<Field>,
    /// The columns of words.
    words: Vec<usize>,
    /// Lines at the end that are no rows.
    ends: usize,
}

impl Table {
    /// A long table of nothing but numbers, from below other lines to the end of the text, as [`Table::of`] finds
    /// it, in one pass.
    fn of_numbers(
        path: &Path,
        all: &Lines<'_>,
        decimal_comma: bool,
    ) -> Option<(std::ops::Range<usize>, Self)> {
        let first = all.lines.get(..4 * MOST_BEFORE)?;
        let start = longest(first, &all.marks).filter(|run| run.end == first.len())?.start;
        let (before, body) = all.lines.split_at(start);
        let above = before.last().map(|(_, line)| *line);
        let separators = Separators::of(path, above, all, body, decimal_comma).ok()?;
        let count = separators.split(body[0].1).count();
        let numbers = numbers_of(path, body, &separators, count).ok()?;
        if before.len() > MOST_BEFORE || numbers.iter().any(|number| number.is_nan()) {
            return None;
        }
        let width = cells(body[0].1, separators.between).count();
        let (numeric, columns) = ((0..count).collect(), columns_of(&numbers, count));
        let table = Self { separators, width, numeric, columns, words: Vec::new(), ends: 0 };
        Some((start..all.lines.len(), table))
    }

    /// The table that these lines are; `None` if they are not a table.
    fn of(
        path: &Path,
        all: &Lines<'_>,
        body: std::ops::Range<usize>,
        decimal_comma: bool,
    ) -> Option<Result<Self, FileError>> {
        let (before, after) = (&all.lines[..body.start], &all.lines[body.end..]);
        if before.len() > MOST_BEFORE || after.len() > MOST_AFTER {
            return None;
        }
        let body = &all.lines[body];
        let above = before.last().map(|(_, line)| *line);
        let separators = match Separators::of(path, above, all, body, decimal_comma) {
            Ok(separators) => separators,
            Err(error) => return Some(Err(error)),
        };
        let between = separators.between;
        let width = cells(body[0].1, between).count();
        let number = |word: &str| parse(word, separators.decimal);
        let blocks: Option<Vec<Block>> =
            body.par_chunks(BLOCK).map(|lines| Block::of(lines, between, width, number)).collect();
        let blocks = blocks?;
        let count = |of: fn(&Block) -> &[usize], at: usize| -> usize {
            blocks.iter().map(|block| of(block)[at]).sum()
        };
        // At least half of the column's cells are numbers.
        let is_numeric = |&at: &usize| 2 * count(|block| &block.numbers, at) >= body.len();
        let (numeric, words): (Vec<usize>, Vec<usize>) = (0..width).partition(is_numeric);
        let words: Vec<usize> =
            words.into_iter().filter(|&at| count(|block| &block.filled, at) > 0).collect();
        // A last line of totals.
        let is_row = |(_, line): &Line<'_>| is_row(line, &separators, width, &numeric);
        let rows_end = body.iter().rposition(is_row).map_or(0, |last| last + 1);
        let ends = body.len() - rows_end;
        if ends > MOST_AFTER || rows_end < LEAST_LINES {
            return None;
        }
        let cell = |row: usize, at: usize| blocks[row / BLOCK].cells[row % BLOCK * width + at];
        let is_missing = |row: usize| numeric.iter().copied().find(|&at| cell(row, at).is_none());
        if let Some((row, at)) = (0..rows_end).find_map(|row| Some((row, is_missing(row)?))) {
            let (line, content) = body[row];
            let word = cells(content, between).nth(at).unwrap_or_default();
            let found = format!("has {:?} in line {line}", shortened(word));
            return Some(Err(FileError::field(path, "table", found, "a number")));
        }
        let column = |&at: &usize| {
            let cells = blocks.iter().flat_map(|block| block.cells.iter().skip(at).step_by(width));
            let real: Vec<f64> =
                cells.take(rows_end).map(|cell| cell.unwrap_or(f64::NAN)).collect();
            Field { shape: vec![real.len()], real, imaginary: None }
        };
        let mut columns: Vec<(usize, Field)> =
            numeric.par_iter().map(|at| (*at, column(at))).collect();
        // A column of plus and minus says which readings are of patterns.
        let signs = |at: usize| -> Option<Field> {
            let word = |(_, line): &Line<'_>| cells(line, between).nth(at).and_then(sign);
            let real: Vec<f64> = body[..rows_end].iter().map(word).collect::<Option<_>>()?;
            Some(Field { shape: vec![real.len()], real, imaginary: None })
        };
        columns.extend(words.iter().filter_map(|&at| Some((at, signs(at)?))));
        columns.sort_by_key(|(at, _)| *at);
        let (numeric, columns): (Vec<usize>, Vec<Field>) = columns.into_iter().unzip();
        let words = words.into_iter().filter(|at| !numeric.contains(at)).collect();
        Some(Ok(Self { separators, width, numeric, columns, words, ends }))
    }
}

/// The cells of some lines.
struct Block {
    /// The number in each cell, one line after another; `None` for a word.
    cells: Vec<Option<f64>>,
    /// How many cells of each column are numbers, and how many are not empty.
    numbers: Vec<usize>,
    filled: Vec<usize>,
}

impl Block {
    /// `None` if a line has another number of cells.
    fn of(
        lines: &[Line<'_>],
        between: Option<char>,
        width: usize,
        number: impl Fn(&str) -> Option<f64>,
    ) -> Option<Self> {
        let (mut numbers, mut filled) = (vec![0; width], vec![0; width]);
        let mut all = Vec::with_capacity(lines.len() * width);
        for (_, line) in lines {
            let before = all.len();
            for (at, word) in cells(line, between).enumerate() {
                let (numbers, filled) = (numbers.get_mut(at)?, &mut filled[at]);
                let found = number(word);
                if !word.is_empty() {
                    *filled += 1;
                    *numbers += usize::from(found.is_some());
                }
                all.push(found);
            }
            if all.len() - before != width {
                return None;
            }
        }
        Some(Self { cells: all, numbers, filled })
    }
}

/// The longest run of lines with the same number of cells, some of them numbers.
fn longest(lines: &[Line<'_>], marks: &[char]) -> Option<std::ops::Range<usize>> {
    let (mut best, mut parted) = (0..0, None);
    let mut has_whole = false;
    // A number with a comma is one with a decimal comma, or one with marks between its thousands.
    let is_number = |word: &str| {
        !word.trim_matches('"').is_empty()
            && (word.contains(',') && parse(word, ',').is_some() || parse(word, '.').is_some())
    };
    for between in [Some(';'), Some('\t'), Some(','), None] {
        if !marks.contains(&between.unwrap_or(' ')) {
            // Lines without the mark are one cell each, whatever the mark is.
            if std::mem::replace(&mut has_whole, true) {
                continue;
            }
        }
        let shape = |(_, line): &Line<'_>| {
            let mut cells = cells(line, between);
            let mut count = 0;
            let has_number = cells.by_ref().inspect(|_| count += 1).any(is_number);
            (count + cells.count(), has_number)
        };
        let shapes: Vec<(usize, bool)> = lines.par_iter().with_min_len(BLOCK).map(shape).collect();
        let mut start = 0;
        for run in shapes.chunk_by(|a, b| a == b) {
            if run[0].1 && run.len() > best.len() {
                (best, parted) = (start..start + run.len(), between);
            }
            start += run.len();
        }
    }
    // A heading may have words that stand for numbers, such as `NA`. A word above a number tells it.
    if let [(_, first), (_, second), ..] = &lines[best.clone()] {
        let mut pairs = cells(first, parted).zip(cells(second, parted));
        let is_word = |word: &str| !word.is_empty() && !is_number(word);
        best.start += usize::from(pairs.any(|(above, below)| is_word(above) && is_number(below)));
    }
    (best.len() >= LEAST_LINES).then_some(best)
}

/// The names of the columns, in the line before the table or in that before a line of units; and whether
/// there are units.
fn heading<'t>(
    before: &[Line<'t>],
    between: Option<char>,
    numeric: &[usize],
    number: impl Fn(&str) -> Option<f64>,
) -> (Option<Vec<&'t str>>, bool) {
    let last = numeric.last().copied().unwrap_or(0);
    let is_blank = |word: &str| word.trim_matches('"').is_empty();
    // `NA` and `inf` may be names, and so may the numbers of channels.
    let is_name = |word: &str| match number(word) {
        Some(number) if number.is_finite() && number < OVERLOAD => word.len() < 3,
        _ => true,
    };
    let words = |(_, line): &Line<'t>| {
        let cells: Vec<&str> = cells(line, between).collect();
        let are_words = cells.len() > last
            && numeric.iter().all(|&at| is_name(cells[at]))
            && numeric.iter().any(|&at| !is_blank(cells[at]) && number(cells[at]).is_none());
        are_words.then_some(cells)
    };
    let is_unit = |word: &str| {
        let plain = word.trim_matches(['(', ')', '[', ']', '"', ' ']);
        UNITS.contains(&plain.to_lowercase().as_str())
    };
    let mut above = before.iter().rev();
    let Some(nearest) = above.next().and_then(words) else { return (None, false) };
    let are_units = numeric.iter().all(|&at| is_unit(nearest[at]));
    // Channels above their units may have numbers for names, as `x-axis,1,2`.
    let names = above.next().map(|(_, line)| cells(line, between).collect::<Vec<&str>>());
    let are_names = |names: &Vec<&str>| names.len() > last && number(names[numeric[0]]).is_none();
    match names.filter(are_names) {
        Some(names) if are_units => (Some(names), true),
        _ => (Some(nearest), false),
    }
}

/// The cells of a line. A separator in quotes separates nothing.
fn cells(line: &str, between: Option<char>) -> Words<'_> {
    Words::of(line, between, true)
}

#[cfg(test)]
mod tests {
    use super::super::{Lines, Numbers, read};
    use super::{Table, longest};
    use crate::testing::{file, line};
    use std::fmt::Write;
    use std::path::Path;

    /// The columns of a text by their names, and what was left out.
    fn columns(content: &str) -> (Vec<(String, Vec<f64>)>, String) {
        let (_folder, path) = file("y.csv", content.as_bytes());
        let found = read(&path, false).unwrap();
        let columns = match found.numbers {
            Numbers::Columns(columns) => {
                columns.into_iter().map(|(name, field)| (name, field.real)).collect()
            }
            Numbers::Table(field) => vec![(format!("{:?}", field.shape), field.real)],
        };
        (columns, found.skipped.unwrap_or_default())
    }

    fn rows(of: impl Fn(u32) -> String) -> String {
        (0..9).fold(String::new(), |mut text, k| {
            writeln!(text, "{}", of(k)).unwrap();
            text
        })
    }

    fn expected(name: &str, of: impl Fn(u32) -> f64) -> (String, Vec<f64>) {
        (name.to_owned(), (0..9).map(of).collect())
    }

    #[test]
    fn what_instruments_export_is_read_and_what_is_left_out_is_told() {
        let y = |k: u32| 8.5 - f64::from(k);
        let k = f64::from;
        // Names with numbers in them.
        let text = format!("time,Channel 1\n{}", rows(|k| format!("{k},{}", y(k))));
        let named = vec![expected("time", k), expected("Channel 1", y)];
        assert_eq!(columns(&text), (named, String::new()));
        // An oscilloscope: start and increment beside the units, a comma at the end of a line.
        let text = format!(
            "X,CH1,Start,Increment,\nSequence,Volt,-6e-04,1e-06\n{}",
            rows(|k| format!("{k},{},", y(k)))
        );
        let (found, skipped) = columns(&text);
        assert_eq!(found, [expected("X", k), expected("CH1", y)]);
        assert_eq!(skipped, "left out of the text: the units below its heading");
        // A power meter: lines of its own before the table, dates and times of day.
        let text = format!(
            "Power Monitor\nDevice:;PM1\nWavelength:;1550 nm\n\nSamples;Date;Time;Power (W)\n{}",
            rows(|k| format!("{k};11/20/2026;10:00:0{k}.000;{}", y(k)))
        );
        let (found, skipped) = columns(&text);
        assert_eq!(found, [expected("Samples", k), expected("Power (W)", y)]);
        let told = "3 lines before the table; columns that hold words: `Date`, `Time`";
        assert!(skipped.ends_with(told), "{skipped}");
        // A preamble with numbers, above times.
        let text = format!(
            "t0\t10:00:00\ndelta t\t1,5E-3\n\ntime\ty\n{}",
            rows(|k| format!("10:00:0{k}\t{},5", 8 - k))
        );
        let (found, skipped) = columns(&text);
        assert_eq!(found, [expected("y", y)]);
        assert!(skipped.ends_with("2 lines before the table; columns that hold words: `time`"));
        // A serial monitor.
        let (found, _) = columns(&rows(|k| format!("14:02:0{k}.000 -> {}", y(k))));
        assert_eq!(found, [expected("[9, 1]", y)]);
        // Quoted names with commas, a column of words, a line of totals.
        let text = format!(
            "\"d, V\",comment\n{}total,sum of 9\n",
            rows(|k| format!("{},\"ok, {k}\"", y(k)))
        );
        let (found, skipped) = columns(&text);
        assert_eq!(found, [expected("d, V", y)]);
        assert!(skipped.ends_with("columns that hold words: `comment`; 1 line after it"));
        // Units in brackets, infinity for overload, decimal commas.
        let text = format!(
            "Time;Channel A\n(ms);(V)\n0;∞\n{}",
            rows(|k| format!("{};{}", k + 1, y(k).to_string().replace('.', ",")))
        );
        let (found, _) = columns(&text);
        assert!(found[1].0 == "Channel A" && found[1].1[0] >= 9.9e37 && found[1].1[1] == 8.5);
    }

    #[test]
    fn headings_of_more_programs_are_read() {
        let y = |k: u32| 8.5 - f64::from(k);
        let k = f64::from;
        // Channels that have numbers for names, above their units.
        let text = format!("x-axis,1,2\nsecond,Volt,Volt\n{}", rows(|k| format!("{k},{},5", y(k))));
        let (found, _) = columns(&text);
        assert_eq!(found, [expected("x-axis", k), expected("1", y), expected("2", |_| 5.0)]);
        // Words that stand for no number, or for too large a one, are names above numbers.
        for name in ["NA", "none", "inf", "null", "OL", "1"] {
            for (text, wanted) in [
                (rows(|k| format!("{k},{}", y(k))), [expected("time", k), expected(name, y)]),
                (rows(|k| format!("{},{k}", y(k))), [expected("time", y), expected(name, k)]),
            ] {
                assert_eq!(columns(&format!("time,{name}\n{text}")).0, wanted);
            }
        }
        for name in ["Power 1550 nm (W)", "Phase offset: 2/3 pi"] {
            let text = format!("time,{name}\n{}", rows(|k| format!("{k},{}", y(k))));
            assert_eq!(columns(&text).0, [expected("time", k), expected(name, y)]);
        }
        // A name may begin with any letter.
        let text = format!("µs;y\n{}", rows(|k| format!("{k};{}", y(k))));
        assert_eq!(columns(&text).0, [expected("µs", k), expected("y", y)]);
        // R quotes its names, of which the first is empty.
        let text = format!("\"\",\"y\"\n{}", rows(|k| format!("\"{k}\",{}", y(k))));
        assert_eq!(columns(&text).0, [expected("", k), expected("y", y)]);
        // Plus and minus are signs, in a column of nothing else.
        let is_minus = |k: u32| k % 2 == 1;
        for minus in ["-", "\u{2212}", "\"-\""] {
            let sign = |k: u32| if is_minus(k) { minus } else { "+" };
            let text = format!("sign,y\n{}", rows(|k| format!("{},{}", sign(k), y(k))));
            let signs = expected("sign", |k| if is_minus(k) { -1.0 } else { 1.0 });
            assert_eq!(columns(&text), (vec![signs, expected("y", y)], String::new()), "{minus}");
        }
        // Two columns of one name.
        let text = format!("y,y\n{}", rows(|k| format!("{},{k}", y(k))));
        let (found, told) = columns(&text);
        assert_eq!(found, [expected("y", y), expected("y.1", k)]);
        assert_eq!(told, "another column is called `y`, too: here `y.1`");
    }

    /// A long table of numbers is found in one pass, and is the one that is found cell by cell.
    #[test]
    fn one_pass_finds_what_is_found_cell_by_cell() {
        let rows = |end: &str, mark: char, decimal: &str| {
            let cell = |v: f64| format!("{v:.3}").replace('.', decimal);
            (0..600).fold(String::new(), |text, k| {
                let k = f64::from(k);
                text + &format!("{}{mark}{}{end}\n", cell(k), cell(8.5 - k * k % 7.0))
            })
        };
        let preamble = "Model,MSO5\nFirmware Version,1.28\n,\n,\nLabel,\nTIME,CH1\n";
        for (before, rows, is_one_pass) in [
            (preamble, rows("", ',', "."), true),
            ("X,CH1,Start,Increment\nSequence,Volt,-6e-4,1e-6\n", rows(",,", ',', "."), false),
            ("X,CH1,\ns,Volt,\n", rows(",", ',', "."), true),
            ("Zeit;Kanal A\n(ms);(V)\n", rows("", ';', ","), true),
            ("a log\nt\ty\n", rows("", '\t', "."), true),
            ("a log\nt\ty\n", rows("", '\t', ",").replace("8,500", "OL"), true),
            ("a log\nt,y\n", rows("", ',', ".").replace("8.500", "nan"), false),
            ("a log\nt,y,word\n", rows(",ok", ',', "."), false),
            ("a log\nt,y\n", rows("", ',', ".") + "total,5\n", false),
        ] {
            let (path, text) = (Path::new("y.csv"), format!("{before}{rows}"));
            let lines = Lines::of(&text);
            let body = longest(&lines.lines, &lines.marks).unwrap();
            let by_cell = Table::of(path, &lines, body.clone(), false).unwrap().unwrap();
            let one_pass = Table::of_numbers(path, &lines, false);
            assert_eq!(one_pass.is_some(), is_one_pass, "{before}");
            let Some((range, found)) = one_pass else { continue };
            assert_eq!((range, found.width), (body, by_cell.width), "{before}");
            assert_eq!((found.numeric, found.columns), (by_cell.numeric, by_cell.columns));
            assert_eq!((found.words, found.ends), (by_cell.words, by_cell.ends));
            assert!(columns(&text).0.iter().all(|(_, column)| column.len() == 600), "{before}");
        }
    }

    #[test]
    fn a_table_with_a_gap_is_refused_as_before() {
        for wrong in [
            // Lines of numbers that another line divides, before and behind.
            format!("{}lost\n{}", rows(|k| format!("{k},1.5")), rows(|k| format!("{k},2.5"))),
            format!("{}3,4,5\n1,2.5\n", rows(|k| format!("{k},1.5"))),
            // A word in the middle of a column of numbers.
            format!("a,b\n{}3,x\n{}", rows(|k| format!("{k},1.5")), rows(|k| format!("{k},2.5"))),
            // A line of the table behind another one, with a word beside its number.
            format!("{}lost\nk 9,1.5\n", rows(|k| format!("k {k},1.5"))),
            // More lines behind the table than a footer has.
            format!("{}end\n of\nthe\nlog\n", rows(|k| format!("{k},1.5"))),
        ] {
            let (_folder, path) = file("y.csv", wrong.as_bytes());
            let message = line(&read(&path, false).err().unwrap(), "y.csv");
            assert!(message.contains("in line"), "{wrong}: {message}");
        }
    }
}
